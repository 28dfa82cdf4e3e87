"""Conditions, fields that may be None, files that name a feature of another: none may become more."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.house.ratchet import counted, grown, record, spread
from tests.house.source import Module, modules

REMEDY = "make them fewer, or say in the change why it grows and run `python -m tests.house.ratchet`"


@pytest.mark.parametrize(
    ("title", "count"), [("house", counted), ("files outside their own", spread)], ids=["house", "features"]
)
def test_nothing_that_makes_the_house_hard_to_live_in_grows(
    title: str, count: Callable[[list[Module]], Mapping[str, int]]
) -> None:
    now = count(modules())
    assert min(now.values()) > 0, "something was not found at all: nothing was tested"
    assert grown(now, record()[title]) == {}, REMEDY


SAMPLE = """
from dataclasses import dataclass
@dataclass(frozen=True)
class Spring:
    law: str | None
    size: float
    def __post_init__(self):
        object.__setattr__(self, "size", 1.0)
    def stiffen(self, a, b, c, d, e, quick: bool = False):
        object.__setattr__(self, "size", 2.0)
        if self.law is not None and isinstance(a, int):
            raise ValueError(
                "none"
            )
        return {id(a): 1}
"""


def test_each_kind_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text(SAMPLE)
    house = [Module("fenics_contact.own", path)]
    ones = {
        "modules", "tests for None", "isinstance", "id", "fields that may be None", "flags",
        "writes into frozen values", "functions of six parameters and more",
    }  # fmt: skip
    assert counted(house) == {**dict.fromkeys(ones, 1), "lines": 15, "lines that raise": 3}
    assert spread(house)["springs"] == 0, "only the lower case word counts"
    path.write_text("spring = 1\n")
    assert spread(house)["springs"] == 1
    own = path.rename(tmp_path / "spring_rows.py")
    assert spread([Module("fenics_contact.spring_rows", own)])["springs"] == 0
    assert grown({"flags": 2, "id": 1}, {"flags": 1, "id": 1}) == {"flags": "2, held 1"}
