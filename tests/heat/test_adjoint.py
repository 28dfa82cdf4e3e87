"""Derivatives of temperatures, heat and resistances by the adjoint, against differences of solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError
from fenics_contact.heat import (
    GapRadiation,
    HeatObjective,
    HeatOfContact,
    HeatOfHeld,
    HeatProblem,
    HeatScene,
    HeatSource,
    HeatState,
    JointResistance,
    PressureConductance,
    TemperatureMean,
    heat_adjoint,
    solve_heat,
)
from fenics_contact.heat.objectives import AtTemperatures
from fenics_contact.heat.problem import GivenContact
from tests.heat.joined_bodies import NAMES, START, scene


def objectives(dim: int, joint: str) -> list[HeatObjective]:
    up = "yz"[dim - 2]
    found: list[HeatObjective] = [TemperatureMean("upper"), TemperatureMean("upper", f"{up}1", 8.0, 100.0)]
    if joint != "obstacle":
        found.append(HeatOfHeld("lower", f"{up}0"))
    if joint != "tie":
        found += [HeatOfContact(0), JointResistance(0)]
    return found


def value_of(objective: HeatObjective, state: HeatState) -> float:
    return objective.value(AtTemperatures.of(state.scene, state.torn.decomposition, state.values))


def check(make: Callable[[np.ndarray], HeatScene], wanted: list[HeatObjective], only: list[int]) -> None:
    state = solve_heat(make(START), MPI.COMM_SELF)
    ahead, behind = {}, {}
    for number in only:
        change = np.zeros(len(START))
        change[number] = 1e-4 * START[number]
        ahead[number], behind[number] = (solve_heat(make(START + s * change), MPI.COMM_SELF) for s in (1, -1))
    for objective in wanted:
        found = heat_adjoint(state, objective)
        gradient = found.gradient(make, START)
        assert found.iterations == 1 or not state.scene.is_linear
        size = np.abs(gradient * START).max()
        assert size > 1e-3 * abs(found.value)
        for number in only:
            values = [value_of(objective, each[number]) for each in (ahead, behind)]
            difference = (values[0] - values[1]) / (2e-4 * START[number])
            assert gradient[number] == pytest.approx(difference, rel=1e-6, abs=1e-7 * size / START[number]), (
                f"{objective} by {NAMES[number]}"
            )


ALL = list(range(len(START)))


@pytest.mark.claim
def test_derivatives_are_those_of_differences_with_laws_by_temperature() -> None:
    check(lambda p: scene(p, laws=True), objectives(2, "film")[1:4:2], [0, 3, 4, 5])


@pytest.mark.claim
@pytest.mark.parametrize(
    "joint", ["tie", *(pytest.param(joint, marks=pytest.mark.slow) for joint in ("film", "node", "obstacle"))]
)
def test_derivatives_through_each_joint(joint: str) -> None:
    only = ALL if joint != "node" else [0, 3, 5]
    check(lambda p: scene(p, joint=joint), objectives(2, joint)[-2:], only)


@pytest.mark.slow
@pytest.mark.parametrize("laws", [False, True])
@pytest.mark.parametrize(
    ("dim", "kind", "joint", "revolved"),
    [
        (3, "quadratic", "film", False),
        (3, "hanging", "tie", False),
        (2, "hanging", "film", False),
        (2, "quadratic", "film", True),
        (3, "hanging", "film", False),
    ],
)
def test_derivatives_in_space_around_axes_and_with_hanging_nodes(
    dim: int, kind: str, joint: str, revolved: bool, laws: bool
) -> None:
    def make(p: np.ndarray) -> HeatScene:
        return scene(p, dim, kind, joint, laws=laws, revolved=revolved)

    assert bool(make(START).bodies["lower"].mesh.hanging) == (kind == "hanging")
    check(make, objectives(dim, joint)[:4], [0, 3, 4, 5])


def test_values_of_objectives_are_those_of_the_state() -> None:
    state = solve_heat(scene(START), MPI.COMM_SELF)
    joint = state.contacts[0]
    assert heat_adjoint(state, HeatOfContact(0)).value == pytest.approx(joint.total, rel=1e-9)
    area = joint.heat / joint.flux
    jump = area @ (joint.slave - joint.master) / area.sum()
    assert heat_adjoint(state, JointResistance(0)).value == pytest.approx(jump / joint.total, rel=1e-9)
    held = heat_adjoint(state, HeatOfHeld("lower", "y0")).value
    assert held == pytest.approx(state.balance.by_part["HeldTemperature lower y0"], rel=1e-9)
    nodes = np.unique(state.scene.bodies["upper"].mesh.surfaces["y1"])
    hottest = state.temperature["upper"][nodes].max()
    near = value_of(TemperatureMean("upper", "y1", exponent=200.0), state)
    assert hottest * 0.98 < near <= hottest


def test_the_adjoint_of_a_mean_is_the_green_function_of_its_weights() -> None:
    # By heat at nodes nothing but the source changes: dJ/dq = w, here that of one unit over the upper body.
    state = solve_heat(scene(START), MPI.COMM_SELF)
    found = heat_adjoint(state, TemperatureMean("upper"))
    by_source = found.gradient(
        lambda p: replace(state.scene, loads=[*state.scene.loads, HeatSource("lower", p[0])]), [0.0], step=1.0
    )
    more = replace(state.scene, loads=[*state.scene.loads, HeatSource("lower", 1.0)])
    change = value_of(TemperatureMean("upper"), solve_heat(more, MPI.COMM_SELF)) - found.value
    assert by_source[0] == pytest.approx(change, rel=1e-8)


RANKS = """
import numpy as np
from fenics_contact.heat import HeatOfHeld, heat_adjoint, solve_heat
from fenics_contact.mesh import bisection_partition
from mpi4py import MPI
from tests.heat.joined_bodies import START, scene
given = scene(START, laws=True)
cut = {name: bisection_partition(body.mesh, 2) for name, body in given.bodies.items()}
state = solve_heat(given, MPI.COMM_WORLD, partitions=cut)
found = heat_adjoint(state, HeatOfHeld("lower", "y0"))
gradient = found.gradient(lambda p: scene(p, laws=True), START)
through = state.heat_through("lower", "y0")
if MPI.COMM_WORLD.rank == 0:
    print(through, found.value, *gradient)
"""


@pytest.mark.slow
def test_derivatives_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(RANKS, n).split(), dtype=float) for n in (1, 2))
    assert np.abs(one).min() > 0.0
    np.testing.assert_allclose(two, one, rtol=1e-6)


def test_states_that_mechanics_closed_have_no_adjoint_of_the_scene_alone() -> None:
    given = scene(START, laws=True)
    law = replace(given.contacts[0], conductance=GapRadiation(0.8, 0.7))
    problem = HeatProblem(replace(given, contacts=[law]), MPI.COMM_SELF)
    count = len(solve_heat(given, MPI.COMM_SELF).contacts[0].nodes)
    closed = GivenContact(np.ones(count), np.zeros(count), np.zeros(count))
    pressed = replace(given, contacts=[replace(law, conductance=PressureConductance(1.0, 1.0))])
    state = problem.solve(pressed, given=closed)
    with pytest.raises(InvalidInputError, match=r"needs the pressures and gaps of its scene.*HeatedState"):
        heat_adjoint(state, TemperatureMean("upper"))
