"""The demo of a relieved tooth runs, and leaves files from which the tooth can be made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fenics_contact.io import read_result
from fenics_contact.mesh_io import read_cad
from fenics_contact.scene import read_field

ROOT = Path(__file__).parents[2]


def test_a_relieved_tip_has_less_pressure_and_the_tooth_is_a_cad_file(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    mpirun(ROOT / "demos" / "demo_tooth_flank.py", 1, timeout=120.0)
    output = tmp_path / "output" / "tooth_flank"
    more = read_result(output)["more"]
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
