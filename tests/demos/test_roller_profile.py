"""The roller finds an even pressure, Lundberg's profile, and one that bears a tilt."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


def run(demo: Callable[..., Any], ranks: int, *size: str) -> dict[str, Any]:
    """Run the demo; return what its result holds beside the optimisation."""
    result, output, printed = demo("roller_profile", *size, ranks=ranks, timeout=500.0)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    assert {path.stem for path in output.glob("*.png")} == {"profile", "pressure", "tilted"}
    assert min(path.stat().st_size for path in output.glob("*.png")) > 10_000
    more: dict[str, Any] = result["more"]
    return more


@pytest.mark.slow
def test_a_coarse_roller_is_relieved_at_its_ends_and_more_so_where_it_tilts(
    demo: Callable[..., Any],
) -> None:
    more = run(demo, 1, "--size", "small")
    assert more["cases"]["straight"]["parallel"] == pytest.approx(4.452, rel=1e-3)
    assert max(more["peaks"].values()) < 1.1
    assert more["cases"]["two loads"]["tilted"] < 0.5 * more["cases"]["one load"]["tilted"]


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.claim), 2])
def test_two_starts_end_with_even_pressure_and_lundbergs_profile(
    ranks: int, demo: Callable[..., Any]
) -> None:
    more = run(demo, ranks)
    first, second = more["peaks"].values()
    assert first == pytest.approx(second, rel=1e-3)
    assert max(first, second) < 1.03 < more["peak_lundberg"]
    for errors in more["errors"].values():
        assert max(map(abs, errors)) < 0.05
    assert max(more["evaluations"].values()) <= 45
    assert max(more["cases"]["two loads"].values()) < 0.5 * more["cases"]["one load"]["tilted"]


def test_an_unknown_size_is_refused(demo: Callable[..., Any]) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"--size must be small or full, got 'huge'"):
        demo("roller_profile", "--size", "huge")
