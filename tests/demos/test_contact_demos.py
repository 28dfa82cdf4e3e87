"""The demos without optimisation: each runs, asserts its own number, and prints the same on two ranks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.demos.running import DEMOS, assert_files, numbers

Run = Callable[[str, int], tuple[str, Path]]
RANKS = [1, 2]


@pytest.fixture
def demo(mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return ``demo(name, ranks)``: what it printed, and the folder with its files."""
    monkeypatch.chdir(tmp_path)

    def run(name: str, ranks: int) -> tuple[str, Path]:
        return mpirun(DEMOS / f"demo_{name}.py", ranks, timeout=200.0), tmp_path / "output" / name

    return run


@pytest.mark.parametrize("ranks", RANKS)
def test_hertz_finds_the_analytic_pressure_with_mortar_and_misses_it_with_nodes(
    demo: Run, ranks: int
) -> None:
    printed, output = demo("hertz_sphere", ranks)
    peak, radius = numbers(printed, "Hertz")
    found, peak_error, found_radius, radius_error = numbers(printed, "mortar")
    assert found == pytest.approx(7287.7, abs=0.5)
    assert (found / peak - 1, found_radius / radius - 1) == pytest.approx(
        (peak_error / 100, radius_error / 100), abs=2e-4
    )
    assert abs(peak_error) < 2 < numbers(printed, "node")[1]
    assert "tangential" not in printed
    assert_files(output, ["stress", "pressure", "curve"])


@pytest.mark.parametrize("ranks", RANKS)
def test_the_bolted_joint_slides_at_the_closed_formula(demo: Run, ranks: int) -> None:
    printed, output = demo("bolted_joint", ranks)
    pull, clamping, ratio, stick, slip = numbers(printed, "0.110")
    assert ratio == pytest.approx(pull / (2 * 0.3 * clamping), abs=1e-4)
    assert (pull, clamping) == pytest.approx((15932.4, 26459.1), abs=2.0)
    assert (stick, slip > 50) == (0, True)
    before = numbers(printed, "0.020")
    assert before[2] < 0.5
    assert before[3] > 50
    assert "4 pairs have a friction coefficient above zero" in printed
    assert_files(output, ["stress", "pressure_tightened", "pressure_sliding", "curve"])


@pytest.mark.parametrize("ranks", RANKS)
def test_every_contact_of_five_links_carries_the_whole_pull(demo: Run, ranks: int) -> None:
    printed, output = demo("five_links", ranks)
    for number in range(1, 5):
        force, stick, slip = numbers(printed, f"link {number} to link {number + 1}")
        assert force == pytest.approx(40e3, rel=1e-6)
        assert stick > 0
        assert slip > 0
    moved = numbers(printed, "mean displacement of the links")
    assert moved == pytest.approx([0.0205, 0.1415, 0.2799, 0.4184, 0.5539], abs=1e-4)
    assert_files(output, ["stress", "pressure", "decomposition"])


@pytest.mark.parametrize("ranks", RANKS)
def test_a_model_of_ones_own_equals_the_package_s_and_feels_the_fibres(demo: Run, ranks: int) -> None:
    printed, output = demo("orthotropic", ranks)
    long, short = numbers(printed, "half axes of patch")
    assert long > 1.15 * short > 1.0
    assert numbers(printed, "long axis to fibres")[0] == pytest.approx(90, abs=3)
    assert numbers(printed, "own model against the package's")[0] < 1e-6
    assert_files(output, ["stress", "pressure"])
