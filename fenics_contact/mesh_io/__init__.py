"""Meshes of other programs: gmsh, CAD, meshio, dolfinx, XDMF."""

from __future__ import annotations

from fenics_contact.mesh_io.cad_choice import InBox, OnCylinder, OnPlane
from fenics_contact.mesh_io.cad_faces import CadFace
from fenics_contact.mesh_io.cad_files import read_cad
from fenics_contact.mesh_io.cad_shapes import cad_shapes
from fenics_contact.mesh_io.dolfinx_bodies import DolfinxBodies
from fenics_contact.mesh_io.dolfinx_import import from_dolfinx, read_xdmf
from fenics_contact.mesh_io.gmsh_import import from_gmsh_model, read_msh
from fenics_contact.mesh_io.gmsh_session import gmsh_model, silenced
from fenics_contact.mesh_io.meshio_import import from_meshio, read_mesh, read_with_meshio
from fenics_contact.mesh_io.refilling import refilled

__all__ = [
    "CadFace",
    "DolfinxBodies",
    "InBox",
    "OnCylinder",
    "OnPlane",
    "cad_shapes",
    "from_dolfinx",
    "from_gmsh_model",
    "from_meshio",
    "gmsh_model",
    "read_cad",
    "read_mesh",
    "read_msh",
    "read_with_meshio",
    "read_xdmf",
    "refilled",
    "silenced",
]
