"""Load steps, several at once: values change linearly to those at the end, or as formulas of the time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import Field, PositiveFloat

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import Body, LoadStep, is_nonlinear
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
    in_parts = any(is_nonlinear(each) for body in bodies.values() for each in body.materials)
    held = _Values([part.name for part in supports], [part.size or (0.0,) * dim for part in supports])
    acting = _Values([part.name for part in loads], [part.size for part in loads])
    built: list[LoadStep] = []
    begin = 0.0
    for position, step in enumerate(steps):
        duration = step.duration or float(step.count)
        acted = _LoadHistory(tuple(loads), dim, acting.ways(step.loads), begin, duration)
        held_up = _LoadHistory(tuple(supports), dim, held.ways(step.supports), begin, duration)
        with at("steps", position):
            for number in range(1, step.count + 1):
                time, share = begin + number / step.count * duration, number / step.count
                name = step.name if step.count == 1 else f"{step.name} {number}/{step.count}"
                acts, holds = (
                    each if in_parts and each.varies else each.at(time, share) for each in (acted, held_up)
                )
                built.append(LoadStep(name, acts, holds, time))
            for part in (*acted.at(time, 1.0), *held_up.at(time, 1.0)):
                check_formulas(part, bodies)
        held.reach(step.supports)
        acting.reach(step.loads)
        begin += duration
    return tuple(built)


@dataclass(frozen=True)
class _LoadHistory:
    """All loads, or all supports, within a step, as a function of time.

    Attributes:
        parts: Those of the file.
        dim: Dimension of the bodies.
        ways: Their values before the step and at its end, or as formulas in t.
        begin: Time at the begin of the step.
        duration: Of the step.
    """

    parts: tuple[Any, ...]
    dim: int
    ways: tuple[tuple[Any, Any], ...]
    begin: float
    duration: float

    @property
    def varies(self) -> bool:
        """Whether a value is a formula in t."""
        return any(changes(end) for _, end in self.ways)

    def __call__(self, time: float) -> tuple[Any, ...]:
        """Return what the parts are at a time."""
        return self.at(time, (time - self.begin) / self.duration)

    def at(self, time: float, share: float) -> tuple[Any, ...]:
        """Return what the parts are at a time, after a share of the step."""
        values = [self._value(start, end, time, share) for start, end in self.ways]
        return tuple(part.build(self.dim, value) for part, value in zip(self.parts, values, strict=True))

    def _value(self, start: Any, end: Any, time: float, share: float) -> Any:
        """Return the value between those before the step and at its end, or of a formula in t."""
        if isinstance(start, tuple) and isinstance(end, tuple):
            return tuple(self._value(a, b, time, share) for a, b in zip(start, end, strict=False))
        if changes(end):
            return at_time(end, time)
        if share == 1.0 or start is None or end is None:
            return end
        return between(_whole(at_time(start, self.begin)), _whole(end), share)


class _Values:
    """The values of all supports or loads as they stand in the file; steps change those with names."""

    def __init__(self, names: Sequence[str | None], values: Sequence[Any]) -> None:
        self._values = dict(enumerate(values))
        self._place = {name: place for place, name in enumerate(names) if name}

    def ways(self, changed: Mapping[str, Any]) -> tuple[tuple[Any, Any], ...]:
        """Return the values before a step and at its end, in the order of the file."""
        ends = {**self._values, **{self._place[name]: value for name, value in changed.items()}}
        return tuple((start, ends[place]) for place, start in self._values.items())

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
