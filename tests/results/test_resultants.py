"""Reactions of supports, forces of pairs, and their balance with the loads."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
    gravity,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke, PlaneStrain, PlaneStress
from fenics_contact.mesh import quadratic
from tests.conftest import run_on_ranks
from tests.equilibrium.bedded import FORCE, Bedded, pushed
from tests.results.resultant_cases import BESIDE, GIVEN, MOMENT, SCENES, numbers, solved
from tools.hard_cases.invariants import Whole

SCRIPT = Path(__file__).with_name("resultant_cases.py")
STEEL = IsotropicElasticity(1000.0, 0.3)
COMM = MPI.COMM_SELF


@pytest.fixture(scope="module", params=SCENES)
def state(request: pytest.FixtureRequest) -> State:
    return solved(SCENES[request.param](), COMM)


def residual_of_whole_bodies(state: State) -> tuple[Whole, np.ndarray]:
    """Return K u − f − contact forces at the nodes of bodies that are not torn, (n_nodes, dim), [force]."""
    whole = Whole(state.scene)
    u = np.concatenate([state.gather_displacement(name) for name in state.scene.bodies])
    inner = (whole.K @ u.ravel()).reshape(u.shape)
    return whole, inner - whole.load - whole.torn.points.jump.T @ state.contact.force


def test_reactions_are_the_forces_that_whole_bodies_lack(state: State) -> None:
    whole, lacking = residual_of_whole_bodies(state)
    # Ties are no part of that: what they exert is compared on bodies as a whole.
    for name in state.scene.body_names:
        own = whole.nodes(name)
        held = lacking[own].sum(axis=0)
        reactions = [each for each in state.reactions() if each.surface and each.surface.body == name]
        found = np.sum([each.force for each in reactions], axis=0) if reactions else np.zeros(len(held))
        for tie in state.resultants().ties:
            found = found + tie.force * (1.0 if tie.surface and tie.surface.body == name else -1.0)
        size = state.balance().force_scale
        np.testing.assert_allclose(found, held, rtol=0, atol=1e-8 * size, err_msg=name)


def test_each_support_has_its_own_part() -> None:
    state = solved(SCENES["pinched"](), COMM)
    whole, lacking = residual_of_whole_bodies(state)
    for reaction in state.reactions():
        assert reaction.surface is not None
        mesh = state.scene.bodies[reaction.surface.body].mesh
        nodes = np.unique(mesh.surfaces[reaction.surface.name])
        places, own = mesh.points[nodes], whole.nodes(reaction.surface.body)
        force = np.where(whole.fixed[own][nodes], lacking[own][nodes], 0.0)
        arm = places - places.mean(axis=0)  # the nodes are evenly spaced
        moment = (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum()
        assert np.abs(force).sum() > 0.1
        np.testing.assert_allclose(reaction.about, places.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(reaction.force, force.sum(axis=0), atol=1e-8)
        assert reaction.moment == pytest.approx(moment, abs=1e-8)


def test_all_forces_balance(state: State) -> None:
    balance = state.balance()
    assert balance.imbalance <= 1e-9
    assert balance.force_scale > 0.5
    assert balance.moment_scale > 0.1
    assert np.linalg.norm(balance.reactions.force) > 0.5


def test_the_balance_holds_at_a_loose_tolerance_and_about_any_point() -> None:
    state = solved(SCENES["dragged"](), COMM, tolerance=1e-3)
    assert state.solution.gluing_residual > 1e-9, "the solver left nothing"
    assert state.balance().imbalance <= 1e-9
    about = (3.0, -2.0, 7.0)
    near, far = state.balance().total, state.balance(about)
    assert far.imbalance <= 1e-9
    np.testing.assert_allclose(far.total.about, about)
    np.testing.assert_allclose(near.force, far.total.force, atol=1e-12)


@pytest.mark.parametrize("lost", ["contact", "reaction", "load"])
def test_the_balance_notices_a_force_that_is_forgotten(lost: str) -> None:
    state = solved(SCENES["dragged"](), COMM)
    assert state.balance().imbalance <= 1e-9
    forces = state._nodal_forces
    less = getattr(forces, lost).copy()
    less[np.argmax(np.linalg.norm(less, axis=1))] *= 0.999
    vars(state)["_nodal_forces"] = replace(forces, **{lost: less})
    assert state.balance().imbalance > 1e-6


def test_a_force_at_a_point_is_held_there() -> None:
    state = solved(SCENES["turned"](), COMM)
    loads, (held,) = state.balance(BESIDE).loads, state.reactions(BESIDE)
    np.testing.assert_allclose([loads.force, loads.moment], [GIVEN, MOMENT], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        [held.force, held.moment], [[-f for f in GIVEN], [-m for m in MOMENT]], atol=1e-9
    )


def test_friction_across_a_gap_is_told_as_its_moment() -> None:
    state = solved(SCENES["dragged"](), COMM)
    balance, (pair, floor) = state.balance(), state.resultants().contacts
    gap = 0.01
    np.testing.assert_allclose(balance.gaps.force, 0.0, atol=1e-12 * balance.force_scale)
    moment = np.cross((0.0, 0.0, gap), pair.force)  # the slave is above the master
    np.testing.assert_allclose(balance.gaps.moment, moment, atol=1e-9 * balance.moment_scale)
    assert np.abs(balance.gaps.moment).max() > 0.01
    np.testing.assert_allclose(balance.obstacles.force, floor.force, rtol=1e-12)
    np.testing.assert_allclose(
        balance.obstacles.moment_about(floor.about), floor.moment, atol=1e-9 * balance.moment_scale
    )


@pytest.fixture(scope="module")
def on_two_ranks() -> dict[str, Any]:
    return json.loads(run_on_ranks(SCRIPT, 2, "dragged", "tied", "turned"))


@pytest.mark.parametrize("name", ["dragged", "tied", "turned"])
def test_numbers_are_the_same_on_two_ranks(name: str, on_two_ranks: dict[str, Any]) -> None:
    alone, ranks = numbers(solved(SCENES[name](), COMM)), on_two_ranks[name]
    assert len(ranks) == 2
    assert ranks[0] == ranks[1]
    for what, values in alone.items():
        size = max(alone["scales"]) if what != "off" else 1.0
        np.testing.assert_allclose(ranks[0][what], values, rtol=0, atol=1e-8 * size)


@pytest.mark.parametrize("parts", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_bar_in_tension(dim: int, parts: int) -> None:
    """σ A at the wall and nothing at the rollers; the moment of the force about the wall's lower end."""
    pull, height = 7.0, 1.5
    if dim == 2:
        mesh, material = rectangle((0.0, 0.0), (4.0, height), (8, 3)), PlaneStress(1000.0, 0.3)
    else:
        mesh, material = block((0.0, 0.0, 0.0), (4.0, height, 1.0), (8, 3, 2)), STEEL
    rollers = [
        Support("bar", "xyz"[k] + "0", tuple(0.0 if k == j else None for j in range(dim))) for k in range(dim)
    ]
    load = Traction("bar", "x1", (pull, *[0.0] * (dim - 1)))
    scene = Scene({"bar": Body(mesh, material)}, rollers, [load])
    cut = {"bar": box_partition(mesh, (parts, *[1] * (dim - 1)))}
    state = solve_scene(scene, COMM, partitions=cut, tolerance=1e-10)
    assert isinstance(state.system, DirectSystem) == (parts == 1)
    wall, *others = state.reactions()
    np.testing.assert_allclose(wall.force, [-pull * height, *[0.0] * (dim - 1)], atol=1e-8)
    np.testing.assert_allclose(np.atleast_1d(wall.moment), 0.0, atol=1e-8)
    for other in others:
        np.testing.assert_allclose(other.force, 0.0, atol=1e-8)
    corner = wall.moment_about((0.0,) * dim)
    expected = pull * height * height / 2
    np.testing.assert_allclose(np.atleast_1d(corner)[-1], expected, rtol=1e-9)
    (again, *_) = state.reactions(about=(0.0,) * dim)
    np.testing.assert_allclose(again.moment, corner, atol=1e-12)
    assert state.balance().imbalance <= 1e-9


