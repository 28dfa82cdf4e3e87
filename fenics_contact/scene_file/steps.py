"""Load steps, several at once: values change linearly to those at the end."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from pydantic import Field

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import Body, LoadStep
from fenics_contact.scene_file.evaluation import check_formulas
from fenics_contact.scene_file.expression import between
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import Components, Line, LoadValue

if TYPE_CHECKING:
    from fenics_contact.scene_file.loads import AnyLoad, SupportPart

#: Largest total number of load steps of a file; longer histories are driven from Python.
MOST = 100_000


class StepPart(Part):
    """One load step or several: values go linearly from those before to those given here."""

    name: Line = Field("step", description="what it does, for records")
    count: int = Field(1, ge=1, le=MOST, description="number of load steps in which the values are reached")
    supports: dict[str, Components] = Field({}, description="name of a support -> its value at the end")
    loads: dict[str, LoadValue] = Field({}, description="name of a load -> its value at the end")


def load_steps(
    steps: Sequence[StepPart],
    supports: Sequence[SupportPart],
    loads: Sequence[AnyLoad],
    bodies: Mapping[str, Body],
    at: Callable[..., AbstractContextManager[None]],
) -> tuple[LoadStep, ...]:
    """Return all load steps, in their order.

    A support or load that a step does not name keeps its value; a named one changes linearly from the value
    before, initially its own, to the one given.

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
    held: dict[str, Any] = {part.name: part.value or (0.0,) * dim for part in supports if part.name}
    acting: dict[str, Any] = {part.name: part.size for part in loads if part.name}
    built: list[LoadStep] = []
    for position, step in enumerate(steps):
        with at("steps", position):
            for number in range(1, step.count + 1):
                share = number / step.count
                supported = {**held, **_on_the_way(held, step.supports, share)}
                loaded = {**acting, **_on_the_way(acting, step.loads, share)}
                name = step.name if step.count == 1 else f"{step.name} {number}/{step.count}"
                built.append(
                    LoadStep(
                        name,
                        loads=tuple(part.build(dim, loaded.get(part.name or "")) for part in loads),
                        supports=tuple(part.build(dim, supported.get(part.name or "")) for part in supports),
                    )
                )
            for part in (*(built[-1].loads or ()), *(built[-1].supports or ())):
                check_formulas(part, bodies)
        held.update(step.supports)
        acting.update(step.loads)
    return tuple(built)


def _require_few(steps: Sequence[StepPart]) -> None:
    count = sum(step.count for step in steps)
    if count > MOST:
        raise InvalidInputError(
            f"a file may have at most {MOST} load steps in all, got {count}: take larger steps, or drive a "
            "longer history from Python with LoadSequence"
        )


def _on_the_way(before: Mapping[str, Any], after: Mapping[str, Any], share: float) -> dict[str, Any]:
    return {name: way(before[name], value, share) for name, value in after.items()}


def way(start: Any, end: Any, share: float) -> Any:
    """Return the value, numbers or formulas, between ``start`` and ``end``."""
    if isinstance(end, tuple):
        return tuple(way(one, other, share) for one, other in zip(start, end, strict=True))
    return None if start is None or end is None else between(start, end, share)
