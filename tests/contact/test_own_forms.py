"""Results are dolfinx Functions that forms of the user's own can be written with, on any number of ranks."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from tests.contact.own_forms import PRESSURE, integrals


def check(found: dict[str, float], order: int) -> None:
    """∫ σ_zz dx is the load times the height; the rest is known to the state."""
    assert found["vertical stress"] == pytest.approx(-2.0 * PRESSURE, rel=1e-6)
    assert found["elastic energy"] == pytest.approx(found["energy of the state"], rel=1e-7)
    assert found["von Mises"] == pytest.approx(found["own von Mises"], rel=2e-2)
    # A nodal pressure is a force by a nodal area, which is the integral of a linear shape function.
    assert found["contact force"] == pytest.approx(2.0 * PRESSURE, rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_results_are_integrated_by_the_users_own_forms(order: int) -> None:
    check(integrals(MPI.COMM_SELF, order), order)


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 4])
def test_own_forms_give_the_same_on_more_ranks(mpirun: Callable[..., str], ranks: int) -> None:
    lines = mpirun(Path(__file__).parent / "own_forms.py", ranks).splitlines()
    assert len(lines) == 2
    for order, line in enumerate(lines, 1):
        found, alone = json.loads(line), integrals(MPI.COMM_SELF, order)
        check(found, order)
        assert found == pytest.approx(alone, rel=1e-6)
