"""A problem is described so that another run finds the same words, and another problem other ones."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact import Coulomb
from fenics_contact._base.fingerprint import described, described_by_names, differences
from fenics_contact._base.launching import finished


class Colour(Enum):
    RED = 1


class Plain:
    pass


@dataclass(frozen=True)
class Part:
    size: float = 1.0
    shape: np.ndarray = field(default_factory=lambda: np.arange(3))


def scaled(factor: float) -> Callable[[float], float]:
    return lambda x: factor * x


def recursive() -> Callable[[int], int]:
    def down(n: int) -> int:
        return down(n - 1) if n else 0

    return down


PAIRS: dict[str, tuple[Any, Any]] = {
    "numbers": (1.0, 1.0 + 1e-15),
    "an integer": (1, 2),
    "types": (1, 1.0),
    "enumerations": (Colour.RED, None),
    "arrays": (np.zeros(3), np.zeros(4)),
    "one bit of an array": (np.zeros(3), np.array([0.0, 0.0, -0.0])),
    "dataclasses": (Part(), Part(2.0)),
    "mappings": ({"a": 1}, {"b": 1}),
    "lengths": ((1, 2), (1, 2, 3)),
    "what a function carries along": (scaled(1.0), scaled(2.0)),
    "what a partial function is given": (partial(scaled, 1.0), partial(scaled, 2.0)),
    "functions": (scaled, recursive),
    "classes": (Plain, Part),
    "objects": (Plain(), Part()),
}


@pytest.mark.parametrize("name", PAIRS)
def test_what_differs_is_described_differently_and_what_is_equal_alike(name: str) -> None:
    one, other = PAIRS[name]
    assert described(one, "it") == described(one, "it")
    assert differences(described(one, "it"), described(other, "it"))


def test_what_functions_carry_along_is_left_out_where_that_is_asked() -> None:
    one, other = ({"function": scaled(size), "number": size} for size in (1.0, 2.0))
    found = differences(described_by_names(one, "it"), described_by_names(other, "it"))
    assert found == ["it['number'] (1.0, 2.0)"]


def test_a_function_that_calls_itself_comes_to_an_end() -> None:
    assert len(described(recursive(), "it")) == 2


def test_no_address_of_an_object_is_told() -> None:
    parts = described({"object": Plain(), "function": scaled(2.0), "method": Part().__eq__}, "it")
    assert not any("0x" in text for text in parts.values())


def test_another_process_finds_the_same_words() -> None:
    script = (
        "import json, numpy as np\nfrom fenics_contact._base.fingerprint import described\n"
        "from fenics_contact import Coulomb\n"
        "print(json.dumps(described([Coulomb(0.3), {'a': np.arange(3.0)}, np.sin], 'it')))"
    )
    root = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", script]
    answer = finished(command, 60.0, folder=root)
    expected = described([Coulomb(0.3), {"a": np.arange(3.0)}, np.sin], "it")
    assert json.loads(answer.output) == expected
    assert "0.3" in answer.output


def test_only_the_first_differences_are_spelt_out() -> None:
    there, here = ({str(k): str(shift + k) for k in range(10)} for shift in (0, 1))
    named = differences(there, here)
    assert len(named) == 5
    assert named[0] == "0 (0, 1)"
    assert named[-1] == "6 more"
