"""Progress of a study: remaining time from runs that are done, told as an event and as a line each."""

from __future__ import annotations

import logging

import pytest

from fenics_contact.progress import LOGGER_NAME, Event
from fenics_contact.study import Parameters
from fenics_contact.study.progress import Forecast, Progress


def test_time_left_follows_the_growth_that_runs_have_shown() -> None:
    forecast = Forecast()
    assert forecast.seconds([Parameters(4)]) is None
    forecast.learn(Parameters(2), 1.0)
    forecast.learn(Parameters(4), 8.0)
    assert forecast.seconds([Parameters(2), Parameters(4)]) == pytest.approx(9.0)
    assert forecast.seconds([Parameters(8)]) == pytest.approx(64.0)


def test_there_is_a_line_about_every_run(caplog: pytest.LogCaptureFixture) -> None:
    runs = [Parameters(2), Parameters(2, tolerance=1e-3, solver="fixed point", subdomains=8)]
    with caplog.at_level(logging.INFO), Progress(runs, "A study") as progress:
        for run in runs:
            progress.begin(run)
            progress.done(run, 5.0, "1.00 s")
    assert [record.message for record in caplog.records] == [
        "1/2 size 2, hexahedron, node, balanced: 1.00 s, 5 s left",
        "2/2 size 2, hexahedron, node, 1e-03, fixed point, 8 subdomains: 1.00 s",
    ]


def test_the_run_under_way_is_told_with_the_time_that_all_will_take(caplog: pytest.LogCaptureFixture) -> None:
    runs = [Parameters(2), Parameters(4)]
    with caplog.at_level(logging.DEBUG, LOGGER_NAME), Progress(runs, "A study") as progress:
        progress.begin(runs[0])
        progress.done(runs[0], 10.0, "")
        progress.begin(runs[1])
    events = [record.progress for record in caplog.records if hasattr(record, "progress")]
    assert all(isinstance(event, Event) for event in events)
    last = events[-2]
    assert (last.what, last.number, last.total) == ("A study", 1, 2)
    assert last.words == "size 4, hexahedron, node, balanced"
    assert last.left == pytest.approx(28.3, abs=0.1)
