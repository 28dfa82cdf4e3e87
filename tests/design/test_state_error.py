"""States as accurate as an optimiser needs: errors of values, and fewer products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    Tresca,
)
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import AdaptiveTolerance, DesignPoint, Result, TotalPotential, WeakChoice
from fenics_contact.design.adjoint import linearise_face
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from tests.design.blocks import RUBBER, block_on_block, block_on_floor, designs_of
from tests.design.objectives import objectives
from tests.design.pressed import DESIGN, SWITCHES
from tests.design.quotients import Remembering
from tests.design.resumed_cases import BOUND, minimised, posed
from tests.scenes import FLOOR, Friction, crowned, partitions

LOOSE, EXACT = (1e-2, 1e-3, 1e-4), 1e-11
SEEDS = range(2)
JUDGES = tuple(objectives("block"))


def dragged(friction: Friction, way: float) -> Scene:
    """A block whose top is turned while it is dragged: every point slips in a direction of its own."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (7, 3, 3)), 0.03)
    top = Support("block", "z1", (way, lambda x: 0.3 * way * (x[:, 0] - 1.0), -0.03))
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene({"block": Body(mesh, RUBBER)}, [top], contacts=[pair])


@dataclass(frozen=True)
class Case:
    """A scene, and how its loose states are found; exact ones are found by faces."""

    build: Callable[[], Scene]
    body: str = "block"
    solver: DualSolver = field(default_factory=FaceNewton)


CASES = {
    "dragged a little": Case(lambda: dragged(Coulomb(0.3), 0.01)),
    "dragged far": Case(lambda: dragged(Coulomb(0.3), 0.2)),
    "dragged far, Tresca": Case(lambda: dragged(Tresca(0.6), 0.2)),
    "floor": Case(lambda: block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))),
    "blocks": Case(lambda: block_on_block(Coulomb(0.38), load=(0.6, 0.12, -2.0)), "upper"),
    # Its states are out of balance, too.
    "floor, SMALSE": Case(lambda: block_on_floor(Tresca(0.6), load=(0.35, 0.1, -2.0)), solver=Smalse()),
}


@cache
def problem(name: str, tolerance: float) -> Remembering:
    case = CASES[name]
    scene = case.build()
    solver = FaceNewton() if tolerance == EXACT else case.solver
    contact = ContactProblem(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver, tolerance=tolerance
    )
    return Remembering(contact, designs_of(scene), TotalPotential())


def point(name: str, judge: str, seed: int, tolerance: float) -> DesignPoint:
    here, rng = problem(name, tolerance), np.random.default_rng(seed)
    judges = objectives(CASES[name].body)
    return here.evaluate_by(judges[judge], 0.003 * rng.standard_normal(here.size))


@dataclass(frozen=True)
class Miss:
    """What the value of a loose state misses, before and after its correction, and what was claimed."""

    before: float
    after: float
    claimed: float

    @property
    def left(self) -> float:
        return abs(self.after / self.before)


@cache
def misses(name: str) -> list[Miss]:
    """All that is not rounding; forces that friction bounds alone may be exact at once."""
    found = []
    for judge in JUDGES:
        for seed in SEEDS:
            exact = point(name, judge, seed, EXACT).value
            for tolerance in LOOSE:
                loose = point(name, judge, seed, tolerance)
                before = exact - loose.value
                if abs(before) > 1e-11 * abs(exact):
                    found.append(Miss(before, before - loose.correction, loose.error))
    assert len(found) > 20
    return found


@pytest.mark.parametrize("name", CASES)
def test_many_points_slip_and_turn(name: str) -> None:
    state = point(name, "energy", 0, EXACT).state
    assert state.contact.count(Status.SLIP) > 3
    face = linearise_face(state, problem(name, EXACT).choice).face
    assert face.overshoot[face.slip].max() > 2.0


@pytest.mark.parametrize("name", CASES)
def test_what_remains_after_the_correction_is_of_second_order(name: str) -> None:
    left = np.array([miss.left for miss in misses(name)])
    assert np.median(left) < 0.005
    assert np.mean(left > 0.1) < 0.2
    # An error may vanish by chance, the claimed one does not.
    assert max(abs(miss.after / miss.claimed) for miss in misses(name)) < 0.5


