"""Local refinement: marked cells are halved, surfaces, regions and true shapes carried along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from fenics_contact import _dolfinx
from fenics_contact._base.checks import brief, naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh, check_jacobians
from fenics_contact.mesh.cell_types import CELL_TYPES, CellType, shape_values
from fenics_contact.mesh.chart import Chart, kept_valid
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces
from fenics_contact.mesh.halving import halved
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes
from fenics_contact.mesh.linear_facets import linear_facets
from fenics_contact.mesh.on_shapes import on_shapes, with_parts
from fenics_contact.mesh.quadratic import with_more_nodes
from fenics_contact.mesh.quality import thickness
from fenics_contact.mesh.serendipity_cells import completed, serendipity

_Found: TypeAlias = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray], Chart | None]
_LINEAR = {2: CELL_TYPES["triangle"], 3: CELL_TYPES["tetrahedron"]}


@displayed
@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, and where its cells and nodes come from.

    Attributes:
        mesh: The refined mesh. Its first vertices are those of the coarse one, with the same numbers.
        parents: The coarse cell in which each cell lies, shape (n_cells,), ascending.
        positions: Where in its coarse cell each node of each cell lies, in reference coordinates, shape
            (n_cells, nodes of a cell, dim).
        parts: Those one after the other that lead to the mesh; empty if it is one.
    """

    mesh: BodyMesh
    parents: np.ndarray
    positions: np.ndarray
    parts: tuple[Refinement, ...] = ()

    def fits(self, coarse: BodyMesh, fine: BodyMesh) -> bool:
        """Return whether it may lead from one mesh to the other: their numbers of cells agree."""
        covered = int(self.parents.max(initial=-1)) + 1
        return fine.cells.shape == self.positions.shape[:2] and covered == coarse.n_cells

    def after(self, first: Refinement) -> Refinement:
        """Return the refinement that leads from the mesh before another one to this mesh.

        `first`: the one whose mesh this one refines.
        """
        cells = np.repeat(self.parents, self.positions.shape[1])
        _, positions = first.located(cells, self.positions.reshape(-1, self.mesh.dim))
        positions = positions.reshape(self.positions.shape)
        return Refinement(self.mesh, first.parents[self.parents], positions, one_by_one((first, self)))

    def located(self, cells: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return in which coarse cells points of fine ones lie, (n,), and where in them, (n, dim).

        `cells`: fine cells, (n,); `positions`: reference coordinates in them, (n, dim).
        """
        values = shape_values(CELL_TYPES[self.mesh.cell_type], positions)
        return self.parents[cells], np.asarray(np.einsum("nk,nki->ni", values, self.positions[cells]))


def one_by_one(refinements: Sequence[Refinement]) -> tuple[Refinement, ...]:
    """Return refinements one after the other with the parts of those that have some in their places."""
    return tuple(one for each in refinements for one in each.parts or (each,))


@naming_arguments
def refined(mesh: BodyMesh, marked: ArrayLike) -> Refinement:
    """Halve some cells, and as many others as the mesh needs.

    Of simplices others are halved until the mesh conforms. The angles of the cells stay bounded however often
    they are refined: every cell with a halved edge has its longest edge halved (A. Plaza, G.F. Carey, Applied
    Numerical Mathematics 32 (2000) 195-218). Linear quadrilaterals and hexahedra are halved in every
    direction into 4 or 8; nodes in the middle of edges and faces of larger cells hang (`BodyMesh.hanging`),
    and others are halved only so that cells that share a point differ by one level. Quadratic quadrilaterals
    and hexahedra, complete or serendipity, are halved all together.

    New nodes on surfaces whose shape the mesh carries lie on the shape, those between two shapes or beside a
    plane on both, those of quadratic cells else on the curved facets; hanging nodes lie on the larger facet.
    Other new nodes are drawn along, and where a surface leaves its facets by so much that cells would still
    be inverted, more cells are halved around them. All new nodes of a mesh with a `Chart` are images by it.
    Surfaces and regions are carried to the new cells; a
    structured grid is lost.

    Args:
        mesh: Triangles or tetrahedra, quadrilaterals or hexahedra, linear or quadratic.
        marked: Numbers of cells, or a mark for every cell, shape (n_cells,) bool; all cells of quadratic
            quadrilaterals or hexahedra.

    Raises:
        InvalidInputError: If the cells are of another type, no such cells exist, the mesh has nodes that
            coincide, or a shape crosses another side of the body, so that cells are inverted.

    Example:
        >>> from fenics_contact.gallery import rectangle
        >>> plate = rectangle((0.0, 0.0), (2.0, 1.0), (4, 2), cell="triangle")
        >>> near = np.linalg.norm(plate.points[plate.cells].mean(axis=1), axis=1) < 0.5
        >>> fine = refined(plate, near)
        >>> fine.mesh.n_cells > plate.n_cells, fine.mesh.volume
        (True, 2.0)
    """
    chosen = _checked_marks(mesh, marked)
    if mesh.origin is not mesh:
        return _reshaped(mesh, refined(mesh.origin, chosen))
    if halves_together(mesh):
        return _halved_together(mesh)
    if not CELL_TYPES[mesh.cell_type].is_simplex:
        parts = halved(mesh, chosen)
        found = parts.points, parts.cells, parts.surfaces, parts.chart
        return _checked(mesh, found, parts.hanging, parts.parents, parts.positions)
    while True:
        found, parents, positions = _halved_simplices(mesh, chosen)
        more = _around_inverted(mesh, found, parents)
        if mesh.chart is not None or not more.any():
            return _checked(mesh, found, NO_HANGING, parents, positions)
        chosen = np.union1d(chosen, np.flatnonzero(more))


def halves_together(mesh: BodyMesh) -> bool:
    """Return whether all cells of a mesh are halved, or none: quadratic quadrilaterals and hexahedra."""
    kind = CELL_TYPES[mesh.cell_type]
    return kind.order == 2 and not kind.is_simplex and not mesh.has_several_shapes


def _halved_together(mesh: BodyMesh) -> Refinement:
    """Halve all quadratic quadrilaterals or hexahedra; those of serendipity functions have these again."""
    kind = CELL_TYPES[mesh.cell_type]
    linear = CELL_TYPES[kind.shape_name]
    pieces = mesh.cells[:, kind.pieces].reshape(-1, len(linear.nodes))
    groups, cells = with_more_nodes(mesh.n_nodes, pieces, linear, kind)
    parents = np.repeat(np.arange(mesh.n_cells), len(kind.pieces))
    places = np.einsum("kv,pvi->pki", shape_values(linear, kind.nodes), kind.nodes[kind.pieces])
    positions = np.tile(places, (mesh.n_cells, 1, 1))
    boundary, _ = boundary_faces(cells, mesh.dim)
    parts, shapes = with_parts(mesh)
    surfaces = {
        name: boundary[match_faces(linear_facets(facets, mesh.dim).rows, corners_of(boundary, mesh.dim))]
        for name, facets in parts.items()
    }
    chart = mesh.chart and mesh.chart.extended(groups)
    points = _mapped(mesh.points, mesh, parents, positions, cells) if chart is None else chart.points()
    points[: mesh.n_nodes] = mesh.points
    if chart is None:
        points = on_shapes(points, cells, surfaces, shapes, np.arange(len(points)) >= mesh.n_nodes)
    named = {name: surfaces[name] for name in mesh.surfaces}
    fine = _checked(mesh, (points, cells, named, chart), NO_HANGING, parents, positions)
    if not mesh.centres:
        return fine
    freed = [name for name, facets in mesh.surfaces.items() if not np.isin(mesh.centres.nodes, facets).any()]
    lean = serendipity(fine.mesh)
    return replace(fine, mesh=completed(lean, *freed) if freed else lean)


def _halved_simplices(mesh: BodyMesh, chosen: np.ndarray) -> tuple[_Found, np.ndarray, np.ndarray]:
    """Return what was found, see `_checked`; the parent of each cell; positions of its nodes in that."""
    kind, linear = CELL_TYPES[mesh.cell_type], _LINEAR[mesh.dim]
    vertices, inverse = np.unique(mesh.cells[:, : mesh.dim + 1], return_inverse=True)
    skeleton = inverse.reshape(-1, mesh.dim + 1)
    ends, cells = _identified(mesh.points[vertices], skeleton, linear, chosen)
    parents, places, cells = _placed_in_parents(ends, cells, skeleton, linear)
    groups: list[np.ndarray] = []
    if kind.order == 2:
        groups, cells = with_more_nodes(len(ends), cells, linear, kind)
    positions = np.einsum("kv,cvi->cki", shape_values(linear, kind.nodes), places)
    parts, shapes = with_parts(mesh)
    surfaces = _carried_surfaces(parts, mesh.dim, ends, cells, vertices)
    chart = mesh.chart and mesh.chart.of(vertices[ends]).extended(groups)
    points = _mapped(mesh.points, mesh, parents, positions, cells) if chart is None else chart.points()
    points[: len(vertices)] = mesh.points[vertices]
    if chart is None:
        points = on_shapes(points, cells, surfaces, shapes, np.arange(len(points)) >= len(vertices))
    named = {name: surfaces[name] for name in mesh.surfaces}
    return (points, cells, named, chart), parents, positions


def _around_inverted(mesh: BodyMesh, found: _Found, parents: np.ndarray) -> np.ndarray:
    """Mark the coarse cells that share a vertex with that of an inverted one and are not wholly halved.

    Where a surface leaves its facets by more than the thickness of the cells behind, all have to follow.
    """
    inverted = parents[thickness(*found[:2]) <= 0.0]
    near = np.isin(mesh.cells[:, : mesh.dim + 1], mesh.cells[inverted]).any(axis=1)
    return np.asarray(near & (np.bincount(parents, minlength=mesh.n_cells) < 2**mesh.dim))


def _checked(
    mesh: BodyMesh,
    found: _Found,
    hanging: HangingNodes,
    parents: np.ndarray,
    positions: np.ndarray,
) -> Refinement:
    """Return the refinement with regions and shapes of the coarse mesh, unless a cell is inverted."""
    points, cells, surfaces, chart = found
    if chart is not None:
        straight = _mapped(mesh.points, mesh, parents, positions, cells)
        points = kept_valid(points, straight, cells, (surfaces[name] for name in mesh.shapes), hanging)
    remedy = "see whether shapes of surfaces cross each other or other sides of the body, or leave them away"
    check_jacobians(points, cells, remedy)
    regions = {name: np.flatnonzero(np.isin(parents, inside)) for name, inside in mesh.regions.items()}
    fine = BodyMesh(
        points, cells, surfaces, None, regions, shapes=mesh.shapes, hanging=hanging,
        node_sets=_carried_nodes(mesh, points),
    )  # fmt: skip
    return Refinement(fine.with_chart(chart), parents, positions)


def _carried_nodes(mesh: BodyMesh, points: np.ndarray) -> dict[str, np.ndarray]:
    """Return the node sets with the numbers of their nodes on the fine mesh, where they have their places."""
    if not mesh.node_sets:
        return {}
    number = cKDTree(points).query(mesh.points)[1]
    return {name: number[nodes] for name, nodes in mesh.node_sets.items()}


def _checked_marks(mesh: BodyMesh, marked: ArrayLike) -> np.ndarray:
    """Return the numbers of the marked cells."""
    if mesh.has_several_shapes:
        raise InvalidInputError(
            f"refined needs cells of one shape, got {mesh.cells_in_words}: take tetrahedra"
        )
    if mesh.coincident_nodes or mesh.cuts:
        raise InvalidInputError("refined needs a mesh without coincident nodes: refine before it is cut")
    marks = np.asarray(marked)
    if marks.dtype == bool and marks.shape == (mesh.n_cells,):
        marks = np.flatnonzero(marks)
    fits = marks.ndim == 1 and np.issubdtype(marks.dtype, np.integer) and marks.size > 0
    if not fits or marks.min() < 0 or marks.max() >= mesh.n_cells:
        raise InvalidInputError(
            f"marked must be at least one of the cells 0 to {mesh.n_cells - 1}, or bools, got {brief(marked)}"
        )
    if halves_together(mesh) and len(np.unique(marks)) < mesh.n_cells:
        raise InvalidInputError(
            "quadratic quadrilaterals and hexahedra are refined all together, got "
            f"{len(np.unique(marks))} of {mesh.n_cells} cells: mark all, or take linear cells or simplices"
        )
    return marks


def _identified(
    points: np.ndarray, skeleton: np.ndarray, linear: CellType, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the two coarse vertices between which each fine one lies, equal for old ones, and fine cells.

    Old vertices keep their numbers, new ones follow in the order of their ends, whatever dolfinx's order is.
    """
    points = _on_lattice(points)
    found, cells = _dolfinx.halved_simplices(points, skeleton, linear.name, chosen)
    pairs = [skeleton[:, list(pair)] for pair in zip(*np.triu_indices(len(linear.edges), 1), strict=True)]
    edges = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    ends = np.concatenate([np.repeat(np.arange(len(points)), 2).reshape(-1, 2), edges])
    _, which = cKDTree(points[ends].mean(axis=1)).query(found)
    used, renumbered = np.unique(np.concatenate([np.arange(len(points)), which]), return_inverse=True)
    return ends[used], renumbered[len(points) :][cells]


def _on_lattice(points: np.ndarray, bits: int = 40) -> np.ndarray:
    """Return coordinates relative to the body, without their last bits.

    Cells are cut by what edge is longest, and triangles by whether it is √2 times the shortest one, as in
    half a square: rounding would decide that, in another way in other units, elsewhere, or by another BLAS.
    """
    low = points.min(axis=0)
    return np.asarray(np.round((points - low) / np.ptp(points, axis=0).max() * 2.0**bits) / 2.0**bits)


def _placed_in_parents(
    ends: np.ndarray, cells: np.ndarray, skeleton: np.ndarray, linear: CellType
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return parent, reference coordinates of the vertices in it, and vertices of each cell, by parent."""
    size = skeleton.shape[1]
    cells = np.sort(cells, axis=1)
    parents = match_faces(_spanned(ends, cells), skeleton)
    order = np.lexsort((*cells.T, parents))
    parents, cells = parents[order], cells[order]
    local = (skeleton[parents][:, None, None, :] == ends[cells][..., None]).argmax(axis=3)
    places = linear.vertices[local].mean(axis=2)
    turned = np.linalg.det(places[:, 1:] - places[:, :1]) < 0.0
    flip = [*range(size - 2), size - 1, size - 2]
    cells[turned], places[turned] = cells[turned][:, flip], places[turned][:, flip]
    return parents, places, cells


def _spanned(ends: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the coarse vertices of the cells or facets in which fine ones lie, given by their vertices.

    Between them, the vertices of a fine cell lie on edges of all vertices of its coarse cell.
    """
    among = np.sort(ends[faces].reshape(len(faces), -1), axis=1)
    first = np.column_stack([np.ones(len(faces), dtype=bool), np.diff(among, axis=1) > 0])
    return among[first].reshape(len(faces), -1)


def _mapped(
    values: np.ndarray, mesh: BodyMesh, parents: np.ndarray, positions: np.ndarray, cells: np.ndarray
) -> np.ndarray:
    """Return values at the fine nodes, interpolated in the coarse cells; coordinates on curved ones."""
    result = np.empty((int(cells.max()) + 1, mesh.dim))
    weights = shape_values(CELL_TYPES[mesh.cell_type], positions.reshape(-1, mesh.dim))
    weights = weights.reshape(*cells.shape, -1)
    result[cells] = np.einsum("ckn,cni->cki", weights, values[mesh.cells[parents]])
    return result


def _reshaped(mesh: BodyMesh, before: Refinement) -> Refinement:
    """Return the refinement of a mesh before it was reshaped, moved as its coarse nodes have been."""
    moved = mesh.points - mesh.origin.points
    moved = _mapped(moved, mesh, before.parents, before.positions, before.mesh.cells)
    return replace(before, mesh=before.mesh.reshaped(before.mesh.points + moved))


def _carried_surfaces(
    surfaces: dict[str, np.ndarray], dim: int, ends: np.ndarray, cells: np.ndarray, vertices: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the fine facets of the surfaces."""
    boundary, _ = boundary_faces(cells, dim)
    spanned = vertices[_spanned(ends, corners_of(boundary, dim))]
    return {
        name: boundary[match_faces(spanned, corners_of(facets, dim)) >= 0]
        for name, facets in surfaces.items()
    }
