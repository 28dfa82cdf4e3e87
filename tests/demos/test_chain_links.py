"""The demo runs from its first line to its last, on two ranks, and leaves what it promises."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PICTURES = ["decomposition", "control_net", "convergence"]
PICTURES += [f"{what}_{when}" for what in ("stress", "pressure") for when in ("before", "after")]


def test_the_small_demo_lowers_the_energy_and_leaves_pictures_files_and_result(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    printed = mpirun(ROOT / "demos" / "demo_chain_links.py", 2, "--size", "small", timeout=300.0)
    output = tmp_path / "output" / "chain_links"
    result = json.loads((output / "result.json").read_text())
    assert result["ranks"] == 2
    assert (result["torn_unknowns"], result["subdomains"], result["design_variables"]) == (29568, 32, 28)
    assert result["objective_final"] < 1.5 * result["objective_initial"] < 0
    assert result["objective_initial"] == pytest.approx(-19660.71, abs=0.1)
    assert max(result["natural_residual"], result["gluing_residual"]) <= 1e-6
    assert result["versions"]
    assert "2 ranks" in printed
    for name in PICTURES:
        assert (output / f"{name}.png").stat().st_size > 10_000
    assert {path.suffix for path in output.iterdir()} == {".png", ".json", ".vtm", ".vtu", ".xdmf", ".h5"}


def test_an_unknown_size_is_refused(mpirun: Callable[..., str]) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"--size must be one of .*got 'huge'"):
        mpirun(ROOT / "demos" / "demo_chain_links.py", 1, "--size", "huge")
