"""Contacts known by formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, trapezoid

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory import (
    PointContact,
    contact_modulus,
    hertz_line,
    hertz_point,
    pin_in_hole,
    relative_curvatures,
    roller_relief,
)

#: Semi-axes over those of a circle of the same mean curvature, by the angle whose cosine is the difference of
#: the curvatures over their sum: Timoshenko and Goodier, Theory of elasticity, section 140.
TABLE = [(30, 2.731, 0.493), (45, 1.926, 0.604), (60, 1.486, 0.717), (75, 1.202, 0.845), (90, 1.0, 1.0)]


def sinking(contact: PointContact, modulus: float, place: tuple[float, float]) -> float:
    """Integrate 1 / (π E*) ∫ p / r dA around a place in the ellipse, in polar coordinates."""
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)[:, None]
    t, weight = np.polynomial.legendre.leggauss(60)
    t, weight = (t + 1.0) / 2.0, weight / 2.0
    axes, ray = np.array(contact.semi_axes), np.array([np.cos(angle), np.sin(angle)])
    here, there = np.array(place) / axes, ray / axes[:, None, None]
    square, mixed = (there**2).sum(axis=0), np.tensordot(here, there, 1)
    edge = (np.sqrt(mixed**2 + square * (1.0 - here @ here)) - mixed) / square
    r = edge * (1.0 - t**2)  # the pressure is smooth in t up to the edge
    pressure = contact.pressure(place[0] + r * ray[0], place[1] + r * ray[1])
    along = (pressure * 2.0 * edge * t * weight).sum(axis=1)
    return float(along.mean() * 2.0 / modulus)


@pytest.mark.parametrize("curvatures", [(0.02, 0.02), (0.01, 0.03), (0.2, 0.01)])
def test_the_pressure_closes_the_gap_in_the_ellipse(curvatures: tuple[float, float]) -> None:
    contact = hertz_point(500.0, curvatures, 1e4)
    a, b = contact.semi_axes
    for x, y in ((0.0, 0.0), (0.7 * a, 0.0), (0.0, 0.7 * b), (0.5 * a, -0.6 * b)):
        gap = curvatures[0] * x**2 / 2.0 + curvatures[1] * y**2 / 2.0
        assert gap < 0.9 * contact.approach
        assert sinking(contact, 1e4, (x, y)) + gap == pytest.approx(contact.approach, rel=1e-8)


@pytest.mark.parametrize(("degrees", "long", "short"), TABLE)
def test_semi_axes_are_those_of_the_published_table(degrees: float, long: float, short: float) -> None:
    cosine = np.cos(np.radians(degrees))
    contact = hertz_point(7.0, (1.0 - cosine, 1.0 + cosine), 30.0)
    circle = (3.0 * 7.0 / (4.0 * 30.0)) ** (1.0 / 3.0)
    assert contact.semi_axes[0] / circle == pytest.approx(long, abs=1e-3)
    assert contact.semi_axes[1] / circle == pytest.approx(short, abs=1e-3)


def test_two_links_of_a_chain_touch_in_a_circle() -> None:
    steel = contact_modulus(2.1e5, 0.3, 2.1e5, 0.3)
    spot = hertz_point(80e3, (1.0 / 49.45, 1.0 / 49.45), steel)
    assert spot.semi_axes == pytest.approx((2.952, 2.952), abs=5e-4)
    assert spot.peak_pressure == pytest.approx(4384.0, abs=1.0)
    assert spot.area == pytest.approx(27.4, abs=0.05)
    assert spot.approach == pytest.approx(spot.semi_axes[0] ** 2 / 49.45)


@pytest.mark.parametrize("ratio", [1.0, 1.0 + 1e-15, 1.0 + 1e-10, 1.001, 50.0, 1e6, 1e12])
def test_pressure_balances_the_force_whatever_the_slenderness(ratio: float) -> None:
    contact = hertz_point(3.0, (1.0, ratio), 2.0)
    assert 2.0 / 3.0 * contact.peak_pressure * contact.area == pytest.approx(3.0)
    assert contact.semi_axes[0] >= contact.semi_axes[1]
    turned = hertz_point(3.0, (ratio, 1.0), 2.0)
    assert turned.semi_axes == contact.semi_axes[::-1]


def test_a_slender_ellipse_is_a_strip_in_its_middle() -> None:
    contact = hertz_point(3.0, (1e-9, 1.0), 2.0)
    force_there = np.pi / 2.0 * contact.peak_pressure * contact.semi_axes[1]
    strip = hertz_line(force_there, 1.0, 2.0)
    assert contact.semi_axes[1] == pytest.approx(strip.half_width, rel=1e-6)
    assert contact.peak_pressure == pytest.approx(strip.peak_pressure, rel=1e-6)


def test_the_pressure_of_a_strip_balances_the_force() -> None:
    contact = hertz_line(40.0, 0.1, 1000.0)
    x = np.linspace(-1.5, 1.5, 200_001) * contact.half_width
    assert trapezoid(contact.pressure(x), x) == pytest.approx(40.0, rel=1e-6)
    assert contact.pressure(np.zeros(1)) == pytest.approx(contact.peak_pressure)
    # Johnson (4.45): p0² = F E* κ / π
    assert contact.peak_pressure == pytest.approx(np.sqrt(40.0 * 1000.0 * 0.1 / np.pi))


def test_the_modulus_is_that_of_both_bodies() -> None:
    assert contact_modulus(2.1e5, 0.3, 2.1e5, 0.3) == pytest.approx(2.1e5 / 1.82)
    assert contact_modulus(7e4, 0.33, np.inf, 0.0) == pytest.approx(7e4 / (1.0 - 0.33**2))
    assert contact_modulus(1.0, 0.5, 3.0, 0.0) == pytest.approx(1.0 / (0.75 + 1.0 / 3.0))


def test_relative_curvatures_add_and_turn() -> None:
    link = (1.0 / 9.0, -1.0 / 11.0)
    assert relative_curvatures(link, link) == pytest.approx((-2.0 / 11.0, 2.0 / 9.0))
    assert relative_curvatures(link, link, np.pi / 2.0) == pytest.approx(2 * (2.0 / 99.0,))
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    both = np.diag([0.3, 0.1]) + turn @ np.diag([0.2, 0.5]) @ turn.T
    expected = np.linalg.eigvalsh(both)
    assert relative_curvatures((0.3, 0.1), (0.2, 0.5), angle) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        (hertz_point, (0.0, (1, 1), 1), "force must be positive, got 0.0"),
        (hertz_point, (1.0, (1, -1), 1), r"curvatures\[0\] must be positive, got -1"),
        (hertz_point, (1.0, (1, 1), None), "modulus must be a finite number, got None"),
        (hertz_point, (1.0, (1,), 1), "curvatures must be two relative curvatures, got 1"),
        (hertz_point, (1.0, (1e-13, 1), 1), "must differ by less than 1e"),
        (hertz_line, (1.0, np.nan, 1), "curvature must be a finite number, got nan"),
        (contact_modulus, (1.0, 0.3, 0.0, 0.3), "young_2 must be positive, got 0.0"),
        (contact_modulus, (1.0, 0.6, 1.0, 0.3), "poisson_1 must lie between -1 and 1/2, got 0.6"),
        (relative_curvatures, ((1,), (1, 1)), "first must be two principal curvatures, got 1"),
        (relative_curvatures, ((1, 1), (1, "2")), r"second\[1\] must be a finite number, got '2'"),
    ],
)
def test_what_no_formula_takes_is_refused(function: Any, arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        function(*arguments)


# The pin in a hole fulfils the contact conditions, written down a second time as Fourier series.
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
        ({"clearance": -0.1}, "clearance must lie between 0 and 1, got -0.1"),
        ({"clearance": 2.0}, "got 2.0: use hertz_line"),
        ({"force": -1.0}, "force must be positive, got -1.0"),
        ({"radius": np.inf}, "radius must be a finite number, got inf"),
    ],
)
def test_what_is_no_pin_in_a_hole_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        pin_in_hole(**{"force": 1.0, "radius": RADIUS, "clearance": 0.1, "modulus": MODULUS, **change})


# The relief of rollers: published closed forms, and an integral over the half space by other means.
def test_under_a_line_it_is_that_of_lundberg() -> None:
    found = roller_relief(np.array([0.0, -0.5, 0.9, 0.99, 1.0]), 2.0)
    np.testing.assert_allclose(found, [0.0, 0.2876821, 1.6607312, 3.9170354, np.inf], rtol=1e-6)


@pytest.mark.parametrize("half_length", [10.0, 50.0])
def test_under_a_strip_the_end_sinks_as_johns_and_gohar_found(half_length: float) -> None:
    (end,) = roller_relief(np.array([half_length]), 2.0 * half_length, 1.0)
    assert end == pytest.approx(1.1932 + np.log(half_length), rel=1e-3)


@pytest.mark.parametrize("place", [0.5, 0.9, 0.99])
def test_it_is_an_integral_over_the_half_space(place: float) -> None:
    half, b = 3.0, 0.3

    def sunk(y: float) -> float:
        """∫ p / r over the strip for p0 = 1, across first."""

        def along(x: float) -> float:
            return float(np.arcsinh((half - y) / x) + np.arcsinh((half + y) / x))

        return 2.0 * quad(lambda x: np.sqrt(1.0 - (x / b) ** 2) * along(x), 0.0, b)[0]

    wanted = (sunk(0.0) - sunk(place * half)) / (np.pi * b / 2)
    assert roller_relief(np.array([place * half]), 2 * half, b)[0] == pytest.approx(wanted, rel=1e-6)


def test_a_relief_is_a_clearance_that_pairs_take_as_their_gap() -> None:
    relief = roller_relief(np.linspace(-5.0, 5.0, 11), 10.0, 0.10601941747572816)
    assert relief.min() == relief[5] == 0.0, "not minus a rounding error"


def test_places_beyond_the_ends_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"position must be within 1 of the middle, got 1\.5"):
        roller_relief(np.array([0.0, 1.5]), 2.0)
    with pytest.raises(InvalidInputError, match="half_width"):
        roller_relief(np.array([0.0]), 2.0, 0.0)
