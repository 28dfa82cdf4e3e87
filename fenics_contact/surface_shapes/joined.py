"""Surfaces of several shapes: flat and round faces, fillets between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.checks import checked
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.protocol import Quantity, SurfaceShape

#: Samples on each edge of a border.
SAMPLES = 4
#: Weight of the distance along a shape beyond its part. Near a ridge two parts are equally far away; this
#: selects the one above which a point is higher, whose distance is closer to that from the ridge.
BEYOND = 2.0


@displayed
@dataclass(frozen=True)
@checked("facets")
class Joined:
    """A surface of several shapes, each limited to its facets; the nearest one is evaluated.

    Attributes:
        shapes: The shapes; each may extend beyond its part of the surface.
        facets: For each shape the corners of facets of its part, (n_facets, 4 | 3 | 2, dim), [length].
    """

    shapes: Sequence[SurfaceShape]
    facets: Sequence[np.ndarray]

    def __post_init__(self) -> None:
        """Reject shapes without facets."""
        if not self.shapes or len(self.shapes) != len(self.facets) or not all(map(len, self.facets)):
            raise InvalidInputError(
                f"Joined.facets must hold facets for each of the {len(self.shapes)} shapes, got "
                f"{[len(each) for each in self.facets]}: give the parts of the surface that have the shapes"
            )

    def _facts(self) -> dict[str, str]:
        kinds = Counter(type(shape).__name__ for shape in self.shapes)
        return {
            "shapes": ", ".join(f"{count} × {kind}" for kind, count in kinds.items()),
            "facets": str(sum(map(len, self.facets))),
        }

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return int(self.facets[0].shape[2])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance from the nearest shape."""
        return self._of_nearest("distance", points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the normals of the nearest shape."""
        return self._of_nearest("normals", points)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the curvatures of the nearest shape."""
        return self._of_nearest("curvatures", points)

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return the numbers of the shapes whose parts of the surface are the nearest, (n, dim) -> (n,)."""
        return np.argmin([self._away(number, points) for number in range(len(self.shapes))], axis=0)

    def _of_nearest(self, what: Quantity, points: np.ndarray) -> np.ndarray:
        """Evaluate each shape at the points to which it is the nearest."""
        nearest = self.nearest(points)
        order = ("distance", "normals", "curvatures").index(what)
        answer = np.zeros((len(points), *[points.shape[1]] * order))
        for number, shape in enumerate(self.shapes):
            mine = nearest == number
            if mine.any():
                answer[mine] = getattr(shape, what)(points[mine])
        return answer

    def _away(self, number: int, points: np.ndarray) -> np.ndarray:
        """Return the distance of points from a shape's part of the surface, (n,)."""
        shape = self.shapes[number]
        distance = shape.distance(points)
        if (border := self._borders[number]) is None:
            return np.abs(distance)
        tree, outwards = border
        feet = points - distance[:, None] * shape.normals(points)
        _, closest = tree.query(feet)
        over = np.einsum("nd,nd->n", feet - tree.data[closest], outwards[closest])
        return np.hypot(distance, BEYOND * np.maximum(over, 0.0))

    @cached_property
    def _borders(self) -> list[tuple[cKDTree, np.ndarray] | None]:
        """For each shape samples of its part's border and directions out of it; None if it is closed."""
        return [_border(shape, part) for shape, part in zip(self.shapes, self.facets, strict=True)]


def _border(shape: SurfaceShape, facets: np.ndarray) -> tuple[cKDTree, np.ndarray] | None:
    """Return samples of the sides of only one facet, and tangents that leave the part across them."""
    alone = _alone(facets)
    if not alone.any():
        return None
    start = facets[alone]
    outwards = start - np.broadcast_to(facets.mean(axis=1, keepdims=True), facets.shape)[alone]
    if facets.shape[2] == 3:
        along = np.roll(facets, -1, axis=1)[alone] - start
        share = (np.arange(SAMPLES) + 0.5) / SAMPLES
        start = (start[:, None] + share[:, None] * along[:, None]).reshape(-1, 3)
        along, outwards = np.repeat(along, SAMPLES, axis=0), np.repeat(outwards, SAMPLES, axis=0)
        across = np.cross(along, shape.normals(start))
        outwards = np.sign(np.einsum("nd,nd->n", across, outwards))[:, None] * across
    else:
        normals = shape.normals(start)
        outwards = outwards - np.einsum("nd,nd->n", outwards, normals)[:, None] * normals
    return cKDTree(start), outwards / np.linalg.norm(outwards, axis=1)[:, None]


def _alone(facets: np.ndarray) -> np.ndarray:
    """Return which sides of facets are not shared: each from a corner to the next; in the plane corners."""
    count, corners, dim = facets.shape
    lengths = np.linalg.norm(np.roll(facets, -1, axis=1) - facets, axis=2)
    # Corners coincide if they differ by less than a millionth of the shortest side.
    rounded = np.round(facets.reshape(-1, dim) / (1e-6 * lengths.min()))
    number = np.unique(rounded, axis=0, return_inverse=True)[1].reshape(count, corners, 1)
    sides = number if dim == 2 else np.concatenate([number, np.roll(number, -1, axis=1)], axis=2)
    sides = np.sort(sides.reshape(count * corners, -1), axis=1)
    _, which, times = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return np.asarray((times[which.ravel()] == 1).reshape(count, corners))
