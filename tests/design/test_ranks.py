"""One, two and four ranks find the same objective and gradient; all ranks of one run find the same bits."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Status
from tests.conftest import run_on_ranks
from tests.design.rank_cases import JUDGES, PROBLEMS, collect

RANKS = [2, 4]


@cache
def answer(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect(MPI.COMM_SELF)
    script = Path(__file__).with_name("rank_cases.py")
    found = json.loads(run_on_ranks(script, ranks, timeout=300.0))
    assert found["ranks"] == ranks
    return found


def relative(found: list[float], expected: list[float]) -> float:
    difference = np.linalg.norm(np.subtract(found, expected))
    return float(difference / np.linalg.norm(expected))


@pytest.mark.parametrize("name", PROBLEMS)
def test_there_is_something_to_compare(name: str) -> None:
    case = answer(1)["designs"][name]
    assert all(np.count_nonzero(np.array(case["status"]) == status) > 0 for status in Status)
    assert case["weak"] == [0, 0]
    for judge in (*JUDGES[name], "volume"):
        assert np.abs(case[judge][1]).max() > 1e-3 * abs(case[judge][0])


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_value_and_gradient_are_those_of_one_rank(name: str, ranks: int) -> None:
    found, expected = answer(ranks)["designs"][name], answer(1)["designs"][name]
    assert found["status"] == expected["status"]
    for judge in (*JUDGES[name], "volume"):
        assert found[judge][0] == pytest.approx(expected[judge][0], rel=1e-8)
        assert relative(found[judge][1], expected[judge][1]) < 1e-6


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_all_ranks_of_a_run_hold_the_same_bits(name: str, ranks: int) -> None:
    assert answer(ranks)["designs"][name]["same bits"]


@pytest.mark.parametrize("ranks", RANKS)
def test_the_mesh_moves_alike_also_where_a_rank_has_no_part_of_a_body(ranks: int) -> None:
    motion = answer(ranks)["motion"]
    assert {body: case["ranks without it"] for body, case in motion.items()} == {
        "upper": ranks - 2,
        "lower": ranks - 2,
    }
    for body, case in motion.items():
        expected = answer(1)["motion"][body]
        for what in ("moved", "pulled"):
            assert np.abs(expected[what]).max() > 0.1
            assert relative(case[what], expected[what]) < 1e-12
        forth, back = case["forth and back"]
        assert back == pytest.approx(forth, rel=1e-10)


@pytest.mark.parametrize("ranks", RANKS)
def test_all_ranks_refuse_a_bad_design_in_the_same_words(ranks: int) -> None:
    expected = answer(1)["refusals"]
    assert [words.partition(":")[0] for words in expected] == [
        "InvalidDesignError",
        "InvalidInputError",
        "InvalidInputError",
    ]
    assert answer(ranks)["refusals"] == ranks * expected
