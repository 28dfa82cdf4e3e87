"""The pin in a hole fulfils the contact conditions, written down a second time as Fourier series."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory import hertz_line, pin_in_hole

RADIUS, MODULUS = 10.0, 1e5
PLACES = 2**17


def opening(pressure: np.ndarray) -> np.ndarray:
    """Return how far pressure of an even function of the angle parts hole and pin, but for a translation.

    A pressure p cos nθ does so by 2 n / (n² − 1) R p / E* cos nθ, a constant one by R p / E* (elastic disc
    and infinite plate with a hole, plane strain).
    """
    modes = np.fft.rfft(pressure)
    n = np.arange(modes.size)
    compliance = np.zeros(modes.size)
    compliance[0], compliance[2:] = 1.0, 2.0 * n[2:] / (n[2:] ** 2 - 1.0)
    return np.fft.irfft(compliance * modes, pressure.size) * RADIUS / MODULUS


@pytest.mark.parametrize(("force", "degrees"), [(10.0, 2), (1e3, 20), (1e4, 50), (1e6, 84)])
def test_the_gap_is_closed_in_the_contact_and_open_beside_it(force: float, degrees: float) -> None:
    clearance = 0.02
    contact = pin_in_hole(force, RADIUS, clearance, MODULUS)
    assert np.degrees(contact.half_angle) > degrees
    angle = 2.0 * np.pi * np.arange(PLACES) / PLACES
    angle = np.where(angle > np.pi, angle - 2.0 * np.pi, angle)
    pressure = contact.pressure(angle)
    assert np.sum(pressure * np.cos(angle)) * RADIUS * 2.0 * np.pi / PLACES == pytest.approx(force, rel=1e-5)
    inside = np.abs(angle) < 0.99 * contact.half_angle
    parted = opening(pressure) + clearance
    approach = parted[inside] @ np.cos(angle[inside]) / np.sum(np.cos(angle[inside]) ** 2)
    gap = parted - approach * np.cos(angle)
    scale = np.ptp(parted[inside])
    assert np.abs(gap[inside]).max() < 1e-4 * scale
    assert gap[np.abs(angle) > 1.05 * contact.half_angle].min() > 1e-4 * scale
    assert pressure[inside].min() > 0.0


def test_a_loose_pin_touches_as_hertz_has_it() -> None:
    clearance = 0.5
    contact = pin_in_hole(1.0, RADIUS, clearance, MODULUS)
    strip = hertz_line(1.0, clearance / RADIUS**2, MODULUS)
    assert RADIUS * contact.half_angle == pytest.approx(strip.half_width, rel=1e-4)
    assert contact.peak_pressure == pytest.approx(strip.peak_pressure, rel=1e-4)
    x = np.linspace(-0.9, 0.9, 7) * strip.half_width
    assert contact.pressure(x / RADIUS) == pytest.approx(strip.pressure(x), rel=1e-3)


def test_a_pin_without_clearance_touches_on_one_arc_whatever_its_load() -> None:
    arcs = [np.degrees(pin_in_hole(force, RADIUS, 0.0, MODULUS).half_angle) for force in (1.0, 1e5)]
    assert arcs == pytest.approx([84.83, 84.83], abs=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"clearance": -0.1}, "clearance must lie between 0 and a tenth of the radius 10.0, got -0.1"),
        ({"clearance": 2.0}, "got 2.0: take hertz_line for a loose pin"),
        ({"force": -1.0}, "force must be positive, got -1.0"),
        ({"radius": np.inf}, "radius must be a finite number, got inf"),
    ],
)
def test_what_is_no_pin_in_a_hole_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        pin_in_hole(**{"force": 1.0, "radius": RADIUS, "clearance": 0.1, "modulus": MODULUS, **change})
