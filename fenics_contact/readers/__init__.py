"""Meshes of other programs: gmsh, CAD, meshio, dolfinx, XDMF, decks."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.readers.cad import CadFace, InBox, OnCylinder, OnPlane
    from fenics_contact.readers.deck_bodies import read_deck_mesh
    from fenics_contact.readers.dolfinx import DolfinxBodies, from_dolfinx, read_xdmf
    from fenics_contact.readers.gmsh import from_gmsh_model, read_msh, refilled
    from fenics_contact.readers.gmsh_session import gmsh_model
    from fenics_contact.readers.meshio import from_meshio
    from fenics_contact.readers.triangulation import read_triangulation

__all__ = [
    "CadFace",
    "DolfinxBodies",
    "InBox",
    "OnCylinder",
    "OnPlane",
    "from_dolfinx",
    "from_gmsh_model",
    "from_meshio",
    "gmsh_model",
    "read_deck_mesh",
    "read_msh",
    "read_triangulation",
    "read_xdmf",
    "refilled",
]

__getattr__, __dir__ = late_names(__name__)
