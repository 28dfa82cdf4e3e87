"""Progress: remaining time from runs that are done, a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import io
import logging

import pytest

from fenics_contact.study import Parameters
from fenics_contact.study.progress import Forecast, Progress, duration


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_time_left_follows_the_growth_that_runs_have_shown() -> None:
    forecast = Forecast()
    assert forecast.seconds([Parameters(4)]) is None
    forecast.learn(Parameters(2), 1.0)
    forecast.learn(Parameters(4), 8.0)
    assert forecast.seconds([Parameters(2), Parameters(4)]) == pytest.approx(9.0)
    assert forecast.seconds([Parameters(8)]) == pytest.approx(64.0)


@pytest.mark.parametrize(
    ("seconds", "words"), [(None, "?"), (7.6, "8 s"), (200.0, "3 min"), (7200.0, "2.0 h")]
)
def test_durations_are_words(seconds: float | None, words: str) -> None:
    assert duration(seconds) == words


def test_without_a_terminal_there_are_lines(caplog: pytest.LogCaptureFixture) -> None:
    runs = [Parameters(2), Parameters(2, tolerance=1e-3, solver="fixed point", subdomains=8)]
    with caplog.at_level(logging.INFO), Progress(runs, "A study", io.StringIO()) as progress:
        for run in runs:
            progress.begin(run)
            progress.done(run, 5.0, "1.00 s")
    assert [record.message for record in caplog.records] == [
        "1/2 size 2, hexahedron, node, balanced: 1.00 s, 5 s left",
        "2/2 size 2, hexahedron, node, 1e-03, fixed point, 8 subdomains: 1.00 s, 0 s left",
    ]


def test_a_terminal_without_tqdm_gets_lines(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with caplog.at_level(logging.INFO), Progress([Parameters(2)], "A study", Terminal()) as progress:
        progress.done(Parameters(2), 5.0, "1.00 s")
    assert [record.message for record in caplog.records] == [
        "1/1 size 2, hexahedron, node, balanced: 1.00 s, 0 s left"
    ]


def test_on_a_terminal_there_is_a_bar_with_the_time_left() -> None:
    stream, runs = Terminal(), [Parameters(2), Parameters(4)]
    with Progress(runs, "A study", stream) as progress:
        progress.begin(runs[0])
        progress.done(runs[0], 10.0, "")
        progress.begin(runs[1])
    shown = stream.getvalue()
    assert "A study 1/2 |" in shown
    assert "size 4, hexahedron, node, balanced, 28 s left" in shown
