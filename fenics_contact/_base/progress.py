"""Progress of long work: events that every part of the package reports, and their display."""

from __future__ import annotations

import importlib.util
import logging
import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

from fenics_contact._base.launching import ranks_of
from fenics_contact.errors.kinds import safe_log

if TYPE_CHECKING:
    from mpi4py import MPI

#: Logger of all reports.
LOGGER_NAME = "fenics_contact.progress"
#: Other listeners of events: `show_progress` while it draws.
LISTENERS: list[Callable[[Event], None]] = []

_LOGGER = logging.getLogger(LOGGER_NAME)


class Kind(Enum):
    """Kinds of events of a piece of work."""

    BEGIN = "begins"
    STEP = "step"
    END = "done"
    FAILED = "failed"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Event:
    """One report. Unknown numbers are None.

    `most`: largest number, if the total is unknown; `measure`: quantity that must become small: the residual;
    `value`: best value so far, of an optimisation.
    """

    task: int
    what: str
    kind: Kind
    unit: str = "steps"
    number: int | None = None
    total: int | None = None
    most: int | None = None
    measure: float | None = None
    target: float | None = None
    measured: str = "residual"
    value: float | None = None
    words: str = ""

    def __str__(self) -> str:
        """Return one line for readers."""
        if self.kind is Kind.STEP:
            return f"{self.what}: {self.details}"
        return joined(f"{self.what}: {self.kind.value}", self.details)

    @property
    def details(self) -> str:
        """The numbers as text."""
        count = value = measure = ""
        if self.number is not None:
            unit = self.unit.removesuffix("s") if self.number == 1 else self.unit
            count = f"{self.number} {unit}" if self.total is None else f"{self.number} of {self.total}"
        if self.value is not None:
            value = f"best {self.value:.6g}"
        if self.measure is not None:
            measure = f"{self.measured} {self.measure:.1e}"
            if self.target is not None:
                sign = "≤" if self.measure <= self.target else ">"
                measure += f" {sign} {self.target:.1e}".replace(".0e", "e")
        return joined(count, value, measure, self.words)


