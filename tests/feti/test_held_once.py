"""The ranks of a machine hold the tables of a scene together, and find what one rank does."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tests.conftest import run_on_ranks
from tests.feti.held_on_ranks import CASES, answers

on_ranks = pytest.mark.parametrize(("case", "ranks"), [(case, ranks) for case in CASES for ranks in (2, 4)])


@cache
def found(ranks: int) -> dict[str, list[dict[str, Any]]]:
    script = Path(__file__).with_name("held_on_ranks.py")
    every: dict[str, list[dict[str, Any]]] = json.loads(run_on_ranks(script, ranks).splitlines()[-1])
    return every


@cache
def alone(case: str) -> dict[str, Any]:
    return answers(MPI.COMM_SELF, *CASES[case])


@on_ranks
def test_ranks_map_the_same_memory_read_only(case: str, ranks: int) -> None:
    every = found(ranks)[case]
    assert len(every) == ranks
    for each in every:
        assert all(each["shared"].values()), each["shared"]
        assert each["writeable"] == []
        assert each["files"] == every[0]["files"]
        assert sum(each["files"].values()) > each["bytes"]
        assert each["afterwards"] == []
    assert len(every[0]["shared"]) == (16 if case == "quadratic" else 14)


@on_ranks
def test_no_rank_has_a_copy_of_a_table(case: str, ranks: int) -> None:
    for each in found(ranks)[case]:
        assert 0 < each["largest copy"] < 0.2 * each["bytes"]


@pytest.mark.parametrize("case", CASES)
def test_one_rank_shares_nothing(case: str) -> None:
    assert not any(alone(case)["shared"].values())
    assert alone(case)["files"] == {}


@on_ranks
def test_answers_are_those_of_one_rank(case: str, ranks: int) -> None:
    known = alone(case)
    assert known["status"][0] > 0
    assert min(known["status"][1:]) > 0, "some stick, some slip"
    for each in found(ranks)[case]:
        assert each["status"] == known["status"]
        for name in ("potential", "forces", "displacement"):
            value, expected = np.asarray(each[name]), np.asarray(known[name])
            assert np.abs(value - expected).max() <= 1e-8 * np.abs(expected).max() > 0.0, name
