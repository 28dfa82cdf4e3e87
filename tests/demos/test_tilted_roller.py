"""Profiles of a tilted roller: by formula, and the best found, of all tilts and of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_profile_found_for_all_tilts_outlives_those_by_formula(
    ranks: int, demo: Callable[..., Any]
) -> None:
    result, output, printed = demo("tilted_roller", "--size", "small", ranks=ranks, timeout=500.0)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    pictures = {path.stem: path for path in output.glob("*.png")}
    assert set(pictures) == {"profile", "life"}
    assert min(path.stat().st_size for path in pictures.values()) > 10_000
    more = result["more"]
    life, largest, lives = more["life"], more["largest"], more["lives"]
    known = {"straight": 0.010309, "ISO/TS 16281": 0.483, "three parameters": 0.615}
    for name, value in known.items():
        assert life[name] == pytest.approx(value, rel=2e-3), name
    assert life["ours"] == pytest.approx(0.620, rel=2e-3)
    assert largest["straight"]["3′"] == pytest.approx(4.842, rel=1e-3)
    for tilt, best in lives["best at one tilt"].items():
        assert best > max(lives[name][tilt] for name in (*known, "ours", "ours, below ISO"))
        assert lives["ours, below ISO"][tilt] > 1.06 * lives["ISO/TS 16281"][tilt]
        assert largest["ours, below ISO"][tilt] < 0.99 * largest["ISO/TS 16281"][tilt]
    assert more["evaluations"]["ours"] <= 25
    assert more["gradient"] < 1e-3


def test_an_unknown_size_is_refused(demo: Callable[..., Any]) -> None:
    with pytest.raises(pytest.fail.Exception, match="give --size small or --size full, got --size huge"):
        demo("tilted_roller", "--size", "huge")
