"""Shapes made of others: joined, placed, or recognised from points and normals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.checks import GivenVector, checked, floats
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes.simple import (
    Circle,
    Cylinder,
    Plane,
    Quantity,
    Revolved,
    Sphere,
    SurfaceShape,
    Torus,
    require_place,
)

#: Samples on each edge of a border.
SAMPLES = 4


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
                f"Joined needs facets of each of {len(self.shapes)} shapes, got {[*map(len, self.facets)]}"
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

    def _away(self, number: int, points: np.ndarray, beyond: float = 2.0) -> np.ndarray:
        """Return the distance of points from a shape's part of the surface, (n,).

        `beyond`: weight of the distance along a shape beyond its part. Near a ridge two parts are equally far
        away; this selects the one above which a point is higher, whose distance is closer to that from the
        ridge.
        """
        shape = self.shapes[number]
        distance = shape.distance(points)
        if (border := self._borders[number]) is None:
            return np.abs(distance)
        tree, outwards = border
        feet = points - distance[:, None] * shape.normals(points)
        _, closest = tree.query(feet)
        over = np.einsum("nd,nd->n", feet - tree.data[closest], outwards[closest])
        return np.hypot(distance, beyond * np.maximum(over, 0.0))

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


#: Tolerance of the orthonormality of a rotation's columns.
ORTHOGONAL = 1e-9


@displayed
@dataclass(frozen=True)
@checked()
class Placed:
    """A shape whose points x are mapped to scale R x + translation; built by `placed`.

    Attributes:
        shape: The shape.
        rotation: The orthogonal matrix R by rows; it may be a reflection.
        translation: Image of the origin, [length].
    """

    shape: SurfaceShape
    rotation: Sequence[GivenVector]
    translation: GivenVector
    scale: float = 1.0

    def __post_init__(self) -> None:
        """Reject a matrix that is not orthogonal and a scale that is not positive."""
        dim = len(self.translation)
        require_place(self, self.translation)
        turn = np.array([[float(entry) for entry in row] for row in self.rotation if len(row) == dim])
        if turn.shape != (dim, dim) or not np.abs(turn @ turn.T - np.eye(dim)).max() <= ORTHOGONAL:
            raise InvalidInputError(
                f"Placed.rotation must be an orthogonal matrix of shape ({dim}, {dim}), got {self.rotation!r}"
            )
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InvalidInputError(f"Placed.scale must be positive, got {self.scale!r}: mirror by rotation")
        if getattr(self.shape, "dim", dim) != dim:
            raise InvalidInputError(
                f"Placed.translation must have {self.shape.dim} entries as its shape, got {dim}: give them"  # type: ignore[attr-defined]
            )

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.translation)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the shape's distance, scaled."""
        return np.asarray(self.scale * self.shape.distance(self._back(points)))

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the shape's normals, rotated."""
        return np.asarray(self.shape.normals(self._back(points)) @ self._turn.T)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the shape's curvatures, rotated and divided by the scale."""
        return np.asarray(self._turn @ self.shape.curvatures(self._back(points)) @ self._turn.T / self.scale)

    @property
    def _turn(self) -> np.ndarray:
        return np.asarray(self.rotation, dtype=np.float64)

    def _back(self, points: np.ndarray) -> np.ndarray:
        return np.asarray((points - np.asarray(self.translation)) @ self._turn / self.scale)


def placed(
    shape: SurfaceShape, rotation: np.ndarray | None, translation: Sequence[float], scale: float = 1.0
) -> SurfaceShape:
    """Move a shape: its points x are mapped to scale R x + translation, with an orthogonal R.

    A placed shape has the combined motion, the parts of a joined one are moved.
    """
    turn = np.eye(len(translation)) if rotation is None else np.asarray(rotation, dtype=np.float64)
    moved = Placed(shape, tuple(floats(row) for row in np.atleast_2d(turn)), tuple(translation), scale)
    if isinstance(shape, Joined):
        facets = [scale * part @ turn.T + np.asarray(translation) for part in shape.facets]
        return Joined([placed(part, rotation, translation, scale) for part in shape.shapes], facets)
    if not isinstance(shape, Placed):
        return moved
    both, origin = turn @ np.asarray(shape.rotation), np.asarray(shape.translation)
    place = scale * turn @ origin + np.asarray(translation)
    rows = tuple(floats(row) for row in both)
    return Placed(shape.shape, rows, floats(place), scale * shape.scale)


