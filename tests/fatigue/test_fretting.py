"""Fretting with bulk tension, the closed form of Nowell and Hills, and what Ruiz' parameters know of size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from fenics_contact import State, Status
from fenics_contact.fatigue import Findley, SmithWatsonTopper, assess_cycle, ruiz_parameters
from tests.fatigue.fretting import MATERIAL, Fretting, fretted

STRAIN, SHEAR, CELL = 4e-5, 6e-4, 1 / 24


@cache
def cycle(scale: float = 1.0, cell: float = CELL) -> Sequence[State]:
    return fretted(STRAIN, scale, cell, SHEAR)


def theory_of(states: Sequence[State], scale: float = 1.0) -> Fretting:
    contact = states[0].contact
    bulk = MATERIAL.young_modulus * STRAIN / (1.0 - MATERIAL.poisson_ratio**2)
    force, shear = float(contact.normal_force.sum()), float(abs(contact.friction_force.sum()))
    return Fretting(2000.0 * scale, force, shear, bulk)


def surface(states: Sequence[State], reach: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """Places of the nodes on the lower surface near the contact, and half the range of σ_xx there."""
    mesh = states[0].scene.bodies["lower"].mesh
    nodes = np.unique(mesh.surfaces["y1"])
    nodes = nodes[np.abs(mesh.points[nodes, 0]) < reach]
    right, left = (state.gather_nodal_stress("lower")[0, nodes, 0, 0] for state in states[:2])
    return mesh.points[nodes, 0], 0.5 * (right - left)


def test_stress_and_stick_zone_are_those_of_nowell_and_hills() -> None:
    states = cycle()
    theory, (x, half) = theory_of(states), surface(cycle())
    assert 0.09 < theory.centre < 0.11
    contact = states[0].contact
    sticks = states[0].contact_places[contact.status == Status.STICK, 0]
    ends = theory.centre - theory.stick, theory.centre + theory.stick
    np.testing.assert_allclose([sticks.min(), sticks.max()], ends, atol=1.1 * CELL)
    corners = np.array([theory.half_width, *ends])  # and those of the other half of the cycle
    away = np.abs(x[:, None] - np.concatenate([corners, -corners])).min(axis=1) > 2.5 * CELL
    error = (half - theory.along(x)) / theory.edge
    assert np.count_nonzero(away) > 20
    assert np.abs(error[away]).max() < 0.01
    assert np.sqrt((error**2).mean()) < 0.025


def test_parameters_behind_the_trailing_edge_are_those_of_the_stress_there() -> None:
    # The free surface has σ_xx and σ_zz = ν σ_xx alone, in proportion, from S to −S: shear amplitude S/2.
    states = cycle()
    theory = theory_of(states)
    found = assess_cycle(states, Findley(0.0), ["lower"], where=behind_edge)
    x, amplitude = found.points["lower"][:, 0], found.planes["lower"].parameter
    there = np.isfinite(amplitude)
    assert 4 <= np.count_nonzero(there) < 20
    np.testing.assert_allclose(amplitude[there], 0.5 * theory.along(x[there]), rtol=0.015)
    swt = assess_cycle(states, SmithWatsonTopper(), ["lower"], where=behind_edge)
    planes, nu = swt.planes["lower"], MATERIAL.poisson_ratio
    # Tension opens planes across it; Δε/2 = (1 − ν²) S/E.
    assert np.abs(planes.normal[there, 0]).min() > 0.99
    half = planes.amplitude[there] * MATERIAL.young_modulus / (1.0 - nu**2)
    np.testing.assert_allclose(half, theory.along(x[there]), rtol=0.02)
    assert "lower" in str(swt)
    assert str(np.nanargmax(planes.parameter)) in str(swt)


def behind_edge(points: np.ndarray) -> np.ndarray:
    """The lower surface left of the contact."""
    return np.asarray((points[:, 0] < -1.1) & (points[:, 0] > -1.5) & (points[:, 1] > -0.01))


def test_what_friction_dissipates_is_the_sum_of_the_first_parameter() -> None:
    # There and back each point that slips dissipates τ δ.
    states = cycle()
    found, area = ruiz_parameters(states, "lower y1"), states[0].contact.area
    work = sum(state.energies.friction for state in states[1:])
    assert 2.0 * area @ found.f1 == pytest.approx(work, rel=0.02)
    edge = found.points[found.f2.argmax(), 0]
    assert edge == pytest.approx(-theory_of(states).half_width, abs=4.0 * CELL)


@pytest.mark.slow
@pytest.mark.claim
def test_contacts_twice_as_large_slip_twice_as_far_under_the_same_stress() -> None:
    """What Nowell and Hills conclude of tests: lives are long below a size of contact at the same stresses.

    Micro-slip is less in small contacts (Wear 136 (1990) 329-343); stresses do not know of the size.
    """
    small, large = ruiz_parameters(cycle(1.0, 1 / 8)), ruiz_parameters(cycle(2.0, 1 / 8))
    np.testing.assert_allclose(large.traction, small.traction, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(large.tension, small.tension, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(large.f2, 2.0 * small.f2, rtol=1e-5, atol=1e-7 * small.f2.max())
    assert small.f2.max() > 0.0
    one, other = (
        assess_cycle(cycle(scale, 1 / 8), SmithWatsonTopper(), ["lower"], where=near(scale)).largest
        for scale in (1.0, 2.0)
    )
    assert one == pytest.approx(other, rel=1e-6)


def near(scale: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda points: np.hypot(*points.T) < 1.3 * scale


@pytest.mark.slow
@pytest.mark.claim
def test_the_peak_at_the_trailing_edge_converges_to_the_closed_form() -> None:
    errors = []
    for cell in (CELL, CELL / 2.0):
        states = cycle(cell=cell)
        (x, half), theory = surface(states), theory_of(states)
        errors.append(np.sqrt(((half - theory.along(x)) ** 2).mean()) / theory.edge)
        assert x[half.argmax()] == pytest.approx(-theory.half_width, abs=1.2 * cell)
    assert errors[1] < 0.5 * errors[0]
    assert half.max() == pytest.approx(theory.edge, rel=0.04)
