"""Laws of closure on quadratic cells and bodies of revolution: patches, Winkler's bed, a whole cylinder."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ClosureLaw,
    ContactPair,
    ExponentialClosure,
    LinearClosure,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block, cylinder, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import quadratic

PRESSURE, STIFFNESS = 6.0, 800.0
#: Cells of a slave and, beside it, whether a section is revolved; all but the last have midside nodes.
CELLS: dict[str, tuple[bool, Any]] = {
    "hexahedron27": (False, lambda a, b, n: quadratic(block((0, 0, a), (2, 1, b), (n, 2, 1)))),
    "tetrahedron10": (
        False,
        lambda a, b, n: quadratic(block((0, 0, a), (2, 1, b), (n, 2, 1), cell="tetrahedron")),
    ),
    "quadrilateral9": (True, lambda a, b, n: quadratic(rectangle((0, a), (2, b), (n, 1)))),
    "triangle6": (True, lambda a, b, n: quadratic(rectangle((0, a), (2, b), (n, 1), cell="triangle"))),
    "quadrilateral": (True, lambda a, b, n: rectangle((0, a), (2, b), (n, 1))),
}


def solved(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)


@pytest.mark.parametrize(
    ("material", "law"),
    [
        (IsotropicElasticity(1000.0, 0.0), LinearClosure(STIFFNESS)),
        (NeoHooke(1000.0, 0.0), ExponentialClosure(5.0, 0.01)),
    ],
)
@pytest.mark.parametrize("name", CELLS)
def test_a_uniform_pressure_closes_all_points_alike(
    name: str, material: IsotropicElasticity | NeoHooke, law: ClosureLaw
) -> None:
    """On a floor and between bodies; linear cells by mortar, whose meshes need not match."""
    revolved, mesh = CELLS[name]
    up, above = ("y", "y1") if revolved else ("z", "z1")
    load = (0.0, -PRESSURE) if revolved else (0.0, 0.0, -PRESSURE)
    upper: BodyMesh = mesh(0.0, 1.0, 3)
    lower: BodyMesh = mesh(-1.0, 0.0, 4 if name == "quadrilateral" else 3)
    guides = [] if revolved else [("x0", (0.0, None, None)), ("y0", (None, 0.0, None))]
    bodies = {
        which: Body(each, material, axisymmetric=revolved)
        for which, each in (("upper", upper), ("lower", lower))
    }
    supports = [Support(body, *guide) for body in bodies for guide in guides]
    held = Support("lower", f"{up}0", (None, 0.0) if revolved else (None, None, 0.0))
    pair = ContactPair(Surface("upper", f"{up}0"), Surface("lower", above), closure=law)
    floor = RigidPlane((0.0, 0.0), (0.0, 1.0)) if revolved else RigidPlane((0.0,) * 3, (0.0, 0.0, 1.0))
    on_floor = ContactPair(Surface("upper", f"{up}0"), floor, closure=law)
    pressing = [Traction("upper", above, load)]
    own = [each for each in supports if each.body == "upper"]
    for scene in (
        Scene(bodies, [*supports, held], pressing, [pair]),
        Scene({"upper": bodies["upper"]}, own, pressing, [on_floor]),
    ):
        contact = solved(scene).contact
        np.testing.assert_allclose(contact.normal_force / contact.nominal_area, PRESSURE, rtol=1e-6)
        expected = law.reach - float(law.closure(np.array([PRESSURE]))[0])
        np.testing.assert_allclose(contact.gap, expected, atol=1e-8)


def on_ball(mesh: BodyMesh, modulus: float, *, revolved: bool) -> State:
    """A cylinder of radius 1 whose upper side is moved down by 0.02 on a ball of radius 10."""
    low, high = ("y0", "y1") if revolved else ("bottom", "top")
    aside = (0.0,) * (1 if revolved else 2)
    ball = RigidSphere((*aside, -10.0), 10.0)
    pair = ContactPair(Surface("body", low), ball, closure=LinearClosure(100.0))
    body = Body(mesh, IsotropicElasticity(modulus, 0.3), axisymmetric=revolved)
    return solved(Scene({"body": body}, [Support("body", high, (*aside, -0.02))], contacts=[pair]))


@pytest.mark.parametrize("order", [1, 2])
def test_a_stiff_cylinder_on_a_ball_is_that_on_a_bed_of_springs(order: int) -> None:
    mesh = rectangle((0.0, 0.0), (1.0, 0.5), (20 // order, 1))
    state = on_ball(mesh if order == 1 else quadratic(mesh), 1e9, revolved=True)
    contact = state.contact
    r = state.scene.points[contact.points.slave, 0]
    out = np.hypot(r, 10.0)
    closing = np.maximum(0.02 * 10.0 / out - (out - 10.0), 0.0)  # along the normals of the ball
    # The bed carries π k R δ².
    np.testing.assert_allclose(contact.normal_force, 100.0 * closing * contact.nominal_area, atol=1e-5)
    assert contact.normal_force.sum() == pytest.approx(np.pi * 100.0 * 10.0 * 0.02**2, rel=0.01)


def test_a_soft_cylinder_of_revolution_is_the_whole_one() -> None:
    section = on_ball(rectangle((0.0, 0.0), (1.0, 0.5), (16, 6)), 20.0, revolved=True)
    whole = on_ball(cylinder(1.0, 0.5, 3, 3), 20.0, revolved=False)
    one, all_around = section.contact, whole.contact
    assert one.normal_force.sum() == pytest.approx(all_around.normal_force.sum(), rel=0.01)
    places = section.scene.points[one.points.slave, 0]
    ascending = np.argsort(places)
    radius = np.hypot(*whole.scene.points[all_around.points.slave, :2].T)
    expected = np.interp(radius, places[ascending], one.gap[ascending])
    closed = expected < 0.0
    miss = np.sqrt(np.mean((all_around.gap[closed] - expected[closed]) ** 2))
    assert miss < -0.02 * one.gap.min()
    assert -one.gap.min() < 0.5 * 0.02, "the body gives way as much as its surface"
