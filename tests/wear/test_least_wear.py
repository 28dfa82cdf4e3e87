"""The shape that wears evenly from the start is the worn-in one (Páczelt and Mróz 2005)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    RigidPlane,
    Scene,
    ShapeProblem,
    State,
    Surface,
    SurfaceDesign,
    TotalForce,
    Wear,
    minimize,
    wear_to,
)
from fenics_contact.design import BundleTrust, WearNonuniformity
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity

INNER, OUTER, FORCE = 10.0, 30.0, 1000.0


def along(state: State, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return radii and values at contact points, from the inner edge on."""
    r = state.scene.points[state.contact.points.slave, 0]
    return np.sort(r), values[np.argsort(r)]


@pytest.mark.slow
def test_the_shape_of_even_wear_is_the_worn_in_one() -> None:
    body = Body(
        rectangle((INNER, 0.0), (OUTER, 20.0), (40, 20)), IsotropicElasticity(2e3, 0.3), axisymmetric=True
    )
    turning = Wear(1e-9, sliding=lambda x: 2.0 * np.pi * x[:, 0])
    pair = ContactPair(Surface("punch", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), wear=turning)
    load = TotalForce("punch", "y1", (0.0, -FORCE))
    scene = Scene({"punch": body}, loads=[load], contacts=[pair])
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)

    worn = wear_to(
        replace(scene, contacts=[replace(pair, wear=replace(turning, coefficient=1e-7))]), 2e5, MPI.COMM_SELF,
        follow=np.inf,
    )  # fmt: skip
    r, depth = along(worn.state, worn.depth)
    exact = FORCE / (2.0 * np.pi * (OUTER - INNER) * r)
    np.testing.assert_allclose(along(worn.state, worn.state.contact.pressure)[1], exact, rtol=5e-3)

    designs = ShapeProblem(problem, SurfaceDesign("punch", "y0", net=9), WearNonuniformity())
    best = minimize(designs, np.zeros(9), BundleTrust(tolerance=1e-3), bounds=(-0.05, 0.05))
    state = designs.state_of(best.x)
    np.testing.assert_allclose(along(state, state.contact.pressure)[1], exact, rtol=5e-3)
    mesh = state.scene.bodies["punch"].mesh
    foot = mesh.points[mesh.nodes_of("y0")]
    shape = foot[np.argsort(foot[:, 0]), 1]
    missed = (shape - shape.min()) - (depth - depth.min())
    assert np.abs(missed).max() < 0.01 * np.ptp(depth)
