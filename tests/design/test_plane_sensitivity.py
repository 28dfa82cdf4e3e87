"""Derivatives of plane scenes: obstacles, one block on another, Coulomb and Tresca friction."""

from __future__ import annotations

import pytest

from tests.design.left_out import TERMS, without_areas
from tests.design.plane_blocks import OBJECTIVES, SCENES, line
from tests.design.quotients import check_adjoint, check_default_settings, check_statuses, miss_without


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[objective], 0.015)


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "friction forces"):
        assert line(name).taylor_rate(OBJECTIVES[objective]) > 1.9


@pytest.mark.parametrize("term", [term for term in TERMS if term != "turning of friction"])
def test_every_term_counts_but_the_turning_of_friction_which_has_one_direction(term: str) -> None:
    here, judge = line("blocks"), OBJECTIVES["displacement"]
    assert miss_without(TERMS[term], here, judge) > 1e-3
    assert miss_without(TERMS["turning of friction"], here, judge) < 1e-5


def test_the_slip_bound_of_tresca_friction_changes_with_the_nodal_length() -> None:
    here, judge = line("blocks, Tresca"), OBJECTIVES["friction forces"]
    assert miss_without(without_areas, here, judge) > 1e-3


@pytest.mark.parametrize("name", ["pipe", "blocks"])
def test_default_settings_give_the_same_gradient(name: str) -> None:
    check_default_settings(line(name), OBJECTIVES["energy"])
