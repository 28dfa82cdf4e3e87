"""Given gaps are the same on any number of ranks, and so are the errors."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tests.conftest import run_on_ranks
from tests.pairing.given_gaps_on_ranks import collect

SCRIPT = Path(__file__).with_name("given_gaps_on_ranks.py")


@cache
def alone() -> dict[str, Any]:
    return collect(MPI.COMM_SELF)


@cache
def answer(ranks: int) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(run_on_ranks(SCRIPT, ranks).splitlines()[-1])
    return answer


@pytest.mark.parametrize("ranks", [2, 4])
def test_gaps_and_forces_are_those_of_one_rank(ranks: int) -> None:
    for found in answer(ranks)["found"]:
        for name, (gap, other) in alone().items():
            assert np.ptp(gap) > 0.0 or name == "press fit"
            np.testing.assert_allclose(found[name][0], gap, rtol=0, atol=1e-15)
            bound = 1e-6 * np.abs(other).max()
            assert bound > 0.0
            np.testing.assert_allclose(found[name][1], other, rtol=0, atol=bound)


def test_functions_that_differ_or_fail_on_one_rank_are_refused_on_all() -> None:
    for differ, negative in answer(2)["messages"]:
        assert "all ranks must be given the same" in differ
        assert "the gap given between upper z0 on lower z1" in differ
        assert "gap of upper z0 on lower z1 must be zero or positive everywhere, got" in negative
