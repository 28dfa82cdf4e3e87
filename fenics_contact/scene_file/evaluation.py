"""Evaluation of formulas at the nodes before anything is solved, so that errors refer to their keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fenics_contact.scene import Body, ContactPair, DistanceObstacle, Support, SurfaceLoad


def check_formulas(part: Any, bodies: Mapping[str, Body]) -> None:
    """Evaluate the formulas of a support, load or pair at the nodes, as solvers will.

    Args:
        part: A part built from the file.
        bodies: The bodies by name.

    Raises:
        InvalidInputError: If one has no finite value at some node, or depends on z in the plane.
    """
    if isinstance(part, Support):
        if any(map(callable, part.value)):
            part.values(_nodes(bodies[part.body], part.surface))
    elif isinstance(part, ContactPair):
        if isinstance(part.master, DistanceObstacle):
            part.master.distance(_nodes(bodies[part.slave.body], part.slave.name))
    elif callable(value := getattr(part, "value", None)):
        body = bodies[part.body]
        value(_nodes(body, part.surface) if isinstance(part, SurfaceLoad) else body.mesh.points)


def check_pair(pair: ContactPair, key: str, bodies: Mapping[str, Body]) -> None:
    """Evaluate the friction, gap or interference of a pair, whichever the key is, at the slave's nodes.

    Raises:
        InvalidInputError: If it is a function that has no finite value somewhere, or a negative one.
    """
    nodes = _nodes(bodies[pair.slave.body], pair.slave.name)
    if key == "friction":
        pair.friction_at(nodes)
    elif getattr(pair, key) is not None:
        pair.gap_at(nodes)


def _nodes(body: Body, surface: str) -> np.ndarray:
    return np.asarray(body.mesh.points[np.unique(body.mesh.surfaces[surface])])
