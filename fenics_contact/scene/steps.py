"""A sequence of loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fenics_contact.checks import checked
from fenics_contact.display import displayed
from fenics_contact.scene.loads import Load
from fenics_contact.scene.rigid_surfaces import AnySupport
from fenics_contact.scene.scene import Scene


@displayed
@dataclass(frozen=True)
@checked()
class LoadStep:
    """Loads and supports at the end of a step; what is not given stays as it was.

    Attributes:
        name: What the step does, for records.
        loads: All loads that act at the end of the step, or None.
        supports: All supports with their values at the end of the step, or None; they must hold the same
            components in every step.
        time: Time at the end of the step in any unit, for records and for obstacles that move; None: the
            number of the step, from 1.
    """

    name: str
    loads: Sequence[Load] | None = None
    supports: Sequence[AnySupport] | None = None
    time: float | None = None

    def applied_to(self, scene: Scene) -> Scene:
        """Return the scene at the end of the step."""
        loads = scene.loads if self.loads is None else self.loads
        supports = scene.supports if self.supports is None else self.supports
        return replace(scene, loads=loads, supports=supports)
