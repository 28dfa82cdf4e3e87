"""Demos run in a folder of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fenics_contact.output import read_result

DEMOS = Path(__file__).parents[2] / "demos"
IN_FOLDER = Path(__file__).with_name("in_folder.py")


@pytest.fixture
def demo(mpirun: Callable[..., str], tmp_path: Path) -> Callable[..., tuple[dict[str, Any], Path, str]]:
    """Return ``demo(name, *arguments, ranks=1, timeout=120.0, ...)``, which runs it in an empty folder.

    The answer is its result, the folder of its files and what it printed.
    """

    def run(
        name: str, *arguments: object, ranks: int = 1, timeout: float = 120.0, fresh: bool = False
    ) -> tuple[dict[str, Any], Path, str]:
        given = (tmp_path, DEMOS / f"demo_{name}.py", *arguments)
        printed = mpirun(IN_FOLDER, ranks, *given, timeout=timeout, fresh=fresh)
        (output,) = (tmp_path / "output").iterdir()
        return read_result(output), output, printed

    return run
