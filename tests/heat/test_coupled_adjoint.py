"""Derivatives of quantities of heat and mechanics through both, against closed forms and differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.design import FrictionWork, LargestPressure, LargestStress, Movement, VolumeIntegral
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.heat import (
    Conductor,
    HeatedState,
    HeatObjective,
    HeatOfContact,
    HeatOfHeld,
    JointResistance,
    TemperatureMean,
    heat_adjoint,
    solve_heat,
    solve_heated,
)
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.objectives import AtTemperatures, NoMechanics
from fenics_contact.heat.problem import GivenContact
from fenics_contact.mesh import refined
from tests.heat.heated_bodies import (
    ALPHA,
    APART,
    CUBES,
    CURVED,
    GAP,
    LAYERS,
    RING,
    RUB,
    Scenes,
    cubes,
    ends,
    film,
    gap_that_closes,
    layers,
    rod,
    rubbed_rod,
    rubbing,
    shrink_fit,
    touching_in_part,
)
from tests.heat.manufactured import prisms

Goal = Any


def solved(scenes: Scenes, **given: Any) -> HeatedState:
    return solve_heated(*scenes, MPI.COMM_SELF, tolerance=1e-12, settled=1e-12, **given)


def values_of(goals: Sequence[Goal], state: HeatedState) -> np.ndarray:
    """Return quantities of a state as they are defined, without what adjoints make of it."""
    heat, forms = state.heat, ShapeForms.at_rest(state.mechanics.torn)
    at = AtTemperatures.of(heat.scene, heat.torn.decomposition, heat.values, Given(state))
    return np.array(
        [
            goal.value(at) if isinstance(goal, HeatObjective) else goal.value(state.mechanics, forms)
            for goal in goals
        ]
    )


class Given(NoMechanics):
    """Pressures and gaps of a state."""

    def __init__(self, state: HeatedState) -> None:
        self._state = state

    def given(self, joints: Joints) -> GivenContact:
        return self._state.interaction.given(self._state.mechanics)


def check(
    make: Callable[[np.ndarray], Scenes],
    start: np.ndarray,
    goals: Sequence[Goal],
    only: Sequence[int] = range(5),
    step: float = 3e-4,
    **given: Any,
) -> None:
    """Compare derivatives by some of the variables with central differences of new solutions."""
    chosen = list(only)

    def scenes(some: np.ndarray) -> Scenes:
        p = start.copy()
        p[chosen] = some
        return make(p)

    at, state = start[chosen], solved(make(start), **given)
    assert state.passes > 1
    differences = np.empty((len(goals), len(at)))
    for number, way in enumerate(np.diag(step * at)):
        ahead, behind = (values_of(goals, solved(scenes(at + end), **given)) for end in (way, -way))
        differences[:, number] = (ahead - behind) / (2.0 * step * at[number])
    for goal, wanted, value in zip(goals, differences * at, values_of(goals, state), strict=True):
        found = heat_adjoint(state, goal)
        assert found.value == pytest.approx(value, rel=1e-9)
        changes = found.gradient(scenes, at) * at
        size = np.abs(changes).max()
        assert size > 1e-3 * abs(found.value)
        assert changes == pytest.approx(wanted, rel=1e-6, abs=1e-7 * size), f"{goal}"


JOINT = [TemperatureMean("lower"), HeatOfContact(0), JointResistance(0), LargestPressure(0)]


def test_friction_heat_presses_as_its_closed_form_says():
    # p = E δ / (1 − v / v_c) with v_c = 2 k / (E α μ) = 8, and T = μ v p / k at the end.
    at = np.array([6.0, 1.0])

    def scenes(p: np.ndarray) -> Scenes:
        scene, heat = rubbed_rod(p[0])
        return scene, replace(heat, bodies={"rod": replace(heat.bodies["rod"], material=Conductor(p[1]))})

    state, growth = solved(scenes(at)), 1.0 / (1.0 - 6.0 / 8.0)
    found = heat_adjoint(state, LargestPressure(0))
    assert found.value == pytest.approx(2.0 * growth, rel=1e-6)
    # v_c is proportional to k.
    by_speed = 2.0 / 8.0 * growth**2
    assert found.gradient(scenes, at) == pytest.approx([by_speed, -6.0 * by_speed], rel=1e-6)
    warm = heat_adjoint(state, TemperatureMean("rod", "x1"))
    assert warm.value == pytest.approx(0.25 * 6.0 * 2.0 * growth, rel=1e-6)
    by_speed = 0.25 * 2.0 * growth**2
    assert warm.gradient(scenes, at)[0] == pytest.approx(by_speed, rel=1e-6)
    assert warm.weak.count == 0


@pytest.mark.parametrize("rough", [pytest.param(1.0, marks=pytest.mark.claim), 30.0])
def test_a_rod_that_cools_where_it_touches_changes_as_its_closed_form_does(rough: float):
    at = np.array([100.0, 0.04])

    def end(hot: float, clearance: float) -> float:
        return ends(rough, 0.01, hot, 0.0, clearance)[0]

    def scenes(p: np.ndarray) -> Scenes:
        return rod(film(rough, 0.01), p[0], 0.0, p[1])

    found = heat_adjoint(solved(scenes(at)), TemperatureMean("rod", "x1"))
    assert found.iterations < 8
    by_hot = (end(100.0 + 1e-3, 0.04) - end(100.0 - 1e-3, 0.04)) / 2e-3
    by_clearance = (end(100.0, 0.04 + 1e-6) - end(100.0, 0.04 - 1e-6)) / 2e-6
    assert found.gradient(scenes, at) == pytest.approx([by_hot, by_clearance], rel=1e-6)


def test_a_rod_that_only_just_touches_has_the_derivatives_of_one_side():
    end = 100.0 / (1.0 + 1e-3 / 0.01)  # without a gap, and without a pressure
    at = np.array([100.0, ALPHA * 0.5 * (100.0 + end)])

    def scenes(p: np.ndarray) -> Scenes:
        return rod(film(1.0, 0.01), p[0], 0.0, p[1])

    def one_sided(step: np.ndarray) -> float:
        values = [ends(1.0, 0.01, hot, 0.0, gap)[0] for hot, gap in (at + k * step for k in range(3))]
        return float((-3.0 * values[0] + 4.0 * values[1] - values[2]) / (2.0 * step.sum()))

    state = solve_heated(*scenes(at), MPI.COMM_SELF, tolerance=1e-12, settled=1e-10)
    contact = state.mechanics.contact
    assert np.abs(contact.gap).max() < 1e-9
    assert contact.normal_force.max() < 1e-6
    opening, closing = (
        [one_sided(np.array([-1e-3 * way, 0.0])), one_sided(np.array([0.0, 1e-6 * way]))] for way in (1, -1)
    )
    assert np.abs(np.array(closing) / opening - 1.0).min() > 1.0
    # Steps are longer than the way to the other side.
    found = heat_adjoint(state, TemperatureMean("rod", "x1"))
    closed = contact.normal_force.any() and not found.weak.contacts
    assert found.gradient(scenes, at) == pytest.approx(closing if closed else opening, rel=1e-5)


@pytest.mark.claim
def test_derivatives_of_a_gap_that_closes_by_all_variables():
    more = HeatOfHeld("upper", "y1"), Movement("lower", "y1", (0.0, 1.0)), LargestStress("lower")
    check(gap_that_closes, GAP, [*JOINT, *more])


@pytest.mark.slow
@pytest.mark.parametrize("other_way", [False, True])
def test_derivatives_of_surfaces_that_touch_in_part(other_way: bool):
    check(lambda p: touching_in_part(p, other_way=other_way), CURVED, JOINT)


@pytest.mark.slow
def test_derivatives_by_gaps_that_displacements_leave():
    goals = [TemperatureMean("lower"), HeatOfContact(0), Movement("lower", "y1", (0.0, 1.0))]
    check(lambda p: touching_in_part(p, apart=True), APART, goals)


@pytest.mark.claim
@pytest.mark.parametrize("clearance", [0.08, 0.03])
def test_derivatives_of_one_body_that_a_pair_does_not_stop(clearance: float):
    # It was solved directly; with the smaller clearance it overlaps the wall, where gaps count as none.
    def make(p: np.ndarray) -> Scenes:
        scene, heat = rod(film(1.0, 0.01), p[0], 0.0, p[1])
        return replace(scene, contacts=[]), heat

    goals = [TemperatureMean("rod", "x1"), Movement("rod", "x1", (1.0, 0.0))]
    check(make, np.array([80.0, clearance]), goals, [0, 1], step=1e-4)
    gap = solved(make(np.array([80.0, clearance]))).adjoining()[1].gives.gap
    assert np.all(gap < 0.0) == (clearance < 0.05)


@pytest.mark.claim
def test_derivatives_of_a_shrink_fit_that_heats():
    goals = [TemperatureMean("shaft"), HeatOfContact(0), JointResistance(0), LargestPressure(0)]
    check(shrink_fit, RING, goals, step=5e-4)


@pytest.mark.claim
@pytest.mark.parametrize("falling", [False, True])
def test_derivatives_where_sliding_heats(falling: bool):
    check(lambda p: rubbing(p, falling=falling), RUB, [*JOINT, HeatOfHeld("upper", "y1"), FrictionWork(0)])


@pytest.mark.slow
@pytest.mark.parametrize("how", ["node", "mortar"])
def test_derivatives_where_the_work_of_friction_heats(how: str):
    check(lambda p: rubbing(p, speed=0.0, how=how), RUB, JOINT, duration=0.05)


@pytest.mark.slow
def test_derivatives_where_only_some_points_slip():
    partly = np.array([*RUB[:2], 0.01 * RUB[2], *RUB[3:]])
    check(lambda p: rubbing(p, speed=0.0), partly, [*JOINT, FrictionWork(0)], duration=1e-3)


@pytest.mark.slow
def test_derivatives_by_thickness_and_shape_of_tied_bodies():
    check(layers, LAYERS, [TemperatureMean("layer"), JointResistance(0), LargestPressure(0)])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["prisms", "hanging"])
def test_derivatives_of_cells_whose_nodes_follow_others(kind: str):
    whole = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))
    lower = prisms(2) if kind == "prisms" else refined(whole, np.array([7])).mesh
    assert bool(lower.hanging) == (kind == "hanging")
    check(lambda p: cubes(p, lower), CUBES, [JointResistance(0), LargestPressure(0)])


@pytest.mark.claim
def test_derivatives_in_space():
    check(lambda p: rubbing(p, dim=3, falling=True), RUB, JOINT)


RANKS = """
from fenics_contact.design import LargestPressure
from fenics_contact.heat import JointResistance, TemperatureMean, heat_adjoint, solve_heated
from fenics_contact.mesh import bisection_partition
from mpi4py import MPI
from tests.heat.heated_bodies import *
cases = (gap_that_closes, GAP, LargestPressure(0)), (rubbing, RUB, JointResistance(0))
apart = lambda p: touching_in_part(p, apart=True)
for make, start, goal in (*cases, (apart, APART, TemperatureMean("lower"))):
    scene, heat = make(start)
    cut = {name: bisection_partition(body.mesh, 2) for name, body in scene.bodies.items()}
    given = dict(partitions=cut, tolerance=1e-12, settled=1e-12)
    state = solve_heated(scene, heat, MPI.COMM_WORLD, **given)
    found = heat_adjoint(state, goal)
    gradient = found.gradient(make, start)
    if MPI.COMM_WORLD.rank == 0:
        print(found.value, *gradient)
