"""Slip of nodes that slide over facets, measured from places that the master carries along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import Body, ContactPair, MovingObstacle, RigidCylinder, RigidPlane, Scene, Surface
from fenics_contact._pairing.sliding.points import SlidingPoints
from tests.pairing.sliding_scenes import KINDS, on_arch, rotation, shaken, sliding


def in_space(now: SlidingPoints, slip: np.ndarray) -> np.ndarray:
    """Return slip as vectors."""
    return np.asarray(np.einsum("na,nad->nd", slip, now.points.tangents))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("when", ["before", "between", "after"])
def test_slip_is_the_same_when_everything_turns_by_a_right_angle(kind: str, when: str) -> None:
    scene = on_arch(kind)
    contact, x = sliding(scene), shaken(scene)
    later = x.copy()
    later[: scene.bodies["high"].mesh.n_nodes, 0] += 0.06
    start = contact.at(x).material_points()
    now = contact.at(later)
    wanted = in_space(now, now.slip(start))
    common = np.isin(now.key, start.key)
    assert np.linalg.norm(wanted[common], axis=1) == pytest.approx(0.06, rel=0.2)
    for axis in range(3 if scene.dim == 3 else 1):
        turn = rotation(scene.dim, np.pi / 2, axis)
        if when == "before":
            start = contact.at(x @ turn.T).material_points()
        turned = contact.at(
            later if when == "before" else later @ turn.T - 0.2, now if when == "after" else None
        )
        assert np.array_equal(turned.key, now.key)
        expected = wanted if when == "before" else wanted @ turn.T
        assert in_space(turned, turned.slip(start)) == pytest.approx(expected, abs=1e-12)


def test_slip_over_several_facets_is_the_way() -> None:
    """On a plane master, by two thirds of a slave's length, in one step or in many."""
    from fenics_contact.gallery import block
    from fenics_contact.materials import IsotropicElasticity

    material = IsotropicElasticity(10.0, 0.3)
    low = block((0.0, 0.0, -0.5), (3.0, 1.0, 0.0), (9, 3, 1))
    high = block((0.3, 0.2, 0.0), (1.1, 0.8, 0.4), (4, 3, 1))
    scene = Scene(
        {"high": Body(high, material), "low": Body(low, material)},
        contacts=[ContactPair(Surface("high", "z0"), Surface("low", "z1"), discretisation="node")],
    )
    contact, x, way = sliding(scene), scene.points.copy(), np.array([1.5, 0.13, 0.0])
    now = contact.at(x)
    start, facets, total = now.material_points(), now.points.facet, np.zeros((now.points.count, 3))
    for _ in range(10):
        before = now.material_points()
        x[: high.n_nodes] += way / 10
        now = contact.at(x, now)
        total += in_space(now, now.slip(before))
    assert (now.points.facet != facets).all()
    assert in_space(now, now.slip(start)) == pytest.approx(np.tile(way, (now.points.count, 1)), abs=1e-12)
    assert total == pytest.approx(np.tile(way, (now.points.count, 1)), abs=1e-12)


def test_what_sticks_to_a_stretched_master_does_not_slip() -> None:
    scene = on_arch("tetrahedron")
    contact, x = sliding(scene), scene.points.copy()
    now = contact.at(x)
    start, low = now.material_points(), contact.meetings[0].master_nodes
    x[low, 0] *= 1.2
    feet = now.points.master @ x
    x[now.points.slave] = feet + 0.01 * now.points.normal
    then = contact.at(x, now)
    assert np.abs(then.slip(start)).max() < 2e-3
    assert np.linalg.norm(x[now.points.slave] - scene.points[now.points.slave], axis=1).max() > 0.05


def test_nodes_that_come_later_slip_from_where_they_are_found() -> None:
    scene = on_arch("hexahedron")
    contact, x = sliding(scene), scene.points.copy()
    high = slice(0, scene.bodies["high"].mesh.n_nodes)
    x[high, 1] += 0.5
    before = contact.at(x)
    start = before.material_points()
    x[high, 1] -= 0.5
    now = contact.at(x, before)
    new = ~np.isin(now.key, start.key)
    assert np.count_nonzero(new) > 3
    assert np.abs(now.slip(start)[new]).max() < 1e-13
    assert np.abs(now.slip(start)[~new]).max() > 0.4
    start = start.extended(now.material_points())
    assert np.array_equal(start.key, np.union1d(before.key, now.key))
    x[high, 0] += 0.05
    then = contact.at(x, now)
    known = np.isin(then.key, now.key[new])
    assert np.linalg.norm(then.slip(start)[known], axis=1) == pytest.approx(0.05, rel=0.07)


