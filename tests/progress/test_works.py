"""What is under way: remaining time by the pace of the last steps, what is told of it, and what remains."""

from __future__ import annotations

import pytest

from fenics_contact.progress import Event, Kind, duration
from fenics_contact.progress.works import Work, Works


def fed(events: list[tuple[float, Event]]) -> Works:
    works = Works()
    for moment, event in events:
        works.take(event, moment)
    return works


def pieces(spent: list[float], total: int, **known: object) -> Work:
    """Return work whose pieces took so long."""
    events, moment = [(0.0, Event(1, "steps", Kind.BEGIN, total=total, number=0))], 0.0
    for number, seconds in enumerate(spent, 1):
        moment += seconds
        events.append((moment, Event(1, "steps", Kind.STEP, total=total, number=number, **known)))  # type: ignore[arg-type]
    return fed(events).shown()[0]


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


def test_pieces_that_are_left_take_what_the_last_ones_took() -> None:
    assert pieces([], 10).left(6.0) == ""
    work = pieces([2.0, 2.0, 2.0], 10)
    assert work.left(6.0) == "about 14 s left"
    assert work.fraction == pytest.approx(0.3)
    assert pieces([60.0] * 20 + [1.0] * 12, 40).left(1212.0) == "about 8 s left"


def test_the_piece_under_way_counts_down() -> None:
    work = pieces([4.0, 4.0], 5)
    assert [work.left(8.0 + later) for later in (0.0, 3.0, 60.0)] == ["about 12 s left", "about 9 s left", ""]


def test_steps_that_were_only_read_say_nothing_about_time() -> None:
    assert pieces([5.0, 5.0], 5, timed=False).left(10.0) == ""


def test_work_that_knows_better_says_itself_how_long_it_takes() -> None:
    assert pieces([2.0, 2.0], 5, left=60.0).left(14.0) == "about 50 s left"


def test_a_residual_that_falls_tells_when_it_will_be_small_enough() -> None:
    work = falling([10.0 ** (-0.5 * k) for k in range(11)])
    assert work.fraction == pytest.approx(5 / 8)
    assert work.left(10.0) == "about 6 s left"


def test_residuals_that_have_hardly_fallen_or_rise_tell_nothing() -> None:
    assert falling([1.0, 0.5, 0.2]).left(2.0) == ""
    assert falling([1.0, 10.0, 100.0]).left(2.0) == ""
    assert falling([1e-9, 1e-9]).fraction is None


def test_a_limit_is_told_as_a_bound_once_a_fifth_of_it_is_spent() -> None:
    def words(done: int) -> str:
        events = [(0.0, Event(1, "optimisation", Kind.BEGIN, most=20))]
        for number in range(1, done + 1):
            events.append((3.0 * number, Event(1, "optimisation", Kind.STEP, number=number, most=20)))
        return fed(events).shown()[0].left(3.0 * done)

    assert words(3) == ""
    assert words(5) == "at most about 45 s left"


def test_what_is_told_is_the_work_with_numbers_and_the_innermost_phase() -> None:
    works = fed(
        [
            (0.0, Event(1, "load steps", Kind.BEGIN, total=4, number=0)),
            (0.0, Event(2, "outer phase", Kind.BEGIN)),
            (1.0, Event(3, "factor", Kind.BEGIN)),
        ]
    )
    assert [work.line(1.0) for work in works.shown()] == ["load steps: 0 of 4", "factor"]
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
    assert works.shown()[0].line(5.0) == "load steps: 3 of 4"


def test_the_end_of_unknown_work_is_nothing() -> None:
    assert Works().take(Event(1, "solve", Kind.END), 1.0) is None
