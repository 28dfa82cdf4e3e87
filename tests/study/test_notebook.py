"""The notebook on accuracy runs as a plain script."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.conftest import ROOT


@pytest.mark.slow
def test_the_notebook_on_accuracy_runs_from_its_first_cell_to_its_last(
    mpirun: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    printed = mpirun(ROOT / "notebooks" / "05_what_accuracy_costs.py", 1, timeout=300.0)
    assert "certificate over true error: 1." in printed
    assert "in peak pressure" in printed
    assert "For 5 %, 1 %" in printed or "For 10 %" in printed
    assert "largest error at a tolerance of 1e-8" in printed
    assert (ROOT / "output" / "notebooks" / "plate" / "accuracy.png").stat().st_size > 10_000