def test_a_turning_roll_drags_by_the_way_of_its_surface() -> None:
    radius, turn = 2.0, 0.04
    roll = RigidCylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), radius)

    def path(time: float) -> tuple[np.ndarray, np.ndarray]:
        return rotation(3, turn * time), np.array([0.0, 0.0, -radius])

    body = on_arch("hexahedron", radius=radius).bodies["high"]
    pair = ContactPair(Surface("high", "z0"), MovingObstacle(roll, path))
    scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
    contact = sliding(scene)
    start = contact.at(scene.points).material_points()
    now = contact.at(scene.points, time=1.0)
    slip = in_space(now, now.slip(start))
    assert np.linalg.norm(slip, axis=1) == pytest.approx(radius * turn, rel=1e-3)
    # Seen from the roll the body goes backwards.
    top = np.argmax(now.points.normal[:, 2])
    assert slip[top, 0] == pytest.approx(-radius * turn, rel=1e-2)


def test_friction_forces_turn_with_the_bodies() -> None:
    scene = on_arch("hexahedron")
    contact, x = sliding(scene), shaken(scene)
    now = contact.at(x)
    friction = np.random.default_rng(0).standard_normal((now.points.count, 2))
    turn = rotation(3, 0.7, 1)
    then = contact.at(x @ turn.T, now)
    carried = then.carry_tangential(friction, now)
    assert np.linalg.norm(carried, axis=1) == pytest.approx(np.linalg.norm(friction, axis=1))
    upright = np.abs(now.points.normal[:, 1]) < 0.02
    assert upright.any()
    vectors, before = in_space(then, carried), in_space(now, friction)
    assert vectors[upright] == pytest.approx(before[upright] @ turn.T, abs=0.05)


def test_planes_that_stand_still_carry_nothing_along() -> None:
    body = on_arch("hexahedron").bodies["high"]
    pair = ContactPair(Surface("high", "z0"), RigidPlane((0, 0, -1.0), (0, 0, 1)))
    scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
    contact = sliding(scene)
    start = contact.at(scene.points).material_points()
    way = np.array([0.3, -0.2, 0.1])
    now = contact.at(scene.points + way)
    assert in_space(now, now.slip(start)) == pytest.approx(np.tile(way * [1, 1, 0], (now.points.count, 1)))


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("kind", KINDS)
def test_slip_of_earlier_steps_turns_with_bodies_that_turn_together(kind: str, discretisation: str) -> None:
    """About normals, too, and by more than a right angle."""
    scene = on_arch(kind)
    scene = replace(scene, contacts=[replace(scene.contacts[0], discretisation=discretisation)])
    contact, x = sliding(scene), shaken(scene)
    then = contact.at(x)
    slip = np.random.default_rng(5).standard_normal((then.points.count, scene.dim - 1))
    for axis in range(3 if scene.dim == 3 else 1):
        turn = rotation(scene.dim, 2.1, axis)
        now = contact.at(x @ turn.T + 0.4)
        wanted = in_space(then, slip) @ turn.T
        assert in_space(now, now.carry_slip(slip, then)) == pytest.approx(wanted, abs=1e-9)


def test_slip_of_earlier_steps_turns_with_an_obstacle_and_not_with_the_slave() -> None:
    plane, at_rest = RigidPlane((0, 0, 0), (0, 0, 1)), np.zeros(3)
    wheel = MovingObstacle(plane, lambda time: (rotation(3, 2.0 * time, 2), at_rest))
    body = on_arch("hexahedron").bodies["high"]
    for obstacle, angle in ((wheel, 2.0), (plane, 0.0)):
        pair = ContactPair(Surface("high", "z0"), obstacle)
        scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
        contact = sliding(scene)
        then = contact.at(scene.points)
        now = contact.at(scene.points @ rotation(3, 0.7, 2).T, time=1.0)
        slip = np.tile([0.3, -0.1], (then.points.count, 1))
        wanted = in_space(then, slip) @ rotation(3, angle, 2).T
        assert in_space(now, now.carry_slip(slip, then)) == pytest.approx(wanted, abs=1e-12)
