"""A belt round a post, a block on an incline, a wedge: friction forces that a formula of mechanics gives."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStress
from fenics_contact.qp import FaceNewton

RADIUS, THICKNESS, ANGLE, AROUND = 1.0, 0.02, np.pi / 2, 200
#: Sliding is a hundred times what the belt stretches: E t = 2e4, and the tension is about one.
DRAWN = 0.03
STEEL = IsotropicElasticity(1e5, 0.3)


def belt() -> BodyMesh:
    """A quarter of a ring of rectangles around the origin, from the top (x0) clockwise to the right (x1)."""
    mesh = rectangle((0.0, 0.0), (ANGLE, THICKNESS), (AROUND, 1))
    angle, radius = mesh.points[:, 0], RADIUS + mesh.points[:, 1]
    return mesh.moved(np.column_stack([radius * np.sin(angle), radius * np.cos(angle)]))


@cache
def drawn(friction_coefficient: float, towards: int) -> State:
    """Load one end by a unit force, draw the other one out (towards = 1) or let it in (−1)."""
    outward = (np.cos(ANGLE), -np.sin(ANGLE))
    # The end turns about the centre as the rest does, lest its section be bent.
    turn = Support("belt", "x0", (lambda x: -towards * DRAWN * x[:, 1] / RADIUS, None))
    load = Traction("belt", "x1", (outward[0] / THICKNESS, outward[1] / THICKNESS))
    disc = ContactPair(Surface("belt", "y0"), RigidSphere((0.0, 0.0), RADIUS), Coulomb(friction_coefficient))
    mesh = belt()
    scene = Scene({"belt": Body(mesh, PlaneStress(1e6, 0.3))}, [turn], [load], [disc])
    return solve_scene(
        scene,
        MPI.COMM_SELF,
        partitions={"belt": box_partition(mesh, (6, 1))},
        solver=FaceNewton(tolerance=1e-8),
    )


def pull(state: State) -> float:
    """Return the force at the drawn end, from the balance of all others along it."""
    return float(state.contact.force[:, 0].sum() + np.cos(ANGLE))


def exponent(friction_coefficient: float) -> float:
    r"""Return a in T(θ) = T(0) exp(a θ) for a thin belt of thickness t on a disc of radius R.

    T is the tension in the middle of the belt, Q its shear force, p and μ p the tractions on its inner face,
    N = p R. The belt stays on the disc, so its curvature and its bending moment stay. Balance of an element
    along the belt, across it, and of moments about its middle, where r = R + t/2:

        T' = μ N − Q,    N = T − Q',    Q r = μ N t/2.

    With ε = t/(2 r) there is T' = μ (1 − ε) N, which is the lever: friction acts at R, tension at r; and
    T = N + μ ε N'. Exponentials solve both if μ ε a² + a = μ (1 − ε).
    """
    lever = THICKNESS / (2 * RADIUS + THICKNESS)
    half = 2 * friction_coefficient * lever
    return float((np.sqrt(1 + 2 * half * friction_coefficient * (1 - lever)) - 1) / half)


@pytest.mark.parametrize("towards", [1, -1])
def test_without_friction_both_ends_of_a_belt_pull_alike(towards: int) -> None:
    state = drawn(0.0, towards)
    assert pull(state) == pytest.approx(1.0, rel=1e-4)
    assert (state.contact.normal_force > 0).all()


@pytest.mark.parametrize("friction_coefficient", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("towards", [1, -1])
def test_the_pull_of_a_sliding_belt_grows_exponentially_with_its_wrap(
    friction_coefficient: float, towards: int, record_property: Callable[[str, object], None]
) -> None:
    state = drawn(friction_coefficient, towards)
    assert state.contact.count(Status.SLIP) == AROUND + 1
    found, textbook = pull(state), np.exp(towards * friction_coefficient * ANGLE)
    expected = np.exp(towards * exponent(friction_coefficient) * ANGLE)
    record_property("ratio of the pulls", float(found))
    record_property("error", float(found / expected - 1))
    assert found == pytest.approx(expected, rel=3e-4)
    assert abs(textbook / expected - 1) > 10 * abs(found / expected - 1), "the lever matters"


def test_the_two_ways_of_sliding_are_inverse_to_each_other() -> None:
    assert pull(drawn(0.5, 1)) * pull(drawn(0.5, -1)) == pytest.approx(1.0, rel=1e-4)
    assert pull(drawn(0.5, 1)) > 2.0


SLOPE = 0.35


def on_slope(friction_coefficient: float, supports: list[Support]) -> Scene:
    """A block on a rigid plane that rises along x, under a weight of 2."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 0.5), (6, 3, 2))
    turn = np.array(
        [[np.cos(SLOPE), 0.0, -np.sin(SLOPE)], [0.0, 1.0, 0.0], [np.sin(SLOPE), 0.0, np.cos(SLOPE)]]
    )
    plane = RigidPlane((0.0, 0.0, 0.0), tuple(turn[:, 2]))
    pair = ContactPair(Surface("block", "z0"), plane, Coulomb(friction_coefficient))
    weight = Traction("block", "z1", (0.0, 0.0, -1.0))
    return Scene({"block": Body(mesh.moved(mesh.points @ turn.T), STEEL)}, supports, [weight], [pair])


