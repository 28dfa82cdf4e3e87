"""The demos with known answers find the same numbers on one rank and on two, and leave pictures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

#: Of each demo: what its result holds, on any number of ranks, and its pictures. That the numbers are those
#: of theory is for the demos to assert; they end with an error otherwise.
DEMOS: dict[str, tuple[dict[str, float | list[float]], set[str]]] = {
    "punch_2d": (
        {"force": 1248.70, "half_width": 1.15780, "peak_pressure": 683.659},
        {"hertz", "stress", "pressure", "decomposition"},
    ),
    "cattaneo_mindlin": (
        {"stick_half_width": [0.811537, 0.613885, 0.381714]},
        {"traction", "contact", "stress"},
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
        {"stress", "pressure", "curve", "error"},
    ),
    "bolted_joint": (
        {
            "pull": [-916.4, 4462.9, 9606.9, 14259.4, 15827.3, 15932.4],
            "bolt_force": [27576.2, 27267.6, 26966.4, 26686.9, 26508.3, 26459.1],
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
    "orthotropic": (
        {"force": 1849.15, "half_axes": [3.20134, 2.71753], "angle": 89.153},
        {"stress", "pressure"},
    ),
}

#: Many states.
SLOW = {"uncertain_friction"}
#: One in the plane and one in space run alone, too; `test_reliefs` has two more, the slow tests all.
ALONE = {"punch_2d", "hertz_sphere"}
CLAIMS = {*((name, 2) for name in DEMOS if name not in SLOW), *((name, 1) for name in ALONE)}


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
