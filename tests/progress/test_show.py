"""The context that shows progress: lines in a log, an output of a notebook, and all as it was afterwards."""

from __future__ import annotations

import io
import logging
import sys
import types
from typing import Any

import pytest

from fenics_contact import show_progress
from fenics_contact._base.progress import LAUNCHERS, LISTENERS, LOGGER_NAME, Task, at_terminal

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
