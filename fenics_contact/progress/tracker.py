"""What is under way at the moment, put together from the events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fenics_contact.progress.event import Event, Kind
from fenics_contact.progress.remaining import Counted, Falling, Left
from fenics_contact.progress.words import duration, joined

#: Part of what may be done that must be done before the rest of it is told as a bound.
BOUNDING = 0.2


@dataclass
class Work:
    """A piece of work under way.

    Attributes:
        event: Its last event, with what earlier ones told.
        begun: When it began, [s].
        stepped: When it took its last step, [s].
        counted: What the last steps took.
        falling: How its measure falls.
    """

    event: Event
    begun: float
    stepped: float
    counted: Counted = field(default_factory=Counted)
    falling: Falling = field(default_factory=Falling)

    def take(self, event: Event, moment: float) -> None:
        """Take a step, or the end."""
        if event.kind is not Kind.STEP:
            self.event, self.stepped = replace(self.event, kind=event.kind, words=event.words), moment
            return
        before, done = self.event.number or 0, event.number or 0
        if event.timed and done > before:
            self.counted.add((moment - self.stepped) / (done - before))
        if event.measure is not None:
            self.falling.add(moment, event.measure)
        kept = {
            name: getattr(self.event, name)
            for name in ("number", "measure", "target", "value")
            if getattr(event, name) is None
        }
        self.event, self.stepped = replace(event, **kept), moment

    @property
    def shows_numbers(self) -> bool:
        """Whether more is known than that it is under way."""
        return self.event.number is not None or self.event.total is not None

    def fraction(self) -> float | None:
        """Return how much is done, from 0 to 1: of the pieces, or of the digits; None if nobody knows."""
        event, first = self.event, self.falling.first
        if event.total:
            return min((event.number or 0) / event.total, 1.0)
        if event.measure and event.target and first is not None and first > event.target:
            return min(max(math.log(first / event.measure) / math.log(first / event.target), 0.0), 1.0)
        return None

    def left(self, moment: float) -> Left | None:
        """Return how long it will still take, None where nobody knows."""
        event, done = self.event, self.event.number or 0
        if event.left is not None:
            return Left(max(event.left - (moment - self.stepped), 0.0))
        if event.total is not None:
            return self._for_pieces(event.total - done, moment)
        if event.target is not None:
            end = self.falling.end(event.target)
            if end is not None:
                return Left(max(end - moment, 0.0))
        if event.most is not None and done >= BOUNDING * event.most:
            found = self._for_pieces(event.most - done, moment)
            return None if found is None else replace(found, bound=True)
        return None

    def _for_pieces(self, pieces: int, moment: float) -> Left | None:
        """Return the time for so many pieces, the present one begun already."""
        whole = self.counted.seconds(pieces)
        if whole is None or pieces <= 0:
            return None
        others = self.counted.seconds(pieces - 1) or 0.0
        return Left(max(whole - (moment - self.stepped), others))


@dataclass(frozen=True)
class Row:
    """One line about a piece of work.

    Attributes:
        what: The work.
        details: Its numbers in words.
        fraction: How much is done, None if nobody knows.
        spent: How long it has taken, [s].
        left: How long it will still take.
    """

    what: str
    details: str
    fraction: float | None
    spent: float
    left: Left | None

    @property
    def left_in_words(self) -> str:
        """The time that is left: "about 3 min left"; empty below a second."""
        if self.left is None or self.left.seconds < 1.0:
            return ""
        return f"{'at most ' if self.left.bound else ''}about {duration(self.left.seconds)} left"

    def __str__(self) -> str:
        """Return the line."""
        name = f"{self.what}: {self.details}" if self.details else self.what
        return joined(name, self.left_in_words)


class Tracker:
    """Keeps the pieces of work that are under way, outer ones first."""

    def __init__(self) -> None:
        """Begin with none."""
        self._under_way: dict[int, Work] = {}

    def take(self, event: Event, moment: float) -> Work | None:
        """Take an event.

        Args:
            event: What happened.
            moment: When, [s].

        Returns:
            The work, where it is over and no other is under way.
        """
        known = self._under_way
        if event.kind is Kind.BEGIN:
            known.pop(event.task, None)
            known[event.task] = Work(event, moment, moment)
        elif event.kind is Kind.STEP:
            known.setdefault(event.task, Work(replace(event, number=None), moment, moment)).take(
                event, moment
            )
        else:
            return self._ended(event, moment)
        return None

    def _ended(self, event: Event, moment: float) -> Work | None:
        work = self._under_way.pop(event.task, None)
        if work is None:
            return None
        work.take(event, moment)
        around = list(self._under_way.values())
        if not around:
            return work
        outer = around[-1]
        if outer.event.what == work.event.what and not outer.shows_numbers:
            # A phase and the solver within it have one name: the phase ends with the solver's numbers.
            outer.event = replace(work.event, task=outer.event.task, kind=Kind.STEP)
        return None

    def rows(self, moment: float) -> Sequence[Row]:
        """Return what to tell at a moment: all work with numbers, and the innermost one."""
        works = list(self._under_way.values())
        told = [work for work in works if work.shows_numbers or work is works[-1]]
        return [_row(work, moment) for work in told]


def _row(work: Work, moment: float) -> Row:
    return Row(work.event.what, work.event.details, work.fraction(), moment - work.begun, work.left(moment))


def summary(work: Work) -> str:
    """Return one line about work that is over."""
    event = work.event
    if event.measure is not None and event.target is not None and event.measure > event.target:
        event = replace(event, measure=None)  # of the last step: it is over for another reason
    ending = "" if event.kind is Kind.END else event.kind.value
    return f"{event.what}: {joined(ending, event.details, duration(work.stepped - work.begun))}"
