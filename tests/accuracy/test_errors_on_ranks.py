"""The errors of a state are the same on any number of ranks."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

#: Takes long: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

SCRIPT = Path(__file__).with_name("errors_on_ranks.py")
Mpirun = Callable[..., str]


@pytest.fixture(scope="module")
def alone() -> dict[str, Any]:
    from tests.conftest import run_on_ranks

    return dict(json.loads(run_on_ranks(SCRIPT, 1)))


@pytest.mark.parametrize("ranks", [2, 4])
def test_errors_are_the_same_on_any_number_of_ranks(
    ranks: int, alone: dict[str, Any], mpirun: Mpirun
) -> None:
    found = json.loads(mpirun(SCRIPT, ranks))
    assert alone
    for name, numbers in found.items():
        assert numbers["error"] <= numbers["bound"] < 10 * numbers["error"]
        for what, value in numbers.items():
            assert value == pytest.approx(alone[name][what], rel=0.02), (name, what)
