"""Heat of plastic work: that of a step at the points of the quadrature, spread to nodes as sources are."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.cell_types import shape_values
from fenics_contact.results.at_points import QuadraturePoints, added_up


def plastic_work(before: Any, state: Any, name: str) -> np.ndarray:
    """Return the plastic work of a body after a state before, None at rest, at nodes, (n_nodes,), [energy].

    Its sum is all of it, of plane bodies by thickness. Collective on first use of a state.
    """
    body, after = state.scene.bodies[name], state.history.values[name]
    first = np.zeros_like(after) if before is None else before.history.values[name]
    density = np.zeros(after.shape[:2])
    for number, material in enumerate(body.materials):
        if has_history(material):
            size, mine = material.history_size, body.material_of_cells == number
            ends = (each[mine][..., :size].reshape(-1, size) for each in (first, after))
            density[mine] = material.plastic_work(*ends).reshape(density[mine].shape)
    points = QuadraturePoints(body, np.zeros_like(body.mesh.points))
    spread = (points.weights * density) @ shape_values(body.element.cell, points.positions)
    return added_up(body.mesh, spread[..., None])[:, 0]
