"""Hertz: a ball and a cylinder on a rigid plane, without friction, against the analytic pressure.

Both are pressed by a total force for which the contact ends at a node of the coarsest mesh, hence at one of
every finer mesh: errors then fall smoothly. The contact is small beside the body (1 % to 5 % of its radius),
so that the half space of the theory is a good model. Peak pressure is the nodal force over the nodal area at
the first point of contact. The radius of contact comes from the second moment of the nodal forces λ_i at
distance r_i, which for the pressure p0 √(1 − r²/a²) is Σ λ_i r_i² / Σ λ_i = 2a²/5 (ball) or a²/4 (cylinder):
unlike the area of the closed nodes it does not jump by whole cells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fenics_contact.gallery import half_cylinder, hemisphere
from tests.contact.hertz import LENGTH, PLANE_STRAIN, Hertz, cylinder, edge, errors, pressed


def ball(radius: float) -> Hertz:
    force = 4 * PLANE_STRAIN * radius**3 / 3
    return Hertz(radius, 3 * force / (2 * np.pi * radius**2), force)


def ball_errors(n: int, *, grading: float) -> tuple[float, float]:
    theory = ball(edge(grading))
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    state = pressed(hemisphere(1.0, n, grading=grading), guides, theory.force / 4)
    assert state.contact.normal_force.sum() == pytest.approx(theory.force / 4, rel=1e-9)
    return errors(state, theory, (0, 1), 2 / 5)


def cylinder_errors(n: int, *, grading: float) -> tuple[float, float]:
    theory = cylinder(edge(grading))
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "y1": (None, 0.0, None)}
    state = pressed(half_cylinder(1.0, LENGTH, n, grading=grading), guides, theory.force * LENGTH / 2)
    assert state.contact.normal_force.sum() == pytest.approx(theory.force * LENGTH / 2, rel=1e-9)
    return errors(state, theory, (0,), 1 / 4)


def table(name: str, sizes: Sequence[int], found: np.ndarray) -> np.ndarray:
    """Print errors and rates of peak and radius; return the rates, (n − 1, 2)."""
    refinement = np.log(np.array(sizes[1:]) / np.array(sizes[:-1]))
    rates = np.log(np.abs(found[:-1] / found[1:])) / refinement[:, None]
    print(f"\n{name}: cells to the edge | error of peak pressure, rate | error of contact radius, rate")
    for n, error, rate in zip(sizes, found, np.vstack([[np.nan] * 2, rates]), strict=True):
        print(f"  {n:3d} | {error[0]:+.5f} {rate[0]:5.2f} | {error[1]:+.5f} {rate[1]:5.2f}")
    return rates


def assert_falling(found: np.ndarray) -> None:
    assert np.all(np.abs(found[1:]) < np.abs(found[:-1]))


def test_a_cylinder_converges_to_the_pressure_of_hertz() -> None:
    sizes = (4, 8, 16, 32)
    found = np.array([cylinder_errors(n, grading=5.0) for n in sizes])
    rates = table("cylinder", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.005
    assert np.all(rates[:, 1] > 1.5)  # the radius, by second moment, converges at second order
    assert np.abs(found[0]).min() > 0.05, "the coarsest mesh is too good to show convergence"


def test_a_ball_converges_to_the_pressure_of_hertz() -> None:
    sizes = (4, 8, 12)
    found = np.array([ball_errors(n, grading=3.0) for n in sizes])
    rates = table("ball", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.015
    assert rates.min() > 1.0
    assert np.abs(found[0]).min() > 0.05, "the coarsest mesh is too good to show convergence"


@pytest.mark.slow
def test_a_ball_converges_further_on_a_fine_mesh() -> None:
    sizes = (4, 8, 16)
    found = np.array([ball_errors(n, grading=4.0) for n in sizes])
    rates = table("ball, fine", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.01
    assert rates.min() > 1.0
