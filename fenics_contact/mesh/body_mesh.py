"""The mesh of one body: coordinates, cells, named surfaces; checked once, then an immutable value."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import quality
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.coincidence import check_no_coincident_nodes
from fenics_contact.mesh.quadratic_nodes import check_node_order
from fenics_contact.mesh.shape_fit import check_shapes
from fenics_contact.mesh.similarity import similarity
from fenics_contact.mesh.validation import (
    check_jacobians,
    checked_cells,
    checked_grid,
    checked_points,
    checked_regions,
    checked_surfaces,
)
from fenics_contact.surface_shapes import SurfaceShape, placed


@displayed
@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Cells of one body, replicated on all ranks.

    Hexahedra or tetrahedra with three coordinates, quadrilaterals or triangles with two. The arrays are
    copied and read-only; a moved body is a new value, see `moved`.

    Attributes:
        points: Coordinates, (n_nodes, 3 | 2) float64, in the scene's unit of length.
        cells: Node numbers, (n_cells, 8) for hexahedra, (n_cells, 4) for tetrahedra; in two dimensions
            (n_cells, 4) for quadrilaterals, (n_cells, 3) for triangles; quadratic hexahedra have 27 nodes,
            tetrahedra 10, quadrilaterals 9 and triangles 6 (`quadratic` makes them); int64, nodes in the
            order of VTK, Jacobian positive (in two dimensions: counter-clockwise).
        surfaces: Name to facets, (n_facets, 4 | 3) int64 node numbers in cyclic order, the right-hand
            normal pointing out of the body. In two dimensions (n_facets, 2) edges with the body on their
            left: run through in their direction, the boundary runs counter-clockwise around the body. Facets
            of quadratic cells have their midpoints after the corners, 9, 6 or 3 nodes in all.
        grid: Structured index of every cell, (n_cells, 3 | 2) int64, or None. The simplices that a cell was
            split into share its index.
        regions: Name to ascending cell numbers, int64, of parts of the body that differ, for instance in
            their material; by default none, else every cell belongs to exactly one.
        coincident_nodes: Whether nodes may coincide, as on the two sides of a crack.
        shapes: Name of a surface to the true shape that its facets approximate, such as a `Cylinder`; contact
            uses it for gaps and normals. Other surfaces are reconstructed from their nodes.

    Raises:
        InvalidInputError: If an array has the wrong shape or type, a coordinate is not finite, a node
            number is out of range or unused, a cell is inverted, nodes coincide, a facet is not an outward
            boundary face or is listed twice, the regions overlap or leave out a cell, or a surface does not
            lie on its shape.

    Example:
        A square of two triangles with a named lower edge.

        >>> corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        >>> mesh = BodyMesh(corners, [[0, 1, 2], [0, 2, 3]], {"bottom": [[0, 1]]})
        >>> mesh.dim, mesh.n_nodes, mesh.volume
        (2, 4, 1.0)
    """

    points: np.ndarray
    cells: np.ndarray
    surfaces: Mapping[str, np.ndarray] = field(default_factory=dict)
    grid: np.ndarray | None = None
    regions: Mapping[str, np.ndarray] = field(default_factory=dict)
    coincident_nodes: bool = False
    shapes: Mapping[str, SurfaceShape] = field(default_factory=dict)
    _origin: BodyMesh | None = field(default=None, init=False, repr=False)
    _off_shapes: Mapping[str, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check everything, in order of cost."""
        points = checked_points(self.points)
        cells = checked_cells(self.cells, *points.shape)
        self._set(
            points=points,
            cells=cells,
            grid=checked_grid(self.grid, cells.shape[0], points.shape[1]),
            regions=checked_regions(self.regions, cells.shape[0]),
        )
        curved = "refine the mesh along its curved surfaces, or take linear cells"
        straight = "list the vertices of the cells in VTK order and check the coordinates"
        try:
            check_jacobians(points, cells, straight if self.order == 1 else curved)
        except InvalidInputError:
            if self.order > 1:
                check_node_order(points, cells)
            raise
        if not self.coincident_nodes:
            check_no_coincident_nodes(points)
        self._set(surfaces=checked_surfaces(self.surfaces, cells, *points.shape))
        self._set(_off_shapes=check_shapes(self.points, self.surfaces, self.shapes))

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _facts(self) -> dict[str, Any]:
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return {
            "cells": self.cells_in_words,
            "nodes": self.n_nodes,
            "extent": " × ".join(f"{a:.6g} to {b:.6g}" for a, b in zip(low, high, strict=True)),
            "surfaces": _sizes(self.surfaces),
            "regions": _sizes(self.regions),
            "shapes": {name: type(shape).__name__ for name, shape in self.shapes.items()},
        }

    @property
    def cells_in_words(self) -> str:
        """Number and type of the cells: "24 hexahedra"."""
        kind = cell_type_of(self.cells, self.dim)
        return f"{self.n_cells} {kind.plural}"

    @property
    def cell_type(self) -> str:
        """Name of the type of cells.

        ``"hexahedron"``, ``"tetrahedron"``, ``"quadrilateral"`` or ``"triangle"``; the quadratic ones are
        ``"hexahedron27"``, ``"tetrahedron10"``, ``"quadrilateral9"`` and ``"triangle6"``.
        """
        return cell_type_of(self.cells, self.dim).name

    @property
    def order(self) -> int:
        """Degree of the displacements and of the map from the reference cell, 1 or 2."""
        return cell_type_of(self.cells, self.dim).order

    @property
    def dim(self) -> int:
        """Dimension of the space the body lies in, 2 or 3."""
        return int(self.points.shape[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return int(self.points.shape[0])

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(self.cells.shape[0])

    @property
    def volume(self) -> float:
        """Volume of the body, in two dimensions its area; exact for its cells."""
        return quality.volume(self.points, self.cells)

    @property
    def origin(self) -> BodyMesh:
        """The mesh for which its shapes were given, before it was `reshaped`; else the mesh itself."""
        return self if self._origin is None else self._origin

    @property
    def off_shapes(self) -> Mapping[str, np.ndarray]:
        """Name of a surface with a shape to the distance of its nodes, ascending, from the shape.

        Relative to the shortest edge around the node, computed when the shapes were given.
        """
        return self._off_shapes

    def with_shapes(self, shapes: Mapping[str, SurfaceShape]) -> BodyMesh:
        """Return the mesh with exactly these shapes of its surfaces.

        Args:
            shapes: Name of a surface -> its shape in the present position.

        Raises:
            InvalidInputError: If there is no such surface, or its nodes do not lie on the shape.
        """
        off = check_shapes(self.points, self.surfaces, shapes)
        result = copy(self)
        result._set(shapes=dict(shapes), _origin=None, _off_shapes=off)
        return result

    def placed(self, rotation: np.ndarray, translation: np.ndarray, scale: float = 1.0) -> BodyMesh:
        """Return the mesh with its shapes scaled and rotated about the origin, then moved.

        Args:
            rotation: Proper rotation matrix, (3, 3) or (2, 2).
            translation: Displacement, (3,) or (2,), [length].
            scale: Positive factor on all coordinates.
        """
        result = self._at(scale * self.points @ np.asarray(rotation).T + translation)
        shift = tuple(float(component) for component in translation)
        shapes = {name: placed(shape, rotation, shift, scale) for name, shape in self.shapes.items()}
        origin = self._origin and self._origin.placed(rotation, translation, scale)
        result._set(shapes=shapes, _origin=origin)
        return result

    def moved(self, points: np.ndarray) -> BodyMesh:
        """Return the same mesh at new coordinates.

        Cells, surfaces, grid and regions are shared with this mesh and not checked again, nor is coincidence
        of nodes. Its shapes are kept if the mesh is only scaled, rotated and shifted; a deformed mesh has
        none.

        Args:
            points: New coordinates, (n_nodes, 3 | 2).

        Returns:
            The moved mesh.

        Raises:
            InvalidInputError: If the shape is wrong, a coordinate is not finite or a cell is inverted.
        """
        result = self._at(points)
        motion = similarity(self.points, result.points) if self.shapes else None
        if motion is not None:
            return self.placed(*motion)
        result._set(shapes={}, _origin=None, _off_shapes={})
        return result

    def reshaped(self, points: np.ndarray) -> BodyMesh:
        """Return the mesh at slightly different coordinates, as `moved`; its shapes follow the nodes.

        The offset of a surface from its facets, and of its normals from theirs, is unchanged, so that gaps
        are smooth functions of the coordinates.

        Args:
            points: New coordinates, (n_nodes, 3 | 2).
        """
        result = self._at(points)
        result._set(_origin=self.origin)
        return result

    def reshaped_from(self, points: np.ndarray, shapes: Mapping[str, SurfaceShape]) -> BodyMesh:
        """Return the mesh as if it had been `reshaped` from other coordinates, where it had these shapes.

        Only the surfaces matter there: cells behind them may be inverted.

        Args:
            points: The other coordinates, (n_nodes, 3 | 2).
            shapes: Name of a surface -> its shape there.
        """
        origin, result = copy(self), copy(self)
        for mesh in (origin, result):
            mesh.__dict__.pop("linear", None)
        origin._set(points=checked_points(points, self.points.shape))
        result._set(_origin=origin.with_shapes(shapes))
        return result

    def _at(self, points: np.ndarray) -> BodyMesh:
        new_points = checked_points(points, self.points.shape)
        check_jacobians(
            new_points,
            self.cells,
            "move the nodes less, spread the motion over more cells, or coarsen the mesh there",
        )
        result = copy(self)
        result.__dict__.pop("linear", None)
        result._set(points=new_points)
        return result

    @cached_property
    def linear(self) -> BodyMesh:
        """The linear cells through the same nodes; the mesh itself unless its cells are quadratic.

        Contact search and pictures use them. Each cell of order two is split into 2^dim consecutive ones;
        facets likewise. There is no grid.
        """
        kind = cell_type_of(self.cells, self.dim)
        if kind.order == 1:
            return self
        count, pieces = len(kind.pieces), kind.face_pieces
        result = copy(self)
        result._set(
            cells=self.cells[:, kind.pieces].reshape(-1, kind.pieces.shape[1]),
            surfaces={
                name: facets[:, pieces].reshape(-1, pieces.shape[1]) for name, facets in self.surfaces.items()
            },
            grid=None,
            regions={
                name: (count * cells[:, None] + np.arange(count)).ravel()
                for name, cells in self.regions.items()
            },
        )
        return result


def _sizes(parts: Mapping[str, np.ndarray]) -> str:
    return ", ".join(f"{name} ({len(rows)})" for name, rows in parts.items()) or "none"
