"""The surfaces and bodies that a design moves, for the files that hold them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.shape import MovedSurface

if TYPE_CHECKING:
    from fenics_contact.mesh import BodyMesh
    from fenics_contact.shape import LoadPath, ShapeProblem

#: Largest distance of a node from its smooth surface, relative to the extent of the surface.
OFF = 1e-9


def moved_surfaces(problem: ShapeProblem | LoadPath, alpha: np.ndarray) -> tuple[MovedSurface, ...]:
    """Return the surface of every design, moved. Collective.

    Raises:
        InvalidInputError: If alpha does not fit, or a surface is moved by other designs as well.
    """
    points = problem.points_of(alpha)
    parts = np.split(np.asarray(alpha), np.cumsum([design.size for design in problem.designs])[:-1])
    found = []
    for design, part in zip(problem.designs, parts, strict=True):
        surface = MovedSurface(design, problem.scene.bodies[design.body].mesh, part)
        at = points[design.body][design.lattice.nodes]
        off = float(np.abs(surface.after(surface.parameters) - at).max())
        if off > OFF * float(np.ptp(at, axis=0).max()):
            raise InvalidInputError(
                f"a surface in a file must be moved by one design, that on {design.body!r} is moved by "
                f"{off:.3g} by another one, too: let the designs share no nodes, or give them narrower "
                "transitions"
            )
        found.append(surface)
    return tuple(found)


def moved_body(problem: ShapeProblem | LoadPath, alpha: np.ndarray, body: str | None) -> tuple[str, BodyMesh]:
    """Return the name and the mesh of a designed body in the shape of a design. Collective.

    Args:
        problem: The problem.
        alpha: Design variables, shape (size,), [length].
        body: Name of the body; may be None if designs move only one.

    Raises:
        InvalidInputError: If the body is not designed, or several are and none is named.
    """
    designed = sorted({design.body for design in problem.designs})
    if body not in designed and (body is not None or len(designed) > 1):
        raise InvalidInputError(
            f"the body must be one that a design moves, got {body!r}: name one of {designed}"
        )
    name = designed[0] if body is None else body
    return name, problem.scene_of(alpha).bodies[name].mesh
