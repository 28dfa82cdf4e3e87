"""Generalised minimal residuals on small dense matrices: what they find, and what they own up to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.qp import Stop
from fenics_contact.qp.face_system import CoupledSystem
from fenics_contact.qp.krylov import projected_gmres

Array = np.ndarray
LIMIT = 50


def coupled(matrix: Array) -> CoupledSystem:
    """A system whose operator is a matrix and that no rigid motion concerns."""
    system = SimpleNamespace(comm=MPI.COMM_SELF, operator=lambda x: matrix @ x, patience=60)
    parts: dict[str, Any] = {
        "system": system,
        "moving": np.eye(len(matrix)),
        "oblique": lambda v: v,
        "precondition": lambda v: v,
        "operate": lambda z, full: full,
        "image": lambda z, full: full,
    }
    return cast(CoupledSystem, SimpleNamespace(**parts))


@pytest.mark.parametrize("scale", [1.0, 1e-150, 1e150])
def test_an_unsymmetric_system_is_solved_to_the_tolerance_whatever_its_scale(scale: float) -> None:
    rng = np.random.default_rng(1)
    matrix, right = np.eye(7) + 0.2 * rng.standard_normal((7, 7)), scale * rng.standard_normal(7)
    found = projected_gmres(coupled(matrix), -right, np.ones(7), 1e-12 * np.linalg.norm(right), LIMIT)
    assert found.stop is Stop.CONVERGED
    assert np.linalg.norm(matrix @ found.step - right) < 2e-12 * np.linalg.norm(right)
    assert found.iterations <= 7


def test_nothing_asked_for_costs_nothing() -> None:
    found = projected_gmres(coupled(np.eye(3)), np.zeros(3), np.ones(3), 0.0, LIMIT)
    assert (found.stop, found.iterations) == (Stop.CONVERGED, 0)
    assert np.all(found.step == 0.0)


@pytest.mark.parametrize("right", [(1.0, 1.0), (0.0, 1.0), (0.3, 0.7), (1e-20, 1.0)])
def test_a_right_side_outside_of_the_range_is_no_convergence(right: tuple[float, float]) -> None:
    """The Krylov space ends at once, and the part of the right side that no image reaches is left."""
    found = projected_gmres(coupled(np.diag([1.0, 0.0])), -np.array(right), np.ones(2), 1e-9, LIMIT)
    assert found.stop is not Stop.CONVERGED
    assert found.measure > 0.99 * right[1]
