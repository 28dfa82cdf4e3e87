"""Cattaneo and Mindlin: two equal cylinders pressed, then sheared until the edges of the contact slip.

The bodies mirror each other and are of the same material: what one's surface does under pressure and shear,
the other's does in the mirror, so that pressing calls for no friction and shearing changes no pressure,
also in bodies that are no half planes and on meshes that mirror each other. What is left of the size of the
bodies, 30 times the contact, is its curvature of the surfaces over the contact, (1/30)², below a
thousandth: the errors on the finest mesh are more than twice that. Far edges are moved, not loaded. How far
belongs to the size of the bodies, as a line load shifts a half plane without bounds; tractions do not know
about it, so theory takes the measured forces P and Q. The radius is a thousand times the contact, as theory
presses along one direction, and contact along its normals.

Both a and c end at nodes of all meshes to within a thousandth, so that errors fall at clean rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import State, Status, solve_steps
from fenics_contact.geometry import BodyMesh, rectangle_lattice
from fenics_contact.qp import FaceNewton
from fenics_contact.scene import Body, ContactPair, Coulomb, LoadStep, PlaneStrain, Scene, Support, Surface
from tests.contact.checks import assert_solved

YOUNG, POISSON, FRICTION = 1000.0, 0.3, 0.4
RADIUS, SIZE = 2000.0, 30.0
PRESS, SHEAR = 0.00205, 0.000735
TOLERANCE = 1e-6
SIZES = (8, 16, 32)


def ticks(fine: float, cell: float, growth: float) -> np.ndarray:
    """Equal cells up to ``fine``, then growing ones up to the size of the body."""
    count = int(np.ceil(np.log1p((SIZE - fine) / cell * (growth - 1)) / np.log(growth)))
    tail = np.cumsum(growth ** np.arange(count))
    equal = np.linspace(0.0, fine, round(fine / cell) + 1)
    return np.concatenate([equal, fine + (SIZE - fine) * tail / tail[-1]])


def half(side: float, n: int) -> BodyMesh:
    """The upper body (side 1) or its mirror image (side −1), n cells on the half contact."""
    across, down = ticks(1.25, 1 / n, 1 + 1 / n), ticks(1 / n, 1 / n, 1 + 1 / n)
    lines = [np.concatenate([-across[:0:-1], across]), down if side > 0 else -down[::-1]]
    mesh = rectangle_lattice(lines)
    x, y = mesh.points.T
    return mesh.moved(np.column_stack([x, y + side * x**2 / (2 * RADIUS) * (1 - np.abs(y) / SIZE)]))


def sheared(n: int) -> tuple[State, State]:
    """Return the states after pressing and after shearing."""
    material = PlaneStrain(YOUNG, POISSON)
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(FRICTION))
    scene = Scene(
        {"upper": Body(half(1, n), material), "lower": Body(half(-1, n), material)}, contacts=[pair]
    )
    base = Support("lower", "y0", (0.0, 0.0))
    steps = [
        LoadStep(f"{shift:g}", supports=[base, Support("upper", "y1", (shift, -PRESS))])
        for shift in (0.0, SHEAR)
    ]
    states = solve_steps(scene, steps, None, MPI.COMM_SELF, solver=FaceNewton(tolerance=TOLERANCE))
    for state in states:
        assert_solved(state, TOLERANCE)
    return states[0], states[1]


@dataclass(frozen=True)
class Errors:
    """Relative errors of the stick half width, of q in L² and in L¹, and of the pressure at the middle."""

    stick: float
    traction: float
    misplaced: float
    peak: float


def ellipse(x: np.ndarray, a: float) -> np.ndarray:
    return np.sqrt(np.maximum(0.0, 1 - (x / a) ** 2))


def errors(state: State) -> Errors:
    """Compare with theory for the measured forces."""
    contact = state.contact
    points = np.concatenate([body.mesh.points for body in state.scene.bodies.values()])
    x, area = points[contact.points.slave, 0], contact.points.area
    pressure, traction = contact.pressure, np.abs(contact.friction_force[:, 0]) / area
    force, shear = contact.normal_force.sum(), np.abs(contact.friction_force.sum())
    a = np.sqrt(2 * force * RADIUS / np.pi * 2 * (1 - POISSON**2) / YOUNG)
    c = a * np.sqrt(1 - shear / (FRICTION * force))
    peak = 2 * force / (np.pi * a)
    exact = FRICTION * peak * (ellipse(x, a) - c / a * ellipse(x, c))
    assert a == pytest.approx(1.0, abs=2e-3)
    assert c == pytest.approx(0.625, abs=2e-3)
    # Where it sticks (μp − q)² = (μ p0 / a)² (c² − x²): a line over x², fitted, ends at c².
    sticks = contact.status == Status.STICK
    assert np.count_nonzero(sticks) >= 9
    assert contact.count(Status.SLIP) >= 6
    slope, start = np.polyfit(x[sticks] ** 2, (FRICTION * pressure - traction)[sticks] ** 2, 1)
    error = traction - exact
    return Errors(
        float(np.sqrt(-start / slope) / c - 1),
        float(np.sqrt(area @ error**2 / (area @ exact**2))),
        float(area @ np.abs(error) / shear),
        float(pressure[np.argmin(np.abs(x))] / peak - 1),
    )


def test_stick_width_and_traction_converge_to_those_of_cattaneo_and_mindlin(
    record_property: Callable[[str, object], None],
) -> None:
    found = [errors(sheared(n)[1]) for n in SIZES]
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
    pressed, pushed = (state.contact for state in sheared(8))
    largest = pressed.pressure.max()
    tangential = np.abs(pressed.friction_force[:, 0]) / pressed.points.area
    assert np.abs(pushed.friction_force).sum() > 0.5 * FRICTION * pushed.normal_force.sum()
    np.testing.assert_allclose(pushed.pressure, pressed.pressure, rtol=0, atol=2e-3 * largest)
    assert tangential.max() < 5e-3 * FRICTION * largest
