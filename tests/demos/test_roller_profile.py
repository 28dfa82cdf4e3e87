"""The roller finds an even pressure, Lundberg's profile, and one that bears a tilt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fenics_contact.io import read_result

DEMO = Path(__file__).parents[2] / "demos" / "demo_roller_profile.py"


def run(mpirun: Callable[..., str], folder: Path, ranks: int, *size: str) -> dict[str, Any]:
    """Run the demo in a folder; return what its result holds beside the optimisation."""
    printed = mpirun(DEMO, ranks, *size, timeout=500.0)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    output = folder / "output" / "roller_profile"
    assert {path.stem for path in output.glob("*.png")} == {"profile", "pressure", "tilted"}
    assert min(path.stat().st_size for path in output.glob("*.png")) > 10_000
    more: dict[str, Any] = read_result(output)["more"]
    return more


@pytest.mark.slow
@pytest.mark.claim
def test_a_coarse_roller_is_relieved_at_its_ends_and_more_so_where_it_tilts(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    more = run(mpirun, tmp_path, 1, "--size", "small")
    assert more["cases"]["straight"]["parallel"] == pytest.approx(4.452, rel=1e-3)
    assert max(more["peaks"].values()) < 1.1
    assert more["cases"]["two loads"]["tilted"] < 0.5 * more["cases"]["one load"]["tilted"]


@pytest.mark.slow
@pytest.mark.claim
def test_two_starts_end_with_even_pressure_and_lundbergs_profile(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    more = run(mpirun, tmp_path, 2)
    first, second = more["peaks"].values()
    assert first == pytest.approx(second, rel=1e-3)
    assert max(first, second) < 1.03 < more["peak_lundberg"]
    for errors in more["errors"].values():
        assert max(map(abs, errors)) < 0.05
    assert max(more["evaluations"].values()) <= 45
    assert max(more["cases"]["two loads"].values()) < 0.5 * more["cases"]["one load"]["tilted"]


def test_an_unknown_size_is_refused(mpirun: Callable[..., str]) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"--size must be small or full, got 'huge'"):
        mpirun(DEMO, 1, "--size", "huge")
