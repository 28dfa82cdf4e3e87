"""A sequence of loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, user_code
from fenics_contact.scene.loads import Load
from fenics_contact.scene.rigid_surfaces import AnySupport
from fenics_contact.scene.scene import Scene

#: Loads or supports as functions of time.
LoadsInTime: TypeAlias = Callable[[float], Sequence[Load]]
SupportsInTime: TypeAlias = Callable[[float], Sequence[AnySupport]]


@displayed
@dataclass(frozen=True)
@checked()
class LoadStep:
    """Loads and supports at the end of a step; what is not given stays as it was.

    Friction and histories of materials are those of one step, by backward Euler: slip counts from the start
    of the step to its end, also the way of points before they touch, so that a step ends best where bodies
    touch, turn back or change their direction.

    Where a step is followed in parts, as large deformations are, values change in proportion to the time,
    rotations of rigid surfaces by their angles. Functions of time have their values at every part: ramps and
    cycles are steps with the same function. Parts are no finer history, unless
    `AutomaticSteps.finer_history` says so.

    Attributes:
        name: What the step does, for records.
        loads: All loads that act at the end of the step, a function that returns them at a time, or None.
        supports: All supports with their values at the end of the step, a function that returns them at a
            time, or None; they must hold the same components in every step.
        time: Time at the end of the step in any unit, for records, functions of time, obstacles that move
            and materials that creep; None: the number of the step, from 1.

    Raises:
        InvalidInputError: If there are functions of time, and no time, or it is not finite.

    Example:
        >>> def turned(t):
        ...     return [RigidSurface("rod", "top", (0, 0, 9), (0, 0, 0), (0, 0, np.sin(t)))]
        >>> twist = [LoadStep(f"twist {t:.1f}", supports=turned, time=t) for t in np.linspace(0.1, 6.3, 63)]
    """

    name: str
    loads: Sequence[Load] | LoadsInTime | None = None
    supports: Sequence[AnySupport] | SupportsInTime | None = None
    time: float | None = None

    def __post_init__(self) -> None:
        """Reject functions of time without a time, and a time that is none."""
        if self.time is not None and not np.isfinite(self.time):
            raise InvalidInputError(
                f"time of LoadStep {self.name!r} must be a finite number or None, got {self.time!r}: give "
                "the time at its end"
            )
        if self.time is None and (callable(self.loads) or callable(self.supports)):
            raise InvalidInputError(
                f"LoadStep {self.name!r} must have the time at its end, its loads or supports are functions "
                "of it: give time=..."
            )

    def applied_to(self, scene: Scene) -> Scene:
        """Return the scene at the end of the step.

        Raises:
            InvalidInputError: If a function of time returns no loads or supports.
            UserCodeError: If it raises.
        """
        loads = scene.loads if self.loads is None else self.loads
        supports = scene.supports if self.supports is None else self.supports
        end = 0.0 if self.time is None else self.time
        return self._with(scene, loads, supports, end)

    def at(self, scene: Scene, time: float) -> Scene:
        """Return a scene with the functions of time at another time; the rest stays as it is."""
        loads = self.loads if callable(self.loads) else scene.loads
        supports = self.supports if callable(self.supports) else scene.supports
        return self._with(scene, loads, supports, time)

    def _with(
        self,
        scene: Scene,
        loads: Sequence[Load] | LoadsInTime,
        supports: Sequence[AnySupport] | SupportsInTime,
        time: float,
    ) -> Scene:
        if callable(loads):
            with user_code(f"the loads of LoadStep {self.name!r} at time {time:g}"):
                loads = tuple(loads(time))
        if callable(supports):
            with user_code(f"the supports of LoadStep {self.name!r} at time {time:g}"):
                supports = tuple(supports(time))
        return replace(scene, loads=loads, supports=supports)
