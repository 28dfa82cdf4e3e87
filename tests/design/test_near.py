"""Means of stress and displacement near a place."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, Scene, State, Support, Traction
from fenics_contact.design import MovementNear, Objective, StressNear
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from tests.design import moved_blocks
from tests.design.quotients import check_adjoint

YOUNG, POISSON, PRESSURE = 100.0, 0.3, 3.0


@pytest.fixture(scope="module")
def column() -> State:
    """An evenly pressed column between rollers at the left and below."""
    body = Body(rectangle((0.0, 0.0), (2.0, 1.0), (8, 5), cell="triangle"), PlaneStrain(YOUNG, POISSON))
    rollers = [Support("column", "x0", (0.0, None)), Support("column", "y0", (None, 0.0))]
    scene = Scene({"column": body}, rollers, [Traction("column", "y1", (0.0, -PRESSURE))])
    return ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11).solve(design=True)


def value(objective: Objective, state: State) -> float:
    return objective.value(state, ShapeForms(state.torn.decomposition.comm))


def test_an_even_stress_is_its_own_mean(column: State) -> None:
    here = {"at": (0.9, 0.6), "radius": 0.4}
    stresses = {"xx": 0.0, "yy": -PRESSURE, "xy": 0.0, "zz": -POISSON * PRESSURE}
    stresses["von_mises"] = PRESSURE * np.sqrt(1.0 - POISSON + POISSON**2)
    for component, expected in stresses.items():
        found = value(StressNear("column", component=component, **here), column)
        assert found == pytest.approx(expected, abs=1e-8)


def test_a_linear_displacement_has_its_value_in_the_middle_of_the_place(column: State) -> None:
    strain = PRESSURE / YOUNG * (1.0 - POISSON**2)
    down = MovementNear("column", (0.9, 0.6), 0.35, direction=(0.0, -2.0))
    assert value(down, column) == pytest.approx(0.6 * strain, rel=2e-3), "cells are cut by the rim"


def test_smaller_regions_lie_closer_to_the_place(column: State) -> None:
    found = [value(MovementNear("column", (0.0, 1.0), r, direction=(0, -1)), column) for r in (0.8, 0.4)]
    strain = PRESSURE / YOUNG * (1.0 - POISSON**2)
    assert found[0] < found[1] < strain


NEAR: dict[str, Objective] = {
    "stress": StressNear("block", (1.5, 0.5, 0.2), 0.8),
    "shear": StressNear("block", (1.0, 0.5, 0.3), 0.8, "xz"),
    "movement": MovementNear("block", (1.5, 0.5, 0.2), 0.8, direction=(1, 0, 0)),
}


@pytest.mark.parametrize("name", NEAR)
def test_the_adjoint_agrees_with_central_differences(name: str) -> None:
    check_adjoint(moved_blocks.line("floor"), NEAR[name], 0.005)


def test_what_is_not_there_is_refused(column: State) -> None:
    with pytest.raises(InvalidInputError, match=r"StressNear.radius must be a positive length, got 0.0"):
        StressNear("column", (0, 0), 0.0)
    with pytest.raises(InvalidInputError, match=r"component must be one of \['von_mises', 'xx'.*got 'rr'"):
        StressNear("column", (0, 0), 1.0, "rr")
    with pytest.raises(
        InvalidInputError, match=r"at must be a place of 2 coordinates in the body, got \(0, 0, 1\)"
    ):
        value(StressNear("column", (0, 0, 1), 1.0), column)
    with pytest.raises(
        InvalidInputError,
        match=r"within 0.5 of its place, got none at \(5.0, 0.0\): give a place in the body",
    ):
        value(StressNear("column", (5, 0), 0.5), column)
    with pytest.raises(
        InvalidInputError, match=r"MovementNear.body must name a body of the scene, got 'top'"
    ):
        value(MovementNear("top", (0, 0), 1.0, direction=(1, 0)), column)
