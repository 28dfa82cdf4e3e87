"""Meshes of bodies: cells, faces, named sides, quality, local refinement; independent of forms."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names
from fenics_contact.mesh.quadratic import quadratic

if TYPE_CHECKING:
    from fenics_contact.mesh.bisection import bisection_partition
    from fenics_contact.mesh.cell_types import CellType
    from fenics_contact.mesh.chart import Chart
    from fenics_contact.mesh.collapsed import joined_cells
    from fenics_contact.mesh.faces import boundary_faces, merge_duplicate_nodes, orient
    from fenics_contact.mesh.quadratic_nodes import in_vtk_order
    from fenics_contact.mesh.quality import scaled_jacobian
    from fenics_contact.mesh.refinement import Refinement, refined
    from fenics_contact.mesh.serendipity_cells import completed, serendipity
    from fenics_contact.mesh.thin_bodies import Thickened, thickened
    from fenics_contact.mesh.transfer import MeshTransfer

__all__ = [
    "CellType",
    "Chart",
    "MeshTransfer",
    "Refinement",
    "Thickened",
    "bisection_partition",
    "boundary_faces",
    "completed",
    "in_vtk_order",
    "joined_cells",
    "merge_duplicate_nodes",
    "orient",
    "quadratic",
    "refined",
    "scaled_jacobian",
    "serendipity",
    "thickened",
]

__getattr__, __dir__ = late_names(__name__)
