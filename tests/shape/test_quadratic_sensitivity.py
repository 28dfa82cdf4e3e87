"""Derivatives of bodies of quadratic cells, of all types, with contact by nodes."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_contact.contact import ContactProblem, Status
from fenics_contact.shape import ShapeProblem
from tests.shape.left_out import TERMS, without_areas
from tests.shape.quadratic_blocks import OBJECTIVES, SCENES, line
from tests.shape.quotients import miss_without


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    contact = line(name).state().contact
    assert all(contact.count(status) > 0 for status in Status), line(name).counts()
    assert line(name).is_smooth()


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    here, judge = line(name), OBJECTIVES[objective]
    assert here.steepness(judge) > 0.015
    assert here.miss(judge) < 1e-5


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
    here, judge = line("blocks, tetrahedra"), OBJECTIVES["energy"]
    contact = ContactProblem(SCENES["blocks, tetrahedra"](), MPI.COMM_SELF)
    slope = float(ShapeProblem(contact, here.problem.designs, judge)(here.alpha)[1] @ here.direction)
    assert slope == pytest.approx(here.quotient(judge), rel=1e-3)
