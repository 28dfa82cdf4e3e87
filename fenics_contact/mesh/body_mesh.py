"""The mesh of one body: coordinates, cells, named surfaces; checked once, then an immutable value."""

from __future__ import annotations

import logging
from collections.abc import Hashable, Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fenics_contact._base.checks import LARGEST, brief, check_each
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import quality
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.chart import Chart, check_chart
from fenics_contact.mesh.checked_surfaces import check_range, checked_surfaces, integers
from fenics_contact.mesh.collapsed import check_collapsed, cut_into_linear, expanded, in_words, shapes_in
from fenics_contact.mesh.faces import (
    LAST_BITS,
    boundary_faces,
    check_no_coincident_nodes,
    coordinate_rounding,
)
from fenics_contact.mesh.hanging import (
    NO_CENTRES,
    NO_HANGING,
    Centres,
    DependentNodes,
    HangingNodes,
    nodes_to_hold,
)
from fenics_contact.mesh.linear_facets import has_both, linear_facets
from fenics_contact.mesh.quadratic_nodes import check_node_order
from fenics_contact.mesh.quality import (
    AT_GAUSS_POINTS,
    check_shapes,
    jacobian_ratio,
    similarity,
    thickness,
)
from fenics_contact.shapes.combined import placed
from fenics_contact.shapes.simple import SurfaceShape

_LOG = logging.getLogger(__name__)

_FOLLOWING = ("quadratic", "serendipity")
"""How cells are called, and how those whose centres follow."""
RESOLVED = 1e3
"""Smallest ratio of a cell's thickness to the rounding of its coordinates."""


