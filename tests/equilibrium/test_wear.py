"""Wear of contact surfaces: exact balances, the limit of explicit steps, laws, ranks, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LinearClosure,
    LoadStep,
    Scene,
    Support,
    Surface,
    Tie,
    Wear,
    WearCurve,
    WearTable,
    solve_steps,
)
from fenics_contact._equilibrium.passes import Passes
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact._equilibrium.wearing import Wearing
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.feti.point_wear import PointWear
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.equilibrium.wear_cases import FLOOR, FORCE, YOUNG, fretted, punch, worn

SLID = 1.0


class Severe(WearCurve):
    """A rate with a corner."""

    def rate(self, pressure: np.ndarray) -> np.ndarray:
        return 1e-5 * (pressure + 4.0 * np.maximum(pressure - 5.0, 0.0))

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        return 1e-5 * np.where(pressure > 5.0, 5.0, 1.0)


LAWS = {
    "number": Wear(2e-5),
    "hardness": Wear(2e-2, hardness=1e3),
    "power": Wear(1e-6, exponent=1.7),
    "slow power": Wear(1e-4, exponent=0.6),
    "least pressure": Wear(3e-5, least_pressure=4.0),
    "least slip": Wear(3e-5, least_slip=0.004),
    "place": Wear(lambda x: 1e-5 * (2.0 + np.sin(x[:, 0]))),
    "table": Wear(WearTable((0.0, 10.0), (1e-5, 3e-5))),
    "curve": Wear(Severe()),
    "cycles": Wear(2e-5, cycles=50.0),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("friction", [None, 0.3])
def test_what_is_lost_is_the_law_of_pressure_and_slip(name: str, friction: float | None) -> None:
    law = LAWS[name]
    lost = 0.0
    for state in worn(*fretted(law, friction)):
        contact = state.contact
        way = np.linalg.norm(contact.slip, axis=1)
        places = state.scene.points[contact.points.slave]
        k: Any = law.coefficient
        if isinstance(k, WearCurve):
            rate = k.rate(contact.pressure)
        else:
            rate = np.maximum(contact.pressure - law.least_pressure, 0.0) ** law.exponent
            rate = rate * (k(places) if callable(k) else k)
        expected = rate / law.hardness * np.maximum(way - law.least_slip, 0.0) * law.cycles
        balance = contact.area @ contact.worn
        assert balance == pytest.approx(contact.area @ expected, rel=1e-12, abs=1e-300)
        lost += balance
        assert contact.worn_volume() == pytest.approx(lost, rel=1e-12, abs=1e-300)
        closed = contact.normal_force > 0.0
        assert np.abs(contact.gap[closed]).max() < 1e-7
    assert lost > 0.0


def test_a_punch_that_slides_loses_its_force_times_its_way_whatever_the_steps() -> None:
    """Implicit steps stay smooth beyond k Δs E* / h = 2, where explicit ones oscillate."""
    h, stiff = 8.0 / 32.0, YOUNG / (1.0 - 0.3**2)
    for factor, count in ((0.2, 8), (20.0, 8), (2000.0, 8)):
        k = factor * 2.0 * h / stiff
        states = worn(punch(Wear(k, sliding=SLID)), [LoadStep(f"{n}") for n in range(count)])
        for number, state in enumerate(states, 1):
            assert state.contact.worn_volume() == pytest.approx(number * k * FORCE * SLID, rel=1e-9)
        contact = states[-1].contact
        order = np.argsort(state.scene.points[contact.points.slave, 0])
        pressure = contact.pressure[order]
        bent = np.diff(pressure[pressure > 0.0][1:-1], 2)
        assert bent.max() < 0.01 * pressure.max(), "a zigzag is bent upwards at every second point"
    assert np.ptp(contact.pressure) < 1e-6 * FORCE / 8.0, "worn for long the pressure is even"


def explicit(k: float, count: int) -> np.ndarray:
    """Return pressures after steps whose wear is that of the pressures before."""
    lost, places = 0.0, punch(None).bodies["punch"].mesh
    nodes = np.sort(places.points[places.nodes_of("y0"), 0])
    for _ in range(count):
        given = np.array(lost * np.ones(len(nodes)))
        pair = replace(
            punch(None).contacts[0],
            gap=lambda x, w=given: x[:, 0] ** 2 / 100.0 + np.interp(x[:, 0], nodes, w),
        )
        (state,) = worn(replace(punch(None), contacts=[pair]), [LoadStep("press")], 1e-7)
        order = np.argsort(state.scene.points[state.contact.points.slave, 0])
        lost = given + k * state.contact.pressure[order]
    return np.asarray(state.contact.pressure[order])


def test_explicit_steps_oscillate_beyond_their_limit() -> None:
    h, stiff = 8.0 / 32.0, YOUNG / (1.0 - 0.3**2)
    pressures = explicit(4.0 * h / stiff, 6)
    assert np.diff(pressures, 2).max() > 0.5 * pressures.max()


def test_wear_beside_a_closure_keeps_the_closure() -> None:
    law = LinearClosure(500.0)
    state = worn(punch(Wear(2e-5, sliding=SLID), closure=law), [LoadStep("1"), LoadStep("2")])[-1]
    closed = state.contact.normal_force > 0.0
    np.testing.assert_allclose(state.contact.gap[closed], -state.contact.pressure[closed] / 500.0, atol=1e-9)
    assert state.contact.worn_volume() == pytest.approx(2 * 2e-5 * FORCE, rel=1e-9)


def test_cycles_of_a_step_are_those_of_its_wear() -> None:
    many = worn(punch(Wear(2e-5, sliding=SLID)), [LoadStep("many", cycles=30.0), LoadStep("as many")])
    once = worn(punch(Wear(6e-4, sliding=SLID)), [LoadStep("1"), LoadStep("2")])
    for one, other in zip(many, once, strict=True):
        np.testing.assert_allclose(one.contact.worn_depth, other.contact.worn_depth, atol=1e-12)


def test_states_that_wear_come_back_from_their_arrays() -> None:
    scene, steps = fretted(Wear(2e-4))
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    states = solve_steps(problem, steps)
    again = problem.restore(stored_state(states[-1]), states[-1].scene)
    np.testing.assert_allclose(again.contact.worn_depth, states[-1].contact.worn_depth, rtol=1e-12)


def test_depth_is_not_forgotten_by_steps_whose_pairs_wear_no_more() -> None:
    scene = punch(Wear(2e-4, sliding=SLID))
    (pair,) = scene.contacts
    with pytest.raises(
        InvalidInputError, match=r"a pair that has worn must keep its law, but punch y0 on rigid"
    ):
        worn(scene, [LoadStep("1"), LoadStep("2", contacts=[replace(pair, wear=None)])])
    states = worn(
        scene, [LoadStep("1"), LoadStep("2", contacts=[replace(pair, wear=Wear(1.0, sliding=0.0))])]
    )
    np.testing.assert_allclose(states[1].contact.worn_depth, states[0].contact.worn_depth, rtol=1e-12)


def test_a_scene_without_wear_has_none() -> None:
    (state,) = worn(punch(None), [LoadStep("press")])
    assert not state.contact.worn_depth.any()
    assert "wear" not in [effect.name.value for effect in state.scene.effects()]
    assert "wear" in [effect.name.value for effect in punch(Wear(1e-8)).effects()]


ON_RANKS = """
import numpy as np
from mpi4py import MPI
from fenics_contact import ContactProblem, LoadStep, Wear, solve_steps
from tests.equilibrium.wear_cases import fretted
scene, steps = fretted(Wear(lambda x: 1e-4 * (2.0 + np.sin(x[:, 0]))))
problem = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-9, partitions=scene.partition(4))
state = solve_steps(problem, steps)[-1]
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.worn_depth)
"""


def test_wear_is_the_same_on_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    np.testing.assert_allclose(two, one, atol=1e-7 * one.max())


def test_slips_that_do_not_agree_are_an_error_with_their_history() -> None:
    (state,) = worn(fretted(Wear(1e-2))[0], [LoadStep("press")])
    ways = [0.0, 1.0]

    def solve(torn: Any, last: Any, tolerance: Any) -> Any:
        ways.reverse()
        return replace(state, contact=replace(state.contact, slip=np.full_like(state.contact.slip, ways[0])))

    with pytest.raises(ConvergenceError, match=r"wear must agree with the slips, .* fewer cycles"):
        Wearing(max_passes=3).solve(Passes(solve, None), state.torn, None, 1e-8)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"coefficient": 0.0}, "Wear.coefficient must be positive and finite, got 0.0"),
        ({"coefficient": -1e-8}, "Wear.coefficient must be positive"),
        ({"coefficient": 1e-8, "hardness": 0.0}, "Wear.hardness must be positive"),
        ({"coefficient": 1e-8, "exponent": -1.0}, "Wear.exponent must be positive"),
        ({"coefficient": 1e-8, "cycles": np.inf}, "Wear.cycles must be positive and finite"),
        ({"coefficient": 1e-8, "least_pressure": -1.0}, "Wear.least_pressure must be zero or positive"),
        ({"coefficient": 1e-8, "least_slip": -1.0}, "Wear.least_slip must be zero or positive"),
        ({"coefficient": 1e-8, "sliding": -1.0}, "Wear.sliding must be zero or positive"),
        ({"coefficient": 1e-8, "share": 1.5}, "Wear.share must lie between 0 and 1, got 1.5"),
        ({"coefficient": Severe(), "exponent": 2.0}, "Wear by a curve has no exponent"),
    ],
)
def test_what_is_no_law_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        Wear(**given)


def test_tables_and_curves_that_fall_are_refused() -> None:
    class Falling(Severe):
        def rate(self, pressure: np.ndarray) -> np.ndarray:
            return np.sin(pressure) ** 2

    with pytest.raises(InvalidInputError, match=r"k\(p\) p of a WearTable must not fall"):
        WearTable((0.0, 1.0, 2.0), (1.0, 1.0, 0.1))
    with pytest.raises(InvalidInputError, match="the wear of Falling must be zero without pressure"):
        Wear(Falling())


def test_functions_that_return_no_coefficients_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="wear of punch y0 on rigid plane must be zero or positive"):
        worn(punch(Wear(lambda x: -(x[:, 0] ** 2) - 1.0, sliding=1.0)), [LoadStep("press")])


def test_surfaces_that_are_held_or_tied_do_not_wear() -> None:
    mesh, steel = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1, 1, 1)), IsotropicElasticity(2e5, 0.3)
    above = block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (1, 1, 1))
    bodies = {"a": Body(mesh, steel), "b": Body(above, steel)}
    pair = ContactPair(Surface("b", "z0"), Surface("a", "z1"), wear=Wear(1e-8))
    with pytest.raises(InvalidInputError, match="a surface that wears must be free, but 'z0' of body 'b'"):
        Scene(bodies, [Support("b", "z0")], contacts=[pair])
    with pytest.raises(InvalidInputError, match="that of b z0 on a z1, too"):
        Scene(bodies, contacts=[pair], ties=[Tie(Surface("b", "z0"), Surface("a", "z1"))])
    Scene(bodies, [Support("a", "z1")], contacts=[pair])
    with pytest.raises(InvalidInputError, match="but 'z1' of body 'a'"):
        Scene(bodies, [Support("a", "z1")], contacts=[replace(pair, wear=Wear(1e-8, share=0.5))])


def slope(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Return a central difference."""
    return (function(at + step) - function(at - step)) / (2.0 * step)