@pytest.mark.parametrize("cells", ["linear", "quadratic"])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_on_a_plane_carries_its_weight(dim: int, cells: str) -> None:
    if dim == 2:
        mesh, material = rectangle((0.0, 0.0), (2.0, 1.0), (4, 3)), PlaneStress(1000.0, 0.3)
    else:
        mesh, material = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2)), STEEL
    mesh = quadratic(mesh) if cells == "quadratic" else mesh
    up, down = np.eye(dim)[-1], "yz"[dim - 2] + "0"
    plane = RigidPlane((0.0,) * dim, tuple(up))
    scene = Scene(
        {"block": Body(mesh, material)},
        loads=[gravity("block", 3.0, tuple(-5.0 * up))],
        contacts=[ContactPair(Surface("block", down), plane, Coulomb(0.4))],
    )
    state = solve_scene(scene, COMM, tolerance=1e-10)
    (on_floor,) = state.resultants().contacts
    np.testing.assert_allclose(on_floor.force, 30.0 * up, atol=1e-7)
    # The weight acts at the middle, above the centroid of the floor's side.
    np.testing.assert_allclose(np.atleast_1d(on_floor.moment), 0.0, atol=1e-7)
    assert len(state.reactions()) == 0
    assert state.balance().imbalance <= 1e-9
    np.testing.assert_allclose(state.balance().loads.force, -30.0 * up, rtol=1e-12)


