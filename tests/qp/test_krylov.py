"""Generalised minimal residuals on small dense matrices: what they find, and what they own up to."""

from __future__ import annotations

import tracemalloc
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.qp import Stop
from fenics_contact.qp.face_system import CoupledSystem
from fenics_contact.qp.krylov import projected_gmres

Array = np.ndarray
LIMIT = 50


class Everything:
    """A projector that removes nothing."""

    moving = SimpleNamespace(m=0)

    def __call__(self, vector: Array) -> Array:
        return vector


def coupled(matrix: Array, *, single: bool = False) -> CoupledSystem:
    """A system whose operator is a matrix and that no rigid motion concerns."""
    system = SimpleNamespace(comm=MPI.COMM_SELF, operator=lambda x: matrix @ x, patience=60, single=single)
    parts: dict[str, Any] = {
        "system": system,
        "moving": np.eye(len(matrix)),
        "oblique": Everything(),
        "precondition": lambda v: v,
        "balanced": lambda v, load: v,
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


@pytest.mark.parametrize("scale", [1.0, 1e-150, 1e150])
def test_directions_in_single_precision_reach_the_tolerance_by_restarts(scale: float) -> None:
    rng = np.random.default_rng(1)
    matrix, right = 3.0 * np.eye(80) + 0.2 * rng.standard_normal((80, 80)), scale * rng.standard_normal(80)
    goal, ones = 1e-12 * np.linalg.norm(right), np.ones(80)
    whole = projected_gmres(coupled(matrix), -right, ones, goal, 500)
    for longest in (12, 80):
        found = projected_gmres(coupled(matrix, single=True), -right, ones, goal, 500, longest=longest)
        assert found.stop is Stop.CONVERGED
        assert np.linalg.norm(found.product - right) <= goal
        # Products are sums of vectors in single precision.
        assert np.linalg.norm(matrix @ found.step - right) < 1e-6 * np.linalg.norm(right)
        assert whole.iterations < found.iterations < 3 * whole.iterations
    around, one = np.roll(np.eye(80), 1, axis=0), scale * np.eye(80)[0]  # no progress in 79 iterations
    stuck = projected_gmres(coupled(around, single=True), -one, ones, goal, 500)
    assert (stuck.stop, stuck.iterations) == (Stop.STAGNATION, 40)
    few = projected_gmres(coupled(matrix, single=True), -right, ones, goal, 13, longest=12)
    assert (few.stop, few.iterations) == (Stop.ITERATION_LIMIT, 13)


def test_directions_in_single_precision_take_half_the_memory() -> None:
    length, taken = 20_000, dict[bool, int]()
    diagonal = np.linspace(1.0, 1e3, length)
    for single in (False, True):
        system = coupled(np.zeros((0, length)), single=single)
        system.system.operator = lambda x: diagonal * x  # type: ignore[misc]
        system.moving = sp.identity(length, format="csr")  # type: ignore[misc]
        tracemalloc.start()
        projected_gmres(system, np.ones(length), np.ones(length), 0.0, 32)
        taken[single] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert 3 * 32 * 4 * length < taken[True] < 0.65 * taken[False]


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
