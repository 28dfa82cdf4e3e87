"""Demos run in a folder of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fenics_contact.output import read_result

DEMOS = Path(__file__).parents[2] / "demos"


@pytest.fixture
def demo(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., tuple[dict[str, Any], Path, str]]:
    """Return ``demo(name, *arguments, ranks=1, timeout=120.0)``, which runs it in an empty folder.

    The answer is its result, the folder of its files and what it printed.
    """
    monkeypatch.chdir(tmp_path)

    def run(
        name: str, *arguments: object, ranks: int = 1, timeout: float = 120.0
    ) -> tuple[dict[str, Any], Path, str]:
        printed = mpirun(DEMOS / f"demo_{name}.py", ranks, *arguments, timeout=timeout, fresh=True)
        (output,) = (tmp_path / "output").iterdir()
        return read_result(output), output, printed

    return run