@pytest.mark.parametrize("name", CASES)
def test_the_claimed_error_holds_after_the_correction(name: str) -> None:
    assert all(abs(miss.after) < miss.claimed for miss in misses(name))
    # It is an estimate of what is there, too.
    assert np.median([miss.claimed / abs(miss.before) for miss in misses(name)]) < 10.0


# What a loosely solved state does to value and subgradient, and an optimiser that asks for what it needs.
INEXACT_STATES_LOOSE = (1e-2, 1e-3, 1e-4)
INEXACT_STATES_SEEDS = range(3)
INEXACT_STATES_EXACT, STOPPING = 1e-11, 1e-4


class Found(NamedTuple):
    """What is known of a design, without its state."""

    value: float
    correction: float
    error: float
    gradient: np.ndarray


@cache
def inexact_point(judge: str, seed: int, tolerance: float) -> Found:
    """A random design of the block, solved from nothing."""
    problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(tolerance, tolerance))
    problem.objective = objectives("block")[judge]
    point = problem.evaluate(0.01 * np.random.default_rng(seed).standard_normal(problem.size))
    return Found(point.value, point.correction, point.error, point.gradient)


def missing(judge: str, seed: int, tolerance: float) -> tuple[float, float]:
    """What the value of a loose state misses, before and after its correction."""
    found, exact = inexact_point(judge, seed, tolerance), inexact_point(judge, seed, INEXACT_STATES_EXACT)
    return exact.value - (found.value - found.correction), exact.value - found.value


@pytest.mark.parametrize("tolerance", INEXACT_STATES_LOOSE)
@pytest.mark.parametrize("judge", JUDGES)
def test_the_error_of_the_value_is_known_from_the_adjoint(judge: str, tolerance: float) -> None:
    for seed in INEXACT_STATES_SEEDS:
        plain, corrected = missing(judge, seed, tolerance)
        found = inexact_point(judge, seed, tolerance)
        assert abs(plain) > 1e-10 * abs(found.value), "the state was accurate: nothing was tested"
        assert abs(corrected) < found.error
        assert found.error < 100 * tolerance * abs(found.value)


def test_the_correction_takes_most_of_the_error_away() -> None:
    pairs = np.array(
        [
            missing(judge, seed, t)
            for judge in JUDGES
            for seed in INEXACT_STATES_SEEDS
            for t in INEXACT_STATES_LOOSE
        ]
    )
    left = np.abs(pairs[:, 1] / pairs[:, 0])
    assert np.median(left) < 0.01
    # Where shares of both signs cancel, an error may be small before it is corrected.
    assert np.mean(left > 1.0) < 0.1


@pytest.mark.parametrize("judge", JUDGES)
def test_the_subgradient_is_about_as_accurate_as_the_state(judge: str) -> None:
    for tolerance in INEXACT_STATES_LOOSE:
        errors = []
        for seed in INEXACT_STATES_SEEDS:
            found, exact = (
                inexact_point(judge, seed, tolerance).gradient,
                inexact_point(judge, seed, INEXACT_STATES_EXACT).gradient,
            )
            errors.append(np.linalg.norm(found - exact) / np.linalg.norm(exact))
        assert 0.0 < np.median(errors) < 10 * tolerance


@cache
def found_by(name: str, adaptive: bool) -> tuple[ShapeProblem, Result]:
    problem = posed(name, MPI.COMM_SELF, AdaptiveTolerance() if adaptive else 1e-8)
    return problem, minimised(name, problem, None, max_evaluations=40, tolerance=STOPPING)


@pytest.mark.parametrize("name", BOUND)
def test_the_optimum_is_that_of_accurate_states_with_fewer_products(name: str) -> None:
    (rough, found), (fine, expected) = found_by(name, True), found_by(name, False)
    assert found.reason.success
    assert found.reason is expected.reason
    exact = posed(name, MPI.COMM_SELF, INEXACT_STATES_EXACT)
    value = exact.evaluate(found.x).value
    assert value < expected.value + STOPPING * (1 + abs(expected.value))
    assert abs(found.value - value) < max(found.error, 1e-9 * abs(value))
    assert rough.products < 0.75 * fine.products