def checked_points(points: ArrayLike, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Return finite coordinates, (n_nodes, 3 | 2) float64, as a read-only copy."""
    try:
        array = np.array(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"points must be numbers, got {brief(points)} ({error})") from error
    if array.ndim != 2 or array.shape[1] not in (2, 3) or (shape is not None and array.shape != shape):
        needed = "(n_nodes, 3) or (n_nodes, 2)" if shape is None else str(shape)
        raise InvalidInputError(f"points must have shape {needed}, got {array.shape}: give one row per node")
    check_each(
        (np.abs(array) < LARGEST).all(axis=1),
        f"points must have finite coordinates below {LARGEST:g}",
        "see what computed them",
        lambda node: f"node {node} at {array[node].tolist()}",
    )
    array.setflags(write=False)
    return array


def checked_cells(cells: ArrayLike, n_nodes: int, dim: int) -> np.ndarray:
    """Return cells, (n_cells, nodes of a cell) int64, that use every one of the ``n_nodes`` nodes."""
    array = integers(cells, "cells")
    cell_type_of(array, dim)
    if array.shape[0] == 0:
        raise InvalidInputError("a mesh must have at least one cell, got none: give the cells of the body")
    check_range(array, n_nodes, "cells")
    check_collapsed(array, dim)
    used = np.bincount(array.ravel(), minlength=n_nodes) > 0
    check_each(used, "every node must belong to a cell", "remove them and renumber", "node {}".format)
    return array


def check_jacobians(points: np.ndarray, cells: np.ndarray, remedy: str, given: bool = False) -> None:
    """Reject a mesh with an inverted or degenerate cell, or so far from the origin that rounding bends cells.

    `given`: whether the mesh is one that others made, of which Gauss points decide: a corner that is turned
    inside out is reported, as other programs solve such meshes, too.
    """
    thick = thickness(points, cells)
    inverted = np.flatnonzero(thick <= 0.0)
    if given and inverted.size:
        at_points = thickness(points, cells[inverted], AT_GAUSS_POINTS)
        if (at_points > 0.0).any():
            _report_corners(points, cells[inverted[at_points > 0.0]])
        thick[inverted], inverted = at_points, inverted[at_points <= 0.0]
    if inverted.size == 0:
        _check_resolved(points, thick)
        return
    ratios = jacobian_ratio(points, cells[inverted])
    worst = int(np.argmin(ratios))
    centre = ", ".join(f"{x:.6g}" for x in points[cells[inverted[worst]]].mean(axis=0))
    raise InvalidInputError(
        f"every cell must have a positive Jacobian, {inverted.size} of {len(cells)} are inverted or flat; "
        f"the worst is cell {inverted[worst]} at ({centre}), of Jacobian ratio {ratios[worst]:.3g}: {remedy}"
    )


def _report_corners(points: np.ndarray, cells: np.ndarray) -> None:
    """Report cells that are turned inside out where they are not integrated."""
    ratios = jacobian_ratio(points, cells)
    worst = int(np.argmin(ratios))
    at = ", ".join(f"{x:.6g}" for x in points[cells[worst]].mean(axis=0))
    _LOG.warning(
        "%d cells are turned inside out at a corner or an edge, the worst around (%s) with a Jacobian ratio "
        "(smallest over largest) of %.3g; at their Gauss points, which count, they are not: bend them less "
        "where results matter", len(cells), at, ratios[worst],
    )  # fmt: skip


def _check_resolved(points: np.ndarray, thick: np.ndarray) -> None:
    rounding = coordinate_rounding(points)
    coarse = np.count_nonzero(thick < RESOLVED * rounding)
    if coarse:
        raise InvalidInputError(
            f"coordinates must resolve the cells, but are rounded by {rounding:.1e}, and {coarse} of "
            f"{len(thick)} cells are as thin as {thick.min():.1e}: move all bodies nearer to the origin"
        )


def checked_grid(grid: ArrayLike | None, n_cells: int, dim: int) -> np.ndarray | None:
    """Return the structured index of every cell, (n_cells, dim) int64 from zero, or None."""
    if grid is None:
        return None
    array = integers(grid, "grid")
    if array.shape != (n_cells, dim) or array.min() < 0:
        raise InvalidInputError(
            f"grid must have shape ({n_cells}, {dim}) without negative entries, or be None, got {array.shape}"
        )
    return array


def checked_regions(regions: Mapping[str, ArrayLike], n_cells: int) -> dict[str, np.ndarray]:
    """Return named ascending cell numbers, int64 each; every cell is in exactly one if there are any."""
    checked: dict[str, np.ndarray] = {}
    owner = np.full(n_cells, -1, dtype=np.int64)
    for number, (name, cells) in enumerate(regions.items()):
        array = np.sort(integers(cells, f"region '{name}'"), axis=None)
        if array.size == 0 or array[0] < 0 or array[-1] >= n_cells:
            given = f"{array[0]} to {array[-1]}" if array.size else "none"
            raise InvalidInputError(
                f"region '{name}' must hold cell numbers below {n_cells}, got {given}: omit it if empty"
            )
        taken = np.union1d(array[owner[array] >= 0], array[1:][np.diff(array) == 0])
        if taken.size:
            raise InvalidInputError(
                f"a cell is in one region, {taken.size} of '{name}' in it twice or in others, first "
                f"{taken[0]}"
            )
        owner[array] = number
        array.setflags(write=False)
        checked[name] = array
    if checked:
        needed = "every cell must belong to a region where there are any"
        check_each(owner >= 0, needed, "give the rest a region of its own", "cell {}".format)
    return checked


def checked_node_sets(
    sets: Mapping[str, ArrayLike], n_nodes: int, surfaces: Mapping[str, object]
) -> dict[str, np.ndarray]:
    """Return named ascending node numbers, int64 each."""
    checked: dict[str, np.ndarray] = {}
    for name, nodes in sets.items():
        array = integers(nodes, f"node set '{name}'")
        check_range(array, n_nodes, f"node set '{name}'")
        checked[name] = np.unique(array)
        checked[name].setflags(write=False)
        if array.size == 0 or array.ndim != 1 or len(checked[name]) < len(array) or name in surfaces:
            given = "the name of a surface" if name in surfaces else f"an array of shape {array.shape}"
            raise InvalidInputError(
                f"node set '{name}' must hold one or more nodes once and have its own name, got {given}"
            )
    return checked


def check_hanging(hanging: HangingNodes, points: np.ndarray, n_cells: int) -> None:
    """Reject hanging nodes that are not at the mean of masters which do not hang."""
    if not hanging:
        return
    nodes, masters, levels = hanging.nodes, hanging.masters, hanging.levels
    shape = (len(nodes), 2 ** (points.shape[1] - 1))
    if masters.shape != shape or levels.shape != (n_cells,) or np.any(np.diff(nodes) <= 0):
        raise InvalidInputError(
            f"hanging must have ascending nodes, masters of shape {shape} and {n_cells} levels, got masters "
            f"{masters.shape} and levels {levels.shape} or nodes in another order: let mesh.refined make them"
        )
    every = np.concatenate([nodes, masters.ravel()])
    if every.min() < 0 or every.max() >= len(points) or np.isin(masters, nodes).any():
        raise InvalidInputError(
            "masters of hanging nodes must be nodes of the mesh that do not hang: let mesh.refined make them"
        )
    away = np.abs(points[nodes] - points[masters].mean(axis=1)).max(axis=1)
    check_each(
        away <= 2 * coordinate_rounding(points),
        "hanging nodes must lie at the mean of their masters",
        "let mesh.refined place them",
        lambda k: f"node {nodes[k]} by {away[k]:.3g}",
    )


def check_centres(centres: Centres, points: np.ndarray) -> None:
    """Reject centres that do not lie where the nodes are that they follow."""
    away = np.abs(points - centres.placed(points)).max(axis=1)
    if (worst := float(away.max())) > LAST_BITS * coordinate_rounding(points):
        raise InvalidInputError(
            f"centre node {int(away.argmax())} is {worst:.3g} away from where the nodes of its cell or face "
            "place it: use mesh.serendipity"
        )


@dataclass(frozen=True, eq=False)
class Cut:
    """Faces of cells along which a mesh is cut.

    `pairs`: node behind the cut and node before it, at the same place; `facets`: the faces, outward of the
    cells before the cut.
    """

    pairs: np.ndarray
    facets: np.ndarray


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
        hanging: The nodes of small cells in the middle of edges and faces of larger ones, which `refined`
            makes; by default none.
        chart: The map whose images the nodes are, which `refined` and `quadratic` follow, as of chain links;
            by default none.
        node_sets: Name to ascending node numbers, int64, for supports and forces at single nodes; by default
            none.
        centres: Nodes in the centres of faces and cells that follow the others, so that cells of 27 nodes
            are those of 20, and of 9 those of 8, which `serendipity` makes; by default none.

    Raises:
        InvalidInputError: If an array has the wrong shape or type, a coordinate is not finite, a node
            number is out of range or unused, a cell is inverted, nodes coincide, a facet is not an outward
            boundary face or is listed twice, the regions overlap or leave out a cell, a surface does not lie
            on its shape, or nodes are not the images of their chart.

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
    hanging: HangingNodes = NO_HANGING
    chart: Chart | None = None
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    centres: Centres = NO_CENTRES
    _origin: BodyMesh | None = field(default=None, init=False, repr=False)
    _off_shapes: Mapping[str, np.ndarray] = field(default_factory=dict, init=False, repr=False)
    _cuts: Mapping[Hashable, Cut] = field(default_factory=dict, init=False, repr=False)

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
            check_jacobians(points, cells, straight if self.order == 1 else curved, given=True)
        except InvalidInputError:
            if self.order > 1:
                check_node_order(points, cells)
            raise
        if not self.coincident_nodes:
            check_no_coincident_nodes(points)
        check_hanging(self.hanging, points, len(cells))
        check_centres(self.centres, points)
        outside = self.boundary[0] if self.surfaces else cells[:0]
        self._set(surfaces=checked_surfaces(self.surfaces, outside, *points.shape))
        self._set(node_sets=checked_node_sets(self.node_sets, len(points), self.surfaces))
        self._set(_off_shapes=self._checked_shapes(self.shapes))
        if self.chart is not None:
            check_chart(self.chart, points)

    def _set(self, **values: object) -> None:
        if not values.keys().isdisjoint(("cells", "hanging")):
            self.__dict__.pop("boundary", None)
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _checked_shapes(self, shapes: Mapping[str, SurfaceShape]) -> dict[str, np.ndarray]:
        return check_shapes(self.points, self.surfaces, shapes, self.followers.nodes)

    def _facts(self) -> dict[str, Any]:
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return {
            "cells": self.cells_in_words,
            "nodes": self.n_nodes,
            **({"hanging nodes": len(self.hanging.nodes)} if self.hanging else {}),
            **({"centres that follow": len(self.centres.nodes)} if self.centres else {}),
            "extent": " × ".join(f"{a:.6g} to {b:.6g}" for a, b in zip(low, high, strict=True)),
            "surfaces": _sizes(self.surfaces),
            "regions": _sizes(self.regions),
            **({"node sets": _sizes(self.node_sets)} if self.node_sets else {}),
            "shapes": {name: type(shape).__name__ for name, shape in self.shapes.items()},
        }

    @property
    def cells_in_words(self) -> str:
        """Number and type of the cells: "24 hexahedra"."""
        plural = cell_type_of(self.cells, self.dim).plural
        if self.has_several_shapes:
            return in_words(self.cells, self.dim, bool(self.centres))
        return f"{self.n_cells} {plural.replace(*_FOLLOWING) if self.centres else plural}"

    @property
    def has_several_shapes(self) -> bool:
        """Whether some cells are prisms, pyramids or simplices among others, see `joined_cells`."""
        return bool(shapes_in(self.cells, self.dim))

    @cached_property
    def apart(self) -> tuple[np.ndarray, sp.csr_matrix | None]:
        """The cells as they are integrated: hexahedra all of whose nodes differ, and values at their nodes.

        Node numbers, (n_cells, nodes of a cell), and E, which makes values at their nodes of those at nodes,
        shape (n, n_nodes). Of cells of one shape the cells themselves, and None.
        """
        return expanded(self.cells, self.n_nodes, self.dim) or (self.cells, None)

    def at_nodes_apart(self, values: np.ndarray) -> np.ndarray:
        """Return nodal values, (at least n_nodes, ...), at the nodes of cells as they are integrated."""
        matrix = self.apart[1]
        return values if matrix is None else np.asarray(matrix @ values[: self.n_nodes])

    @property
    def followers(self) -> DependentNodes:
        """The nodes that are no unknowns of their own, `hanging` ones or `centres`."""
        return self.centres or self.hanging

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

    @property
    def cuts(self) -> Mapping[Hashable, Cut]:
        """The sections along which a scene has cut the body, see `fenics_contact.Preload`; by default none.

        Nodes on the far sides are numbered after all others.
        """
        return self._cuts

    def with_chart(self, chart: Chart | None) -> BodyMesh:
        """Return the mesh with a chart of which some nodes need not be images, such as hanging ones."""
        result = copy(self)
        result._set(chart=chart)
        return result

    def with_shapes(self, shapes: Mapping[str, SurfaceShape]) -> BodyMesh:
        """Return the mesh with exactly these shapes of its surfaces.

        Args:
            shapes: Name of a surface -> its shape in the present position.

        Raises:
            InvalidInputError: If there is no such surface, or its nodes do not lie on the shape.
        """
        off = self._checked_shapes(shapes)
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
        chart = self.chart and self.chart.placed(rotation, translation, scale)
        result._set(shapes=shapes, chart=chart, _origin=origin)
        return result

    def moved(self, points: np.ndarray) -> BodyMesh:
        """Return the same mesh at new coordinates.

        Cells, surfaces, grid and regions are shared with this mesh and not checked again, nor is coincidence
        of nodes. Its shapes and chart are kept if the mesh is only scaled, rotated and shifted; a deformed
        mesh has none.

        Args:
            points: New coordinates, (n_nodes, 3 | 2); of a mesh with `cuts` those before it was cut will do.
                Those of `hanging` nodes and `centres` follow from their masters'.

        Returns:
            The moved mesh.

        Raises:
            InvalidInputError: If the shape is wrong, a coordinate is not finite or a cell is inverted.
        """
        result = self._at(points)
        motion = similarity(self.points, result.points) if self.shapes or self.chart else None
        if motion is not None:
            return self.placed(*motion)
        result._set(shapes={}, chart=None, _origin=None, _off_shapes={})
        return result

    def reshaped(self, points: np.ndarray) -> BodyMesh:
        """Return the mesh at slightly different coordinates, as `moved`; shapes and chart follow the nodes.

        The offset of a surface from its facets, and of its normals from theirs, is unchanged, so that gaps
        are smooth functions of the coordinates.

        Args:
            points: New coordinates, (n_nodes, 3 | 2).
        """
        result = self._at(points)
        result._set(chart=None, _origin=self.origin)
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
            mesh._set(chart=None)
        origin._set(points=checked_points(points, self.points.shape))
        result._set(_origin=origin.with_shapes(shapes))
        return result

    def _at(self, points: np.ndarray) -> BodyMesh:
        new_points = checked_points(self._on_both_sides(points), self.points.shape)
        if self.followers:
            new_points = checked_points(self.followers.placed(new_points))
        check_jacobians(
            new_points,
            self.cells,
            "move the nodes less, spread the motion over more cells, or coarsen the mesh there",
        )
        result = copy(self)
        result.__dict__.pop("linear", None)
        result._set(points=new_points)
        return result

    def _on_both_sides(self, points: np.ndarray) -> np.ndarray:
        """Return coordinates of all nodes if those before the mesh was cut are given."""
        for cut in self.cuts.values():
            if len(points) == cut.pairs[0, 0]:
                points = np.concatenate([points, np.asarray(points)[cut.pairs[:, 1]]])
        return points

    def nodes_of(self, name: str) -> np.ndarray:
        """Return the nodes of a surface or of a node set, ascending."""
        return self.node_sets[name] if name in self.node_sets else np.unique(self.surfaces[name])

    def nodes_to_hold(self, surface: str) -> np.ndarray:
        """Return the nodes by which a support holds a surface or a node set, ascending.

        Hanging ones follow their masters.

        Raises:
            InvalidInputError: If the surface contains a hanging node, but not all its masters.
        """
        if surface in self.node_sets:
            return nodes_to_hold(self.followers, surface, self.node_sets[surface])
        return nodes_to_hold(self.followers, surface, self.surfaces[surface])

    @cached_property
    def boundary(self) -> tuple[np.ndarray, np.ndarray]:
        """Faces that belong to only one cell, and the cells that they belong to, see `boundary_faces`."""
        return boundary_faces(self.cells, self.dim, self.hanging)

    @cached_property
    def cells_at_nodes(self) -> np.ndarray:
        """Number of cells at each node, (n_nodes,)."""
        return np.bincount(self.cells.ravel(), minlength=self.n_nodes)

    @cached_property
    def linear(self) -> BodyMesh:
        """The linear cells through the same nodes; the mesh itself unless its cells are quadratic.

        Contact search and pictures use them. Each cell of order two is split into 2^dim consecutive ones, a
        pyramid into 10, see `cells_cut`; facets likewise. A surface of triangles and quadrilaterals has
        triangles alone. There is no grid.
        """
        pieces = self.linear_pieces()
        return self.with_linear_pieces(pieces) if pieces else self

    def linear_pieces(self) -> dict[str, Any]:
        """Return cells, surfaces and regions of the `linear` mesh; nothing if it is the mesh itself."""
        several = self.has_several_shapes
        if self.order == 1 and not (several and any(map(has_both, self.surfaces.values()))):
            return {}
        kind = cell_type_of(self.cells, self.dim)
        if several and self.order == 1:
            cells = self.cells
        elif several:
            cells, _ = cut_into_linear(self.cells, self.dim)
        else:
            cells = self.cells[:, kind.pieces].reshape(-1, kind.pieces.shape[1])
        parents = self.cells_cut
        return {
            "cells": cells,
            "surfaces": {
                name: linear_facets(facets, self.dim).rows for name, facets in self.surfaces.items()
            },
            "regions": {
                name: np.flatnonzero(np.isin(parents, numbers)) for name, numbers in self.regions.items()
            },
        }

    def with_linear_pieces(self, pieces: Mapping[str, Any]) -> BodyMesh:
        """Return the `linear` mesh that has these pieces."""
        result = copy(self)
        for name in ("apart", "linear"):
            result.__dict__.pop(name, None)
        result._set(grid=None, **pieces)
        return result

    @property
    def cells_cut(self) -> np.ndarray:
        """The cell that each cell of `linear` is a piece of, ascending."""
        if self.order == 1:
            return np.arange(self.n_cells)
        if self.has_several_shapes:
            return cut_into_linear(self.cells, self.dim)[1]
        return np.repeat(np.arange(self.n_cells), len(cell_type_of(self.cells, self.dim).pieces))


def _sizes(parts: Mapping[str, np.ndarray]) -> str:
    return ", ".join(f"{name} ({len(rows)})" for name, rows in parts.items()) or "none"
