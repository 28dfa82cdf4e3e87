"""The demos of a relieved hub and a relieved tooth run, and leave files from which both can be made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fenics_contact import read_cad, read_field

#: Takes long: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]


def test_a_relieved_bore_has_no_peak_and_keeps_its_force(demo: Callable[..., Any]) -> None:
    result, output, _ = demo("press_fit_edge")
    more = result["more"]
    assert more["pressure"] == pytest.approx(more["pressure_theory"], rel=0.01)
    growth = more["finer_straight_peak"] / more["straight_peak"]
    assert growth == pytest.approx(more["growth_theory"], rel=0.01)
    assert more["growth_theory"] == pytest.approx(2.0**0.2261, rel=1e-4)
    assert more["finer_relieved_peak"] == pytest.approx(more["relieved_peak"], rel=0.01)
    assert more["relieved_peak"] < 1.15 * more["pressure_theory"]
    relief = read_field(output / "relief.csv", "movement").values
    assert (np.diff(relief) < 1e-9).all(), "it grows towards the end"
    assert (relief[0], relief[-1]) == pytest.approx((0.0, -0.006), abs=1e-9)


def test_a_relieved_tip_has_less_pressure_and_the_tooth_is_a_cad_file(demo: Callable[..., Any]) -> None:
    result, output, _ = demo("tooth_flank")
    more = result["more"]
    assert more["pitch_peak"] == pytest.approx(more["pitch_peak_hertz"], rel=0.01)
    assert more["relieved_peaks"]["half torque"] < 0.8 * more["relieved_peak"]
    relief = read_field(output / "relief.csv", "movement").values
    assert relief[0] == 0.0
    assert (np.diff(relief) <= 0).all(), "it grows towards the tip"
    assert relief[-1] == pytest.approx(-0.04)
    (tooth,) = read_cad(output / "wheel_tooth.step", 0.5).values()
    designed = next(shape for shape in tooth.shapes.values() if type(shape).__name__ == "SplinePatch")
    points = [read_field(output / "relief.csv", f"{axis}_moved").values for axis in "xy"]
    assert np.abs(designed.distance(np.column_stack(points)[1:-1])).max() < 1e-6
