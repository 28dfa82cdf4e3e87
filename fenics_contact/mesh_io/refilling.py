"""New tetrahedra behind the surface of a body, by gmsh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.errors import FenicsContactError, InvalidInputError
from fenics_contact.mesh import BodyMesh, boundary_faces
from fenics_contact.mesh_io.gmsh_session import gmsh_model


def refilled(mesh: BodyMesh) -> BodyMesh:
    """Return new tetrahedra behind the boundary of a body, which keeps its nodes, facets and named surfaces.

    For a body that was deformed so far that its cells have become thin, see `shape.Remeshed`. Cells grow from
    the size of the facets around them. Nodes have other numbers afterwards.

    Args:
        mesh: Linear tetrahedra without regions and without true shapes of surfaces, in one piece.

    Raises:
        InvalidInputError: If the mesh is another one.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
        FenicsContactError: If gmsh fails, such as where the boundary penetrates itself.

    Example:
        >>> from fenics_contact.gallery import block
        >>> cube = block((0, 0, 0), (1, 1, 1), (3, 3, 3), "tetrahedron")
        >>> new = refilled(cube)
        >>> new.cell_type, round(new.volume, 12), len(new.surfaces["z1"])
        ('tetrahedron', 1.0, 18)
    """
    if mesh.cell_type != "tetrahedron" or mesh.regions or mesh.shapes:
        raise InvalidInputError(
            "a body is refilled with linear tetrahedra and has neither regions nor true shapes of surfaces, "
            f"got {mesh.cells_in_words}, regions {sorted(mesh.regions)} and shapes of {sorted(mesh.shapes)}: "
            "keep its cells, as Remeshed does by default, or mesh it by a function of your own"
        )
    facets, _ = boundary_faces(mesh.cells)
    try:
        points, cells = _filled(mesh.points, facets)
    except Exception as error:
        raise FenicsContactError(
            f"gmsh must fill the boundary of {mesh.cells_in_words} with tetrahedra, but failed ({error}): "
            "check that no parts of the boundary penetrate each other"
        ) from error
    rounding = 1e-9 * float(np.ptp(mesh.points, axis=0).max())
    distance, number = cKDTree(points).query(mesh.points[facets])
    if distance.max() > rounding:
        raise FenicsContactError(
            f"gmsh must keep the nodes of the boundary, got one that is off by {distance.max():.1e}: please "
            "report this mesh and the version of gmsh"
        )
    row = np.full(mesh.n_nodes, -1, dtype=np.int64)
    row[facets] = number
    points[number] = mesh.points[facets]
    return BodyMesh(points, cells, {name: row[surface] for name, surface in mesh.surfaces.items()})


def _filled(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates, (n_nodes, 3), and tetrahedra, (n_cells, 4), behind closed facets."""
    nodes, triangles = np.unique(facets, return_inverse=True)
    with gmsh_model("fenics_contact refilled") as gmsh:
        surface = gmsh.model.addDiscreteEntity(2)
        gmsh.model.mesh.addNodes(2, surface, np.arange(1, len(nodes) + 1), points[nodes].ravel())
        gmsh.model.mesh.addElementsByType(
            surface, gmsh.model.mesh.getElementType("Triangle", 1), [], triangles.ravel() + 1
        )
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop([surface])])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
        row[tags.astype(np.int64)] = np.arange(tags.size)
        found = gmsh.model.mesh.getElementsByType(gmsh.model.mesh.getElementType("Tetrahedron", 1))[1]
        cells = row[found.astype(np.int64)].reshape(-1, 4)
    used, number = np.unique(cells, return_inverse=True)
    return coordinates.reshape(-1, 3)[used], number.reshape(-1, 4)
