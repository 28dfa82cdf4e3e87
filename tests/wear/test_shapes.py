"""The mesh follows what has worn off: volumes, gaps, and what the next load step begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    ContactProblem,
    Coulomb,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    wear_to,
)
from fenics_contact._wear.shapes import WornShape
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.torn import build_torn_system
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from tests.wear.shape_cases import blocks, cube, disc_on_plane, on_obstacle, tilted


def worn(scene: Scene) -> Any:
    """Return the problem of a scene, its worn state, and its shape after that."""
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
    state = problem.solve()
    return problem, state, WornShape(scene, problem.decomposition).moved(scene, state)


CASES: dict[str, Callable[[], Scene]] = {
    "matching": lambda: blocks(0.5),
    "mortar": lambda: blocks(0.5, (11, 5)),
    "finer master": lambda: blocks(0.3, (3, 5)),
    "master alone": lambda: blocks(0.0, (11, 5), discretisation="node"),
    "quadratic": lambda: blocks(0.5, (11, 5), curved=True),
    "revolved": lambda: blocks(0.5, material=IsotropicElasticity(2000.0, 0.3), revolved=True),
    "thick": lambda: blocks(0.5, material=PlaneStrain(2000.0, 0.3, thickness=3.0)),
    "half on an obstacle": lambda: on_obstacle(RigidSphere((0.0, -50.0), 50.0), 0.5),
    "cube": cube,
    "tetrahedra": lambda: cube("tetrahedron", True),
}


@pytest.mark.parametrize("case", CASES)
def test_meshes_lose_the_volume_that_has_worn_off(case: str) -> None:
    scene = CASES[case]()
    problem, state, moved = worn(scene)
    contact, (wear,) = state.contact, scene.contacts[0].wears
    volume = contact.worn_volume() / (3.0 if case == "thick" else 1.0)
    assert volume > 0.0
    assert contact.worn_depth.max() > 1e-3
    shares = {"slave": wear.share, "master": 1.0 - wear.share}
    names = dict(zip(("slave", "master"), (side.body for side in scene.contacts[0].surfaces), strict=False))
    lost = {names[side]: share * volume for side, share in shares.items() if share and side in names}
    assert moved.volumes.keys() == lost.keys()
    for name, expected in lost.items():
        assert moved.volumes[name] == pytest.approx(expected, rel=1e-8)
        assert scene.bodies[name].volume - moved.scene.bodies[name].volume == pytest.approx(
            expected, rel=1e-8
        )
    stays = 0.0 if len(names) == 2 else 1.0 - wear.share
    np.testing.assert_allclose(moved.before.contact.worn_depth, stays * contact.worn_depth, atol=1e-15)
    after = problem.solve(moved.scene, before=moved.before)
    assert after.contact.normal_force.sum() > 0.0


def gaps(scene: Scene, problem: ContactProblem) -> np.ndarray:
    """Return the gaps that contact search finds between the surfaces of a scene."""
    return build_torn_system(scene, problem.decomposition, overlap=True).points.gap


@pytest.mark.parametrize(
    ("case", "accuracy"),
    [
        ("flat", 1e-14),
        ("slave alone", 1e-8),
        ("matching", 1e-8),
        ("quadratic", 2e-5),
        ("finer master", 5e-5),
        ("cube", 6e-5),
    ],
)
def test_gaps_found_anew_are_those_that_wear_has_made(case: str, accuracy: float) -> None:
    more = {"flat": lambda: tilted(None), "slave alone": lambda: blocks(1.0, (11, 5))}
    scene = (CASES | more)[case]()
    problem, state, moved = worn(scene)
    expected = state.contact.points.gap + state.contact.worn_depth
    assert expected.max() > 100.0 * accuracy
    np.testing.assert_allclose(gaps(moved.scene, problem), expected, rtol=0.0, atol=accuracy)


def test_bodies_with_friction_rest_when_their_shape_follows() -> None:
    scene = tilted(Coulomb(0.3), sliding=None)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10)
    pressed = problem.solve()
    support = Support("punch", "y1", (0.05, lambda x: -0.05 + 0.002 * x[:, 0]))
    slid = problem.solve(replace(scene, supports=[support]), before=pressed)
    assert slid.contact.worn.max() > 1e-4
    moved = WornShape(scene, problem.decomposition).moved(slid.scene, slid)
    assert (moved.before.contact.worn_depth == 0.0).all()
    after = problem.solve(moved.scene, before=moved.before)
    slip = np.abs(slid.contact.slip).max()
    assert np.abs(after.contact.slip).max() < 0.01 * slip
    for name in ("normal_force", "friction_force"):
        was, now = getattr(slid.contact, name), getattr(after.contact, name)
        assert np.abs(now - was).max() < 0.01 * np.abs(was).max(), name


def test_worn_surfaces_have_no_true_shape_any_more() -> None:
    scene = disc_on_plane()
    mesh = scene.bodies["disc"].mesh
    assert {"contact", "side"} <= mesh.shapes.keys()
    problem, state, moved = worn(scene)
    worn_mesh = moved.scene.bodies["disc"].mesh
    assert worn_mesh.origin.shapes.keys() == mesh.shapes.keys() - {"contact"}
    side = np.setdiff1d(mesh.nodes_of("side"), mesh.nodes_of("contact"))
    np.testing.assert_array_equal(worn_mesh.points[side], mesh.points[side])
    assert moved.volumes["disc"] == pytest.approx(state.contact.worn_volume(), rel=1e-8)
    expected = state.contact.points.gap + state.contact.worn_depth
    np.testing.assert_allclose(gaps(moved.scene, problem), expected, rtol=0.0, atol=2e-5)
    again = problem.solve(moved.scene, before=moved.before)
    twice = WornShape(scene, problem.decomposition).moved(moved.scene, again)
    assert twice.volumes["disc"] == pytest.approx(again.contact.worn_volume(), rel=1e-8)


def test_shapes_that_cannot_follow_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    soft = replace(blocks(0.5).bodies["low"], material=NeoHooke(2000.0, 0.3))
    scene = blocks(0.5)
    problem, state, _ = worn(scene)
    with pytest.raises(
        InvalidInputError, match=r"shapes that follow wear need linear materials, got nonline"
    ):
        WornShape(replace(scene, bodies={**scene.bodies, "low": soft}), problem.decomposition)
    deep = replace(state, contact=replace(state.contact, worn=200.0 * state.contact.worn))
    with pytest.raises(InvalidInputError, match=r"the worn shape of body 'high' cannot be meshed"):
        WornShape(scene, problem.decomposition).moved(scene, deep)


def test_depth_stays_a_gap_where_supports_hold_nodes() -> None:
    scene = blocks(0.5)
    held = [support for support in scene.supports if (support.body, support.surface) != ("low", "x0")]
    scene = replace(scene, supports=[*held, Support("low", "x0", (0.0, 0.0))])
    problem, state, moved = worn(scene)
    contact, before = state.contact, moved.before.contact
    assert before.worn_depth[0] == pytest.approx(0.5 * contact.worn_depth[0], rel=1e-12)
    assert contact.worn_depth[0] > 1e-3
    np.testing.assert_array_equal(before.worn_depth[1:], 0.0)
    volume = contact.nominal_area @ (contact.worn_depth - before.worn_depth) - 0.5 * contact.worn_volume()
    assert moved.volumes["low"] == pytest.approx(volume, rel=1e-8)
    now = gaps(moved.scene, problem) + before.worn_depth
    np.testing.assert_allclose(now, contact.points.gap + contact.worn_depth, rtol=0.0, atol=1e-6)
    deep = replace(state, contact=replace(contact, worn=20.0 * contact.worn))
    with pytest.raises(
        InvalidInputError, match=r"nodes that wear must be free to move, but .* of body 'low' hold"
    ):
        WornShape(scene, problem.decomposition).moved(scene, deep)


def test_depth_on_obstacles_is_taken_from_the_mesh_once() -> None:
    scene = on_obstacle(RigidPlane((0.0, 0.0), (0.0, 1.0)), 0.5)
    problem, _, moved = worn(scene)
    shape = WornShape(scene, problem.decomposition)
    kept = moved.before.contact.worn_depth
    again = problem.solve(moved.scene, before=moved.before)
    twice = shape.moved(moved.scene, again, kept)
    assert twice.volumes["punch"] == pytest.approx(
        0.5 * again.contact.nominal_area @ again.contact.worn, rel=1e-8
    )
    np.testing.assert_allclose(twice.before.contact.worn_depth, kept + 0.5 * again.contact.worn, rtol=1e-12)


@pytest.mark.parametrize("scene", [blocks(0.5), tilted(None)], ids=["bodies", "obstacle"])
def test_histories_whose_shape_follows_are_those_whose_gaps_do(scene: Scene) -> None:
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    gap, shape = (wear_to(problem, 2.0, tolerance=0.05, follow=follow) for follow in (np.inf, 2e-3))
    assert gap.state.scene.points is not shape.state.scene.points
    assert np.abs(gap.state.scene.points - shape.state.scene.points).max() > 1e-3
    assert shape.state.contact.worn_depth.max() < 0.6 * shape.depth.max()
    assert shape.volume == pytest.approx(gap.volume, rel=5e-3)
    np.testing.assert_allclose(shape.depth, gap.depth, rtol=0.0, atol=5e-3 * gap.depth.max())


def test_histories_end_where_their_shape_cannot_follow(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> Any:
        raise InvalidInputError("no such mesh")

    scene = tilted(None)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    monkeypatch.setattr(WornShape, "moved", fails)
    history = wear_to(problem, 2.0, tolerance=0.05, follow=4e-3)
    assert history.reason == "the shape cannot follow: no such mesh"
    assert history.jumps[-1].cycles < 2.0
    with pytest.raises(InvalidInputError, match="the shape cannot follow: no such mesh"):
        wear_to(problem, 2.0, tolerance=0.05, follow=0.0)
    with pytest.raises(InvalidInputError, match=r"follow must not be negative, got -1: give np\.inf"):
        wear_to(problem, 2.0, follow=-1.0)


ON_RANKS = """
from mpi4py import MPI
import numpy as np
from fenics_contact import ContactProblem
from fenics_contact._wear.shapes import WornShape
from tests.scenes import partitions
from tests.wear.shape_cases import cube
scene = cube()
problem = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-10, partitions=partitions(scene))
state = problem.solve()
moved = WornShape(scene, problem.decomposition).moved(scene, state)
after = problem.solve(moved.scene, before=moved.before)
points = moved.scene.bodies["cube"].mesh.points
if MPI.COMM_WORLD.rank == 0:
    print(*points.ravel().tolist(), after.contact.normal_force.sum())
"""


def test_shapes_are_the_same_on_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    assert len(one) == 3 * 48 + 1
    assert np.ptp(one[:-1] - cube().points.ravel()) > 1e-2
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-7)
