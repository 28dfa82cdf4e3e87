"""Reading what a demo prints and leaves."""

from __future__ import annotations

import re
from pathlib import Path

DEMOS = Path(__file__).parents[2] / "demos"
NUMBER = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"


def numbers(printed: str, label: str) -> list[float]:
    """Return the numbers of the one line that begins with a label.

    Args:
        printed: What the demo printed.
        label: The line's first words.
    """
    lines = [line.strip() for line in printed.splitlines() if line.strip().startswith(label)]
    assert len(lines) == 1, f"{label!r} begins {len(lines)} lines of\n{printed}"
    return [float(number) for number in re.findall(NUMBER, lines[0][len(label) :])]


def assert_files(output: Path, pictures: list[str]) -> None:
    """Check that these pictures and files for ParaView are there, and nothing else."""
    for picture in pictures:
        assert (output / f"{picture}.png").stat().st_size > 10_000
    assert {path.stem for path in output.glob("*.png")} == set(pictures)
    assert {path.suffix for path in output.iterdir()} == {".png", ".vtm", ".vtu"}
