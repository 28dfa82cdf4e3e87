"""One, two and four ranks estimate alike, cell by cell."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tests.accuracy.on_ranks import collect
from tests.conftest import run_on_ranks


@cache
def answer(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect(MPI.COMM_SELF)
    found = json.loads(run_on_ranks(Path(__file__).with_name("on_ranks.py"), ranks))
    assert found["ranks"] == ranks
    return found


@pytest.mark.parametrize("ranks", [2, 4])
def test_the_estimate_is_the_same_on_all_numbers_of_ranks(ranks: int) -> None:
    for cut, expected in answer(1)["found"].items():
        found = answer(ranks)["found"][cut]
        assert found["total"] == pytest.approx(expected["total"], rel=1e-9)
        for body, share in expected["by body"].items():
            assert share > 0.1 * expected["total"]
            assert found["by body"][body] == pytest.approx(share, rel=1e-9)
            known, cells = np.array(expected["by cell"][body]), np.array(found["by cell"][body])
            assert np.all(known > 0)
            np.testing.assert_allclose(cells, known, rtol=1e-7)


def test_the_estimate_is_nearly_the_same_for_different_cuts() -> None:
    boxes, bisection = answer(1)["found"].values()
    assert boxes["total"] == pytest.approx(bisection["total"], rel=1e-3), "copies lie apart by that much"
    assert boxes["total"] != bisection["total"]