"""


@pytest.mark.slow
def test_derivatives_through_both_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(RANKS, n).split(), dtype=float) for n in (1, 2))
    assert len(one) == 18
    np.testing.assert_allclose(two, one, rtol=1e-7, atol=1e-12)


def test_states_and_quantities_without_an_adjoint_are_refused():
    scene, heat = rod(film(1.0, 0.01), 100.0, 0.0, 0.04)
    alone = solve_heat(heat, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=r"LargestPressure is a quantity of mechanics, .* has none"):
        heat_adjoint(alone, LargestPressure(0))
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    along = VolumeIntegral("stress along it", lambda u, x, stress: stress[0, 0], "rod")
    with pytest.raises(InvalidInputError, match=r"got VolumeIntegral, which temperatures change, too"):
        heat_adjoint(state, along)
    with pytest.raises(InvalidInputError, match=r"needs the pressures and gaps of its scene.*HeatedState"):
        heat_adjoint(state.heat, TemperatureMean("rod"))
    stores = replace(heat.bodies["rod"], material=Conductor(1.0, 1.0))
    later = replace(heat, bodies={"rod": stores})
    before = solve_heated(scene, later, MPI.COMM_SELF)
    moving = solve_heated(scene, later, MPI.COMM_SELF, before=before, duration=1.0)
    with pytest.raises(InvalidInputError, match=r"needs a steady state, got one that stores heat"):
        heat_adjoint(moving, TemperatureMean("rod"))
    found, mesh = heat_adjoint(state, TemperatureMean("rod")), scene.bodies["rod"].mesh
    longer = replace(scene.bodies["rod"], mesh=mesh.moved(1.1 * mesh.points))
    with pytest.raises(InvalidInputError, match="need the same mesh of body 'rod'"):
        found.gradient(lambda p: (replace(scene, bodies={"rod": longer}), heat), np.array([1.0]))
