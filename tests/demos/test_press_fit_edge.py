"""The demo of a relieved hub runs, and leaves a table from which the bore can be ground."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fenics_contact.io import read_result
from fenics_contact.scene import read_field

ROOT = Path(__file__).parents[2]


def test_a_relieved_bore_has_no_peak_and_keeps_its_force(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    mpirun(ROOT / "demos" / "demo_press_fit_edge.py", 1, timeout=120.0)
    output = tmp_path / "output" / "press_fit_edge"
    more = read_result(output)["more"]
    assert more["pressure"] == pytest.approx(more["pressure_theory"], rel=0.01)
    growth = more["finer_straight_peak"] / more["straight_peak"]
    assert growth == pytest.approx(more["growth_theory"], rel=0.01)
    assert more["growth_theory"] == pytest.approx(2.0**0.2261, rel=1e-4)
    assert more["finer_relieved_peak"] == pytest.approx(more["relieved_peak"], rel=0.01)
    assert more["relieved_peak"] < 1.15 * more["pressure_theory"]
    relief = read_field(output / "relief.csv", "movement").values
    assert (np.diff(relief) < 1e-9).all(), "it grows towards the end"
    assert (relief[0], relief[-1]) == pytest.approx((0.0, -0.006), abs=1e-9)
