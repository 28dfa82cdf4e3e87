"""Where several points lie on a switch, one branch for all of them may be that of no design nearby."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Checkpoint, Coulomb, ShapeProblem
from fenics_contact._optimize.result import Reason, StepKind
from fenics_contact.design import AdaptiveTolerance, Kinked, WeakChoice
from tests.conftest import run_on_ranks
from tests.contact.gallery import Friction
from tests.shape.several_weak import BOUND, collect, minimised, posed

CHOICES = list(WeakChoice)
FRICTION = {"frictionless": None, "Coulomb": Coulomb(0.3)}


@cache
def at_rest(choice: WeakChoice, friction: str) -> ShapeProblem:
    problem = posed(MPI.COMM_SELF, choice=choice, friction=FRICTION[friction])
    problem.evaluate(np.zeros(1))
    return problem


def slopes(friction: Friction) -> list[float]:
    """Difference quotients to either side, of strict states."""
    strict, step = posed(MPI.COMM_SELF, friction=friction, tolerance=1e-11), 1e-5
    ahead, here, behind = (strict.value_of(np.array([at])) for at in (step, 0.0, -step))
    return [(ahead - here) / step, (here - behind) / step]


@pytest.mark.parametrize("friction", FRICTION)
def test_neither_choice_is_the_slope_and_the_point_beside_has_it(friction: str) -> None:
    after, before = slopes(FRICTION[friction])
    assert after == pytest.approx(before, rel=1e-3), "the objective has no kink"
    for choice in CHOICES:
        problem = at_rest(choice, friction)
        assert isinstance(problem, Kinked)
        point = problem.last
        assert point is not None
        assert (point.weak.contacts, point.weak.may_be_invalid) == (8, True)
        assert problem.may_be_invalid(np.zeros(1))
        assert not problem.may_be_invalid(np.ones(1)), "nothing was returned there"
        assert abs(point.gradient[0] - after) > 0.5 * after
        for end in (1e-4, -1e-4):
            assert problem.gradient_near(np.zeros(1), np.array([end]))[0] == pytest.approx(after, rel=2e-3)


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("choice", CHOICES)
def test_the_end_is_the_minimum(choice: WeakChoice, friction: str) -> None:
    """At default tolerances: the first design seems stationary where points are released."""
    problem = posed(MPI.COMM_SELF, choice=choice, friction=FRICTION[friction])
    result = minimised(problem)
    assert result.reason.success
    assert result.x == pytest.approx([-BOUND])
    assert result.value == pytest.approx(problem.value_of(np.array([-BOUND])), rel=1e-5)
    if choice is WeakChoice.RELEASED:
        assert result.history[1].kind is StepKind.REFINED


@pytest.mark.parametrize("choice", CHOICES)
def test_states_that_follow_the_optimiser_end_there_as_well(choice: WeakChoice) -> None:
    problem = posed(MPI.COMM_SELF, net=(2, 2), choice=choice, tolerance=AdaptiveTolerance())
    result = minimised(problem)
    exact = minimised(posed(MPI.COMM_SELF, net=(2, 2), tolerance=1e-10))
    assert result.reason.success
    assert result.value == pytest.approx(exact.value, abs=2e-4)
    assert result.value < -0.2


def test_without_the_question_the_first_design_is_called_stationary(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ShapeProblem, "may_be_invalid", lambda self, alpha: False)
    result = minimised(posed(MPI.COMM_SELF))
    assert (result.reason, result.evaluations) == (Reason.STATIONARY, 1)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Checkpoints of runs that were stopped before and after the first design was looked into."""
    folder = tmp_path_factory.mktemp("stopped")
    paths = {}
    for limit in (1, 2, 4):
        paths[limit] = folder / f"{limit}.npz"
        problem = posed(MPI.COMM_SELF, net=(2, 2))
        minimised(problem, Checkpoint(paths[limit]), max_evaluations=limit, raise_on_failure=False)
    return paths


@cache
def whole() -> dict[str, Any]:
    return collect(MPI.COMM_SELF)


def test_a_run_goes_on_to_the_last_bit(stopped: dict[int, Path], tmp_path: Path) -> None:
    assert "REFINED" in whole()["kinds"]
    for limit, path in stopped.items():
        copy = tmp_path / f"{limit}.npz"
        copy.write_bytes(path.read_bytes())
        assert collect(MPI.COMM_SELF, copy) == whole()


def test_two_ranks_look_beside_the_same_designs(stopped: dict[int, Path]) -> None:
    expected = whole()
    script = Path(__file__).with_name("several_weak_on_ranks.py")
    answers = json.loads(run_on_ranks(script, 2, stopped[2]))
    assert len(answers) == 2
    for found in answers:
        assert (found["ranks"], found["same"]) == (2, True)
        assert found["kinds"] == expected["kinds"]
        assert found["values"] == pytest.approx(expected["values"], rel=1e-5, abs=1e-7)
        assert found["x"] == pytest.approx(expected["x"], abs=1e-6 * BOUND)
