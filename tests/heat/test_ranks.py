"""Temperatures do not depend on ranks or cuts, and ranks raise together."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import run_on_ranks

SCRIPT = Path(__file__).with_name("on_ranks.py")


@cache
def found(kind: str, ranks: int) -> np.ndarray:
    """Return systems, products, error of the balance and temperatures of each cut."""
    return np.array([line.split() for line in run_on_ranks(SCRIPT, ranks, kind).splitlines()], dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["node", "mortar"])
@pytest.mark.parametrize("ranks", [2, 4])
def test_all_ranks_and_cuts_find_the_same_temperatures(kind: str, ranks: int):
    alone, together = found(kind, 1), found(kind, ranks)
    values = alone[0, 3:]
    assert len(together) == 3
    assert np.ptp(values) > 100.0
    assert together[:, 3:] == pytest.approx(alone[:, 3:], rel=0.0, abs=1e-12 * np.ptp(values))
    for other in together[:, 3:]:  # however bodies are cut
        assert other == pytest.approx(values, rel=0.0, abs=1e-10 * np.ptp(values))
    assert np.ptp([alone[:, 0], together[:, 0]]) <= 1  # systems
    assert np.abs(alone[:, 1] - together[:, 1]).max() <= 6  # of 73 products
    assert together[:, 2].max() < 1e-12


@pytest.mark.claim
def test_ranks_refuse_a_law_of_one_rank_together(mpirun: Callable[..., str]):
    lines = mpirun(SCRIPT, 2, "refused").splitlines()
    assert len(lines) == 2
    assert all("Conductor.conductivity must be finite and positive" in line for line in lines)
