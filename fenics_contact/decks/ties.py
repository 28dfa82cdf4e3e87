"""Which nodes of a slave a tie reaches: those within its position tolerance of the master."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh, Faces
from fenics_contact.shapes.triangles import TriangleTree


@dataclass(frozen=True, eq=False)
class Reach:
    """How far the nodes of a slave are from its master, and how far a tie reaches.

    `tied`: which of them have no node that is too far away; `apart`: nodes that are too far away; `farthest`:
    largest distance of nodes of tied faces; `tolerance`: distance up to which nodes are tied.
    """

    faces: Faces
    tied: np.ndarray
    apart: np.ndarray
    farthest: float
    tolerance: float

    @property
    def kept(self) -> Faces:
        """The faces that are tied."""
        return Faces(self.faces.elements[self.tied], self.faces.sides[self.tied])

    def in_words(self, slave: str, master: str, mesh: DeckMesh, least: float = 0.01) -> Iterator[str]:
        """Yield what is not tied, and gaps that stay.

        `least`: share of the tolerance from which on a gap counts.
        """
        if len(self.apart):
            number = mesh.blocks[0].card.label(mesh.numbers[self.apart[0]])
            yield (
                f"{len(self.apart)} nodes of {slave}, such as {number}, are farther from {master} than the "
                f"position tolerance {self.tolerance:.3g}: they stay apart, and {int((~self.tied).sum())} of "
                f"{len(self.tied)} faces, which have such nodes, are not tied"
            )
        if self.farthest > least * self.tolerance:
            yield (
                f"gaps of up to {self.farthest:.3g} stay between the tied faces of {slave} and {master}; "
                "CalculiX moves the slave's nodes onto the master"
            )


def reach_of(card: Card, mesh: DeckMesh, slave: Faces, master: Faces, share: float = 0.025) -> Reach:
    """Return which faces of a slave a tie reaches.

    Distances are those along the normals of the master's faces, so that nodes beyond its edge count by their
    distance from its continuation. `share`: tolerance, unless the card gives one, over the mean edge of the
    master's faces: that of the manual of CalculiX.
    """
    edges = [
        np.linalg.norm(mesh.points[np.roll(corners, -1, axis=1)] - mesh.points[corners], axis=2).ravel()
        for corners in mesh.corners(master)
    ]
    given = card.number_of("POSITIONTOLERANCE")
    tolerance = given if given >= 1e-10 else share * float(np.concatenate(edges).mean())
    nodes = mesh.nodes_of(slave)
    away = _distances(mesh.points[nodes], _triangles(mesh, master))
    far = np.zeros(len(mesh.points))
    far[nodes] = away
    worst = np.zeros(len(slave))
    for mine, _, _, members in mesh.parts_of(slave):
        worst[mine] = far[members].max(axis=1)
    tied = worst <= tolerance
    return Reach(slave, tied, nodes[away > tolerance], float(worst[tied].max(initial=0.0)), tolerance)


def _triangles(mesh: DeckMesh, faces: Faces) -> np.ndarray:
    """Return corners of triangles of faces, (n, 3, 3); of plane elements edges, whose last node repeats."""
    found = []
    for _, element, side, nodes in mesh.parts_of(faces):
        order = {node: place for place, node in enumerate(element.face_nodes[side])}
        points = mesh.points[nodes[:, [order[node] for node in element.rims[side]]]]
        if points.shape[1] == 8:  # the middle of a face of eight nodes
            middle = 0.5 * points[:, 1::2].sum(axis=1) - 0.25 * points[:, ::2].sum(axis=1)
            points = np.concatenate([points, middle[:, None]], axis=1)
        found.append(points[:, _CUT[points.shape[1], element.dim]].reshape(-1, 3, 3))
    return np.concatenate(found)


#: Triangles of the nodes around a face, and of its middle, by their number and the dimension of the space.
_CUT = {
    (2, 2): [[0, 1, 1]],
    (3, 2): [[0, 1, 1], [1, 2, 2]],
    (3, 3): [[0, 1, 2]],
    (4, 3): [[0, 1, 2], [0, 2, 3]],
    (6, 3): [[0, 1, 5], [1, 2, 3], [3, 4, 5], [1, 3, 5]],
    (9, 3): [[8, k, (k + 1) % 8] for k in range(8)],
}


def _distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return distances from the planes of the nearest triangles, or the lines of the nearest edges, (n,)."""
    near = TriangleTree(corners).closest(points)
    first, second = (corners[near.triangle, k] - corners[near.triangle, 0] for k in (1, 2))
    flat = np.einsum("nd,nd->n", second - first, second - first) == 0.0
    normal = np.cross(first, np.where(flat[:, None], [0.0, 0.0, 1.0], second))
    size = np.linalg.norm(normal, axis=1)
    away = points - near.point
    along = np.abs(np.einsum("nd,nd->n", away, normal)) / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.where(size > 0.0, along, np.linalg.norm(away, axis=1)))