def test_derivatives_of_curves_are_those_of_their_rates() -> None:
    p = np.array([0.5, 3.0, 4.5, 7.0, 9.0])
    for law in (Wear(1.0, exponent=1.7), Wear(1.0, exponent=0.6, least_pressure=4.0), LAWS["table"]):
        np.testing.assert_allclose(slope(law.curve.rate, p), law.curve.growth(p), rtol=1e-6)
        np.testing.assert_allclose(slope(law.curve.work, p), law.curve.rate(p), rtol=1e-5, atol=1e-12)


def test_closures_that_wear_are_cut_and_scaled_with_their_points() -> None:
    (state,) = worn(punch(Wear(2e-5, sliding=SLID)), [LoadStep("press")])
    torn = state.torn
    wear = PointWear.of(state.scene, torn.points, np.zeros(torn.points.count), MPI.COMM_SELF)
    closures = wear.closures(torn, wear.distance(state.contact.slip))
    force, some = state.contact.normal_force, np.arange(5, 20)
    part = closures.part(some)
    np.testing.assert_allclose(part.closure(force[some]), closures.closure(force)[some])
    twice = closures.scaled(np.full(torn.points.count, 2.0))
    np.testing.assert_allclose(twice.closure(force / 2.0), 2.0 * closures.closure(force))
    assert FLOOR == state.scene.contacts[0].master
