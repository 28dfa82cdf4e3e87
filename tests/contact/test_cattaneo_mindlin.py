"""Cattaneo and Mindlin: two equal cylinders pressed, then sheared until the edges of the contact slip.

The scene and its theory are those of `fenics_contact.study.scenes.cattaneo_mindlin`. The errors on the finest
mesh are more than twice what is left of the size of the bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Status, solve_steps
from fenics_contact.qp import FaceNewton
from fenics_contact.study import Parameters
from fenics_contact.study.scenes.cattaneo_mindlin import FRICTION, build, stick_half_width, theory, tractions
from fenics_contact.study.study import Outcome
from tests.contact.checks import assert_solved

TOLERANCE = 1e-6
SIZES = (8, 16, 32)


def sheared(n: int) -> Outcome:
    """Return the states after pressing and after shearing."""
    parameters = Parameters(n, cell="quadrilateral")
    problem = build(parameters)
    states = solve_steps(
        ContactProblem(problem.scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=TOLERANCE)), problem.steps
    )
    for state in states:
        assert_solved(state, TOLERANCE)
    return Outcome(problem, states, parameters)


@dataclass(frozen=True)
class Errors:
    """Relative errors of the stick half width, of q in L² and in L¹, and of the pressure at the middle."""

    stick: float
    traction: float
    misplaced: float
    peak: float


def errors(outcome: Outcome) -> Errors:
    """Compare with theory for the measured forces."""
    contact, known = outcome.state.contact, theory(outcome.state)
    (x, traction), area = tractions(outcome), contact.points.area
    assert known.half_width == pytest.approx(1.0, abs=2e-3)
    assert known.stick == pytest.approx(0.625, abs=2e-3)
    assert contact.count(Status.STICK) >= 9
    assert contact.count(Status.SLIP) >= 6
    exact = known.traction(x)
    error = traction - exact
    return Errors(
        float(stick_half_width(outcome) / known.stick - 1),
        float(np.sqrt(area @ error**2 / (area @ exact**2))),
        float(area @ np.abs(error) / np.abs(contact.friction_force.sum())),
        float(contact.pressure[np.argmin(np.abs(x))] / known.peak - 1),
    )


def test_stick_width_and_traction_converge_to_those_of_cattaneo_and_mindlin(
    record_property: Callable[[str, object], None],
) -> None:
    found = [errors(sheared(n)) for n in SIZES]
    table = np.array([[abs(e.stick), e.traction, e.misplaced] for e in found])
    rates = np.log2(table[:-1] / table[1:])
    print("\ncells on a | error of c, rate | of q in L2, rate | of q in L1, rate | of p(0)")
    for n, row, rate, e in zip(SIZES, table, np.vstack([[np.nan] * 3, rates]), found, strict=True):
        parts = " | ".join(f"{value:.5f} {r:5.2f}" for value, r in zip(row, rate, strict=True))
        print(f"  {n:3d} | {parts} | {e.peak:+.5f}")
    for name, column in zip(("stick half width", "traction L2", "traction L1"), range(3), strict=True):
        record_property(f"{name}, errors", table[:, column].tolist())
        record_property(f"{name}, rates", rates[:, column].tolist())
    assert np.all(rates > 0.8)
    assert np.all(rates[:, 2] > 1.3)
    assert table[-1, 0] < 0.003
    assert table[-1, 1] < 0.02
    assert abs(found[-1].peak) < 0.001, "the bodies are too small for a half plane"
    assert np.all(table[0] > 0.01), "the coarsest mesh is too good to show convergence"


def test_shear_changes_no_pressure_and_pressing_calls_for_no_friction() -> None:
    pressed, pushed = (state.contact for state in sheared(8).states)
    largest = pressed.pressure.max()
    tangential = np.abs(pressed.friction_force[:, 0]) / pressed.points.area
    assert np.abs(pushed.friction_force).sum() > 0.5 * FRICTION * pushed.normal_force.sum()
    np.testing.assert_allclose(pushed.pressure, pressed.pressure, rtol=0, atol=2e-3 * largest)
    assert tangential.max() < 5e-3 * FRICTION * largest
