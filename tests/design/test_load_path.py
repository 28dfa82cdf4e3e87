"""Work of friction over load steps: derivatives through the history of slip, and what is no path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, LoadStep, ShapeProblem, Status, Support, minimize, solve_steps
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    FrictionWork,
    LoadPath,
    Movement,
    NonlinearConstraint,
    Objective,
    PressureNorm,
)
from fenics_contact.design.adjoint import LaterSteps
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.several import PathObjective
from fenics_contact.errors import InvalidInputError
from fenics_contact.results.deformed_state import AnyState
from tests.design.chains import SOLVER
from tests.design.load_paths import PathLine, beam, line_of, path_of
from tests.design.quotients import Patch
from tests.scenes import partitions

CLAIM = [pytest.mark.slow, pytest.mark.claim]
SCENES = [
    "floor", "beam", "springs", "space, mortar",
    *(pytest.param(name, marks=CLAIM) for name in ("blocks", "mortar", "space")),
]  # fmt: skip
#: Of the last step alone: what earlier ones left behind.
LEFT: dict[str, Objective] = {"let go": Movement("block", "y1", (1.0, 0.0)) + 0.01 * PressureNorm(0)}


@cache
def line(name: str) -> PathLine:
    return line_of(path_of(name))


def counts(here: PathLine, multiple: float = 0.0) -> list[list[int]]:
    states = here.problem.states_of(here.at(multiple))
    return [state.contact.status.tolist() for state in states.values()]


@pytest.mark.parametrize("name", SCENES)
def test_the_adjoints_agree_with_central_differences(name: str) -> None:
    here = line(name)
    middle = counts(here)
    assert all(any(status in step for step in middle) for status in Status)
    assert counts(here, 1.0) == middle == counts(here, -1.0)
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-5)
    assert abs(here.slope()) > 0.01 * np.linalg.norm(here.problem(here.alpha)[1])


@pytest.mark.parametrize("name", ["floor", "space, mortar"])
def test_taylor_remainders_are_quadratic(name: str) -> None:
    near = replace(line(name), taylor=(0.5, 1.0))  # a point opens on the way to twice the step
    assert near.taylor_rate() > 1.9


def test_points_open_and_close_again_and_slip_in_both_directions() -> None:
    states = list(line("floor").problem.states_of(line("floor").alpha).values())
    opened = [state.contact.status == Status.OPEN for state in states]
    assert np.any(opened[1] & ~opened[2])
    slips = [state.contact.slip[state.contact.status == Status.SLIP, 0] for state in states]
    assert slips[1].min() > 0.0 > slips[2].max()


@pytest.mark.parametrize("name", ["floor", "space"])
def test_without_the_history_of_slip_the_derivative_is_wrong(name: str, monkeypatch: Patch) -> None:
    monkeypatch.setattr(LaterSteps, "added", lambda later, state, own: own)
    assert abs(line(name).slope() / line(name).quotient() - 1.0) > 1e-2


@pytest.mark.parametrize("derivative", ["by_displacement", "by_jump", "by_motion"])
def test_every_way_in_which_slip_is_handed_back_counts(derivative: str, monkeypatch: Patch) -> None:
    whole = LaterSteps.added

    def without(later: Any, state: Any, own: Any) -> Any:
        return replace(whole(later, state, own), **{derivative: getattr(own, derivative)})

    monkeypatch.setattr(LaterSteps, "added", without)
    assert abs(line("beam").slope() / line("beam").quotient() - 1.0) > 1e-3


def test_an_objective_of_the_last_step_depends_on_the_steps_before() -> None:
    path = path_of("floor", objectives=LEFT)
    here = line_of(path)
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-5)
    point = path.evaluate(here.alpha)
    assert [step.value == 0.0 for step in point.parts.values()] == [True, True, True, False]
    assert point.value == point.parts["let go"].value
    assert all(np.array_equal(step.alpha, here.alpha) for step in point.parts.values())
    assert np.abs(point.parts["push"].gradient).max() > 1e-3 * np.abs(point.gradient).max()


class RangeOfMovement(PathObjective):
    """By how much a movement differs between two steps: the difference of their objectives."""

    steps = ("push", "back")

    def at(self, states: Mapping[str, AnyState], forms: ShapeForms) -> Mapping[str, Objective]:
        moved = Movement("block", "y1", (1.0, 0.0))
        push, back = (moved.value(states[name], forms) for name in self.steps)
        sign = float(np.sign(push - back))
        return {"push": sign * moved, "back": -sign * moved}


def test_one_objective_may_depend_on_several_steps() -> None:
    whole = path_of("floor")
    path = whole.function(RangeOfMovement())
    here = line_of(path)
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-5)
    moved = Movement("block", "y1", (1.0, 0.0))
    states = whole.states_of(here.alpha)
    push, back = (moved.value(states[name], path.forms) for name in ("push", "back"))
    assert path.value_of(here.alpha) == pytest.approx(abs(push - back), rel=1e-12)
    assert abs(push - back) > 1e-4


def test_the_states_are_those_of_load_steps_and_the_value_is_what_friction_dissipates() -> None:
    scene, steps = beam()
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene, (2, 1, 1)), solver=SOLVER)
    alone = [state.contact for state in solve_steps(contact, steps)]
    path = path_of("beam")
    states = path.states_of(np.zeros(path.size))
    slid, work = np.zeros_like(alone[0].slip), 0.0
    for state, mate in zip(states.values(), alone, strict=True):
        size = np.abs(mate.friction_force).max()
        np.testing.assert_allclose(state.contact.friction_force, mate.friction_force, atol=1e-6 * size)
        rubs = np.linalg.norm(mate.friction_force, axis=1)
        work += float(rubs @ np.linalg.norm(mate.total_slip - slid, axis=1))
        slid = mate.total_slip
    assert path.value_of(np.zeros(path.size)) == pytest.approx(work, rel=1e-6)


def test_steps_of_a_design_share_matrices_and_factors() -> None:
    states = list(line("floor").problem.states_of(line("floor").alpha).values())
    for state in states[1:]:
        assert state.torn.points is states[0].torn.points
        pairs = zip(state.dual.inverse.operators, states[0].dual.inverse.operators, strict=True)
        assert all(mine is theirs for mine, theirs in pairs)


def test_a_constraint_of_other_objectives_uses_the_states() -> None:
    path, alpha = path_of("floor"), line("floor").alpha
    point = path.evaluate(alpha)
    solved, pressure = path.products, path.function({"push": PressureNorm()})
    found, _ = pressure(alpha)
    assert found == pytest.approx(PressureNorm().value(point.parts["push"].state, path.forms))
    assert 0 < path.products - solved < solved / 2, "the states are not solved again"
    here = line_of(pressure)
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-5)


def test_less_friction_works_under_a_limit_of_the_pressure() -> None:
    path = path_of("floor")
    start = np.zeros(path.size)
    pressure = path.function({"push": PressureNorm()})
    before, limit = path(start)[0], pressure(start)[0]
    result = minimize(
        path,
        start,
        BundleTrust(tolerance=1e-2, max_evaluations=12),
        bounds=(-0.003, 0.003),
        constraints=NonlinearConstraint(pressure, limit, name="pressure"),
    )
    assert result.value < 0.8 * before
    assert pressure(result.x)[0] < limit * (1.0 + 1e-5)


def test_a_path_where_nothing_rubs_has_no_history() -> None:
    scene, steps = beam()
    smooth = replace(
        scene,
        contacts=[replace(scene.contacts[0], friction=None)],
        supports=[*scene.supports, Support("block", "y1", (0.0, None))],
    )
    held = [LoadStep(step.name, supports=[*step.supports, smooth.supports[-1]]) for step in steps]
    contact = ContactProblem(smooth, MPI.COMM_SELF, partitions=partitions(smooth, (2, 1, 1)), solver=SOLVER)
    shaped = ShapeProblem(contact, path_of("beam").designs, LEFT["let go"])
    value, gradient = LoadPath(shaped, held, LEFT)(np.zeros(shaped.size))
    alone, known = shaped.case(held[-1].applied_to(smooth))(np.zeros(shaped.size))
    assert value == pytest.approx(alone, rel=1e-7)
    np.testing.assert_allclose(gradient, known, rtol=1e-6, atol=1e-8 * np.abs(known).max())


def test_what_was_stored_is_recalled() -> None:
    first, again = path_of("floor"), path_of("floor")
    alpha = line("floor").alpha
    first(alpha)
    again.recall(first.memory())
    assert first.fingerprint() == again.fingerprint()
    assert again.evaluations == first.evaluations == 1
    assert again.products - first.products == len(first.problems), "one product rebuilds a state"
    assert again.first is not None
    assert first.first is not None
    assert again.first.value == pytest.approx(first.first.value, rel=1e-6)
    assert again.at(alpha) is again.first is again.best is again.last
    assert again.first.state is again.first.parts["let go"].state
    fresh = path_of("floor")
    fresh(0.9 * alpha)
    spent = again.products
    again(0.9 * alpha)
    assert again.products - spent < fresh.products
    np.testing.assert_allclose(again(0.9 * alpha)[1], fresh(0.9 * alpha)[1], rtol=1e-5, atol=1e-9)


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize(("name", "ranks"), [("beam", (1, 2, 4)), ("mortar", (1, 4))])
def test_ranks_find_the_same(name: str, ranks: tuple[int, ...], mpirun: Callable[..., str]) -> None:
    script = Path(__file__).with_name("load_paths.py")
    said = [np.array(mpirun(script, count, name).split(), dtype=float) for count in ranks]
    for each in said[1:]:
        np.testing.assert_allclose(each, said[0], rtol=1e-6)


def test_a_gradient_beside_a_weak_design_is_that_of_a_design_nearby() -> None:
    here = line("floor")
    assert not here.problem.may_be_invalid(here.alpha)
    beside = here.problem.gradient_near(here.alpha, here.at(1.0))
    near = here.problem(here.alpha + 1e-2 * (here.at(1.0) - here.alpha))[1]
    np.testing.assert_allclose(beside, near, rtol=1e-8)


def test_a_later_step_alone_has_no_derivative() -> None:
    path = line("floor").problem
    states = list(path.states_of(line("floor").alpha).values())
    first = path.problems["press"]
    assert first.differentiate(states[0]).value > 0.0
    with pytest.raises(InvalidInputError, match="one step from rest, got slip of earlier"):
        first.differentiate(states[1])


@pytest.mark.parametrize(
    ("steps", "objectives", "words"),
    [
        ([], None, "needs a load step, got none"),
        (["a", "a"], None, r"steps with different names, got \['a', 'a'\]"),
        (["a", "b"], {"c": FrictionWork()}, r"those of steps \['a', 'b'\], got those of \['c'\]"),
        (["a", "b"], FrictionWork(), "must map steps to objectives, got FrictionWork"),
        (
            ["a", "b"],
            {"a": FrictionWork()},
            "the last step needs an objective, got those of .'a'.: leave out",
        ),
    ],
)
def test_what_is_no_path_is_refused(steps: list[str], objectives: Any, words: str) -> None:
    first = path_of("floor").problems["press"]
    with pytest.raises(InvalidInputError, match=words):
        LoadPath(first, [LoadStep(name) for name in steps], objectives)


def test_states_of_varying_accuracy_are_refused() -> None:
    path = path_of("floor")
    contact = path.problems["press"].contact
    adaptive = ShapeProblem(contact, path.designs, FrictionWork(), tolerance=AdaptiveTolerance())
    with pytest.raises(InvalidInputError, match="states of one tolerance"):
        LoadPath(adaptive, [LoadStep("press")])