@pytest.mark.parametrize("name", BOUND)
def test_errors_follow_the_predicted_decrease(name: str) -> None:
    _, found = found_by(name, True)
    tried = [record for record in found.history if record.kind in (StepKind.SERIOUS, StepKind.NULL)]
    assert len(tried) > 1
    assert all(0.0 < record.error < 0.02 * record.predicted_decrease for record in tried)
    assert found.history[-1].kind is StepKind.REFINED
    assert 0.0 < found.error < 0.02 * STOPPING * (1 + abs(found.value))


def test_no_more_accuracy_is_spent_than_asked_for() -> None:
    spent = []
    for share in (1e-2, 1e-5, 1e-8):
        problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
        alpha = 0.01 * np.random.default_rng(1).standard_normal(problem.size)
        value, _, error = problem.within(alpha, share * 0.1, 1.0)
        assert error <= share * 0.1
        assert abs(value) > 0.1
        spent.append(problem.products)
        assert problem.evaluations == 1
    assert spent[0] < spent[1] < spent[2]


def test_a_design_that_is_asked_for_again_is_solved_on() -> None:
    problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
    alpha = 0.01 * np.random.default_rng(1).standard_normal(problem.size)
    problem.within(alpha, np.inf, 1.0)
    first, loose = problem.products, problem.last
    problem.evaluate(alpha)
    fresh = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
    exact = fresh.evaluate(alpha)
    assert problem.products - first < fresh.products
    assert problem.last is not None
    assert problem.first is problem.best is problem.last is not loose
    assert problem.last.value == pytest.approx(exact.value, rel=1e-9)
    assert problem.last.gradient == pytest.approx(exact.gradient, rel=1e-6, abs=1e-7)


def test_states_of_one_tolerance_are_as_exact_as_they_get() -> None:
    problem = posed("block", MPI.COMM_SELF, 1e-6)
    value, _, error = problem.within(np.zeros(problem.size), np.inf, 1.0)
    assert not problem.inexact
    assert error == 0.0
    assert problem.last is not None
    assert value == problem.last.value
    assert problem.last.tolerance == 1e-6
    assert 0.0 < problem.last.error < 1e-4 * abs(value)


@pytest.mark.parametrize(("loosest", "tightest"), [(1e-3, 1e-2), (1.0, 1e-8), (1e-3, 0.0)])
def test_tolerances_that_are_no_range_are_refused(loosest: float, tightest: float) -> None:
    with pytest.raises(InvalidInputError, match=r"0 < tightest <= loosest < 1, got "):
        AdaptiveTolerance(loosest, tightest)


@cache
def at_switch(switch: str, tolerance: float, choice: WeakChoice) -> DesignPoint:
    """The design at which one point lies on a switch of the contact law, by its stress."""
    exact = SWITCHES[switch]().problem()
    problem = ShapeProblem(
        ContactProblem(exact.scene, MPI.COMM_SELF, partitions=partitions(exact.scene)),
        exact.designs,
        objectives("block")["stress"],
        choice=choice,
        tolerance=tolerance,
    )
    return problem.evaluate(DESIGN)


@pytest.mark.slow
@pytest.mark.parametrize("switch", SWITCHES)
def test_on_a_wrong_face_the_subgradient_is_nearly_that_of_the_other_side(switch: str) -> None:
    """A loose state may lie on either side of a kink; what it gives is an inexact Clarke subgradient."""
    one, other = (at_switch(switch, INEXACT_STATES_EXACT, choice).gradient for choice in WeakChoice)
    kink, far = other - one, []
    for tolerance in (1e-2, 1e-3):
        found = at_switch(switch, tolerance, WeakChoice.RELEASED).gradient
        between = np.clip((found - one) @ kink / (kink @ kink), 0.0, 1.0)
        size = np.linalg.norm(one)
        assert np.linalg.norm(found - one - between * kink) < 0.3 * tolerance * size
        far.append(min(np.linalg.norm(found - side) / size for side in (one, other)))
    assert np.linalg.norm(kink) > 1e-3 * np.linalg.norm(one), "the two sides hardly differ"
    assert max(far) < 0.3 * np.linalg.norm(kink) / np.linalg.norm(one), "the subgradient is of neither side"
