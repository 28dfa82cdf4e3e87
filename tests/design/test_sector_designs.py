"""Designs of one sector of a whole: its sides move alike, and stay where they are."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    CyclicSymmetry,
    RigidSphere,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    centrifugal,
)
from fenics_contact.design import PressureNorm
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

STEP = np.array([0.3, -0.2, 0.5])


def sector(*, matching: bool) -> Scene:
    """Thirty degrees of a ring that spins against a roller and is dragged along."""
    mesh = rectangle((10.0, 0.0), (14.0, 1.0), (6, 16), "triangle")
    r, part = mesh.points.T
    r = r if matching else 10.0 + 4.0 * ((r - 10.0) / 4.0) ** (1.0 + 0.2 * part)
    angle = np.radians(105.0 - 30.0 * part)
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    outer = mesh.surfaces["x1"]
    crown = outer[(abs(points[outer].mean(axis=1)[:, 0]) < 2.0)]
    flipped = mesh.cells[:, ::-1]
    ring = BodyMesh(
        points, flipped, {**{k: f[:, ::-1] for k, f in mesh.surfaces.items()}, "crown": crown[:, ::-1]}
    )
    roller = ContactPair(
        Surface("ring", "crown"), RigidSphere((0.3, 15.995), 2.0), Coulomb(0.3), discretisation="mortar"
    )
    around = CyclicSymmetry(Surface("ring", "y1"), Surface("ring", "y0"), at=(0.0, 0.0))
    loads = [centrifugal("ring", 1.0, 4.0, (0.0, 0.0)), TotalForce("ring", "crown", (40.0, 0.0))]
    body = Body(ring, PlaneStrain(3e3, 0.3))
    return Scene({"ring": body}, [Support("ring", "x0")], loads, [roller], [around])


@pytest.mark.parametrize("matching", [True, False])
def test_a_gradient_through_cyclic_symmetry_is_that_of_differences(matching: bool) -> None:
    contact = ContactProblem(sector(matching=matching), MPI.COMM_SELF, tolerance=1e-11)
    problem = ShapeProblem(
        contact, SurfaceDesign("ring", "crown", net=3, transition=0.5), PressureNorm(p=4.0)
    )
    start = np.array([-0.001, 0.002, 0.0])
    value, gradient = problem(start)
    assert value > 0.0
    state = problem.state_of(start)
    assert np.count_nonzero(state.contact.normal_force) > 2
    h = 1e-6
    quotient = (problem.value_of(start + h * STEP) - problem.value_of(start - h * STEP)) / (2 * h)
    assert abs(quotient) > 1.0
    assert gradient @ STEP == pytest.approx(quotient, rel=1e-5)


def test_a_design_that_moves_a_side_is_refused() -> None:
    problem = ContactProblem(sector(matching=True), MPI.COMM_SELF)
    design = SurfaceDesign("ring", "crown", net=3, transition=4.0)
    message = "a design needs sides of sectors that stay and do not touch, .* nodes? that move and 0 nodes in"
    with pytest.raises(InvalidInputError, match=message):
        ShapeProblem(problem, design, PressureNorm(p=4.0))
