"""The proximal parameter grows, waits and shrinks as the trial deserves."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._optimize.bundle_trust import stopping_test
from fenics_contact._optimize.result import Reason
from fenics_contact._optimize.subproblem import Step, Trial, Trust

TRUST = Trust(t=1.0, radius=10.0, t_least=1e-3, t_most=50.0, radius_least=1e-6)


def trial(change: float, slope: float, measure: float = 0.0, length: float = 1.0) -> Trial:
    step = Step(np.array([length]), 1.0, np.ones(1), 0.5, 0.1, 1.0)
    return Trial(step, change, slope, measure)


def test_parabola_through_prediction_and_value_gives_the_newton_step() -> None:
    # J = a y²/2 with slope -1 at the centre: t = 1 predicts 1 for y = 1; the minimiser is t = 1/a.
    for a in (0.5, 1.0, 4.0):
        assert trial(change=-1.0 + a / 2, slope=-1.0 + a).parabola == pytest.approx(1.0 / a)


@pytest.mark.parametrize(("change", "t"), [(-0.1, 1.0), (-0.75, 2.0), (-1.0, 10.0), (-7.0, 10.0)])
def test_t_grows_with_the_agreement_of_a_serious_step(change: float, t: float) -> None:
    assert TRUST.after_serious(trial(change, slope=-0.5)).t == pytest.approx(t)


def test_t_doubles_when_serious_steps_repeat_and_stays_below_its_limit() -> None:
    trust, seen = TRUST, []
    for _ in range(12):
        trust = trust.after_serious(trial(-0.3, slope=-0.1))
        seen.append(trust.t)
    assert seen[:4] == [1.0, 1.0, 2.0, 4.0]
    assert seen[-1] == 50.0


def test_null_step_that_improves_the_model_keeps_t() -> None:
    assert TRUST.after_null(trial(change=0.2, slope=0.5, measure=0.3)).t == 1.0


def test_null_step_whose_plane_lies_too_deep_shortens_t() -> None:
    assert TRUST.after_null(trial(change=0.2, slope=0.5, measure=1.1)).t == pytest.approx(0.5 / 1.2)


def test_null_step_that_is_far_off_shortens_t_at_the_second_time() -> None:
    far = trial(change=5.0, slope=9.0, measure=4.0)
    once = TRUST.after_null(far)
    assert once.t == 1.0
    assert once.after_null(far).t == pytest.approx(0.1)


def test_t_never_falls_below_its_least_value() -> None:
    trust = TRUST
    for _ in range(20):
        trust = trust.after_null(trial(change=9.0, slope=1.0, measure=8.0))
    assert trust.t == TRUST.t_least
    assert trust.exhausted
    assert not TRUST.exhausted


def test_radius_halves_the_rejected_step_and_doubles_after_a_long_serious_one() -> None:
    trust = TRUST.after_rejection(4.0)
    assert trust.radius == 2.0
    assert trust.after_serious(trial(-0.9, -0.5, length=1.9)).radius == 4.0
    assert trust.after_serious(trial(-0.9, -0.5, length=0.3)).radius == 2.0
    assert TRUST.after_rejection(1e-6).cornered


def stop(error: float, norm: float, t: float, longer: float = 0.0) -> Reason | None:
    test = stopping_test(99.0, tolerance=1e-2, value_scale=1.0, reach=2.0, first_t=1.0)
    assert test.limit == pytest.approx(1.0)
    step = Step(np.array([t * norm]), error + t * norm**2, np.ones(1), norm, error, t)
    other = Step(np.zeros(1), longer, np.ones(1), 0.0, longer, 1.0)
    return test.reason(step, lambda _: other)


@pytest.mark.parametrize("t", [1e-6, 1.0, 10.0])
def test_certificate_alone_stops_whatever_t_is(t: float) -> None:
    assert stop(error=0.5, norm=0.2, t=t, longer=9.0) is Reason.STATIONARY


def test_certificate_reaches_as_far_as_the_step_does() -> None:
    assert stop(error=0.5, norm=0.2, t=1e3) is None


def test_predicted_decrease_stops_when_the_certificate_is_near() -> None:
    assert stop(error=0.2, norm=0.8, t=1.0) is Reason.CONVERGED


def test_small_predicted_decrease_does_not_stop_far_from_the_certificate() -> None:
    assert stop(error=0.2, norm=8.0, t=0.01) is None


def test_small_predicted_decrease_does_not_stop_when_it_is_small_only_for_a_small_t() -> None:
    assert stop(error=0.2, norm=2.0, t=0.1, longer=1.5) is None
    assert stop(error=0.2, norm=2.0, t=0.1, longer=0.9) is Reason.CONVERGED
