"""The contact area is that of theory, a smooth function of the load, and exact where all is closed."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    contact_area,
    solve_scene,
)
from fenics_contact.gallery import block, half_disc, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from fenics_contact.results.area import _reach
from fenics_contact.theory import hertz_line, hertz_point

MODULUS = 1000.0 / (1 - 0.3**2)
SOLID, PLANE = IsotropicElasticity(1000.0, 0.3), PlaneStrain(1000.0, 0.3)


def ball(force: float, size: int = 12) -> State:
    """A quarter of a half ball on a rigid plane."""
    guides = [Support("ball", "x0", (0, None, None)), Support("ball", "y0", (None, 0, None))]
    scene = Scene(
        {"ball": Body(hemisphere(10.0, size), SOLID)},
        guides,
        [TotalForce("ball", "top", (0, 0, -force / 4))],
        [ContactPair(Surface("ball", "contact"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    return solve_scene(scene, MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-8))


@pytest.mark.slow
@pytest.mark.claim
def test_the_area_under_a_ball_is_that_of_hertz() -> None:
    found, nodal = [], []
    for force in (100.0, 200.0, 300.0, 400.0, 500.0):
        state, exact = ball(force), hertz_point(force, (0.1, 0.1), MODULUS).area / 4
        found.append(abs(contact_area(state) / exact - 1))
        closed = state.contact.status > 0
        nodal.append(abs(state.contact.points.area[closed].sum() / exact - 1))
    assert max(found) < 0.1
    assert np.mean(found) < 0.3 * np.mean(nodal), "counting nodes is as good"


def test_the_width_under_a_disc_is_that_of_hertz() -> None:
    force = 200.0
    scene = Scene(
        {"disc": Body(half_disc(10.0, 12), PLANE)},
        [Support("disc", "x0", (0, None))],
        [TotalForce("disc", "top", (0, -force / 2))],
        [ContactPair(Surface("disc", "contact"), RigidPlane((0, 0), (0, 1)))],
    )
    state = solve_scene(scene, MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-8))
    assert contact_area(state) == pytest.approx(hertz_line(force, 0.1, MODULUS).half_width, rel=0.05)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron", "quadrilateral"])
def test_a_face_that_is_pressed_all_over_touches_all_over(cell: str) -> None:
    plane = cell == "quadrilateral"
    mesh = rectangle((0, 0), (3, 1), (3, 2)) if plane else block((0, 0, 0), (3, 2, 1), (3, 2, 2), cell)
    down, side = ((0.0, -1.0), "y") if plane else ((0.0, 0.0, -1.0), "z")
    held = ((0.0, None), (0.0, 1.0)) if plane else ((0.0, None, None), (0.0, 0.0, 1.0))
    supports = [Support("block", "x0", held[0])]
    if not plane:
        supports.append(Support("block", "y0", (None, 0.0, None)))
    floor = RigidPlane((0.0,) * mesh.dim, held[1])
    scene = Scene(
        {"block": Body(mesh, PLANE if plane else SOLID)},
        supports,
        [TotalForce("block", f"{side}1", down)],
        [ContactPair(Surface("block", f"{side}0"), floor)],
    )
    state = solve_scene(scene, MPI.COMM_WORLD)
    assert contact_area(state) == pytest.approx(3.0 if plane else 6.0, rel=1e-12)
    assert state.contact.travel(np.array(down)) == 0.0
    assert state.contact.travel(-np.array(down)) == np.inf


def test_the_rim_lies_where_pressure_and_gap_of_a_smooth_contact_place_it() -> None:
    inside, length, size = np.array([0.1, 0.5, 0.9, 1.7]), 2.0, 3.0
    pressure, spread = size * np.sqrt(inside), 4 / 3 * size * (length - inside) ** 1.5
    np.testing.assert_allclose(_reach(pressure, spread, np.full(4, length)), inside / length, rtol=1e-9)
