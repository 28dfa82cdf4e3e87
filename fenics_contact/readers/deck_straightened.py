"""Quadratic elements that are inverted by their curved edges, with straight ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact.readers.deck_bodies import inverted
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh


def straightened(mesh: DeckMesh, note: Callable[[Card, str], None], most: int = 5) -> DeckMesh:
    """Return a mesh without elements that are inverted only as their edges are curved.

    The nodes in the middles of their edges move onto the straight lines between the ends, also for their
    neighbours. Meshers leave such elements at small radii, and the other program overlooks them as it takes
    four points of ten-node tetrahedra. Elements that are inverted with straight edges stay as they are.

    Args:
        mesh: Nodes and elements.
        note: Takes what was moved, with the card of the elements.
        most: How often neighbours are looked at again.
    """
    curved = [block for block in mesh.blocks if block.element.edges]
    points = mesh.points
    for _ in range(most):
        moved = points.copy()
        for block in curved:
            bad, _ = inverted(block, points[:, : block.element.dim])
            nodes = block.nodes[bad]
            for first, second, middle in block.element.edges if len(bad) else ():
                moved[nodes[:, middle]] = 0.5 * (points[nodes[:, first]] + points[nodes[:, second]])
        if np.array_equal(moved, points):
            break
        points = moved
    away = np.linalg.norm(points - mesh.points, axis=1)
    if not away.any():
        return mesh
    note(
        curved[0].card,
        f"edges of elements that their curves turn inside out are straight: {np.count_nonzero(away)} nodes "
        f"in the middles of edges move by up to {away.max():.3g}",
    )
    return replace(mesh, points=points)
