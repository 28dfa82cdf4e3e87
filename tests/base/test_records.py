"""What the package reports: records with numbers in them, and hardly any work where nobody listens."""

from __future__ import annotations

import logging
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, PhaseTimer, box_partition, minimize, solve_steps
from fenics_contact._base.progress import LOGGER_NAME, Event, Kind, Task
from fenics_contact._optimize.result import Record
from fenics_contact.design import BundleTrust
from fenics_contact.qp import FaceNewton, Smalse
from tests.equilibrium.step_cases import sheared_block, shears
from tests.optimize.cases import BY_NAME
from tests.optimize.nonlinear_cases import NONLINEAR


class Collector(logging.Handler):
    """Keeps the records."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)

    @property
    def events(self) -> list[Event]:
        return [record.progress for record in self.records]  # type: ignore[attr-defined]


@contextmanager
def heard() -> Iterator[Collector]:
    logger, collector = logging.getLogger(LOGGER_NAME), Collector()
    before = logger.level
    logger.setLevel(logging.DEBUG)
    logger.addHandler(collector)
    try:
        yield collector
    finally:
        logger.removeHandler(collector)
        logger.setLevel(before)


def sheared(steps: int, solver: FaceNewton | Smalse) -> int:
    """Shear a block; return the products."""
    scene = sheared_block()
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    states = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=solver), shears()[:steps]
    )
    return sum(state.solution.products for state in states)


def balanced(events: list[Event]) -> bool:
    """Tell whether everything that begins ends, inner before outer."""
    under_way: list[int] = []
    for event in events:
        if event.kind is Kind.BEGIN:
            under_way.append(event.task)
        elif event.kind is not Kind.STEP and under_way.pop() != event.task:
            return False
    return not under_way


def test_records_come_from_one_logger_at_level_debug_with_text_and_numbers() -> None:
    with heard() as collector, Task("load steps", total=2) as task:
        task.step(1, words="pull")
    assert {(record.name, record.levelno) for record in collector.records} == {(LOGGER_NAME, logging.DEBUG)}
    assert [record.getMessage() for record in collector.records] == [
        "load steps: begins, 0 of 2",
        "load steps: 1 of 2, pull",
        "load steps: done",
    ]
    step = collector.events[1]
    assert (step.what, step.kind, step.number, step.total) == ("load steps", Kind.STEP, 1, 2)


def test_a_step_says_how_far_its_residual_is_from_the_target() -> None:
    with heard() as collector:
        task = Task("solve", unit="products", target=1e-6)
        task.step(1, measure=2.5e-3)
        task.step(54, measure=8e-7)
        Task("solve", unit="products", target=2.5e-8).step(60, measure=8e-7, value=-1234.5)
    assert [str(event) for event in collector.events] == [
        "solve: 1 product, residual 2.5e-03 > 1e-06",
        "solve: 54 products, residual 8.0e-07 ≤ 1e-06",
        "solve: 60 products, best -1234.5, residual 8.0e-07 > 2.5e-08",
    ]


def test_a_failure_is_told_and_passes() -> None:
    with heard() as collector, pytest.raises(ZeroDivisionError), Task("factor"):
        1 / 0
    assert [event.kind for event in collector.events] == [Kind.BEGIN, Kind.FAILED]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_what_is_interrupted_has_not_failed(stop: type[BaseException]) -> None:
    with heard() as collector, pytest.raises(stop), Task("factor"):
        raise stop
    assert [str(event) for event in collector.events] == ["factor: begins", "factor: stopped"]


def test_phases_of_a_timer_are_told() -> None:
    timer = PhaseTimer()
    with heard() as collector, timer.phase("mesh"):
        pass
    assert [str(event) for event in collector.events] == ["mesh: begins", "mesh: done"]


@pytest.mark.parametrize(
    "solver", [FaceNewton(tolerance=1e-5), Smalse(tolerance=1e-3)], ids=lambda s: type(s).__name__
)
def test_load_steps_tell_steps_phases_products_and_residuals(solver: FaceNewton | Smalse) -> None:
    with heard() as collector:
        products = sheared(2, solver)
    events = collector.events
    assert balanced(events)
    names = [event.what for event in events if event.kind is Kind.BEGIN]
    assert names[0] == "load steps"
    assert {"decompose", "assemble", "factor", "coarse space", "solve"} <= set(names)
    steps = [event for event in events if event.what == "load steps" and event.kind is Kind.STEP]
    assert [event.number for event in steps] == [0, 1, 1, 2]
    assert [event.words for event in steps] == ["shift 0", "", "shift 0.006", ""]
    assert {event.total for event in steps} == {2}
    solves = [event for event in events if event.what == "solve" and event.number is not None]
    inner = {event.task for event in solves if event.unit == "products"}
    told = [event.measure for event in solves if event.measure is not None]
    assert inner
    assert told[-1] <= solver.tolerance
    assert max(event.number or 0 for event in solves) > 1
    assert products > 10


def test_a_minimisation_tells_evaluations_best_value_and_predicted_decrease() -> None:
    case, method = BY_NAME["Maxquad"], BundleTrust(tolerance=1e-4)
    seen: list[Record] = []
    with heard() as collector:
        result = minimize(case.fun, case.start, method, callback=lambda record, _: seen.append(record))
    events = collector.events
    assert balanced(events)
    steps = [event for event in events if event.kind is Kind.STEP]
    assert [event.number for event in steps] == [record.evaluations for record in seen]
    assert [event.value for event in steps] == [record.best for record in seen]
    assert len(steps) == result.evaluations > 5
    assert {(event.most, event.target, event.measured) for event in steps} == {(500, 1e-4, "decrease")}
    predicted = seen[-1].predicted_decrease / (1.0 + abs(seen[-1].best))
    assert steps[-1].measure == pytest.approx(predicted)
    assert events[-1].words == result.reason.name.lower()


def test_a_constrained_minimisation_tells_its_violation() -> None:
    case = NONLINEAR["Rosen-Suzuki"]
    with heard() as collector:
        result = minimize(case.fun, case.start, constraints=list(case.constraints))
    steps = [event for event in collector.events if event.kind is Kind.STEP]
    assert [step.words for step in steps] == [f"violation {each.violation:.1e}" for each in result.history]
    assert "violation" in steps[-1].details


def test_nobody_listening_costs_a_few_calls_a_product_and_no_event(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: Counter[str] = Counter()

    def never(*_: object, **__: object) -> None:
        pytest.fail("an event is made that nobody hears")

    def counting(name: str) -> Callable[..., None]:
        original = getattr(Task, name)

        def counted(*given: object, **more: object) -> None:
            calls[name] += 1
            original(*given, **more)

        return counted

    for name in ("begin", "step", "end"):
        monkeypatch.setattr(Task, name, counting(name))
    monkeypatch.setattr(sys.modules[Task.__module__], "replace", never)
    products = sheared(3, FaceNewton(tolerance=1e-6))
    assert products > 30
    assert calls["step"] > products / 2, "the products are not told"
    assert calls["step"] < 2 * products
    assert calls["begin"] + calls["end"] < 2 * products
