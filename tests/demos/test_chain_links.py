"""The demo runs from its first line to its last, on two ranks and on one, and leaves what it promises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import pyvista as pv

PICTURES = ["decomposition", "control_net", "convergence"]
PICTURES += [f"{what}_{when}" for what in ("stress", "pressure") for when in ("before", "after")]


@pytest.mark.slow
@pytest.mark.claim
def test_the_small_demo_lowers_the_energy_and_leaves_pictures_files_and_result(
    demo: Callable[..., Any],
) -> None:
    result, output, printed = demo("chain_links", "--size", "small", ranks=2, timeout=300.0, fresh=True)
    told, counts = result["optimisation"], result["counts"]
    assert result["ranks"] == 2
    assert (counts["torn_unknowns"], counts["subdomains"], told["design"]["variables"]) == (29568, 32, 28)
    assert told["objective"]["final"] < 1.5 * told["objective"]["initial"] < 0
    assert told["objective"]["initial"] == pytest.approx(-18836.55, abs=0.1)
    more = result["more"]
    assert more["peak_pressure_initial"] == pytest.approx(more["hertz_peak_pressure"], rel=0.05)
    assert more["contact_area_initial"] == pytest.approx(more["hertz_contact_area"], rel=0.05)
    assert more["retreat_initial"] == pytest.approx(0.0, abs=1e-12)
    assert 0.1 < more["retreat_final"] <= 0.25
    drop = told["objective"]["initial"] - told["objective"]["final"]
    assert more["drop_by_retreat"] + more["drop_by_shape"] == pytest.approx(drop)
    assert more["drop_by_retreat"] == pytest.approx(80e3 * more["retreat_final"])
    assert max(result["residuals"].values()) <= 1e-6
    assert result["versions"]
    films = pv.get_reader(output / "designs.pvd")
    better = [k for k, kind in enumerate(told["history"]["kind"], 1) if kind in ("start", "serious")]
    assert films.time_values == better
    assert len(better) > 3
    assert "2 ranks" in printed
    for name in PICTURES:
        assert (output / f"{name}.png").stat().st_size > 10_000
    suffixes = {path.suffix for path in output.iterdir() if path.is_file()}
    assert suffixes == {
        ".png", ".json", ".vtm", ".vtu", ".xdmf", ".h5", ".pvd", ".csv", ".stl", ".step",
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize(
    ("objective", "quantity", "before", "after"),
    [("energy", "strain_energy", 16073.7, 15134.6), ("pressure", "peak_pressure", 4386.6, 3042.6)],
)
def test_shapes_that_fit_lower_pressure_or_energy_and_keep_the_volume(
    objective: str, quantity: str, before: float, after: float, demo: Callable[..., Any]
) -> None:
    given = "--size", "small", "--objective", objective
    result, output, _ = demo("chain_links", *given, timeout=300.0)
    assert output.name == f"chain_links_{objective}"
    more = result["more"]
    assert more["volume_final"] == pytest.approx(more["volume_initial"], rel=1e-8)
    assert more[f"{quantity}_initial"] == pytest.approx(before, rel=1e-4)
    assert more[f"{quantity}_final"] == pytest.approx(after, rel=1e-2)
    assert result["optimisation"]["stop"]["evaluations"] <= 30


def test_an_unknown_size_is_refused(demo: Callable[..., Any]) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"--size: invalid choice: 'huge'"):
        demo("chain_links", "--size", "huge")
