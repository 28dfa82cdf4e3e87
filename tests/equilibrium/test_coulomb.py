"""Coulomb friction: every sentence of the law, read off displacements, geometry and forces."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Coulomb, FixedPoint, Scene, Status, Support, Traction, Tresca, solve_scene
from fenics_contact.gallery import block
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.checks import assert_solved, balance, body_displacements, friction_law
from tests.equilibrium.conic_reference import ConicReference
from tests.scenes import (
    SOFT,
    block_on_plane,
    cornered_block,
    crowned,
    guided,
    partitions,
    pressed_block,
    stack,
    two_blocks,
    with_friction,
)

TOLERANCE = 1e-8
SOLVERS: dict[str, DualSolver] = {
    "face Newton": FaceNewton(tolerance=TOLERANCE),
    "fixed point": FixedPoint(Smalse(tolerance=TOLERANCE)),
}
SCENES = {
    "block on plane": lambda: block_on_plane(Coulomb(0.6)),
    "block on plane, tetrahedra": lambda: block_on_plane(Coulomb(0.6), "tetrahedron"),
    "two blocks": lambda: two_blocks(Coulomb(0.38)),
    "two blocks, tetrahedra": lambda: two_blocks(Coulomb(0.38), "tetrahedron"),
    "pressed block": lambda: pressed_block(Coulomb(0.5)),
    "both laws": lambda: stack(Coulomb(0.38), Tresca(1.0)),
}
#: Scenes with more contact and support forces at a node than it has displacements: forces are not unique.
REDUNDANT = {
    "guided block": lambda: guided(block_on_plane(Coulomb(0.6)), "block"),
    "cornered block": lambda: cornered_block(Coulomb(0.3)),
}
FLOATING = {"block on plane": "block", "two blocks": "upper", "both laws": "upper"}


@cache
def scene(name: str) -> Scene:
    return (SCENES | REDUNDANT)[name]()


@cache
def solved(name: str, solver: str = "face Newton") -> tuple[AnyState, ConicReference]:
    return solve(scene(name), SOLVERS[solver]), ConicReference(scene(name))


def solve(scene: Scene, solver: DualSolver | None = None) -> AnyState:
    return solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver or SOLVERS["face Newton"]
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", SCENES)
def test_the_whole_law_holds_with_points_that_stick_slip_and_lift_off(name: str, solver: str) -> None:
    state, reference = solved(name, solver)
    assert_solved(state, TOLERANCE)
    assert all(state.contact.count(status) > 0 for status in Status)
    broken = {sentence: value for sentence, value in friction_law(state, reference).items() if value > 1e-6}
    assert broken == {}


@pytest.mark.parametrize("name", REDUNDANT)
def test_the_whole_law_holds_where_forces_are_not_unique(name: str) -> None:
    test_the_whole_law_holds_with_points_that_stick_slip_and_lift_off(name, "face Newton")


def test_half_a_symmetric_scene_has_half_the_energy_and_half_the_forces() -> None:
    def pushed(width: float, layers: int) -> Scene:
        mesh = crowned(block((0.0, 0.0, 0.0), (2.0, width, 1.0), (6, layers, 3)), 0.02)
        load = Traction("block", "z1", (1.0, 0.0, -2.0))
        return replace(block_on_plane(Coulomb(0.6)), bodies={"block": Body(mesh, SOFT)}, loads=[load])

    whole = solve(pushed(2.0, 6))
    cut = pushed(1.0, 3)
    half = solve(replace(cut, supports=[Support("block", "y1", (None, 0.0, None))]))
    assert all(half.contact.count(status) > 0 for status in Status)
    assert 2 * half.energies.total_potential == pytest.approx(whole.energies.total_potential, rel=1e-7)
    # Along y the support carries what the other half would.
    force, expected = half.contact.force.sum(axis=0), whole.contact.force.sum(axis=0)
    assert 2 * force[[0, 2]] == pytest.approx(expected[[0, 2]], rel=1e-7)


def test_a_body_that_starts_above_its_floor_comes_down_on_it() -> None:
    low, _ = solved("block on plane")
    points = low.scene.bodies["block"].mesh.points + np.array([0.0, 0.0, 0.5])
    high = solve(low.scene.moved({"block": points}))
    assert high.contact.points.gap.min() == pytest.approx(0.5)
    assert high.contact.gap.min() > -1e-7
    size = np.abs(low.contact.force).max()
    assert np.abs(high.contact.force - low.contact.force).max() < 1e-6 * size
    fall = high.gather_displacement("block") - low.gather_displacement("block")
    assert fall == pytest.approx(np.broadcast_to([0.0, 0.0, -0.5], fall.shape), abs=1e-6)


@pytest.mark.parametrize("name", ["block on plane", "two blocks, tetrahedra"])
def test_the_check_of_the_law_notices_a_wrong_answer(name: str) -> None:
    state, reference = solved(name)
    turned = replace(state, contact=replace(state.contact, friction_force=-state.contact.friction_force))
    assert friction_law(turned, reference)["slip not opposed"] > 1e-2
    slippery = replace(reference.rows, coefficient=0.9 * reference.rows.coefficient)
    reference = ConicReference(state.scene)
    reference.__dict__["rows"] = slippery
    assert friction_law(state, reference)["friction beyond its bound"] > 1e-2


@pytest.mark.parametrize("name", FLOATING)
def test_contact_forces_balance_the_load(name: str) -> None:
    state, reference = solved(name)
    force, moment = balance(state, reference, FLOATING[name])
    assert np.abs(force).max() < 1e-6
    assert np.abs(moment).max() < 1e-6
    body = FLOATING[name]
    start = reference.offset[body]
    load = reference.f.reshape(-1, 3)[start : start + state.scene.bodies[body].mesh.n_nodes].sum(axis=0)
    pair = state.contact.on_pair(0)
    assert abs(load[2]) > 1.0
    assert np.abs(load[0]) > 0.5
    assert state.contact.force[pair].sum(axis=0) == pytest.approx(-load, abs=1e-6 * np.abs(load).max())


@pytest.mark.parametrize("name", SCENES)
def test_contact_forces_are_what_the_bodies_need_to_stay_at_rest(name: str) -> None:
    state, reference = solved(name)
    reaction = reference.reaction(body_displacements(state))
    rows = reference.rows
    outside = np.isnan(reference.prescribed).reshape(-1, 3).all(axis=1)
    force = state.contact.force
    normal = np.einsum("nd,nd->n", force, rows.normal)
    expected = (rows.T.T @ force.ravel() - rows.N.T @ normal).reshape(-1, 3)
    size = np.abs(expected).max()
    assert size > 0.01
    assert np.abs(reaction - expected)[outside].max() < 1e-6 * size


@pytest.mark.parametrize("name", SCENES)
def test_the_answer_solves_the_tresca_problem_with_its_own_slip_bound(name: str) -> None:
    state, reference = solved(name)
    bound = reference.rows.bound + reference.rows.coefficient * np.maximum(state.contact.normal_force, 0.0)
    assert state.contact.slip_bound == pytest.approx(bound, abs=1e-9 * bound.max())
    expected = reference.solve(bound)
    size = np.abs(expected.contact_force).max()
    assert np.abs(state.contact.force - expected.contact_force).max() < 1e-6 * size
    assert state.energies.primal == pytest.approx(expected.primal, rel=1e-6)
    assert state.energies.dual == pytest.approx(expected.dual, rel=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_one_loop_and_two_loops_agree(name: str) -> None:
    one, two = solved(name)[0], solved(name, "fixed point")[0]
    assert one.solution.history[-1].method != two.solution.history[-1].method
    size = np.abs(one.contact.force).max()
    assert np.abs(one.contact.force - two.contact.force).max() < 1e-6 * size
    assert one.energies.total_potential == pytest.approx(two.energies.total_potential, rel=1e-8)
    assert np.array_equal(one.contact.status, two.contact.status)


def test_less_friction_makes_more_points_slip() -> None:
    states = [solve(with_friction(scene("two blocks"), Coulomb(mu_f))) for mu_f in (0.33, 0.5, 0.8)]
    slipping = [state.contact.count(Status.SLIP) for state in states]
    assert slipping[0] > slipping[1] > slipping[2]
    potentials = [state.energies.total_potential for state in states]
    assert abs(potentials[0] - potentials[1]) > 1e-3 * abs(potentials[0])


def test_a_friction_coefficient_of_zero_is_frictionless_contact() -> None:
    plain = guided(two_blocks(None), "upper")
    without, zero = solve(plain), solve(with_friction(plain, Coulomb(0.0)))
    assert zero.counts["tangential_multipliers"] == without.counts["tangential_multipliers"] == 0
    assert without.contact.count(Status.OPEN) > 0
    assert zero.contact.force == pytest.approx(without.contact.force, abs=1e-12)
    almost = solve(with_friction(plain, Coulomb(1e-9)))
    assert almost.counts["tangential_multipliers"] > 0
    size = np.abs(without.contact.force).max()
    assert np.abs(almost.contact.force - without.contact.force).max() < 1e-6 * size


def test_each_pair_follows_its_own_law() -> None:
    state, _ = solved("both laws")
    upper, lower = state.contact.on_pair(0), state.contact.on_pair(1)
    contact = state.contact
    assert contact.slip_bound[upper] == pytest.approx(0.38 * contact.normal_force[upper])
    assert contact.slip_bound[lower] == pytest.approx(1.0 * contact.points.area[lower])
    for pair in (upper, lower):
        assert np.count_nonzero(contact.status[pair] == Status.SLIP) > 0
        assert np.count_nonzero(contact.status[pair] == Status.STICK) > 0
