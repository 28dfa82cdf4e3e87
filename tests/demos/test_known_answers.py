"""The demos with known answers find the same numbers on one rank and on two, and leave pictures and files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact import read_cad, read_field

#: Of each demo: what its result holds, on any number of ranks, and its pictures. That the numbers are those
#: of theory is for the demos to assert; they end with an error otherwise.
DEMOS: dict[str, tuple[dict[str, float | list[float]], set[str]]] = {
    "punch_2d": (
        {"force": 1248.70, "half_width": 1.15780, "peak_pressure": 683.659},
        {"hertz", "stress", "pressure", "decomposition"},
    ),
    "cattaneo_mindlin": (
        {"stick_half_width": [0.811537, 0.613885, 0.381714], "shear_amplitude": 0.100768},
        {"traction", "contact", "stress", "fatigue"},
    ),
    "shrink_fit": (
        {"pressure": 58.9595, "torque_limit": 33340.8},
        {"torque", "stress_fitted", "stress_turned", "contact", "decomposition"},
    ),
    "press_fit_edge": (
        {"pressure": 115.162, "straight_peak": 327.275, "relieved_peak": 128.28, "force": 0.975},
        {"pressure", "stress_straight", "stress_relieved"},
    ),
    "patch_test": ({}, {"node", "mortar"}),
    "sheared_block": (
        {"plateau_over_bound": [0.992253, 0.999573, 0.999655], "dissipated_energy": 162.774},
        {"loop", "status", "stress"},
    ),
    "hertz_sphere": (
        {"peak_pressure": 7277.51, "radius": 0.991468},
        {"stress", "pressure", "curve", "error", "meshes"},
    ),
    "bolted_joint": (
        {
            "pull": [-897.4, 4483.2, 9620.6, 14232.3, 15517.6, 15599.6],
            "bolt_force": [27000.0, 26691.7, 26389.7, 26107.9, 25948.4, 25904.7],
        },
        {"stress", "pressure_tightened", "pressure_sliding", "curve"},
    ),
    "five_links": (
        {"forces": [40e3] * 4, "displacements": [0.020809, 0.218564, 0.434406, 0.650243, 0.862551]},
        {"stress", "pressure", "decomposition"},
    ),
    "uncertain_friction": (
        {"slide": 7, "largest_pressure_median": 2384.37, "largest_pressure_95": 2571.78},
        {"samples", "distribution", "stress"},
    ),
    "tooth_flank": (
        {"pitch_peak": 928.86, "unrelieved_peak": 3341.70, "finer_unrelieved_peak": 3922.45},
        {"before_after", "stress"},
    ),
    "worn_bush": (
        {"volume": 1.4535, "depth": 0.092449, "new_pressure": 46.2801, "life": 21952.2},
        {"depth", "pressure", "stress"},
    ),
    "power_module": (
        {"chip": [85.4034, 80.0862, 75.2802, 73.197], "hottest": 77.3009, "joint_resistance": 0.0437162},
        {"temperature", "flux", "jump", "pressure"},
    ),
    "orthotropic": (
        {"force": 1849.15, "half_axes": [3.20134, 2.71753], "angle": 89.153},
        {"stress", "pressure"},
    ),
}


def has_a_relieved_bore(more: dict[str, Any], output: Path) -> None:
    """It has no peak and keeps its force."""
    assert more["pressure"] == pytest.approx(more["pressure_theory"], rel=0.01)
    growth = more["finer_straight_peak"] / more["straight_peak"]
    assert growth == pytest.approx(more["growth_theory"], rel=0.01)
    assert more["growth_theory"] == pytest.approx(2.0**0.2261, rel=1e-4)
    assert more["finer_relieved_peak"] == pytest.approx(more["relieved_peak"], rel=0.01)
    assert more["relieved_peak"] < 1.15 * more["pressure_theory"]
    relief = read_field(output / "relief.csv", "movement").values
    assert (np.diff(relief) < 1e-9).all(), "it grows towards the end"
    assert (relief[0], relief[-1]) == pytest.approx((0.0, -0.006), abs=1e-9)


def has_a_relieved_tip(more: dict[str, Any], output: Path) -> None:
    """It has less pressure, and the tooth is a CAD file."""
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


RELIEVED = {"press_fit_edge": has_a_relieved_bore, "tooth_flank": has_a_relieved_tip}
#: Many states.
SLOW = {"uncertain_friction"}
#: Claims rest on two ranks, and on one rank once; demos of large deformations are run on one.
CLAIMS = {*((name, 2) for name in DEMOS if name not in SLOW), ("punch_2d", 1)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        pytest.param(name, ranks, marks=[pytest.mark.claim] if (name, ranks) in CLAIMS else [])
        for name in DEMOS
        for ranks in (1, 2)
    ],
)
def test_a_demo_finds_its_number_on_one_rank_and_on_two(
    name: str, ranks: int, demo: Callable[..., Any]
) -> None:
    numbers, pictures = DEMOS[name]
    result, output, printed = demo(name, ranks=ranks)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    assert ("1 rank\n" if ranks == 1 else "2 ranks\n") in printed
    assert (output.name, result["ranks"]) == (name, ranks)
    for key, value in numbers.items():
        np.testing.assert_allclose(result["more"][key], value, rtol=2e-4, err_msg=key)
    assert {path.stem for path in output.glob("*.png")} == pictures
    assert min(path.stat().st_size for path in output.glob("*.png")) > 10_000
    assert list(output.rglob("*.vtm"))
    if name in RELIEVED:
        RELIEVED[name](result["more"], output)
