"""At a terminal there are bars, on rank 0 alone, and nothing of them stays; elsewhere there is nothing."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from tests.conftest import launch
from tests.progress.pseudo_terminal import COLUMNS, at_a_terminal, plain, screen

SCRIPT = Path(__file__).with_name("on_a_terminal.py")


@cache
def written(ranks: int) -> str:
    return at_a_terminal(SCRIPT, ranks)


@pytest.mark.parametrize("ranks", [1, 2])
def test_bars_are_drawn_with_counts_and_residuals(ranks: int) -> None:
    shown = plain(written(ranks))
    assert "work of rank 0" in shown
    assert "1 of 2" in shown
    assert "products, residual 1.0e-06 ≤ 1e-06" in shown
    assert "━" in shown


def test_only_rank_0_draws() -> None:
    assert "work of rank 0" in written(2)
    assert "work of rank 1" not in written(2)


@pytest.mark.parametrize("ranks", [1, 2])
def test_what_the_program_writes_stays_and_the_bars_do_not(ranks: int) -> None:
    shown = [line for line in screen(written(ranks)) if line]
    expected = [words for number in (1, 2) for words in (f"printed after {number}", f"logged after {number}")]
    # Under mpirun two streams of a rank come along two ways.
    assert sorted(shown[:-1]) == sorted(expected)
    assert shown[-1].startswith("work of rank 0: 2 of 2, 1 s")


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_line_is_wider_than_the_terminal(ranks: int) -> None:
    lines = plain(written(ranks)).replace("\r", "\n").split("\n")
    assert len(lines) > 5
    assert max(map(len, lines)) <= COLUMNS


def test_a_run_that_is_killed_leaves_the_cursor_visible() -> None:
    hidden, shown = "\x1b[?25l", "\x1b[?25h"
    first = written(1).split("━")[0]
    assert first.rindex(shown) > first.rindex(hidden)


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_where_there_is_no_terminal_nothing_is_shown(ranks: int) -> None:
    end = launch(ranks, SCRIPT)
    assert end.returncode == 0, end.stderr
    assert end.stdout.splitlines() == ["printed after 1", "printed after 2"]
    assert end.stderr.splitlines() == ["logged after 1", "logged after 2"]


@pytest.mark.slow
def test_output_into_a_file_stays_there_while_bars_are_drawn(tmp_path: Path) -> None:
    wrapper, log = tmp_path / "wrapper.py", tmp_path / "out.txt"
    wrapper.write_text(
        "import subprocess, sys\n"
        f"with open({str(log)!r}, 'w') as file:\n"
        f"    subprocess.run([sys.executable, {str(SCRIPT)!r}], stdout=file, check=True)\n"
    )
    shown = plain(at_a_terminal(wrapper, 1))
    assert "1 of 2" in shown
    assert "printed" not in shown
    assert log.read_text().splitlines() == ["printed after 1", "printed after 2"]
