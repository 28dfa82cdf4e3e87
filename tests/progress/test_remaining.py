"""Remaining time: by what pieces took, by the slope of a residual, and nothing where it would be a guess."""

from __future__ import annotations

import random

import pytest

from fenics_contact.progress import Event, Kind, duration
from fenics_contact.progress.remaining import Counted, Falling
from fenics_contact.progress.tracker import Tracker, summary


def fed(events: list[tuple[float, Event]]) -> Tracker:
    tracker = Tracker()
    for moment, event in events:
        tracker.take(event, moment)
    return tracker


def pieces(spent: list[float], total: int, **known: object) -> Tracker:
    """Return a tracker of work whose pieces took so long."""
    events, moment = [(0.0, Event(1, "steps", Kind.BEGIN, total=total, number=0))], 0.0
    for number, seconds in enumerate(spent, 1):
        moment += seconds
        events.append((moment, Event(1, "steps", Kind.STEP, total=total, number=number, **known)))  # type: ignore[arg-type]
    return fed(events)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, "?"), (0.0, "0 s"), (0.42, "0.4 s"), (7.6, "8 s"), (200.0, "3 min"), (7200.0, "2.0 h")],
)
def test_durations_are_words(seconds: float | None, words: str) -> None:
    assert duration(seconds) == words


def test_pieces_that_are_left_take_what_the_last_ones_took() -> None:
    assert Counted().seconds(3) is None
    (row,) = pieces([2.0, 2.0, 2.0], 10).rows(6.0)
    assert row.left_in_words == "about 14 s left"
    assert row.fraction == pytest.approx(0.3)


def test_the_piece_under_way_counts_down_and_no_further_than_the_others() -> None:
    tracker = pieces([4.0, 4.0], 5)
    assert [tracker.rows(8.0 + later)[0].left.seconds for later in (0.0, 3.0, 60.0)] == [12.0, 9.0, 8.0]  # type: ignore[union-attr]


def test_steps_that_were_only_read_say_nothing_about_time() -> None:
    assert pieces([0.1, 0.1], 5, timed=False).rows(0.2)[0].left is None


def test_a_residual_that_falls_evenly_tells_when_it_will_be_small_enough() -> None:
    falling, noise = Falling(), random.Random(1)
    for k in range(10):
        falling.add(float(k), 10.0 ** (-0.5 * k) * noise.uniform(0.9, 1.1))
    end = falling.end(1e-8)
    assert end == pytest.approx(16.0, rel=0.05)


def test_few_or_uneven_residuals_tell_nothing() -> None:
    few, uneven, rising = Falling(), Falling(), Falling()
    for k in range(5):
        few.add(float(k), 10.0**-k)
    for k in range(12):
        uneven.add(float(k), 10.0 ** (-0.01 * k if k < 6 else -2.0 * k))
        rising.add(float(k), 10.0**k)
    assert [course.end(1e-30) for course in (few, uneven, rising)] == [None, None, None]


def test_a_limit_is_told_as_a_bound_once_a_fifth_of_it_is_spent() -> None:
    def words(done: int) -> str:
        events = [(0.0, Event(1, "optimisation", Kind.BEGIN, most=20))]
        for number in range(1, done + 1):
            events.append((3.0 * number, Event(1, "optimisation", Kind.STEP, number=number, most=20)))
        return fed(events).rows(3.0 * done)[0].left_in_words

    assert words(3) == ""
    assert words(5) == "at most about 45 s left"


def test_rows_are_the_work_with_numbers_and_the_innermost_phase() -> None:
    tracker = fed(
        [
            (0.0, Event(1, "load steps", Kind.BEGIN, total=4, number=0)),
            (0.0, Event(2, "outer phase", Kind.BEGIN)),
            (1.0, Event(3, "factor", Kind.BEGIN)),
        ]
    )
    assert [str(row) for row in tracker.rows(1.0)] == ["load steps: 0 of 4", "factor"]
    assert [row.spent for row in tracker.rows(3.0)] == [3.0, 2.0]


def test_a_phase_ends_with_the_numbers_of_the_solver_within_it() -> None:
    tracker = Tracker()
    for moment, event in [
        (0.0, Event(1, "solve", Kind.BEGIN)),
        (0.0, Event(2, "solve", Kind.BEGIN, unit="products", target=1e-6)),
        (1.0, Event(2, "solve", Kind.STEP, unit="products", target=1e-6, number=54, measure=1e-7)),
        (2.0, Event(2, "solve", Kind.END, unit="products", target=1e-6)),
    ]:
        assert tracker.take(event, moment) is None
    work = tracker.take(Event(1, "solve", Kind.END), 2.2)
    assert work is not None
    assert summary(work) == "solve: 54 products, residual 1.0e-07 ≤ 1e-06, 2 s"
    assert tracker.rows(3.0) == []


def test_work_that_was_under_way_before_anybody_listened_is_shown() -> None:
    tracker = fed([(5.0, Event(1, "load steps", Kind.STEP, number=3, total=4))])
    assert str(tracker.rows(5.0)[0]) == "load steps: 3 of 4"


def test_the_end_of_unknown_work_is_nothing() -> None:
    assert Tracker().take(Event(1, "solve", Kind.END), 1.0) is None
