"""Serendipity cells, such as hexahedra of 20 nodes, as complete ones whose centres follow."""

from __future__ import annotations

from copy import copy

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh, check_jacobians
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.collapsed import SHAPES, by_shape
from fenics_contact.mesh.hanging import NO_CENTRES, Centres

_OF_A_FACE = np.array([-0.25, -0.25, -0.25, -0.25, 0.5, 0.5, 0.5, 0.5])
"""Serendipity functions of the corners and midpoints of a quadrilateral in its centre."""
_OF_A_CELL = np.concatenate([np.full(8, -0.25), np.full(12, 0.25)])
"""Those of a hexahedron in its centre."""


def centres_of(cells: np.ndarray, dim: int) -> Centres:
    """Return the centres of faces and cells, which follow the other nodes."""
    if cell_type_of(cells, dim).order == 1:
        return NO_CENTRES
    width = 8 if dim == 2 else 20
    nodes, masters, weights = [np.zeros(0, dtype=np.int64)], [np.zeros((0, width), dtype=np.int64)], []
    for name, (_, own) in by_shape(cells, dim).items():
        faces = own[:, SHAPES[name].square_columns].reshape(-1, 9)
        nodes.append(faces[:, 8])
        masters.append(np.column_stack([faces[:, :8], np.repeat(faces[:, :1], width - 8, axis=1)]))
        weights.append(np.tile(np.append(_OF_A_FACE, np.zeros(width - 8)), (len(faces), 1)))
        if dim == 3 and SHAPES[name].centre:
            nodes.append(own[:, 26])
            masters.append(own[:, :20])
            weights.append(np.tile(_OF_A_CELL, (len(own), 1)))
    node, first = np.unique(np.concatenate(nodes), return_index=True)
    if not len(node):
        return NO_CENTRES
    return Centres(node, np.concatenate(masters)[first], np.concatenate(weights)[first])


@naming_arguments
def serendipity(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh with serendipity cells: the centres of faces and cells follow their other nodes.

    Quadrilaterals have 8 nodes then, hexahedra 20, prisms 15 and pyramids 13.

    The nodes in the centres of faces and cells stay, so that surfaces, results and files are those of
    complete cells, but they are no unknowns: u_c = ½ Σ midpoints − ¼ Σ corners on faces, ¼ Σ midpoints − ¼ Σ
    corners in cells. The stiffness is Tᵀ K T with that of the complete cells, exactly that of the serendipity
    cells. They are placed alike. On surfaces in contact or tied the centres become unknowns again, as a
    uniform pressure pulls at the corners of facets without them; a `Scene` sees to that.

    Args:
        mesh: Quadrilaterals of 9 nodes, hexahedra of 27, prisms of 18, pyramids of 14, or several of these.

    Raises:
        InvalidInputError: If the cells are others, or a cell is inverted.

    References:
        O. C. Zienkiewicz, R. L. Taylor: The Finite Element Method, vol. 1 (serendipity functions).

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact.mesh import quadratic, serendipity
        >>> box = serendipity(quadratic(block((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), (1, 1, 2))))
        >>> box.cells_in_words
        '2 serendipity hexahedra'
    """
    centres = centres_of(mesh.cells, mesh.dim)
    if not centres:
        given = cell_type_of(mesh.cells, mesh.dim).plural
        raise InvalidInputError(
            f"serendipity needs quadratic quadrilaterals or hexahedra, got {given}: see mesh.quadratic"
        )
    result = copy(mesh)
    result.__dict__.pop("linear", None)
    points = centres.placed(mesh.points)
    remedy = "refine the mesh along its curved surfaces, or keep complete cells"
    check_jacobians(points, mesh.cells, remedy, given=True)
    result._set(points=points, centres=centres, chart=None)
    return result


def completed(mesh: BodyMesh, *surfaces: str) -> BodyMesh:
    """Return the mesh with complete cells: its centres are unknowns again, where they are now.

    Args:
        mesh: Any mesh; one without serendipity cells is returned as it is.
        surfaces: Names of surfaces on which alone centres become unknowns; all centres if none is given.

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact.mesh import completed, quadratic, serendipity
        >>> box = serendipity(quadratic(block((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), (1, 1, 2))))
        >>> completed(box).cells_in_words
        '2 quadratic hexahedra'
    """
    facets = [mesh.surfaces[name].ravel() for name in surfaces]
    freed = np.concatenate(facets) if surfaces else mesh.centres.nodes
    if not np.isin(mesh.centres.nodes, freed).any():
        return mesh
    result = copy(mesh)
    result._set(centres=mesh.centres.without(freed))
    return result
