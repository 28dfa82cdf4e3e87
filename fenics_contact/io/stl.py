"""The boundary of a designed body as triangles, for printers and other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.io.moved_bodies import moved_body
from fenics_contact.io.replacing import replacing
from fenics_contact.mesh import FACET_TYPES, boundary_faces

if TYPE_CHECKING:
    from fenics_contact.mesh import BodyMesh
    from fenics_contact.shape import LoadPath, ShapeProblem


@collectively("write_stl", lambda problem, *_, **__: problem.comm)
def write_stl(
    problem: ShapeProblem | LoadPath, alpha: np.ndarray, path: str | Path, *, body: str | None = None
) -> Path:
    """Write the closed boundary of a designed body as a binary STL file. Collective.

    The triangles are the facets of the mesh, of quadrilaterals two, of quadratic facets the pieces between
    their nodes; their right-hand normals point out. The format names no unit and has seven digits.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        path: File to write; its folder is created.
        body: Name of the body; needed if designs move several.

    Returns:
        The path.

    Raises:
        InvalidInputError: If the body is plane or not designed, or alpha does not fit.
        InvalidDesignError: If the design inverts a cell.

    Example:
        >>> write_stl(problem, result.x, "output/link_1.stl", body="link 1")  # doctest: +SKIP
    """
    import meshio  # takes a tenth of a second

    target = Path(path)
    with together(problem.comm):
        if problem.scene.dim == 2:
            raise InvalidInputError(
                "an STL file has a body in space, the scene is plane: write its profile with "
                "write_design_table"
            )
    _, mesh = moved_body(problem, alpha, body)
    with together(problem.comm):
        if problem.comm.rank == 0:
            points, triangles = _triangles(mesh)
            with replacing(target) as (temporary,):
                written = meshio.Mesh(points, [("triangle", triangles)])
                meshio.write(temporary, written, file_format="stl", binary=True)
    return target


def _triangles(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the boundary and its triangles, outward."""
    facets, _ = boundary_faces(mesh.linear.cells, mesh.dim)
    triangles = facets[:, FACET_TYPES[facets.shape[1], 3].simplices].reshape(-1, 3)
    nodes, numbers = np.unique(triangles, return_inverse=True)
    return mesh.points[nodes], numbers.reshape(-1, 3)
