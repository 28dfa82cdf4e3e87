"""Surfaces that move as rigid pieces: against prescribed fields, closed forms, and spread forces."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    PointForce,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    Tie,
    TotalForce,
    box_partition,
    gravity,
    solve_scene,
    solve_steps,
)
from fenics_contact._equilibrium.static_admissibility import check_held
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.results import RigidMotion
from fenics_contact.results.deformed_state import AnyState
from tests.feti.rigid_cases import FORCE, MOMENT, POINT, SCENES, SOFT, bar, numbers, shaft, solved
from tools.hard_cases.invariants import Whole

SCRIPT = Path(__file__).with_name("rigid_cases.py")
COMM = MPI.COMM_SELF


def field_of(motion: RigidMotion) -> tuple[Any, ...]:
    """The displacement of a rigid motion, as functions of the points."""

    def moved(x: np.ndarray) -> np.ndarray:
        arm = x - motion.about
        if x.shape[1] == 2:
            return motion.displacement + motion.rotation * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        return motion.displacement + np.cross(motion.rotation, arm)

    return tuple(lambda x, k=k: moved(x)[:, k] for k in range(len(motion.about)))


def prescribed(scene: Scene, state: AnyState) -> Scene:
    """The scene with the motions that were found prescribed by supports."""
    found = iter(state.rigid_motions())
    return replace(
        scene,
        supports=[
            Support(each.body, each.surface, field_of(next(found)))
            if isinstance(each, RigidSurface)
            else each
            for each in scene.supports
        ],
    )


@pytest.mark.parametrize("name", SCENES)
def test_a_rigid_surface_is_a_support_that_moves_by_itself(name: str) -> None:
    scene = SCENES[name]()
    state = solved(scene, COMM, 1e-12)
    same = solved(prescribed(scene, state), COMM, 1e-12)
    for body in scene.bodies:
        u, other = (each.gather_displacement(body) for each in (state, same))
        assert np.abs(u).max() > 1e-3
        np.testing.assert_allclose(u, other, rtol=0, atol=1e-9 * np.abs(u).max())
    parts = {
        body: box_partition(scene.bodies[body].mesh, (4, *[1] * (scene.dim - 1))) for body in scene.bodies
    }
    assert scene.plan(parts).coarse_motions == state.dual.problem.coarse.m + len(state.unheld)
    assert len(state.unheld) == (name == "bridged")  # the punch may spin
    # What the support needs beside the reaction is the load at the point.
    rigid = next(each for each in scene.supports if isinstance(each, RigidSurface))
    place = scene.supports.index(rigid)
    mine, theirs = state.reactions()[place], same.reactions(rigid.at)[place]
    load = rigid.load
    np.testing.assert_allclose(mine.force + load[: scene.dim], theirs.force, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        np.atleast_1d(mine.moment) + load[scene.dim :], np.atleast_1d(theirs.moment), rtol=0, atol=1e-6
    )
    free = np.append(mine.force, mine.moment)[rigid.free]
    np.testing.assert_allclose(free, 0.0, atol=1e-9)
    assert state.balance().imbalance < 1e-12


def test_a_motion_given_in_full_is_found_like_a_support() -> None:
    end = RigidSurface("bar", "x1", POINT, (0.01, -0.02, 0.0), (0.03, 0.0, -0.01))
    state = solved(bar([end]), COMM, parts=1)
    assert isinstance(state.system, DirectSystem)
    (motion,) = state.rigid_motions()
    np.testing.assert_allclose(motion.displacement, (0.01, -0.02, 0.0), atol=1e-14)
    np.testing.assert_allclose(motion.rotation, (0.03, 0.0, -0.01), atol=1e-14)
    same = solved(bar([Support("bar", "x1", field_of(motion))]), COMM, parts=1)
    np.testing.assert_allclose(
        state.gather_displacement("bar"), same.gather_displacement("bar"), rtol=0, atol=1e-13
    )
    moment, force = state.reactions()[1], same.reactions(POINT)[1]
    np.testing.assert_allclose(moment.moment, force.moment, atol=1e-9)
    assert moment.about == pytest.approx(POINT)


def test_a_force_at_a_point_is_that_of_a_spread_force() -> None:
    rigid, spread = (
        solved(SCENES["loaded"](), COMM),
        solved(bar([], [TotalForce("bar", "x1", FORCE, MOMENT, POINT)]), COMM),
    )
    for about in (POINT, (0.0, 0.0, 0.0)):
        mine, theirs = rigid.balance(about).loads, spread.balance(about).loads
        np.testing.assert_allclose(mine.force, theirs.force, atol=1e-12)
        np.testing.assert_allclose(mine.moment, theirs.moment, atol=1e-12)
        mine, theirs = rigid.reactions(about)[0], spread.reactions(about)[0]
        np.testing.assert_allclose(mine.moment, theirs.moment, atol=1e-9)
    # A rigid end is stiffer, but only near the end.
    assert 0.97 < rigid.energies.strain / spread.energies.strain < 1.0
    assert rigid.counts["f_products"] <= spread.counts["f_products"] + 6


def test_a_round_shaft_turns_as_the_closed_form_says() -> None:
    torque, length = 2.0, 6.0
    exact = torque * length / (1000.0 / 2.6 * np.pi / 2)  # M L / (G J)
    end = RigidSurface("shaft", "z1", (0.0, 0.0, length), moment=(0.0, 0.0, torque))
    errors = []
    for cells, order in ((2, 1), (4, 1), (2, 2)):
        body = Body(shaft(cells, order=order), SOFT)
        state = solve_scene(Scene({"shaft": body}, [Support("shaft", "z0"), end]), COMM)
        (motion,) = state.rigid_motions()
        np.testing.assert_allclose([*motion.rotation[:2], *motion.displacement], 0.0, atol=1e-5 * exact)  # type: ignore[index]
        assert state.reactions()[0].torque((0, 0, 0), (0, 0, 1)) == pytest.approx(-torque, rel=1e-9)
        errors.append(abs(motion.rotation[2] / exact - 1))  # type: ignore[index]
    assert errors[0] / errors[1] > 3.5, "of second order"
    assert errors[1] < 0.02
    assert errors[2] < 1e-3, "quadratic cells"


@pytest.mark.parametrize("dim", [2, 3])
def test_a_beam_bends_as_the_closed_form_says(dim: int) -> None:
    length, moment = 4.0, 0.7
    # Without Poisson's ratio pure bending is quadratic, and its ends are plane.
    if dim == 2:
        body = Body(quadratic(rectangle((0, 0), (length, 1), (4, 2))), PlaneStrain(1000.0, 0.0))
        turn: Any = moment
    else:
        body = Body(quadratic(block((0, 0, 0), (length, 1, 1), (4, 2, 2))), IsotropicElasticity(1000.0, 0.0))
        turn = (0.0, 0.0, moment)
    tip = (length, 0.5, 0.5)[:dim]
    end = RigidSurface("beam", "x1", tip, moment=turn)
    state = solved(Scene({"beam": body}, [Support("beam", "x0"), end]), COMM, 1e-12)
    (motion,) = state.rigid_motions()
    angle = moment * length / (1000.0 / 12)
    np.testing.assert_allclose(np.atleast_1d(motion.rotation)[-1], angle, rtol=1e-8)
    np.testing.assert_allclose(motion.displacement[1], angle * length / 2, rtol=1e-8)
    assert abs(motion.displacement[0]) < 1e-9


def test_half_of_a_symmetric_body_moves_as_the_whole() -> None:
    whole = bar([RigidSurface("bar", "x1", (4.5, 0.5, 2.0), force=(0.2, 0.0, -1.0))])
    mesh = block((0.0, 0.0, 0.0), (4.0, 0.5, 1.0), (8, 2, 3))
    fine = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (8, 4, 3))
    whole = replace(whole, bodies={"bar": Body(fine, SOFT)})
    end = RigidSurface("bar", "x1", (4.5, 0.5, 2.0), (None, 0, None), (0, None, 0), (0.1, 0.0, -0.5))
    supports = [Support("bar", "x0"), Support("bar", "y1", (None, 0.0, None)), end]
    half = Scene({"bar": Body(mesh, SOFT)}, supports)
    (first,), (second,) = (solved(scene, COMM, 1e-12).rigid_motions() for scene in (whole, half))
    np.testing.assert_allclose(first.displacement, second.displacement, rtol=0, atol=1e-9)
    np.testing.assert_allclose(first.rotation, second.rotation, rtol=0, atol=1e-9)
    assert np.abs(first.rotation).max() > 0.01
    free = replace(half, supports=[*supports[:2], replace(end, rotation=(0, None, None))])
    with pytest.raises(
        InvalidInputError, match=r"'x1' of body 'bar' meets another support at 4 nodes: prescribe the same"
    ):
        solved(free, COMM)


def test_two_rigid_surfaces_must_not_share_nodes() -> None:
    scene = bar([RigidSurface("bar", "x1", POINT), RigidSurface("bar", "z1", POINT, force=FORCE)])
    with pytest.raises(InvalidInputError, match="meets another support at 4 nodes"):
        solved(scene, COMM)


def test_friction_remembers_the_way_of_a_rigid_top() -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, SOFT)}, contacts=[floor])
    cut = {"block": box_partition(mesh, (2, 1, 1))}

    def states(steps: list[LoadStep]) -> tuple[AnyState, ...]:
        return solve_steps(ContactProblem(scene, COMM, partitions=cut, tolerance=1e-10), steps)

    path = (0.0, 0.02, -0.004, -0.02, 0.01)
    top = RigidSurface(
        "block", "z1", (0.8, 0.5, 1.0), (0.0, 0.0, None), (None, None, None), (0.0, 0.0, -20.0)
    )
    free = states([LoadStep(f"{s}", supports=[replace(top, displacement=(s, 0.0, None))]) for s in path])
    driven = states(
        [LoadStep("", supports=[Support("block", "z1", field_of(each.rigid_motions()[0]))]) for each in free]
    )
    slips = [state.contact.count(1) for state in free]
    assert len(set(slips)) > 1, "sticks and slips"
    for mine, theirs in zip(free, driven, strict=True):
        scale = np.abs(theirs.contact.force).max()
        np.testing.assert_allclose(mine.contact.force, theirs.contact.force, rtol=0, atol=1e-6 * scale)
        assert mine.contact.normal_force.sum() == pytest.approx(20.0, rel=1e-9)
        assert mine.balance().imbalance < 1e-12


def test_components_may_be_let_go_from_step_to_step() -> None:
    scene = bar([RigidSurface("bar", "x1", POINT, (0, 0, -0.1), (0, 0, 0))])
    cut = {"bar": box_partition(scene.bodies["bar"].mesh, (2, 1, 1))}
    ends = [
        RigidSurface("bar", "x1", POINT, (0, 0, -0.1), (0, 0, 0)),
        RigidSurface("bar", "x1", POINT, (0, 0, -0.1)),
        RigidSurface("bar", "x1", POINT, force=FORCE),
        RigidSurface("bar", "x1", POINT, force=(0.0, 0.0, 1.0)),
    ]
    steps = [LoadStep("", supports=[scene.supports[0], end]) for end in ends]
    found = solve_steps(ContactProblem(scene, COMM, partitions=cut, tolerance=1e-11), steps)
    for state, end in zip(found, ends, strict=True):
        (mine,), (alone,) = state.rigid_motions(), solved(bar([end]), COMM, 1e-11).rigid_motions()
        np.testing.assert_allclose(mine.displacement, alone.displacement, atol=1e-9)
        np.testing.assert_allclose(mine.rotation, alone.rotation, atol=1e-9)
    assert abs(found[1].rigid_motions()[0].rotation[1]) > 0.01  # type: ignore[index]


def test_the_bound_of_the_error_holds() -> None:
    scene = SCENES["loaded"]()
    state, exact = solved(scene, COMM, 1e-2), solved(scene, COMM, 1e-12)
    whole = Whole(scene)

    def potential(each: AnyState) -> float:
        u = each.gather_displacement("bar").ravel()
        (motion,) = each.rigid_motions()
        work = np.append(motion.displacement, motion.rotation) @ np.append(FORCE, MOMENT)
        return float(0.5 * u @ (whole.K @ u) - work)

    error = np.sqrt(2 * (potential(state) - potential(exact)))
    bound = state.estimate_errors().algebraic * state.energies.norm
    assert 1e-9 < error <= bound < 20 * error
    assert exact.energies.total_potential == pytest.approx(potential(exact), rel=1e-10)
    assert exact.energies.dual == pytest.approx(exact.energies.primal, rel=1e-9)


@pytest.mark.parametrize(("ranks", "names"), [(2, ["loaded", "pressed"]), (4, ["tied", "pressed"])])
def test_ranks_find_the_same(ranks: int, names: list[str], mpirun: Callable[..., str]) -> None:
    for name, everywhere in json.loads(mpirun(SCRIPT, ranks, *names)).items():
        here = numbers(solved(SCENES[name](), COMM))
        assert len(everywhere) == ranks
        for there in everywhere:
            assert there == everywhere[0]
            for key, values in here.items():
                size = np.abs(values).max()
                np.testing.assert_allclose(there[key], values, rtol=0, atol=1e-7 * size + 1e-12, err_msg=key)


def test_a_body_that_only_its_own_rigid_surface_holds_is_not_held() -> None:
    mesh = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (4, 2, 2))
    free = RigidSurface("bar", "x1", POINT)
    idle = solved(Scene({"bar": Body(mesh, SOFT)}, [free]), COMM)
    assert len(idle.unheld) == 6
    assert np.abs(idle.gather_displacement("bar")).max() < 1e-12
    for end, words in (
        (replace(free, force=FORCE), "body 'bar' can move away under the load"),
        (replace(free, displacement=(0, 0, 0)), "body 'bar' can move away under the load: .*rotation"),
        (replace(free, displacement=(0, 0, 0), rotation=(0, None, 0)), "rotation"),
    ):
        scene = Scene({"bar": Body(mesh, SOFT)}, [end], [gravity("bar", 1.0, (0, 0, -1.0))])
        with pytest.raises(InfeasibleError, match=words):
            solved(scene, COMM)
    # A pendulum that hangs straight down is held: by what it would turn about no load acts.
    hung = RigidSurface("bar", "x1", (7.0, 0.5, 0.5), (0, 0, 0), (0, None, None))
    state = solved(Scene({"bar": Body(mesh, SOFT)}, [hung], [gravity("bar", 1.0, (-1.0, 0, 0))]), COMM)
    assert state.reactions()[0].force[0] == pytest.approx(4.0)
    check_held(state.torn)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"at": (0.0, 0.0)},
            "RigidSurface.displacement .* must be 2 finite numbers, or None for those that are",
        ),
        ({"at": (0.0, 0.0), "displacement": None}, "RigidSurface.rotation .* must be one finite number, as"),
        ({"at": (0.0, np.nan, 0.0)}, "RigidSurface.at must be three finite coordinates"),
        (
            {"rotation": 0.1},
            "RigidSurface.rotation of surface 'x1' of body 'bar' must be 3 finite numbers, or No",
        ),
        ({"rotation": (0.0, np.inf, 0.0)}, "RigidSurface.rotation .* got .*inf"),
        ({"displacement": (0.0, 0.0)}, "RigidSurface.displacement .* must be 3 finite numbers"),
        ({"force": (None, None, 1.0)}, r"RigidSurface.force\[0\] must be a number, got None: force at"),
        (
            {"force": (0.0, 1.0, 0.0)},
            "must act on free components, got force .0.0, 1.0, 0.0. and moment None",
        ),
        ({"moment": (0.0, 0.0, 1.0)}, "must act on free components"),
        (
            {"moment": 1.0},
            "RigidSurface.moment .* must be 3 finite numbers, as its point .* has 3 coordinates, got 1.0",
        ),
        ({"displacement": "far"}, "RigidSurface.displacement must be .* got 'far'"),
    ],
)
def test_what_is_no_motion_is_refused(given: dict[str, Any], words: str) -> None:
    sound: dict[str, Any] = {"at": POINT, "displacement": (None, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0)}
    with pytest.raises(InvalidInputError, match=words):
        RigidSurface("bar", "x1", **{**sound, **given})


def test_a_point_must_lie_in_the_space_of_the_body() -> None:
    with pytest.raises(
        InvalidInputError, match=r"RigidSurface.at of surface 'x1' .* must have 3 coordinates, got"
    ):
        bar([RigidSurface("bar", "x1", (0.0, 0.0))])
    with pytest.raises(InvalidInputError, match="RigidSurface names surface 'top' of body 'bar', which has"):
        bar([RigidSurface("bar", "top", POINT)])


def test_contacts_and_ties_of_rigid_surfaces_are_refused() -> None:
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    below = RigidSurface("block", "z0", (0.5, 0.5, 0.0), (0, 0, None), (0, 0, 0), (0.0, 0.0, -1.0))
    on_floor = Scene(
        {"block": Body(mesh, SOFT)}, [below], contacts=[ContactPair(Surface("block", "z0"), floor)]
    )
    with pytest.raises(
        InvalidInputError, match="slaves must be flexible, but 9 nodes of surface 'z0' of body 'block' lie on"
    ):
        solved(on_floor, COMM, parts=1)
    upper = block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (2, 2, 2))
    below = replace(below, body="upper", at=(0.5, 0.5, 1.0))
    tie = Tie(Surface("upper", "z0"), Surface("block", "z1"))
    tied = Scene(
        {"block": Body(mesh, SOFT), "upper": Body(upper, SOFT)}, [Support("block", "z0"), below], ties=[tie]
    )
    with pytest.raises(
        InvalidInputError, match="slaves must be flexible, but 9 nodes of surface 'z0' of body 'upper' lie on"
    ):
        solved(tied, COMM, parts=1)
    held = replace(tied, supports=[*tied.supports, Support("block", "z1", (None, None, 0.0))], ties=())
    held = replace(held, contacts=[ContactPair(tie.master, tie.slave)])
    with pytest.raises(InvalidInputError, match="9 rows of contact join held slaves and free rigid masters"):
        solved(held, COMM, parts=1)
    other = replace(tied, ties=[Tie(tie.master, tie.slave)])
    (motion,) = solved(other, COMM, 1e-12, parts=1).rigid_motions()
    assert motion.displacement[2] < -5e-4
    np.testing.assert_allclose(
        solved(other, COMM, parts=1).gather_displacement("block")[mesh.points[:, 2] == 1.0],
        [motion.displacement] * 9,
        atol=1e-9,
    )


def lever(length: float, law: type[IsotropicElasticity] | type[NeoHooke]) -> Scene:
    """A block on a floor, pushed beside its middle by a rigid top that may sink and turn."""
    mesh = block((0.0, 0.0, 0.0), (2.0 * length, length, length), (4, 2, 2))
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    at = (0.8 * length, 0.5 * length, length)
    top = RigidSurface("block", "z1", at, (0.0, 0.0, None), (0.0, None, 0.0), (0.0, 0.0, -1e-3))
    return Scene({"block": Body(mesh, law(1.0 / length**2, 0.3))}, [top], contacts=[floor])


@pytest.mark.parametrize("law", [IsotropicElasticity, NeoHooke])
@pytest.mark.parametrize("length", [1e-12, 1e-9, 1.0, 1e10])
def test_a_free_turn_balances_moments_in_any_unit_of_length(length: float, law: Any) -> None:
    state = solve_scene(lever(length, law), COMM, tolerance=1e-9)
    points, force = state.scene.points[state.contact.points.slave] / length, state.contact.normal_force
    assert force.sum() == pytest.approx(1e-3, rel=1e-6)
    assert points[:, 0] @ force == pytest.approx(0.8e-3, rel=3e-4)
    assert points[:, 1] @ force == pytest.approx(0.5e-3, rel=3e-4)
    assert state.rigid_motions()[0].rotation[1] == pytest.approx(-2.75e-4, rel=2e-3)  # type: ignore[index]


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e10])
def test_turns_that_a_rigid_surface_prescribes_hold_bodies_of_any_size(length: float) -> None:
    scene = lever(length, IsotropicElasticity)
    held = replace(scene.supports[0], rotation=(0.0, 0.0, 0.0))  # type: ignore[type-var]
    state = solve_scene(replace(scene, supports=[held]), COMM, tolerance=1e-9)
    assert state.unheld == ()
    assert state.reactions()["block z1"].moment[1] == pytest.approx(0.2e-3 * length, rel=1e-5)


@pytest.mark.parametrize("length", [1e-9, 1e10])
def test_other_supports_leave_room_for_a_free_motion_in_any_unit_of_length(length: float) -> None:
    scene = lever(length, IsotropicElasticity)
    turning = replace(scene.supports[0], rotation=None)  # type: ignore[type-var]
    symmetric = Support("block", "y0", (None, 0.0, None))
    with pytest.raises(InvalidInputError, match=r"meets another support at .* prescribe the same"):
        solve_scene(replace(scene, supports=[turning, symmetric]), COMM)
    assert solve_scene(replace(scene, supports=[scene.supports[0], symmetric]), COMM).unheld == ()


def test_a_single_node_is_a_rigid_surface_without_turns() -> None:
    mesh = replace(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2)), node_sets={"tip": [0]})
    corner = RigidSurface("bar", "tip", (0.0, 0.0, 0.0), force=(0.1, 0.0, -1.0))
    hold = Support("bar", "x1")
    state = solve_scene(Scene({"bar": Body(mesh, SOFT)}, [hold, corner]), COMM, tolerance=1e-10)
    loaded = PointForce("bar", "tip", (0.1, 0.0, -1.0))
    plain = solve_scene(Scene({"bar": Body(mesh, SOFT)}, [hold], [loaded]), COMM, tolerance=1e-10)
    moved = plain.gather_displacement("bar")
    np.testing.assert_allclose(state.gather_displacement("bar"), moved, atol=1e-8 * np.abs(moved).max())
    motion = state.rigid_motions()[0]
    np.testing.assert_allclose(motion.displacement, moved[0], rtol=1e-8)
    assert not np.any(motion.rotation)
    twisted = replace(corner, moment=(0.0, 1.0, 0.0))
    with pytest.raises(InfeasibleError, match="lie on the axis of its moment: name others"):
        solve_scene(Scene({"bar": Body(mesh, SOFT)}, [hold, twisted]), COMM)
