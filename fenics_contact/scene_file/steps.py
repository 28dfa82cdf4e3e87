"""Load steps, several at once: values change linearly to those at the end, or as formulas of the time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import Field, PositiveFloat

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import Body, LoadStep
from fenics_contact.scene_file.evaluation import check_formulas
from fenics_contact.scene_file.expression import VectorExpression, at_time, between, changes
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import Line, LoadValue, StepComponents

if TYPE_CHECKING:
    from fenics_contact.scene_file.loads import AnyLoad, AnySupportPart

#: Largest total number of load steps of a file; longer histories are driven from Python.
MOST = 100_000


class StepPart(Part):
    """One load step or several: values go linearly from those before to those given here.

    A value given by a formula in t is what the formula says at the end of each load step.
    """

    name: Line = Field("step", description="what it does, for records")
    count: int = Field(1, ge=1, le=MOST, description="number of load steps in which the values are reached")
    duration: PositiveFloat | None = Field(
        None, description="time that they take together, for t in formulas; one for each load step by default"
    )
    supports: dict[str, StepComponents] = Field({}, description="name of a support -> its value at the end")
    loads: dict[str, LoadValue] = Field({}, description="name of a load -> its value at the end")


def load_steps(
    steps: Sequence[StepPart],
    supports: Sequence[AnySupportPart],
    loads: Sequence[AnyLoad],
    bodies: Mapping[str, Body],
    at: Callable[..., AbstractContextManager[None]],
) -> tuple[LoadStep, ...]:
    """Return all load steps, in their order.

    A support or load that a step does not name keeps its value; a named one changes linearly from the value
    before, initially its own, to the one given. A formula that depends on t is evaluated at the end of each
    load step instead, also in later steps and where it is the initial value; t starts at zero.

    Args:
        steps: The steps of the file.
        supports: All supports.
        loads: All loads.
        bodies: The bodies by name.
        at: Takes keys and returns a context that refers errors of its block to them.

    Raises:
        InvalidInputError: If there are too many, or one has a value that cannot be used.
    """
    with at("steps"):
        _require_few(steps)
    dim = next(iter(bodies.values())).mesh.dim
    held = _Values([part.name for part in supports], [part.size or (0.0,) * dim for part in supports])
    acting = _Values([part.name for part in loads], [part.size for part in loads])
    built: list[LoadStep] = []
    begin = 0.0
    for position, step in enumerate(steps):
        duration = step.duration or float(step.count)
        with at("steps", position):
            for number in range(1, step.count + 1):
                way = _Way(begin, begin + number / step.count * duration, number / step.count)
                name = step.name if step.count == 1 else f"{step.name} {number}/{step.count}"
                acted = tuple(map(_built(dim), loads, acting.on_the_way(step.loads, way)))
                held_up = tuple(map(_built(dim), supports, held.on_the_way(step.supports, way)))
                built.append(LoadStep(name, acted, held_up, way.time))
            for part in (*(built[-1].loads or ()), *(built[-1].supports or ())):
                check_formulas(part, bodies)
        held.reach(step.supports)
        acting.reach(step.loads)
        begin += duration
    return tuple(built)


def _built(dim: int) -> Callable[[Any, Any], Any]:
    return lambda part, value: part.build(dim, value)


@dataclass(frozen=True)
class _Way:
    """A moment of a step: time at its begin, time now, and the share of the step that is over."""

    begin: float
    time: float
    share: float

    def value(self, start: Any, end: Any) -> Any:
        """Return the value between those before the step and at its end, or of a formula in t."""
        if isinstance(start, tuple) and isinstance(end, tuple):
            return tuple(map(self.value, start, end))
        if changes(end):
            return at_time(end, self.time)
        if self.share == 1.0 or start is None or end is None:
            return end
        return between(_whole(at_time(start, self.begin)), _whole(end), self.share)


class _Values:
    """The values of all supports or loads as they stand in the file; steps change those with names."""

    def __init__(self, names: Sequence[str | None], values: Sequence[Any]) -> None:
        self._values = dict(enumerate(values))
        self._place = {name: place for place, name in enumerate(names) if name}

    def on_the_way(self, changed: Mapping[str, Any], way: _Way) -> list[Any]:
        """Return the values within a step, in the order of the file."""
        ends = {**self._values, **{self._place[name]: value for name, value in changed.items()}}
        return [way.value(start, ends[place]) for place, start in self._values.items()]

    def reach(self, changed: Mapping[str, Any]) -> None:
        """Replace the values that a step has changed."""
        self._values.update({self._place[name]: value for name, value in changed.items()})


def _whole(value: Any) -> Any:
    return VectorExpression(value) if isinstance(value, tuple) else value


def _require_few(steps: Sequence[StepPart]) -> None:
    count = sum(step.count for step in steps)
    if count > MOST:
        raise InvalidInputError(
            f"a file may have at most {MOST} load steps in all, got {count}: take larger steps, or drive a "
            "longer history from Python with LoadSequence"
        )
