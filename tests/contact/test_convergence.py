"""A state is never returned that is not one: no convergence is an error that carries its history."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, FixedPoint, Tresca, solve_scene
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from tests.contact.gallery import partitions, two_blocks

HASTY: dict[str, tuple[DualSolver, Coulomb | Tresca]] = {
    "face Newton": (FaceNewton(tolerance=1e-9, max_steps=1), Coulomb(0.38)),
    "SMALSE": (Smalse(tolerance=1e-9, max_products=15), Tresca(1.0)),
    "fixed point": (FixedPoint(Smalse(tolerance=1e-9), max_steps=1), Coulomb(0.38)),
    "SMALSE in a fixed point": (FixedPoint(Smalse(tolerance=1e-9, max_products=15)), Coulomb(0.38)),
}


@pytest.mark.parametrize("name", HASTY)
def test_a_solver_stopped_too_early_raises_with_its_history(name: str) -> None:
    solver, friction = HASTY[name]
    scene = two_blocks(friction)
    message = r"needs (a natural residual|residuals) below \S+e-(09|10)\b"
    with pytest.raises(ConvergenceError, match=message) as caught:
        solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver)
    assert len(caught.value.history) > 0
    assert all(step.products > 0 for step in caught.value.history)
