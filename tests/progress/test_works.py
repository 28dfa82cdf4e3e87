"""What is under way: which part of it is done, which line describes it, and what remains."""

from __future__ import annotations

import pytest

from fenics_contact._base.progress import Event, Kind, Work, Works, duration


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