def test_supports_that_share_nodes_share_their_reaction() -> None:
    """An even pull on a wall in two pieces of different size: each carries its area, the sum is the whole."""
    even = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (6, 4, 2))
    # Rows of cells of widths 1/16, 3/16, 5/16 and 7/16.
    mesh = even.moved(
        even.points * np.stack([np.ones(even.n_nodes), even.points[:, 1], np.ones(even.n_nodes)], 1)
    )
    facets = mesh.surfaces["x0"]
    left = mesh.points[facets].mean(axis=1)[:, 1] < 1.0 / 16.0
    mesh = replace(mesh, surfaces={**mesh.surfaces, "narrow": facets[left], "wide": facets[~left]})
    roll = [Support("bar", "y0", (None, 0.0, None)), Support("bar", "z0", (None, None, 0.0))]
    pulled = [Support("bar", name, (0.0, None, None)) for name in ("narrow", "wide")]
    load = Traction("bar", "x1", (8.0, 0.0, 0.0))
    state = solve_scene(Scene({"bar": Body(mesh, STEEL)}, [*pulled, *roll], [load]), COMM)
    narrow, wide, *_ = state.reactions()
    np.testing.assert_allclose(narrow.force, (-0.5, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(wide.force, (-7.5, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(narrow.moment, 0.0, atol=1e-9)
    np.testing.assert_allclose(wide.moment, 0.0, atol=1e-9)


def test_reactions_have_the_names_of_their_surfaces() -> None:
    """Two supports of one surface: its name is their sum, about the point of the first."""
    mesh = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (5, 3, 2))
    held = [Support("my bar", "x0", (0.0, None, None)), Support("my bar", "x0", (None, 0.0, 0.0))]
    held.append(Support("my bar", "y1", (None, 0.0, None)))
    pull = np.array([0.3, -0.2, -1.0])
    load = Traction("my bar", "x1", tuple(pull))
    reactions = solve_scene(Scene({"my bar": Body(mesh, STEEL)}, held, [load]), COMM).reactions()
    wall, side = reactions["my bar x0"], reactions["my bar y1"]
    first, second, third = reactions
    assert np.abs(first.force).max() > 0.1
    assert np.abs(second.force).max() > 0.1
    np.testing.assert_allclose(wall.force, first.force + second.force, atol=1e-12)
    np.testing.assert_allclose(side.force, third.force, atol=0)
    np.testing.assert_allclose(wall.force + side.force, -pull, atol=1e-9)
    np.testing.assert_allclose(wall.about, (0.0, 0.5, 0.5), atol=1e-12)
    origin = wall.moment_about((0, 0, 0)) + side.moment_about((0, 0, 0))
    np.testing.assert_allclose(origin, -np.cross((4.0, 0.5, 0.5), pull), atol=1e-8)
    with pytest.raises(InvalidInputError, match=r"which has 'my bar x0', 'my bar y1'; got 'my bar x1'"):
        reactions["my bar x1"]


def test_a_pair_has_the_name_of_its_slave_or_of_both_surfaces() -> None:
    """A strip across two plates: its lower side is the slave of both pairs."""
    plates = {f"plate {k}": rectangle((2.0 * k, 0.0), (2.0 * k + 1.0, 1.0), (4, 3)) for k in range(2)}
    bodies = {"strip": rectangle((0.0, 1.0), (3.0, 1.5), (12, 3)), **plates}
    material = PlaneStrain(100.0, 0.3)
    supports = [Support(name, "y0", (0.0, 0.0)) for name in plates] + [Support("strip", "x0", (0.0, None))]
    pairs = [ContactPair(Surface("strip", "y0"), Surface(name, "y1")) for name in plates]
    loads = [Traction("strip", "y1", lambda x: np.stack([0.0 * x[:, 0], -1.0 - x[:, 0]], axis=1))]
    scene = Scene({name: Body(mesh, material) for name, mesh in bodies.items()}, supports, loads, pairs)
    contacts = solve_scene(scene, COMM, tolerance=1e-10).resultants().contacts
    left, right = contacts["strip y0 on plate 0 y1"], contacts["strip y0 on plate 1 y1"]
    assert 0.5 < left.force[1] < right.force[1]
    whole = contacts["strip y0"]
    np.testing.assert_allclose(whole.force[1], left.force[1] + right.force[1], rtol=1e-12)
    np.testing.assert_allclose(whole.force[1], 3.0 + 4.5, rtol=1e-8)


def test_the_friction_torque_about_an_axis() -> None:
    """A square pad that turns on a floor with Tresca's law: every node slips around the axis."""
    stress, mesh = 0.2, block((-1.0, -1.0, 0.0), (1.0, 1.0, 0.5), (6, 6, 2))

    def turned(points: np.ndarray) -> np.ndarray:
        return 0.05 * points

    twist = (lambda x: -turned(x)[:, 1], lambda x: turned(x)[:, 0], -0.01)
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    scene = Scene(
        {"pad": Body(mesh, STEEL)},
        [Support("pad", "z1", twist)],
        contacts=[ContactPair(Surface("pad", "z0"), floor, Tresca(stress))],
    )
    state = solve_scene(scene, COMM, tolerance=1e-8)
    contact, resultants = state.contact, state.resultants()
    assert contact.count(Status.SLIP) == contact.points.count - 1, "the middle does not slip"
    arm = np.linalg.norm(state.contact_places[:, :2], axis=1)
    expected = -stress * (contact.area * arm).sum()
    rubbing, axis = resultants.friction["pad z0"], ((0.0, 0.0, 3.0), (0.0, 0.0, 1.0))
    assert rubbing.torque(*axis) == pytest.approx(expected, rel=1e-2)  # material bends it
    assert rubbing.torque(*axis) == pytest.approx(-state.reactions()["pad z1"].torque(*axis), rel=1e-6)
    assert abs(rubbing.force[2]) < 1e-9 * np.abs(resultants.contacts["pad z0"].force[2])
    np.testing.assert_allclose(
        resultants.contacts["pad z0"].force, contact.force.sum(axis=0), rtol=1e-6, atol=1e-6
    )


def test_the_torque_of_a_twisted_bar() -> None:
    mesh = block((-0.5, -0.5, 0.0), (0.5, 0.5, 2.0), (3, 3, 4))

    def turning(points: np.ndarray) -> np.ndarray:
        return np.stack([-points[:, 1], points[:, 0], 0.0 * points[:, 0]], axis=1)

    scene = Scene({"bar": Body(mesh, STEEL)}, [Support("bar", "z0")], [Traction("bar", "z1", turning)])
    state = solve_scene(scene, COMM)
    (wall,) = state.reactions()
    polar = 1.0 / 6.0  # ∫ x² + y² over the unit square
    assert wall.torque((0.0, 0.0, 5.0), (0.0, 0.0, -2.0)) == pytest.approx(polar, rel=1e-9)
    assert wall.torque((0.3, -4.0, 0.0), (0.0, 0.0, 1.0)) == pytest.approx(-polar, rel=1e-9)
    assert wall.torque((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == pytest.approx(0.0, abs=1e-12)


def test_a_bed_is_part_of_the_balance() -> None:
    state = pushed(Bedded(1e3, 0.3), (1, 1, 3))
    balance = state.balance()
    assert balance.imbalance <= 1e-9
    pressed = state.resultants().contacts[0].force
    np.testing.assert_allclose(balance.beds.force, -np.add(FORCE, pressed), atol=1e-6)
    assert "beds" in str(balance)


def test_tables_name_surfaces_and_units() -> None:
    state = solved(SCENES["tied"](), COMM)
    reactions, pairs, balance = str(state.reactions()), str(state.resultants()), str(state.balance())
    assert "reaction 1  lower x0" in reactions
    assert "tie 0  upper z0" in pairs
    assert "contact" not in pairs
    assert all("F in [force], M in [force·length]" in text for text in (reactions, pairs, balance))
    assert "obstacles" not in balance
    assert str(state.reactions()[0]).startswith("force (")
    loose = solve_scene(
        Scene({"b": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL)}, [Support("b", "x0")]), COMM
    )
    assert str(loose.resultants()) == "none"
    assert loose.balance().imbalance == 0.0


def test_points_and_axes_must_fit_the_space() -> None:
    state = solved(SCENES["pinched"](), COMM)
    with pytest.raises(InvalidInputError, match=r"needs 2 finite coordinates, got \(0, 0, 0\): give a point"):
        state.reactions(about=(0, 0, 0))
    with pytest.raises(InvalidInputError, match="an axis needs bodies in space: use moment_about"):
        state.reactions()[0].torque((0, 0, 0), (0, 0, 1))
    solid = pushed(Bedded(1e3, 0.3), (1, 1, 1)).resultants().contacts[0]
    with pytest.raises(InvalidInputError, match=r"the direction of an axis must be 3 finite numbers"):
        solid.torque((0, 0, 0), (0, 0, 0))


def test_forces_that_all_point_at_one_place_balance_there() -> None:
    swollen = tuple(lambda x, k=k: 0.01 * (x[:, k] - 0.5) for k in range(2))
    supports = [Support("plate", side, swollen) for side in ("x0", "x1", "y0", "y1")]
    plate = Body(rectangle((0.0, 0.0), (1.0, 1.0), (2, 2)), PlaneStress(1000.0, 0.3))
    balance = solve_scene(Scene({"plate": plate}, supports), COMM).balance(about=(0.5, 0.5))
    assert balance.force_scale > 1.0
    assert balance.imbalance < 1e-13


@pytest.mark.parametrize("material", [PlaneStrain(1.0, 0.3), NeoHooke(1.0, 0.3)])
def test_bodies_that_are_only_moved_are_in_balance(material: Material) -> None:
    """Rounding is all the force there is; it is not compared with itself."""
    plate = Body(rectangle((0.0, 0.0), (2.0, 1.0), (8, 4)), material)
    moved, strained = (
        solve_scene(Scene({"plate": plate}, [Support("plate", "y0"), *more]), COMM).balance()
        for more in ([], [Support("plate", "y1", (0.3, 0.1))])
    )
    assert (moved.imbalance, moved.total.force.any()) == (0.0, False)
    shifted = solve_scene(Scene({"plate": plate}, [Support("plate", "y0", (0.3, 0.1))]), COMM).balance()
    # Rubber that its supports move as a whole has not even that.
    assert np.abs(shifted.reactions.force).any() or isinstance(material, NeoHooke), "nothing to test"
    assert shifted.imbalance < 1e-7
    assert shifted.force_scale < 1e-3 * strained.force_scale
