"""Motion, force and moment of rigid tools."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.forces import NodalForces, on_tool
from fenics_contact.results.rigid_motions import RigidMotion, in_words


@displayed
@dataclass(frozen=True, eq=False)
class ToolResult:
    """A rigid tool in a state.

    Attributes:
        displacement: Of its reference point, shape (dim,), [length].
        rotation: About that point, shape (3,) in space; one number in the plane, positive from x to y; in
            radians.
        force: That bodies exert on it by contact, shape (dim,), [force]. It balances what drives the tool:
            its force, springs, and reactions of prescribed components.
        moment: Of that force about the reference point, with small displacements where it is before it moves,
            shape (3,) in space, one number in the plane, [force·length].
    """

    displacement: np.ndarray
    rotation: np.ndarray | float
    force: np.ndarray
    moment: np.ndarray | float

    def __str__(self) -> str:
        """Return it in one line."""
        moved, turned, force, moment = map(
            in_words, (self.displacement, self.rotation, self.force, self.moment)
        )
        turning = f" and moment {moment} [force·length]" if np.size(self.moment) else ""
        return (
            f"displacement {moved} [length], rotation {turned} rad; contact exerts force {force} [force]"
            f"{turning} on it"
        )


class ToolResults(dict[str, ToolResult]):
    """The tools of a scene by name."""

    def __missing__(self, name: str) -> ToolResult:
        """Reject a name that no tool has."""
        raise InvalidInputError(
            f"tools of the scene are {', '.join(map(repr, self)) or 'none'}, got {name!r}: use one of these"
        )

    def __str__(self) -> str:
        """Return one line for each tool."""
        return "\n".join(f"{name}: {tool}" for name, tool in self.items()) or "none"


def tool_results(torn: TornSystem, forces: NodalForces, motions: Iterable[RigidMotion]) -> ToolResults:
    """Return the tools of a scene by name."""
    scene, found = torn.scene, ToolResults()
    for motion in motions:
        name = motion.surface.body
        if scene.bodies[name].is_rigid:
            point = motion.about + (motion.displacement if scene.deforms_much else 0.0)
            total = on_tool(torn, forces, name, point)
            found[name] = ToolResult(motion.displacement, motion.rotation, total.force, total.moment)
    return found
