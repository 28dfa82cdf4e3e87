"""Progress that is shown, recorded and drawn."""

from __future__ import annotations

import io
import logging
import sys
import types
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fenics_contact import show_progress
from fenics_contact._base.progress import (
    LAUNCHERS,
    LISTENERS,
    LOGGER_NAME,
    Event,
    Kind,
    Task,
    Work,
    Works,
    at_terminal,
    duration,
)
from tests.base.pseudo_terminal import COLUMNS, at_a_terminal, plain, screen
from tests.conftest import launch

LOGGER = logging.getLogger(LOGGER_NAME)


class Screen(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    ticking = Clock()
    monkeypatch.setattr("time.time", ticking)
    monkeypatch.setattr("time.time_ns", lambda: round(1e9 * ticking()))
    return ticking


def work(clock: Clock, pause: float = 4.0) -> None:
    """Take five steps."""
    with Task("load steps", total=5) as task:
        for number in range(1, 6):
            clock.now += pause
            task.step(number)


def as_it_was() -> tuple[Any, ...]:
    root = logging.getLogger()
    streams = [handler.stream for handler in root.handlers if isinstance(handler, logging.StreamHandler)]
    mine = (LOGGER.level, LOGGER.propagate, list(LOGGER.handlers), list(LISTENERS))
    return (*mine, sys.stdout, sys.stderr, streams)


def test_elsewhere_a_line_is_logged_now_and_then(clock: Clock, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), show_progress(stream=io.StringIO(), interval=10.0):
        work(clock)
    assert [record.message for record in caplog.records] == [
        "load steps: 3 of 5",
        "load steps: 5 of 5, 20 s",
    ]
    assert {(record.name, record.levelno) for record in caplog.records} == {(LOGGER_NAME, logging.INFO)}


def test_work_of_no_time_leaves_no_line(clock: Clock, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), show_progress(stream=io.StringIO()):
        work(clock, pause=0.01)
    assert caplog.records == []


def test_many_short_works_leave_few_lines(clock: Clock, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), show_progress(stream=io.StringIO(), interval=1e9):
        for _ in range(200):
            work(clock, pause=0.3)
    assert 5 < len(caplog.records) < 30


def test_nobody_sees_anything_where_logging_is_not_configured(
    clock: Clock, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    with show_progress(stream=io.StringIO(), interval=0.0):
        work(clock)
    assert caplog.records == []
    assert capfd.readouterr() == ("", "")


def test_those_who_listen_to_everything_still_do(clock: Clock, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG), show_progress(stream=io.StringIO(), interval=1e9):
        work(clock, pause=0.0)
    assert [record.message for record in caplog.records][:2] == [
        "load steps: begins, 0 of 5",
        "load steps: 1 of 5",
    ]


def test_own_handlers_of_the_logger_hear_no_more_than_before(clock: Clock) -> None:
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    LOGGER.addHandler(handler)
    try:
        with show_progress(stream=io.StringIO(), interval=1e9):
            work(clock)
        assert LOGGER.handlers == [handler]
    finally:
        LOGGER.removeHandler(handler)
    assert stream.getvalue() == ""


@pytest.mark.parametrize("stream", [io.StringIO(), Screen()], ids=["log", "terminal"])
def test_all_is_as_it_was_also_after_a_failure(stream: io.StringIO) -> None:
    def fail() -> None:
        with show_progress(stream=stream):
            during.append(as_it_was())
            raise ZeroDivisionError

    before, during = as_it_was(), list[Any]()
    with pytest.raises(ZeroDivisionError):
        fail()
    assert during[0] != before
    assert as_it_was() == before


def test_what_is_logged_to_the_terminal_goes_above_the_bars() -> None:
    handler = logging.StreamHandler(sys.stderr)
    root = logging.getLogger()
    root.addHandler(handler)
    try:
        with show_progress(stream=Screen()):
            assert handler.stream is sys.stderr is not sys.__stderr__
            during = handler.stream
        assert handler.stream is sys.stderr is not during
    finally:
        root.removeHandler(handler)


def test_within_another_one_nothing_changes(clock: Clock, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), show_progress(stream=io.StringIO()):
        handlers = list(LOGGER.handlers)
        with show_progress(stream=io.StringIO()):
            assert LOGGER.handlers == handlers
            work(clock)
        work(clock)
    assert len([record for record in caplog.records if record.message.endswith("20 s")]) == 2


def test_other_ranks_show_nothing_and_do_not_listen() -> None:
    other: Any = types.SimpleNamespace(rank=1)
    before = as_it_was()
    with show_progress(other, stream=Screen()):
        assert as_it_was() == before


def test_a_notebook_gets_one_output_that_ends_with_what_came_out(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    outputs: list[dict[str, str]] = []
    handle = types.SimpleNamespace(update=lambda content, raw: outputs.append(content))

    def display(content: dict[str, str], *, raw: bool, display_id: bool) -> Any:
        assert raw
        assert display_id
        assert not outputs, "a second output"
        outputs.append(content)
        return handle

    shell = types.SimpleNamespace(kernel=object())
    modules = {"IPython": types.ModuleType("IPython"), "IPython.display": types.ModuleType("IPython.display")}
    monkeypatch.setattr(modules["IPython"], "get_ipython", lambda: shell, raising=False)
    monkeypatch.setattr(modules["IPython.display"], "display", display, raising=False)
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    with show_progress():
        work(clock)
    texts = [output["text/plain"] for output in outputs]
    assert "load steps: 2 of 5" in texts
    assert texts[-1] == "load steps: 5 of 5, 20 s"
    assert outputs[-1]["text/html"] == "<pre>load steps: 5 of 5, 20 s</pre>"


def test_a_stream_that_is_no_file_says_itself_whether_it_is_a_terminal() -> None:
    assert at_terminal(Screen())
    assert not at_terminal(io.StringIO())


def test_launchers_of_ranks_are_known() -> None:
    assert {"mpirun", "mpiexec", "prterun", "srun"} <= LAUNCHERS


# What is under way: which part of it is done, which line describes it, and what remains.
def fed(events: list[tuple[float, Event]]) -> Works:
    works = Works()
    for moment, event in events:
        works.take(event, moment)
    return works


def falling(measures: list[float]) -> Work:
    """Return work whose residual falls so, in a second each, to a target of 1e-8."""
    events = [(0.0, Event(1, "solve", Kind.BEGIN, target=1e-8))]
    for number, measure in enumerate(measures):
        event = Event(1, "solve", Kind.STEP, number=number, measure=measure, target=1e-8)
        events.append((float(number), event))
    return fed(events).shown()[0]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, "?"), (0.0, "0 s"), (0.42, "0.4 s"), (7.6, "8 s"), (200.0, "3 min"), (7200.0, "2.0 h")],
)
def test_durations_are_words(seconds: float | None, words: str) -> None:
    assert duration(seconds) == words


