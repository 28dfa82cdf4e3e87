"""Bodies whose surface is a closed triangulation, as in STL files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenics_contact._base.checks import LARGEST, checked
from fenics_contact._base.display import counted, displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes.simple import outer
from fenics_contact.shapes.triangles import ClosestOnTriangles, TriangleTree

#: The corners of the sides of a triangle, that opposite to each corner.
SIDES = np.array([[1, 2], [2, 0], [0, 1]])


@displayed
@dataclass(frozen=True, eq=False)
@checked("points", "triangles")
class Triangulation:
    """A body bounded by triangles that close around it.

    The distance is that of the triangles, its sign by the mean normal at the closest triangle, edge or
    corner, which is right at every edge and corner. Normals are interpolated between the corners where
    triangles join at less than an angle, so that they are continuous along a round surface; elsewhere edges
    are sharp, and around them normals are those of the distance.

    Attributes:
        points: Coordinates, shape (n, 3), [length]; equal ones are merged.
        triangles: Corners of the triangles, counterclockwise seen from outside, shape (m, 3).
        smooth: Largest angle between triangles of a round surface, in radians; 0 keeps all edges sharp.

    Raises:
        InvalidInputError: If the triangles leave open edges, differ in their orientation or face inwards.

    Reference: J. A. Bærentzen, H. Aanæs, *Signed distance computation using the angle weighted pseudonormal*,
    IEEE Trans. Visual. Comput. Graphics 11 (2005) 243–253.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Triangulation
        >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
        >>> tip = Triangulation(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> tip.distance(np.array([[0.25, 0.25, -0.5], [0.25, 0.25, 0.125]]))
        array([ 0.5  , -0.125])
    """

    points: np.ndarray
    triangles: np.ndarray
    smooth: float = np.pi / 6

    def __post_init__(self) -> None:
        """Merge equal points; reject surfaces that are not closed or face inwards."""
        points, triangles = _arrays(self.points, self.triangles)
        if not 0.0 <= self.smooth <= np.pi:
            raise InvalidInputError(f"smooth must be an angle from 0 to π in radians, got {self.smooth!r}")
        points, triangles = _merged(points, triangles)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "triangles", triangles)
        self._require_closed()
        self._require_outward()

    def _facts(self) -> dict[str, Any]:
        return {
            "triangles": len(self.triangles),
            "box": [self.points.min(axis=0), self.points.max(axis=0)],
            "sharp edges": int(np.count_nonzero(self._sharp)) // 2,
        }

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance from the triangles."""
        near = self._closest(points)
        arm = points - near.point
        side = np.einsum("nd,nd->n", arm, self._mean_normals(near))
        return np.asarray(np.linalg.norm(arm, axis=1) * np.where(side < 0, -1.0, 1.0))

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return interpolated normals, around sharp edges the gradient of the distance."""
        near = self._closest(points)
        mixed = np.einsum("nk,nkd->nd", near.weights, self._corner_normals[near.triangle])
        sharp = self._at_sharp(near)
        arm, mean = (points - near.point)[sharp], self._mean_normals(near)[sharp]
        away = np.linalg.norm(arm, axis=1)[:, None]
        side = np.where(np.einsum("nd,nd->n", arm, mean) < 0, -1.0, 1.0)[:, None]
        mixed[sharp] = np.where(away > self._tiny, side * arm, mean)
        return np.asarray(mixed / np.linalg.norm(mixed, axis=1)[:, None])

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the derivatives of the normals, (n, 3) -> (n, 3, 3), made symmetric."""
        near, normal = self._closest(points), self.normals(points)
        corner = self._corner_normals[near.triangle]
        size = np.linalg.norm(np.einsum("nk,nkd->nd", near.weights, corner), axis=1)[:, None, None]
        bend = np.einsum("nkd,nke->nde", corner, self._slopes[near.triangle]) / size
        # On an edge or at a corner the closest point moves along the edge only, or not at all.
        count = np.count_nonzero(near.weights, axis=1)
        bend[count == 1] = 0.0
        edge, along = np.flatnonzero(count == 2), self._edge_directions(near)
        bend[edge] = bend[edge] @ outer(along, along)[edge]
        across = np.eye(3) - outer(normal, normal)
        bend = across @ bend @ across
        sharp = self._at_sharp(near)
        away = np.linalg.norm((points - near.point)[sharp], axis=1)
        side = np.where(self.distance(points[sharp]) < 0, -1.0, 1.0)
        turning = across[sharp] - outer(along, along)[sharp]
        free = away > self._tiny
        scale = np.where(free, side / np.where(free, away, 1.0), 0.0)
        bend[sharp] = scale[:, None, None] * turning
        return np.asarray(0.5 * (bend + np.swapaxes(bend, 1, 2)))

    # --- what the triangles consist of ------------------------------------------------------------------

    @cached_property
    def _corners(self) -> np.ndarray:
        return np.asarray(self.points[self.triangles])

    @cached_property
    def _tiny(self) -> float:
        """A distance that is rounding."""
        return 64 * float(np.finfo(float).eps * np.abs(self.points).max())

    @cached_property
    def _faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals, zero of triangles without area, (m, 3), and areas, (m,)."""
        corner = self._corners
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        twice = np.linalg.norm(cross, axis=1)
        return cross / np.where(twice > 0, twice, 1.0)[:, None], 0.5 * twice

    @cached_property
    def _angles(self) -> np.ndarray:
        """Angles at the corners, (m, 3)."""
        corner = self._corners
        first, second = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
        cross = np.linalg.norm(np.cross(first, second), axis=2)
        return np.arctan2(cross, np.einsum("mkd,mkd->mk", first, second))

    @cached_property
    def _vertex_normals(self) -> np.ndarray:
        """Means of the normals at a point, weighted by the angles, not scaled, (n, 3)."""
        total = np.zeros(self.points.shape)
        parts = self._angles[:, :, None] * self._faces[0][:, None, :]
        np.add.at(total, self.triangles.ravel(), parts.reshape(-1, 3))
        return total

    @cached_property
    def _neighbours(self) -> np.ndarray:
        """The triangle across the side opposite to each corner, (m, 3)."""
        first, second = (self.triangles[:, SIDES[:, k]].ravel() for k in (0, 1))
        size = len(self.points)
        forward, backward = first * size + second, second * size + first
        order = np.argsort(forward)
        return (order[np.searchsorted(forward[order], backward)] // 3).reshape(-1, 3)

    @cached_property
    def _sharp(self) -> np.ndarray:
        """Whether the side opposite to each corner is sharp, (m, 3)."""
        normal = self._faces[0]
        cosine = np.einsum("md,mkd->mk", normal, normal[self._neighbours])
        return np.asarray((cosine < np.cos(self.smooth)) & (self._faces[1] > 0)[:, None])

    @cached_property
    def _sharp_points(self) -> np.ndarray:
        """Whether a sharp side ends at a point, (n,)."""
        marks = np.zeros(len(self.points), dtype=bool)
        marks[self.triangles[:, SIDES][self._sharp].ravel()] = True
        return marks

    @cached_property
    def _corner_normals(self) -> np.ndarray:
        """Normals at the corners: means over the triangles there that belong to the same round surface."""
        normal, count = self._faces[0], 3 * len(self.triangles)
        flat = self.triangles.ravel()
        at = sp.csr_matrix((np.ones(count), (np.arange(count), flat)), shape=(count, len(self.points)))
        beside = (at @ at.T).tocoo()
        own, other = normal[beside.row // 3], normal[beside.col // 3]
        round_there = np.einsum("nd,nd->n", own, other) >= np.cos(self.smooth) - 1e-12
        weight = np.where(round_there, self._angles.ravel()[beside.col], 0.0)
        mean = sp.csr_matrix((weight, (beside.row, beside.col)), shape=(count, count)) @ np.repeat(
            normal, 3, 0
        )
        size = np.linalg.norm(mean, axis=1)[:, None]
        return np.where(size > 0, mean / np.where(size > 0, size, 1.0), np.repeat(normal, 3, 0)).reshape(
            -1, 3, 3
        )

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Gradients of the weights of the corners within each triangle, (m, 3, 3)."""
        corner, (normal, area) = self._corners, self._faces
        side = corner[:, SIDES[:, 1]] - corner[:, SIDES[:, 0]]
        twice = np.where(area > 0, 2.0 * area, np.inf)
        return np.asarray(np.cross(normal[:, None, :], side) / twice[:, None, None])

    @cached_property
    def _tree(self) -> tuple[np.ndarray, TriangleTree]:
        """Triangles with an area, and the tree of them."""
        some = np.flatnonzero(self._faces[1] > 0)
        return some, TriangleTree(self._corners[some])

    @cached_property
    def _last(self) -> dict[str, Any]:
        """The last points and what is closest to them: distance, normals and curvatures ask for the same."""
        return {}

    def _closest(self, points: np.ndarray) -> ClosestOnTriangles:
        known = self._last.get("points")
        if known is None or not np.array_equal(known, points):
            some, tree = self._tree
            near = tree.closest(points)
            near = ClosestOnTriangles(some[near.triangle], near.weights, near.point)
            self._last.update(points=np.array(points), near=near)
        result: ClosestOnTriangles = self._last["near"]
        return result

    def _mean_normals(self, near: ClosestOnTriangles) -> np.ndarray:
        """Return normals whose sides decide the sign, those of triangles, edges or corners, (n, 3)."""
        mean = self._faces[0][near.triangle]
        count, everyone = np.count_nonzero(near.weights, axis=1), np.arange(len(mean))
        opposite, only = np.argmin(near.weights, axis=1), np.argmax(near.weights, axis=1)
        across = self._faces[0][self._neighbours[near.triangle, opposite]]
        at_point = self._vertex_normals[self.triangles[near.triangle, only]]
        mean = np.where((count == 2)[:, None], mean + across, mean)
        return np.where((count == 1)[:, None], at_point, mean)[everyone]

    def _at_sharp(self, near: ClosestOnTriangles) -> np.ndarray:
        """Return whether the closest points lie on a sharp edge or at its end, (n,)."""
        count = np.count_nonzero(near.weights, axis=1)
        edge = self._sharp[near.triangle, np.argmin(near.weights, axis=1)]
        corner = self._sharp_points[self.triangles[near.triangle, np.argmax(near.weights, axis=1)]]
        return np.asarray(np.where(count == 2, edge, np.where(count == 1, corner, False)))

    def _edge_directions(self, near: ClosestOnTriangles) -> np.ndarray:
        """Return directions of the edges that closest points lie on, zero elsewhere, (n, 3)."""
        side = SIDES[np.argmin(near.weights, axis=1)]
        corner, everyone = self._corners[near.triangle], np.arange(len(side))
        along = corner[everyone, side[:, 1]] - corner[everyone, side[:, 0]]
        along = along / np.linalg.norm(along, axis=1)[:, None]
        return np.where((np.count_nonzero(near.weights, axis=1) == 2)[:, None], along, 0.0)

    # --- checks -----------------------------------------------------------------------------------------

    def _require_closed(self) -> None:
        """Reject edges of other than two triangles, and neighbours of opposite orientation."""
        if not len(self.triangles):
            raise InvalidInputError("triangles must have three different corners, got none: correct points")
        edges = self.triangles[:, SIDES].reshape(-1, 2)
        low, high = edges.min(axis=1), edges.max(axis=1)
        _, number, count = np.unique(low * len(self.points) + high, return_inverse=True, return_counts=True)
        single, many = int(np.count_nonzero(count == 1)), int(np.count_nonzero(count > 2))
        if single or many:
            first = edges[np.argmax(count[number.ravel()] != 2)]
            place = ", ".join(f"{x:.6g}" for x in self.points[first].mean(axis=0))
            found = [f"{counted(single, 'open edge')}"] if single else []
            found += [f"{counted(many, 'edge')} of more than two triangles"] if many else []
            raise InvalidInputError(
                f"Triangulation must be closed, got {' and '.join(found)} of {len(count)}, one at ({place}): "
                "close the holes in the program that wrote it, or remove what lies inside"
            )
        turned = np.bincount(number.ravel(), np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
        if turned.any():
            raise InvalidInputError(
                f"triangles must be counterclockwise seen from outside, got {np.count_nonzero(turned)} edges "
                "at which they are not: exchange two corners of those that face inwards"
            )

    def _require_outward(self) -> None:
        """Reject closed parts that face inwards, unless they are holes of another one."""
        pieces, number = _pieces(self.triangles, len(self.points))
        corner = self._corners - self.points.mean(axis=0)
        cones = np.einsum("md,md->m", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6.0
        volume = np.bincount(number, cones, pieces)
        for piece in np.flatnonzero(volume <= 0.0):
            place = self.points[self.triangles[number == piece][0, 0]]
            if round(_winding(place, self._corners[number != piece])) >= 1:
                continue
            raise InvalidInputError(
                f"triangles must face outwards, got {np.count_nonzero(number == piece)} around a volume of "
                f"{volume[piece]:.6g}: exchange two corners of each, as by triangles[:, ::-1]"
            )


def _arrays(points: Any, triangles: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return points and triangles as arrays; reject others."""
    try:
        places, corners = np.array(points, dtype=np.float64), np.array(triangles, dtype=np.int64)
        fits = places.ndim == 2 and places.shape[1] == 3 and bool((np.abs(places) < LARGEST).all())
        fits = fits and corners.ndim == 2 and corners.shape[1] == 3 and len(corners) >= 4
        fits = fits and corners.min() >= 0 and corners.max() < len(places)
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise InvalidInputError(
            "Triangulation needs finite points (n, 3) and at least four triangles (m, 3) of numbers of "
            f"points, got shapes {np.shape(points)} and {np.shape(triangles)}: give such arrays"
        )
    return places, corners


def _merged(points: np.ndarray, triangles: np.ndarray, near: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Return points without equal ones and triangles with three different corners.

    `near`: distance of equal points relative to the size of the body: files keep six or seven digits.
    """
    used, corners = np.unique(triangles, return_inverse=True)
    places = points[used]
    size = float(np.ptp(places, axis=0).max())
    pairs = cKDTree(places).query_pairs(near * size, output_type="ndarray")
    count = len(places)
    joined = sp.csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, number = connected_components(joined, directed=False)
    _, first = np.unique(number, return_index=True)
    corners = number[corners.reshape(-1, 3)]
    whole = (np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1)
    return places[first], corners[whole]


def _pieces(triangles: np.ndarray, n_points: int) -> tuple[int, np.ndarray]:
    """Return the number of connected pieces, and the piece of each triangle, (m,)."""
    rows, columns = triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel()
    graph = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n_points, n_points))
    _, number = connected_components(graph, directed=False)
    _, piece = np.unique(number[triangles[:, 0]], return_inverse=True)
    return int(piece.max(initial=-1)) + 1, piece.ravel()


def _winding(place: np.ndarray, corners: np.ndarray) -> float:
    """Return how often triangles wind around a place: their solid angle over 4π."""
    arm = corners - place
    size = np.linalg.norm(arm, axis=2)
    triple = np.einsum("md,md->m", arm[:, 0], np.cross(arm[:, 1], arm[:, 2]))
    rest = size.prod(axis=1)
    for one, other, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rest = rest + np.einsum("md,md->m", arm[:, one], arm[:, other]) * size[:, third]
    return float(2.0 * np.arctan2(triple, rest).sum() / (4.0 * np.pi))
