"""Quadratic cells from linear ones: more nodes on edges, faces and inside."""

from __future__ import annotations

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh, check_jacobians
from fenics_contact.mesh.cell_types import (
    HEXAHEDRON27,
    QUADRILATERAL9,
    TETRAHEDRON10,
    TRIANGLE6,
    CellType,
    cell_type_of,
    shape_values,
)
from fenics_contact.mesh.chart import kept_valid
from fenics_contact.mesh.collapsed import SHAPES, by_shape, joined_cells, shapes_in
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces
from fenics_contact.mesh.hanging import require_none
from fenics_contact.mesh.on_shapes import put_on_shapes, with_parts

_QUADRATIC = {cell.vertices.shape: cell for cell in (TRIANGLE6, QUADRILATERAL9, TETRAHEDRON10, HEXAHEDRON27)}


@naming_arguments
def quadratic(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh with quadratic cells.

    The new nodes are the midpoints of edges, faces and cells; on surfaces whose shape the mesh carries, the
    closest points of the shape, and of a mesh with a `Chart` the images by it. Displacements, and such
    surfaces, become piecewise quadratic. The numbers of the old nodes, cells and facets are unchanged.

    Args:
        mesh: Linear cells of any type.

    Raises:
        InvalidInputError: If the cells are quadratic already, or nodes are moved so far onto a shape that a
            cell is inverted.

    Example:
        >>> from fenics_contact.gallery import half_disc
        >>> from fenics_contact.mesh import quadratic
        >>> disc = quadratic(half_disc(1.0, 8))
        >>> disc.cell_type
        'quadrilateral9'
    """
    linear = cell_type_of(mesh.cells, mesh.dim)
    if linear.order == 2:
        raise InvalidInputError(f"quadratic needs linear cells, got {linear.plural}: use the mesh as it is")
    require_none(mesh.hanging, "quadratic", "refine everywhere, or take more linear cells")
    kind = _QUADRATIC[linear.vertices.shape]
    groups, cells = with_more_nodes(mesh.n_nodes, mesh.cells, linear, kind)
    points = np.concatenate([mesh.points, *(mesh.points[each].mean(axis=1) for each in groups)])
    boundary, _ = boundary_faces(cells, mesh.dim)
    parts, shapes = with_parts(mesh)
    carried = {
        name: boundary[match_faces(facets, corners_of(boundary, mesh.dim))] for name, facets in parts.items()
    }
    surfaces = {name: carried[name] for name in mesh.surfaces}
    chart = mesh.chart and mesh.chart.extended(groups)
    if chart is None:
        new = np.arange(len(points)) >= mesh.n_nodes
        points, placed, _ = put_on_shapes(points, cells, carried, shapes, new)
        if placed.any():
            _follow(points, cells, kind, placed)
    else:
        images = np.concatenate([mesh.points, chart.points(mesh.n_nodes)])
        points = kept_valid(images, points, cells, (surfaces[name] for name in mesh.shapes))
    check_jacobians(points, cells, "refine the mesh along its curved surfaces, or leave their shapes away")
    result = BodyMesh(
        points, cells, surfaces, mesh.grid, mesh.regions, mesh.coincident_nodes, mesh.shapes,
        node_sets=mesh.node_sets,
    )  # fmt: skip
    return result.with_chart(chart)


def with_more_nodes(
    count: int, cells: np.ndarray, linear: CellType, kind: CellType
) -> tuple[list[np.ndarray], np.ndarray]:
    """Number the nodes in the middle of vertices, once for all cells that share them, after `count` nodes.

    Returns groups of the vertices around them, in the order of the numbers, and the cells.
    """
    if shapes_in(cells, linear.dim):
        return _with_nodes_of_shapes(count, cells, linear.dim)
    # The vertices whose linear shape functions are not zero there.
    weights = shape_values(linear, kind.nodes[len(linear.nodes) :])
    parents = [np.flatnonzero(values > 0.1) for values in weights]
    result = np.concatenate([cells, np.empty((len(cells), len(parents)), dtype=np.int64)], axis=1)
    groups: list[np.ndarray] = []
    for size in sorted({len(around) for around in parents}):
        columns = [index for index, around in enumerate(parents) if len(around) == size]
        around = np.sort(cells[:, [parents[index] for index in columns]], axis=2)
        unique, number = np.unique(around.reshape(-1, size), axis=0, return_inverse=True)
        where = len(cells[0]) + np.array(columns)
        result[:, where] = number.reshape(len(cells), -1) + count
        groups.append(unique)
        count += len(unique)
    return groups, result


def _with_nodes_of_shapes(count: int, cells: np.ndarray, dim: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Number the nodes in the middle of edges, faces and cells of several shapes, as `with_more_nodes`."""
    found = by_shape(cells, dim)
    whole = {name: SHAPES[name].sets(SHAPES[name].counts[2]) for name in found}
    rows = {name: np.empty((len(own), len(whole[name])), dtype=np.int64) for name, (_, own) in found.items()}
    groups: list[np.ndarray] = []
    for size in sorted({len(each) for sets in whole.values() for each in sets}):
        where = {
            name: [i for i, each in enumerate(sets) if len(each) == size] for name, sets in whole.items()
        }
        around = [
            np.sort(own[:, [sorted(whole[name][i]) for i in where[name]]].reshape(-1, size), axis=1)
            for name, (_, own) in found.items()
        ]
        if size == 1:
            numbers = np.concatenate(around).ravel()
        else:
            unique, numbers = np.unique(np.concatenate(around), axis=0, return_inverse=True)
            groups.append(unique)
            numbers = numbers.ravel() + count
            count += len(unique)
        ends = np.cumsum([len(each) for each in around])[:-1]
        for name, mine in zip(found, np.split(numbers, ends), strict=True):
            rows[name][:, where[name]] = mine.reshape(len(rows[name]), -1)
    order = np.concatenate([mine for mine, _ in found.values()])
    result = np.empty((len(cells), 9 if dim == 2 else 27), dtype=np.int64)
    result[order] = joined_cells(rows, dim)
    return groups, result


def _follow(points: np.ndarray, cells: np.ndarray, kind: CellType, placed: np.ndarray) -> None:
    """Move the centres of faces and cells with the midpoints of edges, so that thin cells keep their shape.

    A centre is placed by serendipity functions: ½ Σ midpoints − ¼ Σ corners of a face, ¼ Σ midpoints − ¼ Σ
    corners of a hexahedron.
    """
    if kind.is_simplex:
        return
    if kind is HEXAHEDRON27:
        for face in kind.faces:
            centre = cells[:, face[8]]
            centres = 0.5 * points[cells[:, face[4:8]]].sum(axis=1) - 0.25 * points[cells[:, face[:4]]].sum(
                axis=1
            )
            free = ~placed[centre]
            points[centre[free]] = centres[free]
        points[cells[:, 26]] = 0.25 * (points[cells[:, 8:20]].sum(axis=1) - points[cells[:, :8]].sum(axis=1))
        return
    points[cells[:, 8]] = 0.5 * points[cells[:, 4:8]].sum(axis=1) - 0.25 * points[cells[:, :4]].sum(axis=1)