def test_the_part_done_is_that_of_the_digits_of_a_residual() -> None:
    work = falling([10.0 ** (-0.5 * k) for k in range(11)])
    assert work.fraction == pytest.approx(5 / 8)


def test_residuals_that_rise_or_are_small_at_once_have_no_part_done() -> None:
    assert falling([1.0, 10.0, 100.0]).fraction == 0.0
    assert falling([1e-9, 1e-9]).fraction is None


def test_what_is_told_is_the_work_with_numbers_and_the_innermost_phase() -> None:
    works = fed(
        [
            (0.0, Event(1, "load steps", Kind.BEGIN, total=4, number=0)),
            (0.0, Event(2, "outer phase", Kind.BEGIN)),
            (1.0, Event(3, "factor", Kind.BEGIN)),
        ]
    )
    assert [work.line for work in works.shown()] == ["load steps: 0 of 4", "factor"]
    assert [work.begun for work in works.shown()] == [0.0, 1.0]


def test_a_phase_ends_with_the_numbers_of_the_solver_within_it() -> None:
    works = Works()
    for moment, event in [
        (0.0, Event(1, "solve", Kind.BEGIN)),
        (0.0, Event(2, "solve", Kind.BEGIN, unit="products", target=1e-6)),
        (1.0, Event(2, "solve", Kind.STEP, unit="products", target=1e-6, number=54, measure=1e-7)),
        (2.0, Event(2, "solve", Kind.END, unit="products", target=1e-6)),
    ]:
        assert works.take(event, moment) is None
    work = works.take(Event(1, "solve", Kind.END), 2.2)
    assert work is not None
    assert work.summary() == "solve: 54 products, residual 1.0e-07 ≤ 1e-06, 2 s"
    assert works.shown() == []


def test_work_that_was_under_way_before_anybody_listened_is_shown() -> None:
    works = fed([(5.0, Event(1, "load steps", Kind.STEP, number=3, total=4))])
    assert works.shown()[0].line == "load steps: 3 of 4"


def test_the_end_of_unknown_work_is_nothing() -> None:
    assert Works().take(Event(1, "solve", Kind.END), 1.0) is None


# At a terminal there are bars, on rank 0 alone, and nothing of them stays; elsewhere there is nothing.
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