def solved(scene: Scene) -> State:
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-8))


def test_a_block_rests_on_a_slope_that_is_not_too_steep() -> None:
    state = solved(on_slope(1.15 * np.tan(SLOPE), []))
    assert state.contact.count(Status.STICK) > 0
    np.testing.assert_allclose(state.contact.force.sum(axis=0), (0.0, 0.0, 2.0), atol=1e-6)


def test_a_block_slides_off_a_slope_that_is_too_steep() -> None:
    with pytest.raises(InfeasibleError, match="block"):
        solved(on_slope(0.95 * np.tan(SLOPE), []))


@pytest.mark.parametrize("friction_coefficient", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("way", [1, -1], ids=["up", "down"])
def test_pushing_a_block_along_a_slope_takes_the_force_of_the_formula(
    friction_coefficient: float, way: int
) -> None:
    """A horizontal force W tan(φ + β) drives it up the slope β, and W tan(β − φ) keeps it from sliding."""
    state = solved(on_slope(friction_coefficient, [Support("block", "x0", (0.02 * way, None, None))]))
    closed = state.contact.normal_force > 0
    assert (state.contact.status[closed] == Status.SLIP).all()
    assert closed.sum() > 10
    angle = SLOPE + way * np.arctan(friction_coefficient)
    assert -state.contact.force[:, 0].sum() == pytest.approx(2.0 * np.tan(angle), rel=0.01)
    assert state.contact.force[:, 2].sum() == pytest.approx(2.0, rel=1e-6)


def test_a_block_that_a_later_step_pushes_rubs_where_it_was_held_first() -> None:
    """The nodes that are pushed move along the slope only then: before, supports held all that could slip."""
    first, later = (on_slope(0.3, [Support("block", "x0", (push, None, None))]) for push in (0.0, 0.02))
    steps = [LoadStep("held", supports=first.supports), LoadStep("pushed", supports=later.supports)]
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in first.bodies.items()}
    *_, state = solve_steps(ContactProblem(first, MPI.COMM_SELF, partitions=cut, tolerance=1e-8), steps)
    pushed = 2.0 * np.tan(SLOPE + np.arctan(0.3))
    assert -state.contact.force[:, 0].sum() == pytest.approx(pushed, rel=0.01)


@pytest.mark.parametrize("friction_coefficient", [0.1, 0.3])
def test_a_wedge_driven_under_a_slope_takes_the_force_of_the_formula(friction_coefficient: float) -> None:
    """H = V (tan φ + tan(φ + β)): a wedge that bears V on its floor is driven by H under a plane at β."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (8, 3, 4))
    points = mesh.points.copy()
    points[:, 2] *= 1.0 - 0.5 * np.tan(SLOPE) * points[:, 0]
    top = points[np.unique(mesh.surfaces["z1"])]
    slope = np.arctan((top[:, 2].max() - top[:, 2].min()) / 2.0)
    law = Coulomb(friction_coefficient)
    roof = RigidPlane((0.0, 0.0, 1.0), (-np.sin(slope), 0.0, -np.cos(slope)))
    pairs = [
        ContactPair(Surface("wedge", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), law),
        ContactPair(Surface("wedge", "z1"), roof, law),
    ]
    drive = Support("wedge", "x0", (0.02, None, None))
    state = solved(Scene({"wedge": Body(mesh.moved(points), STEEL)}, [drive], contacts=pairs))
    contact = state.contact
    floor, above = contact.on_pair(0), contact.on_pair(1)
    assert (contact.status[contact.normal_force > 0] == Status.SLIP).all()
    borne = contact.force[floor, 2].sum()
    assert borne == pytest.approx(-contact.force[above, 2].sum(), rel=1e-6)
    assert borne > 1.0
    turned = np.arctan(friction_coefficient)
    assert -contact.force[:, 0].sum() == pytest.approx(
        borne * (np.tan(turned) + np.tan(turned + slope)), rel=0.01
    )
