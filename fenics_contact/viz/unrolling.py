"""Surfaces around an axis, unrolled: around it to the right, along it up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.mesh import vector_areas
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import axis_label

#: A surface runs around an axis if Σ A n nᵀ has one eigenvalue below this fraction of the next.
SLENDER = 0.05
#: Its nodes may lie farther or nearer than the mean radius by this fraction of it.
ROUND = 0.1


@dataclass(frozen=True)
class Unrolling:
    """A cylinder that is cut open along a line.

    Attributes:
        centre: A point of its axis, (3,), [length].
        frame: Direction of angle 0, direction of a quarter turn, and axis as rows, (3, 3), right-handed.
        radius: [length].
        middle: Angle opposite of the cut, [rad].
    """

    centre: np.ndarray
    frame: np.ndarray
    radius: float
    middle: float

    def angles(self, points: np.ndarray) -> np.ndarray:
        """Return the angles of points (..., 3), within half a turn of the middle, [rad]."""
        zero, quarter = np.moveaxis((points - self.centre) @ self.frame[:2].T, -1, 0)
        return np.asarray(self.middle + _half_turn(np.arctan2(quarter, zero) - self.middle))

    def unroll(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unroll a surface; facets that the cut runs through stay whole, and their nodes are there twice.

        Args:
            points: Nodes of the body, (n, 3).
            facets: Facets of linear shape, (m, 3 | 4).

        Returns:
            The node of every place, (k,); the places, (k, 2); facets as rows of places. The first place of a
            node is within half a turn of the middle, if a facet is there.
        """
        angles = self.angles(points)
        around = self.angles(points[facets].mean(axis=1))
        turns = np.round((around[:, None] - angles[facets]) / (2 * np.pi)).astype(int)
        keys, rows = np.unique(
            np.column_stack([turns.ravel() ** 2, turns.ravel(), facets.ravel()]), axis=0, return_inverse=True
        )
        node = keys[:, 2]
        arcs = self.radius * (angles[node] + 2 * np.pi * keys[:, 1])
        return node, np.column_stack([arcs, points[node] @ self.frame[2]]), rows.reshape(facets.shape)

    def turn(self, vectors: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return vectors at points, both (n, 3), as they run on the unrolled surface, (n, 2)."""
        angles = self.angles(points)
        around = np.cos(angles)[:, None] * self.frame[1] - np.sin(angles)[:, None] * self.frame[0]
        return np.column_stack([np.einsum("nd,nd->n", vectors, around), vectors @ self.frame[2]])

    def labels(self, units: Units) -> tuple[str, str]:
        """Return the labels of the horizontal and the vertical axis."""
        axis, zero = axis_label(self.frame[2]), axis_label(self.frame[0])
        if not axis:
            return f"around the axis ({units.length})", f"along the axis ({units.length})"
        return f"around {axis} ({units.length}), 0 towards {zero}", f"{axis} ({units.length})"


def unrolling_of(
    points: np.ndarray, facets: np.ndarray, places: np.ndarray, force: np.ndarray
) -> Unrolling | None:
    """Fit a cylinder to a surface that runs around an axis; None if it does not.

    Args:
        points: Nodes of the body, (n, 3), [length].
        facets: Facets of linear shape, (m, 3 | 4).
        places: Where forces act on it, (k, 3): the cut is opposite of their middle.
        force: Their sizes, (k,).
    """
    areas = vector_areas(points, facets)
    size = np.linalg.norm(areas, axis=1)
    values, vectors = np.linalg.eigh((areas / size[:, None]).T @ areas)
    if values[0] > SLENDER * values[1]:
        return None
    frame, nodes = _frame(vectors[:, 0]), points[np.unique(facets)]
    flat = nodes @ frame[:2].T
    origin = flat.mean(axis=0)
    flat -= origin
    # |p|² = 2 c·p + r² − |c|² on a circle of centre c and radius r.
    terms = np.column_stack([2 * flat, np.ones(len(flat))])
    fitted = np.linalg.lstsq(terms, np.sum(flat**2, axis=1), rcond=None)[0]
    middle, radius = fitted[:2], float(np.sqrt(fitted[2] + fitted[:2] @ fitted[:2]))
    if np.abs(np.linalg.norm(flat - middle, axis=1) - radius).max() > ROUND * radius:
        return None
    cylinder = Unrolling((origin + middle) @ frame[:2], frame, radius, 0.0)
    strong = frame[:2] @ (force @ (places - cylinder.centre))
    # Forces alike all around point nowhere.
    alike = np.linalg.norm(strong) < 1e-3 * radius * force.sum()
    return replace(cylinder, middle=0.0 if alike else float(np.arctan2(strong[1], strong[0])))


def _frame(axis: np.ndarray) -> np.ndarray:
    """Return a right-handed frame, (3, 3), whose last row is a unit vector, along and not against x, y or z.

    Along an axis angle 0 is at the next one: around z they count from x to y.
    """
    main = int(np.argmax(np.abs(axis)))
    axis = np.sign(axis[main]) * axis
    zero = np.eye(3)[(main + 1) % 3] - axis[(main + 1) % 3] * axis
    zero /= np.linalg.norm(zero)
    return np.array([zero, np.cross(axis, zero), axis])


def _half_turn(angles: np.ndarray) -> np.ndarray:
    """Return angles from −π to below π."""
    return (angles + np.pi) % (2 * np.pi) - np.pi
