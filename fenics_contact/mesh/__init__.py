"""Meshes of bodies: cells, faces, named sides, quality; independent of finite elements."""

from __future__ import annotations

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import (
    CELL_TYPES,
    FACET_TYPES,
    OF_THE_FILE,
    CellType,
    cell_type_of,
)
from fenics_contact.mesh.coincidence import merge_duplicate_nodes
from fenics_contact.mesh.faces import (
    boundary_faces,
    cell_faces,
    corners_of,
    match_faces,
    neighbours,
    orient,
    shared_faces,
    vector_areas,
)
from fenics_contact.mesh.near_surfaces import near_surfaces
from fenics_contact.mesh.plane import flattened, turned_counter_clockwise, turned_right_handed
from fenics_contact.mesh.quadratic import quadratic
from fenics_contact.mesh.quadratic_nodes import in_vtk_order
from fenics_contact.mesh.quality import cell_volumes, determinants, jacobians
from fenics_contact.mesh.rounding import computed_rounding, coordinate_rounding
from fenics_contact.mesh.shape_functions import quadrature, shape_gradients, shape_values
from fenics_contact.mesh.similarity import similarity

__all__ = [
    "CELL_TYPES",
    "FACET_TYPES",
    "OF_THE_FILE",
    "BodyMesh",
    "CellType",
    "boundary_faces",
    "cell_faces",
    "cell_type_of",
    "cell_volumes",
    "computed_rounding",
    "coordinate_rounding",
    "corners_of",
    "determinants",
    "flattened",
    "in_vtk_order",
    "jacobians",
    "match_faces",
    "merge_duplicate_nodes",
    "near_surfaces",
    "neighbours",
    "orient",
    "quadratic",
    "quadrature",
    "shape_gradients",
    "shape_values",
    "shared_faces",
    "similarity",
    "turned_counter_clockwise",
    "turned_right_handed",
    "vector_areas",
]
