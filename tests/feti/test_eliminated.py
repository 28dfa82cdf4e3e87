"""Motions eliminated from coarse matrices by several ranks."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import LinearState
from fenics_contact.feti.reduced_coarse import ReducedGrams
from tests.conftest import run_on_ranks
from tests.feti.many_boxes import forces, resting


@pytest.fixture(scope="module", params=[2, 4], ids="{} ranks".format)
def found(request: pytest.FixtureRequest) -> dict[str, Any]:
    script = Path(__file__).with_name("eliminated_on_ranks.py")
    answer: dict[str, Any] = json.loads(run_on_ranks(script, request.param, timeout=100).splitlines()[-1])
    return {"ranks": request.param, **answer}


@cache
def alone(held: bool) -> LinearState:
    return resting(MPI.COMM_SELF, (3, 3, 3), 0, held)


@pytest.mark.parametrize("loose", [0, 2])
def test_inverses_of_faces_are_those_of_their_whole_matrices(found: dict[str, Any], loose: int) -> None:
    faces = found["faces"]
    assert 0.0 < faces[f"symmetric, {loose}"] < 1e-12
    assert 0.0 < faces[f"not, {loose}"] < 1e-12
    assert (faces[f"rank, {loose}"], faces[f"singular, {loose}"]) == (60 - loose, loose > 0)
    assert faces[f"null, {loose}"] < 1e-12


def test_all_ranks_refuse_where_nothing_resists_a_motion_or_one_of_them_fails(found: dict[str, Any]) -> None:
    assert found["refused"] == [True] * 3


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
def test_a_state_is_that_of_one_rank_and_the_factor_is_made_once(found: dict[str, Any], held: bool) -> None:
    shared, state = found["held" if held else "floating"], alone(held)
    expected = forces(state)
    size = np.abs(expected).max()
    assert size > 1e-6
    np.testing.assert_allclose(shared["forces"], expected, rtol=0, atol=1e-10 * size)
    assert (shared["factors"], shared["products"]) == (1, state.solution.products)


def test_each_rank_holds_its_part_of_the_factor(found: dict[str, Any]) -> None:
    entries = np.array(found["held"]["entries"])
    assert len(entries) == found["ranks"]
    # How evenly so few are dealt is up to the version of MUMPS.
    assert 0 < entries.max() < 0.7 * entries.sum()
    gram: Any = alone(True).system.problem.coarse.gram
    assert entries.sum() < 1.5 * gram._grams.eliminated.factor.entries


@pytest.mark.parametrize(
    ("ranks", "motions", "holders"), [(1, 10**6, 1), (64, 100_000, 1), (64, 100_001, 6), (8, 10**6, 8)]
)
def test_fewer_than_six_ranks_leave_it_to_one(ranks: int, motions: int, holders: int) -> None:
    assert ReducedGrams.holders(ranks, motions) == holders
