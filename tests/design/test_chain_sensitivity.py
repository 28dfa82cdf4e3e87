"""Derivatives of a chain by both its crowns, in every regime of contact, beside difference quotients."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import Status
from tests.design.chains import REGIMES, line
from tests.design.objectives import objectives
from tests.design.quotients import Line

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

OBJECTIVES = objectives("link1")
CASES = [
    (regime, objective)
    for regime in REGIMES
    for objective in OBJECTIVES
    if (regime, objective) != ("frictionless", "friction forces")
]


@pytest.mark.parametrize("regime", REGIMES)
def test_each_regime_is_what_its_name_says_all_along_the_line(regime: str) -> None:
    contact = line(regime).state().contact
    sticks, slips = contact.count(Status.STICK), contact.count(Status.SLIP)
    assert contact.count(Status.OPEN) > 5
    match regime:
        case "frictionless":
            assert slips > 5
            assert np.all(contact.friction_force == 0.0)
        case "slip" | "Tresca":
            assert (sticks, slips > 5) == (0, True)
            assert np.abs(contact.friction_force).max() > 0.01 * contact.normal_force.max()
        case "stick":
            assert (sticks > 5, slips) == (True, 0)
        case "mixed":
            assert min(sticks, slips) > 1
    assert line(regime).is_smooth()


@pytest.mark.parametrize(("regime", "objective"), CASES)
def test_the_adjoint_agrees_with_central_differences(regime: str, objective: str) -> None:
    here, judge = line(regime), OBJECTIVES[objective]
    assert here.point(judge).weak.contacts == here.point(judge).weak.discs == 0
    assert here.steepness(judge) > 0.02
    assert here.relative_slope(judge) > 1e-3
    assert here.miss(judge) < 1e-5


@pytest.mark.parametrize(("regime", "objective"), CASES)
def test_taylor_remainders_are_quadratic(regime: str, objective: str) -> None:
    assert line(regime).taylor_rate(OBJECTIVES[objective]) > 1.9


def test_the_regimes_have_different_derivatives() -> None:
    slopes = [line(regime).slope(OBJECTIVES["energy"]) for regime in REGIMES]
    assert np.abs(np.diff(np.sort(slopes))).min() > 1e-2 * np.abs(slopes).min()


@pytest.mark.parametrize("objective", ["energy", "stress", "normal forces"])
@pytest.mark.parametrize("geometry", ["reconstructed", "faceted"])
def test_derivatives_are_right_wherever_the_surface_between_nodes_comes_from(
    geometry: str, objective: str
) -> None:
    here, known, judge = line("mixed", geometry), line("mixed"), OBJECTIVES[objective]
    assert here.is_smooth()
    assert min(here.counts().values()) > 1
    assert here.slope(judge) != pytest.approx(known.slope(judge), rel=1e-3), "it is the same surface"
    assert here.steepness(judge) > 0.02
    assert here.miss(judge) < 1e-5
    assert here.taylor_rate(judge) > 1.9


def test_one_adjoint_gives_the_derivative_along_every_variable() -> None:
    here, judge = line("mixed"), OBJECTIVES["stress"]
    gradient = here.point(judge).gradient
    assert gradient.shape == (18,)
    # A variable of the master and one of the slave that matter.
    for part in (slice(0, 12), slice(12, 18)):
        variable = part.start + int(np.argmax(np.abs(gradient[part])))
        alone = Line(here.problem, here.alpha, np.eye(18)[variable], here.step)
        assert alone.quotient(judge) == pytest.approx(gradient[variable], rel=1e-5)
