"""The work under way, assembled from the events."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace

from fenics_contact.progress.event import Event, Kind
from fenics_contact.progress.words import duration, joined

#: Fraction of the digits, or of the limit, that must be done before the remaining time is reported.
ENOUGH = 0.2
#: Number of past steps used for an estimate.
WINDOW = 12


@dataclass
class Work:
    """A piece of work under way.

    Attributes:
        event: Its last event, completed from earlier ones.
        begun: Time of its start, [s].
        stepped: Time of its last event, [s].
        first: Its first measure.
        reached: Times and fractions done, of timed steps.
    """

    event: Event
    begun: float
    stepped: float
    first: float | None = None
    reached: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=WINDOW))

    def take(self, event: Event, moment: float) -> None:
        """Process an event of this work."""
        if event.kind is Kind.STEP:
            names = ("number", "measure", "target", "value")
            earlier = {name: getattr(self.event, name) for name in names if getattr(event, name) is None}
            self.event = replace(event, **earlier)
            self.first = event.measure if self.first is None else self.first
        else:
            self.event = replace(self.event, kind=event.kind, words=event.words)
        self.stepped = moment
        done = self.fraction if event.most is None else (self.event.number or 0) / event.most
        if done is None:
            return
        if not event.timed:
            self.reached.clear()
        if not self.reached or done > self.reached[-1][1]:
            self.reached.append((moment, done))

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

    def left(self, moment: float) -> str:
        """Return the remaining time at the pace of its last steps: "about 3 min left", or ""."""
        event, seconds, since = self.event, self.event.left, self.stepped
        if seconds is None and len(self.reached) > 1:
            (start, before), (since, done) = self.reached[0], self.reached[-1]
            if event.total is not None or done >= ENOUGH:
                seconds = (1.0 - done) * (since - start) / (done - before)
        seconds = 0.0 if seconds is None else seconds - (moment - since)
        bound = "at most " if event.most is not None else ""
        return f"{bound}about {duration(seconds)} left" if seconds >= 1.0 else ""

    def line(self, moment: float) -> str:
        """Return one line about it."""
        name, details = self.event.what, self.event.details
        return joined(f"{name}: {details}" if details else name, self.left(moment))

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
