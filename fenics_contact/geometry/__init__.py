"""Meshes of bodies, built or moved, and their partition into subdomains. Knows no finite elements."""

from __future__ import annotations

from fenics_contact.geometry.block import block, box_lattice
from fenics_contact.geometry.bolted import bolt, drilled_plate
from fenics_contact.geometry.cad_files import read_cad
from fenics_contact.geometry.cad_shapes import cad_shapes
from fenics_contact.geometry.cell_types import CELL_TYPES, FACET_TYPES, CellType, cell_type_of
from fenics_contact.geometry.chain import Chain, chain
from fenics_contact.geometry.coincidence import merge_duplicate_nodes
from fenics_contact.geometry.default_partition import default_partition, target_parts
from fenics_contact.geometry.dolfinx_import import from_dolfinx, read_xdmf
from fenics_contact.geometry.extrusion import extrude
from fenics_contact.geometry.faces import boundary_faces, corners_of, orient, vector_areas
from fenics_contact.geometry.gmsh_import import from_gmsh_model, read_msh
from fenics_contact.geometry.graph_partition import graph_partition
from fenics_contact.geometry.half_disc import half_disc
from fenics_contact.geometry.hemisphere import half_cylinder, hemisphere
from fenics_contact.geometry.link import DesignSurface, Link, chain_link
from fenics_contact.geometry.mesh import BodyMesh
from fenics_contact.geometry.meshio_import import from_meshio, read_mesh
from fenics_contact.geometry.near_surfaces import near_surfaces
from fenics_contact.geometry.partition import (
    bisection_partition,
    box_partition,
    check_face_connected,
    check_one_piece,
    combine,
    merge_pieces,
    torn_node_counts,
)
from fenics_contact.geometry.quadratic import quadratic
from fenics_contact.geometry.rectangle import rectangle, rectangle_lattice, split_quadrilaterals
from fenics_contact.geometry.ring import LinkShape
from fenics_contact.geometry.rounding import coordinate_rounding
from fenics_contact.geometry.shape_functions import quadrature, shape_gradients, shape_values
from fenics_contact.geometry.shapes import (
    Cylinder,
    Extruded,
    Joined,
    Parametric,
    Placed,
    Plane,
    Profile,
    Revolved,
    SignedDistance,
    Sphere,
    SurfaceShape,
    Torus,
    asked,
    closest_points,
    placed,
    principal_curvatures,
)
from fenics_contact.geometry.structured import split_hexahedra
from fenics_contact.geometry.touch import (
    PULL_AXIS,
    TwoLinks,
    two_links,
)

__all__ = [
    "CELL_TYPES",
    "FACET_TYPES",
    "PULL_AXIS",
    "BodyMesh",
    "CellType",
    "Chain",
    "Cylinder",
    "DesignSurface",
    "Extruded",
    "Joined",
    "Link",
    "LinkShape",
    "Parametric",
    "Placed",
    "Plane",
    "Profile",
    "Revolved",
    "SignedDistance",
    "Sphere",
    "SurfaceShape",
    "Torus",
    "TwoLinks",
    "asked",
    "bisection_partition",
    "block",
    "bolt",
    "boundary_faces",
    "box_lattice",
    "box_partition",
    "cad_shapes",
    "cell_type_of",
    "chain",
    "chain_link",
    "check_face_connected",
    "check_one_piece",
    "closest_points",
    "combine",
    "coordinate_rounding",
    "corners_of",
    "default_partition",
    "drilled_plate",
    "extrude",
    "from_dolfinx",
    "from_gmsh_model",
    "from_meshio",
    "graph_partition",
    "half_cylinder",
    "half_disc",
    "hemisphere",
    "merge_duplicate_nodes",
    "merge_pieces",
    "near_surfaces",
    "orient",
    "placed",
    "principal_curvatures",
    "quadratic",
    "quadrature",
    "read_cad",
    "read_mesh",
    "read_msh",
    "read_xdmf",
    "rectangle",
    "rectangle_lattice",
    "shape_gradients",
    "shape_values",
    "split_hexahedra",
    "split_quadrilaterals",
    "target_parts",
    "torn_node_counts",
    "two_links",
    "vector_areas",
]
