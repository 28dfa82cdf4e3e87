"""The dovetail of a blade: peaks at the edges of its flanks, and crowns that take them away."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

#: Peaks at full speed of the flat flank, by quadratic cells that are halved once more at its edges, N/mm².
FLAT = {"μ = 0": 966.6, "μ = 0.4": 681.3}


def check_peaks(more: dict[str, Any]) -> None:
    """Peaks are known to 1 %, agree with the graded meshes, and crowns make them far smaller."""
    table = more["table"]
    assert all(row["reached"] for row in table.values())
    assert all(
        e <= 0.01 * p for row in table.values() for p, e in zip(row["peak"], row["error"], strict=True)
    )
    for name, value in FLAT.items():
        peaks = [table[f"{name}, {shape}"]["peak"][0] for shape in ("flat", "best arc", "ours")]
        assert peaks[0] == pytest.approx(value, rel=0.01), name
        assert peaks[0] > 2.5 * peaks[1] > 2.5 * 1.05 * peaks[2]
    assert table["μ = 0, ours"]["peak"][0] == pytest.approx(248.0, rel=0.02)
    assert table["μ = 0.4, ours"]["peak"][0] == pytest.approx(198.0, rel=0.02)
    sped, slowed = table["μ = 0.4, flat"]["peak"]
    assert slowed == pytest.approx(746.0, rel=0.01), "friction holds the flanks where they were pressed"
    assert slowed > 1.07 * sped
    row = table["μ = 0.4, ours"]
    assert row["slowed"] < row["peak"][0]
    assert 0.6 < row["pressed"][1] / row["pressed"][0] < 0.7, "of 30 % of the load"
    assert row["findley"] < 0.5 * table["μ = 0.4, flat"]["findley"]
    assert max(max(counts) for counts in more["evaluations"].values()) <= 30
    assert max(more["gradient"].values()) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_crown_takes_away_two_thirds_of_the_pressure_of_edges(ranks: int, demo: Callable[..., Any]) -> None:
    result, output, printed = demo("dovetail", "--size", "small", ranks=ranks, timeout=500.0)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    pictures = {path.stem: path for path in output.glob("*.png")}
    assert set(pictures) == {"pressure_0", "pressure_1", "crown", "stress"}
    assert min(path.stat().st_size for path in pictures.values()) > 10_000
    check_peaks(result["more"])


@pytest.mark.claim
def test_peaks_of_edges_are_those_of_graded_quadratic_cells(demo: Callable[..., Any]) -> None:
    result, _, _ = demo("dovetail", "--size", "full", timeout=900.0)
    more = result["more"]
    check_peaks(more)
    for name, value in more["graded"].items():
        peak, error = (more["table"][f"{name}, flat"][key][0] for key in ("peak", "error"))
        assert value == pytest.approx(FLAT[name], rel=3e-3), name
        assert abs(peak - value) < error + 3e-3 * value, name


def test_an_unknown_size_is_refused(demo: Callable[..., Any]) -> None:
    with pytest.raises(pytest.fail.Exception, match="give --size small or --size full, got --size huge"):
        demo("dovetail", "--size", "huge")
