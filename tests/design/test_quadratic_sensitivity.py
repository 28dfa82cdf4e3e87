"""Derivatives of bodies of quadratic cells, of all types, with contact by nodes and by mortar."""

from __future__ import annotations

import pytest

from tests.design.left_out import TERMS, without_areas
from tests.design.quadratic_blocks import OBJECTIVES, SCENES, line
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
    for objective in ("energy", "normal forces"):
        assert line(name).taylor_rate(OBJECTIVES[objective]) > 1.9


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("name", ["blocks", "blocks, tetrahedra"])
def test_every_term_counts(name: str, term: str) -> None:
    assert miss_without(TERMS[term], line(name), OBJECTIVES["displacement"]) > 1e-3


@pytest.mark.parametrize("name", ["floor, Tresca", "floor, Tresca, tetrahedra", "plane floor, Tresca"])
def test_the_slip_bound_of_tresca_friction_changes_with_the_area_that_a_node_bears(name: str) -> None:
    assert miss_without(without_areas, line(name), OBJECTIVES["friction forces"]) > 1e-4


def test_default_settings_give_the_same_gradient() -> None:
    check_default_settings(line("blocks, tetrahedra"), OBJECTIVES["energy"])
