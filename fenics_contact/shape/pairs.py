"""Which scenes and pairs of surfaces a design may move: those whose rows have shape derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fenics_contact.contact import ContactProblem
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import Scene, Surface, SurfaceLoad


def checked_contact(contact: ContactProblem) -> ContactProblem:
    """Return the contact problem of a shape problem.

    Raises:
        InvalidInputError: If it is none.
    """
    if not isinstance(contact, ContactProblem):
        raise InvalidInputError(
            f"ShapeProblem needs a ContactProblem, got {type(contact).__name__}: write "
            "ShapeProblem(ContactProblem(scene, comm), designs, objective)"
        )
    return contact


def check_case(first: Scene, scene: Scene, moving: Mapping[str, np.ndarray]) -> None:
    """Check that a scene is a load case of the same designs.

    Args:
        first: The scene of which designs move the bodies.
        scene: The load case.
        moving: Body name -> whether a design moves each node, shape (n_nodes,).

    Raises:
        InvalidInputError: Says what differs, or what has no derivative.
    """
    if set(scene.bodies) != set(first.bodies):
        raise InvalidInputError(
            f"load cases must share their bodies, got {sorted(scene.bodies)} beside {sorted(first.bodies)}: "
            "take the scene from dataclasses.replace(scene, loads=...) or LoadStep.applied_to(scene)"
        )
    for name, body in scene.bodies.items():
        mate = first.bodies[name]
        if body.mesh is not mate.mesh or body.materials != mate.materials:
            raise InvalidInputError(
                f"load cases must share their bodies, but {name!r} has another mesh or material: take the "
                "scene from dataclasses.replace(scene, loads=...) or LoadStep.applied_to(scene)"
            )
        if not np.array_equal(scene.fixed(name), first.fixed(name)):
            raise InvalidInputError(
                f"load cases must hold the same components, their supports of {name!r} differ: give other "
                "values, or hold by RigidSurface what only some cases move"
            )
    for load in scene.loads:
        if isinstance(load, SurfaceLoad):
            surface = Surface(load.body, load.surface)
            _check(scene, moving, (surface,), f"a {type(load).__name__}", "load another surface")


def _check(
    scene: Scene, moving: Mapping[str, np.ndarray], surfaces: Sequence[Surface], what: str, remedy: str
) -> None:
    for surface in surfaces:
        count = int(np.count_nonzero(moving[surface.body][np.unique(scene.facets(surface))]))
        if count:
            raise InvalidInputError(
                f"a design may move only surfaces whose rows have derivatives by the shape, but {what} lies "
                f"on {surface.name!r} of body {surface.body!r}, of which {count} nodes move: {remedy}"
            )
