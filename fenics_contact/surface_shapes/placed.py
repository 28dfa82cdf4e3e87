"""Shapes that are rotated, scaled and moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, floats
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.joined import Joined
from fenics_contact.surface_shapes.places import require_place
from fenics_contact.surface_shapes.plane import Plane
from fenics_contact.surface_shapes.protocol import SurfaceShape
from fenics_contact.surface_shapes.round import Circle, Cylinder, Sphere

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
        scale: Factor > 0 on all lengths.
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
                f"Placed.rotation must be an orthogonal matrix of shape ({dim}, {dim}), whose rows are "
                f"perpendicular and of length one, got {self.rotation!r}: give the scale by itself"
            )
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InvalidInputError(
                f"Placed.scale must be a positive number, got {self.scale!r}: to mirror a shape give a "
                "rotation that mirrors"
            )
        if getattr(self.shape, "dim", dim) != dim:
            raise InvalidInputError(
                f"Placed.translation must have as many entries as the shape has dimensions, {dim} were given "
                f"for a {type(self.shape).__name__} in {self.shape.dim}: give {self.shape.dim}"  # type: ignore[attr-defined]
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
    """Move a shape: its points x are mapped to scale R x + translation.

    Args:
        shape: Any shape.
        rotation: The orthogonal matrix R, shape (dim, dim); None for no rotation.
        translation: Image of the origin, dim entries, [length].
        scale: Factor > 0 on all lengths.

    Returns:
        The moved shape; a placed shape has the combined motion, the parts of a joined one are moved.

    Raises:
        InvalidInputError: If the matrix is not orthogonal, the scale not positive, or the dimensions differ.
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