class Task:
    """A piece of work that reports its progress if there are listeners.

    Example:
        >>> with Task("load steps", total=2) as task:
        ...     for number in (1, 2):
        ...         task.step(number)
    """

    def __init__(
        self,
        what: str,
        *,
        unit: str = "steps",
        total: int | None = None,
        most: int | None = None,
        target: float | None = None,
        measured: str = "residual",
    ) -> None:
        """Describe the work by the attributes of an `Event`; nothing is reported before it begins."""
        self.outcome = ""
        self._event = Event(id(self), what, Kind.BEGIN, unit, None, total, most, None, target, measured)

    def begin(self, number: int | None = None) -> None:
        """Report that the work begins, and the number of steps of an earlier run."""
        self._tell(Kind.BEGIN, number=number)

    def step(
        self,
        number: int,
        *,
        measure: float | None = None,
        value: float | None = None,
        words: str = "",
    ) -> None:
        """Report progress by the attributes of an `Event`."""
        self._tell(Kind.STEP, number=number, measure=measure, value=value, words=words)

    def end(self, error: BaseException | None = None) -> None:
        """Report that the work is over, and what it ended with instead of a result: a failure, or Ctrl-C."""
        kind = Kind.END
        if error is not None:
            kind = Kind.FAILED if isinstance(error, Exception) else Kind.STOPPED
        self._tell(kind, words=self.outcome)

    def __enter__(self) -> Task:
        """Begin; work with a known number or limit of steps reports that none is done."""
        self.begin(None if self._event.total is None and self._event.most is None else 0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End, as a failure where an exception passes."""
        self.end(error)

    def _tell(self, kind: Kind, **attributes: Any) -> None:
        if LISTENERS or _LOGGER.isEnabledFor(logging.DEBUG):
            event = replace(self._event, kind=kind, **attributes)
            for listen in LISTENERS:
                listen(event)
            safe_log(_LOGGER.debug, "%s", event, extra={"progress": event})


#: Characters that a terminal interprets: control characters except newline and tab, line and paragraph
#: separators, changes of writing direction, surrogates.
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def duration(seconds: float | None) -> str:
    """Format a duration: 0.4 s, 8 s, 3 min, 1.5 h."""
    if seconds is None:
        return "?"
    if 0.05 <= seconds < 0.95:
        return f"{seconds:.1f} s"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"


def joined(*parts: str) -> str:
    """Join the non-empty parts by commas."""
    return ", ".join(part for part in parts if part)


def is_visible(text: str) -> bool:
    """Return whether a text contains no characters that a terminal interprets."""
    return not _OBEYED.search(text)


def visible(text: str) -> str:
    """Return a text with all characters that a terminal interprets as Python's escapes."""
    return _OBEYED.sub(lambda match: match.group().encode("unicode_escape").decode("ascii"), text)


@dataclass
class Work:
    """A piece of work under way: its last event, completed from earlier ones, and times, [s]."""

    event: Event
    begun: float
    stepped: float
    first: float | None = None

    def take(self, event: Event, moment: float) -> None:
        """Process an event of this work."""
        self.stepped = moment
        if event.kind is not Kind.STEP:
            self.event = replace(self.event, kind=event.kind, words=event.words)
            return
        names = ("number", "measure", "target", "value")
        earlier = {name: getattr(self.event, name) for name in names if getattr(event, name) is None}
        self.event = replace(event, **earlier)
        self.first = event.measure if self.first is None else self.first

    @property
    def shows_numbers(self) -> bool:
        """Whether there are numbers to report."""
        return self.event.number is not None or self.event.total is not None

    @property
    def fraction(self) -> float | None:
        """Fraction done, from 0 to 1, of the pieces or of the digits; None if unknown."""
        event, first = self.event, self.first
        if event.total:
            return min((event.number or 0) / event.total, 1.0)
        if event.measure and event.target and first is not None and first > event.target:
            return min(max(math.log(first / event.measure) / math.log(first / event.target), 0.0), 1.0)
        return None

    @property
    def line(self) -> str:
        """One line about it."""
        return f"{self.event.what}: {details}" if (details := self.event.details) else self.event.what

    def summary(self) -> str:
        """Return one line about it at its end."""
        event = self.event
        if event.measure is not None and event.target is not None and event.measure > event.target:
            event = replace(event, measure=None)  # of the last step, but it ended for another reason
        ending = "" if event.kind is Kind.END else event.kind.value
        return f"{event.what}: {joined(ending, event.details, duration(self.stepped - self.begun))}"


class Works:
    """The pieces of work under way, outer ones first."""

    def __init__(self) -> None:
        """Begin with none."""
        self._under_way: dict[int, Work] = {}

    def take(self, event: Event, moment: float) -> Work | None:
        """Process an event at a time, [s]; return work that is over if no other is under way."""
        if event.kind is Kind.BEGIN:
            self._under_way.pop(event.task, None)
        elif event.kind is not Kind.STEP and event.task not in self._under_way:
            return None
        work = self._under_way.setdefault(event.task, Work(replace(event, number=None), moment, moment))
        work.take(replace(event, kind=Kind.STEP) if event.kind is Kind.BEGIN else event, moment)
        return None if event.kind in (Kind.BEGIN, Kind.STEP) else self._ended(work)

    def _ended(self, work: Work) -> Work | None:
        del self._under_way[work.event.task]
        if not self._under_way:
            return work
        outer = list(self._under_way.values())[-1]
        if outer.event.what == work.event.what and not outer.shows_numbers:
            # A phase and the solver within it share a name: the phase ends with the solver's numbers.
            outer.event = replace(work.event, task=outer.event.task, kind=Kind.STEP)
        return None

    def shown(self) -> list[Work]:
        """Return the work to report: all with numbers, and the innermost one."""
        works = list(self._under_way.values())
        return [work for work in works if work.shows_numbers or work is works[-1]]


#: Programs that start ranks and forward their output.
LAUNCHERS = {
    "mpirun", "mpiexec", "mpiexec.hydra", "hydra_pmi_proxy", "orterun", "orted", "prterun", "prted", "srun",
}  # fmt: skip


def at_terminal(stream: TextIO | None) -> bool:
    """Return whether a stream ends at a terminal that supports drawing.

    The output of a rank goes to mpirun through a pipe, or through a pseudo-terminal even if mpirun's own
    output is a file. So under mpirun its output is what counts.
    """
    if stream is None or os.environ.get("TERM") == "dumb":
        return False
    with suppress(OSError, ValueError, AttributeError):  # streams without a file descriptor decide themselves
        launcher, descriptor = _launcher(), stream.fileno()
        if launcher is not None and descriptor <= 2:
            with suppress(OSError):
                return os.readlink(f"/proc/{launcher}/fd/{descriptor}").startswith(("/dev/pts/", "/dev/tty"))
            return False
    with suppress(ValueError, AttributeError):
        return stream.isatty()
    return False


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    return getattr(shell and shell.get_ipython(), "kernel", None) is not None


def _launcher() -> int | None:
    """Return the process that started the ranks on this machine, None if this is not one of them."""
    launcher, candidate = None, os.getppid()
    with suppress(OSError):
        while True:
            status = Path(f"/proc/{candidate}/stat").read_text()
            name, _, rest = status.partition("(")[2].rpartition(")")
            if name not in LAUNCHERS:
                break
            launcher, candidate = candidate, int(rest.split()[1])
    return launcher


#: Outermost work leaves a line if it took this long, [s],
WORTH = 1.0
#: and this fraction of the time so far.
SHARE = 0.05


@contextmanager
def show_progress(
    comm: MPI.Comm | None = None, stream: TextIO | None = None, interval: float = 10.0
) -> Iterator[None]:
    """Show the progress of the work in the block.

    On a terminal there are bars, below what the program prints. In a notebook there is one output of the
    cell. Elsewhere, or without rich, a line is logged at level INFO at intervals, by the logger
    ``fenics_contact.progress``: it is invisible unless logging is configured. Only rank 0 shows anything, and
    no rank waits for another. Within another `show_progress` the inner one does nothing.

    Args:
        comm: Communicator of the work; None for a program that is not started by mpirun.
        stream: Stream for drawing if it is a terminal; stderr by default.
        interval: Smallest time between two lines in the log, [s].

    Example:
        >>> with show_progress(MPI.COMM_WORLD):  # doctest: +SKIP
        ...     state = solve_scene(scene, MPI.COMM_WORLD)
    """
    if LISTENERS or ranks_of(comm).rank != 0:
        yield
        return
    works = Works()
    writer = _writer(stream, interval)
    begun = last = time.time()

    def listen(event: Event) -> None:
        nonlocal last
        now = time.time()
        over = works.take(event, now)
        if over is not None and now - over.begun >= max(WORTH, SHARE * (now - begun)):
            writer.leave(over.summary())
        if now >= last + writer.pause:
            last = now
            writer.show(works.shown())

    LISTENERS.append(listen)
    try:
        yield
    finally:
        LISTENERS.remove(listen)
        writer.stop()


def _writer(stream: TextIO | None, interval: float) -> Bars | Log | Notebook:
    """Return the display that suits the environment of the program."""
    if in_notebook() and stream is None:
        return Notebook()
    stream = stream or sys.stderr
    if not at_terminal(stream) or importlib.util.find_spec("rich") is None:
        return Log(interval)
    return Bars(stream)


class Log:
    """Logs a line at level INFO at intervals, and one about finished work."""

    def __init__(self, pause: float) -> None:
        """Begin; ``pause`` is the smallest time between two lines, [s]."""
        self.pause = pause

    def show(self, works: list[Work]) -> None:
        """Log the progress of the work."""
        if works:
            self.leave("; ".join(work.line for work in works))

    def leave(self, line: str) -> None:
        """Log the outcome."""
        safe_log(_LOGGER.info, "%s", line)

    def stop(self) -> None:
        """Do nothing."""


class Notebook:
    """Replaces an output of the cell; needs no widgets, so that a saved notebook shows the final output."""

    pause = 0.3

    def __init__(self) -> None:
        """Begin without an output."""
        self._over: list[str] = []
        self._output: Any = None

    def show(self, works: list[Work]) -> None:
        """Replace the output."""
        from html import escape

        from IPython.display import display  # available in notebooks

        text = "\n".join([*self._over, *(work.line for work in works)])
        content = {"text/plain": text, "text/html": f"<pre>{escape(text)}</pre>"}
        if self._output is None:
            self._output = display(content, raw=True, display_id=True)
        else:
            self._output.update(content, raw=True)

    def leave(self, line: str) -> None:
        """Keep a line."""
        self._over.append(line)

    def stop(self) -> None:
        """Keep only the lines about finished work."""
        if self._output is not None:
            self.show([])


class Bars:
    """Draws bars of rich below all other output of the program."""

    pause = 0.05

    def __init__(self, stream: TextIO) -> None:
        """Start drawing; output and logs of the program appear above the bars."""
        from rich import progress  # takes a tenth of a second, only for terminals
        from rich.console import Console
        from rich.table import Column

        details = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        self._progress = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(bar_width=12),
            progress.TextColumn("{task.fields[details]}", markup=False, table_column=details),
            progress.TimeRemainingColumn(),
            progress.TimeElapsedColumn(),
            console=Console(file=stream, force_terminal=True, markup=False, highlight=False, emoji=False),
            transient=True,
            expand=True,
            redirect_stdout=at_terminal(sys.stdout),  # output to a file must not be redirected
        )
        self._drawn: dict[int, progress.TaskID] = {}
        streams = {id(stream): name for name in ("stdout", "stderr") if (stream := getattr(sys, name))}
        self._progress.start()
        self._progress.console.show_cursor(True)  # a run that is killed could not bring it back
        handlers = [*logging.getLogger().handlers, *logging.getLogger("fenics_contact").handlers]
        self._logging: list[tuple[logging.StreamHandler[Any], Any]] = []
        for handler in handlers:
            if isinstance(handler, logging.StreamHandler) and id(handler.stream) in streams:
                self._logging.append((handler, handler.stream))
                handler.setStream(getattr(sys, streams[id(handler.stream)]))

    def show(self, works: list[Work]) -> None:
        """Update the bars: one for each work, outer ones first."""
        shown = [work.event.task for work in works]
        for name in [name for name in self._drawn if name not in shown]:
            self._progress.remove_task(self._drawn.pop(name))
        for depth, work in enumerate(works):
            name, details, done = work.event.task, visible(work.event.details), work.fraction
            if name not in self._drawn:
                title = "  " * depth + visible(work.event.what)
                self._drawn[name] = self._progress.add_task(title, total=None, details=details)
            total = None if done is None else 1.0
            self._progress.update(self._drawn[name], total=total, completed=done or 0.0, details=details)

    def leave(self, line: str) -> None:
        """Leave a line above the bars."""
        with suppress(OSError):
            self._progress.console.out(visible(line), highlight=False)

    def stop(self) -> None:
        """Remove the bars and restore the streams."""
        for handler, stream in self._logging:
            handler.setStream(stream)
        self._progress.stop()


#: Phases that timers are in, the innermost last.
_UNDER_WAY: list[str] = []


def phase_under_way() -> str:
    """Return the name of the innermost phase that a timer is in, "" outside of all."""
    return _UNDER_WAY[-1] if _UNDER_WAY else ""


class PhaseTimer:
    """Adds up wall time under names, and reports the phase under way (`fenics_contact.progress`).

    Example:
        >>> timer = PhaseTimer()
        >>> with timer.phase("factor"):
        ...     pass
        >>> list(timer.seconds)
        ['factor']
    """

    def __init__(self) -> None:
        """Start with no phases."""
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent in the block to phase ``name``, also when the block fails."""
        start = perf_counter()
        _UNDER_WAY.append(name)
        try:
            with Task(name):
                yield
        finally:
            _UNDER_WAY.pop()
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
