"""Evaluation of formulas at the nodes before anything is solved, so that errors refer to their keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fenics_contact.scene import Body, DistanceObstacle, Support
from fenics_contact.scene_file.expression import Expression, VectorExpression


def check_formulas(part: Any, bodies: Mapping[str, Body]) -> None:
    """Evaluate the formulas of a support, load or pair at the nodes, as solvers will.

    Args:
        part: A part built from the file.
        bodies: The bodies by name.

    Raises:
        InvalidInputError: If one has no finite value at some node, or depends on z in the plane.
    """
    if isinstance(part, Support):
        if any(isinstance(component, Expression) for component in part.value):
            part.values(_nodes(bodies[part.body], part.surface))
    elif isinstance(getattr(part, "master", None), DistanceObstacle):
        part.master.distance(_nodes(bodies[part.slave.body], part.slave.name))
    elif isinstance(value := getattr(part, "value", None), Expression | VectorExpression):
        value(bodies[part.body].mesh.points)


def _nodes(body: Body, surface: str) -> np.ndarray:
    return np.asarray(body.mesh.points[np.unique(body.mesh.surfaces[surface])])
