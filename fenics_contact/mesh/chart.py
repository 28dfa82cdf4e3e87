"""The smooth map that a built mesh is the image of, so that new nodes are images, too."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.checks import check_each
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes
from fenics_contact.mesh.quality import thickness


@displayed
@dataclass(frozen=True, eq=False)
class Chart:
    """A body as the image of coordinates in which its cells are straight, x = turn · map(ξ) + shift.

    Where a mesh that has one is refined, or made quadratic, a new node in the middle of others is the image
    of the mean of their coordinates: surfaces, also without a name, and layers inside follow the true body,
    and graded cells are divided as they were graded. Where an image would invert a cell, as on very coarse
    ones, the node lies between it and the facets.

    Attributes:
        map: Coordinates -> points, (n, dim) -> (n, dim) [length]; smooth in each cell.
        coordinates: Those of the nodes, shape (n_nodes, dim).
        period: Of the first coordinate, where the body is closed to a ring; none by default. ``map`` is
            evaluated anywhere, also beyond a period.
        turn: Rotation and scale, shape (dim, dim); none by default.
        shift: Image of the map's origin, shape (dim,), [length].

    References:
        L. Heltai, W. Bangerth, M. Kronbichler, A. Mola, Propagating geometry information to finite element
        computations, ACM Trans. Math. Softw. 47 (2021), whose charts these are.

    Example:
        A quarter of a ring: radius and angle are its coordinates.

        >>> from fenics_contact.gallery import rectangle
        >>> from fenics_contact.mesh import Chart, refined
        >>> def ring(polar):
        ...     radius, angle = polar.T
        ...     return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        >>> flat = rectangle((1.0, 0.0), (2.0, np.pi / 2), (2, 3))
        >>> mesh = BodyMesh(ring(flat.points), flat.cells, chart=Chart(ring, flat.points))
        >>> fine = refined(mesh, np.ones(6, dtype=bool)).mesh
        >>> round(4 * fine.volume / (3 * np.pi), 3)
        0.989
    """

    map: Callable[[np.ndarray], np.ndarray]
    coordinates: np.ndarray
    period: float | None = None
    turn: np.ndarray | None = None
    shift: np.ndarray | None = None

    def points(self, start: int = 0) -> np.ndarray:
        """Return the images of the nodes from one number on, shape (n, dim)."""
        chosen = self.coordinates[start:]
        with user_code("Chart.map"):
            image = np.asarray(self.map(chosen), dtype=np.float64)
        if image.shape != chosen.shape or not np.isfinite(image).all():
            raise InvalidInputError(
                f"Chart.map must return finite points of shape {chosen.shape}, got shape {image.shape} or NaN"
            )
        image = image if self.turn is None else image @ self.turn.T
        return image if self.shift is None else image + self.shift

    def means(self, groups: np.ndarray) -> np.ndarray:
        """Return the means of the coordinates of groups of nodes, (n, k) node numbers -> (n, dim)."""
        around = np.asarray(self.coordinates, dtype=np.float64)[groups]
        if self.period is not None:
            along = around[..., 0]
            around[..., 0] -= self.period * np.round((along - along[:, :1]) / self.period)
        return np.asarray(around.mean(axis=1))

    def of(self, groups: np.ndarray) -> Chart:
        """Return the chart of nodes in the middle of groups of these nodes, shape (n, k)."""
        return replace(self, coordinates=self.means(groups))

    def extended(self, groups: Iterable[np.ndarray]) -> Chart:
        """Return the chart with more nodes after these, each in the middle of some, shape (n, k) each."""
        more = [self.means(each) for each in groups]
        return replace(self, coordinates=np.concatenate([self.coordinates, *more]))

    def placed(self, rotation: np.ndarray, translation: np.ndarray, scale: float) -> Chart:
        """Return the chart of the body scaled, rotated about the origin and moved."""
        turn = scale * np.asarray(rotation)
        whole = turn if self.turn is None else turn @ self.turn
        return replace(
            self, turn=whole, shift=translation + (0.0 if self.shift is None else turn @ self.shift)
        )


def kept_valid(
    images: np.ndarray,
    straight: np.ndarray,
    cells: np.ndarray,
    surfaces: Iterable[np.ndarray],
    hanging: HangingNodes = NO_HANGING,
    least: float = 0.1,
) -> np.ndarray:
    """Return the images of nodes, but nearer to straight positions where cells would be nearly inverted.

    On coarse cells of a strongly curved or graded body some would. Nodes inside come first, then those on the
    boundary, and those of `surfaces`, which have shapes, last. `least`: smallest thickness of a cell relative
    to that between straight positions.
    """
    points, thin = images.copy(), least * thickness(straight, cells)
    worse = np.flatnonzero(thickness(points, cells) < thin)
    if not len(worse):
        return points
    share, turn = np.ones(len(points)), np.zeros(len(points), dtype=np.int64)
    turn[boundary_faces(cells, points.shape[1], hanging)[0]] = 1
    for facets in surfaces:
        turn[facets] = 2
    turn[hanging.nodes] = 3  # they follow
    while len(worse):
        nodes = cells[worse].ravel()
        nodes = np.append(nodes, hanging.masters[np.isin(hanging.nodes, nodes)])
        nodes = np.unique(nodes[(share[nodes] > 0.0) & (turn[nodes] < 3)])
        if not len(nodes):
            break
        nodes = nodes[turn[nodes] == turn[nodes].min()]
        share[nodes] = np.where(share[nodes] > 0.2, 0.5 * share[nodes], 0.0)
        points = straight + share[:, None] * (images - straight)
        points = hanging.placed(points)
        worse = np.flatnonzero(thickness(points, cells) < thin)
    return points


def check_chart(chart: Chart, points: np.ndarray, farthest: float = 1e-9) -> None:
    """Reject a chart of which nodes are no images, or too far from them for the extent of the mesh."""
    if np.shape(chart.coordinates) != points.shape:
        raise InvalidInputError(
            f"Chart.coordinates must have shape {points.shape}, got {np.shape(chart.coordinates)}"
        )
    away = np.linalg.norm(chart.points() - points, axis=1)
    check_each(
        away <= farthest * np.ptp(points, axis=0).max(),
        "nodes must lie at the images of their coordinates by the chart",
        "make the points by its map",
        lambda node: f"node {node} by {away[node]:.3g}",
    )