def simplified(shape: SurfaceShape) -> SurfaceShape:
    """Return a placed plane, sphere or cylinder as one that is there, any other shape as it is."""
    if not isinstance(shape, Placed):
        return shape
    turn, shift, scale = np.asarray(shape.rotation), np.asarray(shape.translation), shape.scale
    match shape.shape:
        case Plane(point, normal):
            return Plane(floats(scale * turn @ point + shift), floats(turn @ normal))
        case Sphere(centre, radius, hollow):
            kind = Circle if isinstance(shape, Circle) else Sphere
            return kind(floats(scale * turn @ centre + shift), scale * radius, hollow)
        case Cylinder(point, axis, radius, hollow):
            return Cylinder(floats(scale * turn @ point + shift), floats(turn @ axis), scale * radius, hollow)
    return shape


#: Largest distance of points from their shape, relative to their extent.
CLOSE = 1e-9


def recognised(points: np.ndarray, normals: np.ndarray) -> SurfaceShape | None:
    """Return the plane, sphere, cylinder, cone or torus on which points lie; in the plane the line or circle.

    None if points, many more than a shape has parameters, lie off all of them by more than a billionth of
    their extent. `normals`: unit normals out of the body.
    """
    size = float(np.ptp(points, axis=0).max())
    for fit in (_plane, _sphere, _about_an_axis):
        try:
            shape = fit(points, normals)
        except (InvalidInputError, np.linalg.LinAlgError):  # invalid radius or direction: another shape
            continue
        if shape is not None and np.abs(shape.distance(points)).max() <= CLOSE * size:
            return shape
    return None


def _plane(points: np.ndarray, normals: np.ndarray) -> SurfaceShape:
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][-1]
    return Plane(floats(middle), floats(normal * np.sign((normals @ normal).sum())))


def _sphere(points: np.ndarray, normals: np.ndarray) -> SurfaceShape:
    """‖x − c‖² = r² is linear in c and r² − ‖c‖²."""
    middle = points.mean(axis=0)
    off = points - middle
    linear = np.column_stack([2 * off, np.ones(len(off))])
    centre, rest = np.split(np.linalg.lstsq(linear, np.einsum("nd,nd->n", off, off), rcond=None)[0], [-1])
    radius = float(np.sqrt(max(rest[0] + centre @ centre, 0.0)))
    hollow = bool(np.einsum("nd,nd->n", off - centre, normals).sum() < 0)
    kind = Circle if len(centre) == 2 else Sphere
    return kind(floats(middle + centre), radius, hollow)


def _about_an_axis(points: np.ndarray, normals: np.ndarray) -> SurfaceShape | None:
    """All normals of a surface of revolution meet its axis."""
    if points.shape[1] == 2:
        return None
    point, axis = _axis(points, normals)
    arm, out = points - point, normals - (normals @ axis)[:, None] * axis
    along = arm @ axis
    arm = arm - along[:, None] * axis
    radius = np.linalg.norm(arm, axis=1)
    outward = np.einsum("nd,nd->n", arm, out) / np.maximum(radius, np.finfo(float).tiny)
    flat = np.column_stack([radius, along]), np.column_stack([outward, normals @ axis])
    profile = recognised(*flat)
    place, direction = floats(point), floats(axis)
    if isinstance(profile, Sphere):
        ring, height = profile.centre
        centre = floats(point + height * axis)
        if ring > profile.radius:
            return Torus(centre, direction, ring, profile.radius, profile.hollow)
    if isinstance(profile, Plane) and abs(profile.normal[1]) < CLOSE:
        return Cylinder(place, direction, float(radius.mean()), profile.normal[0] < 0)
    return None if profile is None else Revolved(profile, place, direction)


def _axis(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a point and the direction of the line that all normals meet, in the sense of least squares.

    A line through x along n meets the one through c along a where (x × n)·a + n·(c × a) = 0.
    """
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    off = (points - middle) / size
    *_, flattest = np.linalg.svd(normals, full_matrices=False)[2]
    if np.abs(normals @ flattest).max() < CLOSE:  # a prism: its circular cross-section has a centre
        across = np.linalg.svd(flattest[None])[2][1:]
        circle = _sphere(off @ across.T, normals @ across.T)
        assert isinstance(circle, Sphere)
        return middle + size * np.asarray(circle.centre) @ across, flattest
    line = np.linalg.svd(np.hstack([np.cross(off, normals), normals]), full_matrices=False)[2][-1]
    direction, moment = line[:3], line[3:]
    length = float(np.linalg.norm(direction))
    if length < 1e-6:
        raise InvalidInputError("the normals meet no axis")
    return middle + size * np.cross(direction, moment) / length**2, direction / length
