"""Newton steps are functions of their state: they change nothing that they are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.qp import DualProblem, Face
from fenics_contact.qp.cones import CoulombLaw
from fenics_contact.qp.face import classify
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.newton_steps import FaceState, FaceSteps, Forcing
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.solution import iterate_fitted
from tests.qp.torn_bricks import Bricks, torn_problem


def problem() -> DualProblem:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    return dual.with_law(CoulombLaw(dual.layout, np.full(dual.layout.n_friction, 0.3)))


def face(*closed: bool) -> Face:
    """A face of three contacts without friction."""
    layout = ContactLayout.build(3, normal=[0, 1, 2])
    trial = np.where(closed, 1.0, -1.0)
    return classify(layout, np.zeros(0), trial, np.zeros(3), np.ones(3))


def test_a_step_from_the_same_state_is_the_same_step() -> None:
    dual = problem()
    operator = CountedOperator(dual.operator)
    steps = FaceSteps.build(dual, operator, Forcing(0.25, 0.1, 1e-8), 1000)
    far = dual.coarse.particular()
    state = steps.init(iterate_fitted(dual, far, operator(far)))
    for number in range(3):
        before, rho = state.iterate.multiplier.copy(), state.step.copy()
        (once, line), (again, other) = steps.step(state, number), steps.step(state, number)
        assert np.array_equal(once.iterate.multiplier, again.iterate.multiplier)
        assert (once.mismatch, line.residuals, line.note) == (again.mismatch, other.residuals, other.note)
        assert not np.array_equal(once.iterate.multiplier, before)
        assert np.array_equal(state.iterate.multiplier, before)
        assert np.array_equal(state.step, rho)
        assert len(once.faces) == len(state.faces) + 1
        state = once
    assert state.iterate.residuals.worst < 0.1


def test_a_disc_whose_force_would_turn_back_gets_a_smaller_step() -> None:
    dual = problem()
    operator = CountedOperator(dual.operator)
    steps = FaceSteps.build(dual, operator, Forcing(0.25, 0.1, 1e-8), 1000)
    far = dual.coarse.particular()
    state, _ = steps.step(steps.init(iterate_fitted(dual, far, operator(far))), 0)
    last = state.faces[0]
    turned = replace(state, faces=(replace(last, direction=-last.direction),))
    after, _ = steps.step(turned, 1)
    slipping = np.einsum("ia,ia->i", after.faces[0].direction, last.direction) > 0.0
    assert slipping.any()
    rows = dual.layout.tangential
    assert after.step[rows] / turned.step[rows] == pytest.approx(
        np.where(slipping, 0.3, 1.0)[:, None] * np.ones(2)
    )
    with_springs = replace(steps, safeguards=replace(steps.safeguards, adapts_step=False))
    assert np.array_equal(with_springs.step(turned, 1)[0].step, turned.step)


@pytest.mark.parametrize(
    ("faces", "reason"),
    [
        ([], "the residual stagnates"),
        ([face(True, True, True)] * 3, "the residual stagnates on one face"),
        (
            [face(True, True, False), face(False, True, True)] * 2,
            "the active set cycles with period 2, 2 statuses changed in the last step",
        ),
        (
            [face(True, True, True), face(True, True, False), face(True, False, False)],
            "the active set does not settle, 1 statuses changed in the last step",
        ),
    ],
)
def test_the_last_faces_say_why_steps_led_nowhere(faces: list[Face], reason: str) -> None:
    dual = problem()
    far = dual.coarse.particular()
    state = FaceState(iterate_fitted(dual, far, dual.operator(far)), far, tuple(faces))
    assert state.stall(MPI.COMM_SELF) == reason


def test_forcing_terms_are_those_of_eisenstat_and_walker() -> None:
    """Choice 2 with γ = 0.9, its safeguard above 0.1, no more accurate than the tolerance."""
    forcing = Forcing(0.9, np.inf, 1e-8)
    assert forcing.by_reduction(0.5, None, 0.9, 1.0) == 0.9, "nothing is known before the first step"
    assert forcing.by_reduction(1e-3, 1e-1, 1e-3, 1.0) == pytest.approx(0.9e-4)
    assert forcing.by_reduction(1e-3, 1e-1, 0.5, 1.0) == pytest.approx(0.9 * 0.5**2), "a safeguard"
    assert forcing.by_reduction(1e-3, 1e-1, 1e-3, 0.1) == pytest.approx(0.9e-5), "care"
    assert forcing.by_reduction(1e-7, 1e-1, 1e-3, 1.0) == pytest.approx(0.3e-8 / 1e-7)
    assert forcing.by_reduction(0.99, 1.0 - 1e-9, 1e-3, 1.0) == pytest.approx(0.9 * 0.99**2)
