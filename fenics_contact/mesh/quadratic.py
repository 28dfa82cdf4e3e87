"""Quadratic cells from linear ones: more nodes on edges, faces and inside."""

from __future__ import annotations

import numpy as np

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
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces
from fenics_contact.mesh.hanging import require_none
from fenics_contact.mesh.on_shapes import put_on_shapes

_QUADRATIC = {cell.vertices.shape: cell for cell in (TRIANGLE6, QUADRILATERAL9, TETRAHEDRON10, HEXAHEDRON27)}


def quadratic(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh with quadratic cells.

    The new nodes are the midpoints of edges, faces and cells; on surfaces whose shape the mesh carries, the
    closest points of the shape. Displacements, and such surfaces, become piecewise quadratic. The numbers of
    the old nodes, cells and facets are unchanged.

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
    points, cells = with_more_nodes(mesh.points, mesh.cells, linear, kind)
    boundary, _ = boundary_faces(cells, mesh.dim)
    surfaces = {
        name: boundary[match_faces(facets, corners_of(boundary, mesh.dim))]
        for name, facets in mesh.surfaces.items()
    }
    points, placed, _ = put_on_shapes(
        points, cells, surfaces, mesh.shapes, np.arange(len(points)) >= mesh.n_nodes
    )
    if placed.any():
        _follow(points, cells, kind, placed)
    check_jacobians(points, cells, "refine the mesh along its curved surfaces, or leave their shapes away")
    return BodyMesh(points, cells, surfaces, mesh.grid, mesh.regions, mesh.coincident_nodes, mesh.shapes)


def with_more_nodes(
    points: np.ndarray, cells: np.ndarray, linear: CellType, kind: CellType
) -> tuple[np.ndarray, np.ndarray]:
    """Add a node at the mean of the vertices around it, once for all cells that share it."""
    # The vertices whose linear shape functions are not zero there.
    weights = shape_values(linear, kind.nodes[len(linear.nodes) :])
    parents = [np.flatnonzero(values > 0.1) for values in weights]
    result = np.concatenate([cells, np.empty((len(cells), len(parents)), dtype=np.int64)], axis=1)
    for count in sorted({len(around) for around in parents}):
        columns = [index for index, around in enumerate(parents) if len(around) == count]
        groups = np.sort(cells[:, [parents[index] for index in columns]], axis=2)
        unique, number = np.unique(groups.reshape(-1, count), axis=0, return_inverse=True)
        where = len(cells[0]) + np.array(columns)
        result[:, where] = number.reshape(len(cells), -1) + len(points)
        points = np.concatenate([points, points[unique].mean(axis=1)])
    return points, result


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
