"""Meshes from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import Field, PositiveFloat

from fenics_contact import mesh_io
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene_file.face_choices import SurfaceGroups, by_place, made_choice
from fenics_contact.scene_file.placing import Placed, Shaped
from fenics_contact.scene_file.values import PlaceOfFile, Read, with_message

if TYPE_CHECKING:
    from mpi4py import MPI

#: CAD files that only contain data; a .geo file is a program, to be run from Python.
CAD = (".step", ".stp", ".iges", ".igs", ".brep")

_Label = str | int
_Labels = Annotated[list[_Label], Field(min_length=1, strict=False)]
_OfBodies = Annotated[dict[str, _Label | _Labels | dict[str, _Label]], Field(min_length=1)]
BodyGroups: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            _Labels | _OfBodies,
            with_message(
                "a list of groups, or a table: body = group, body = [groups], or body = {region = group}, "
                "where a group is a name or a number"
            ),
        ]
    ),
]


class MeshFile(Placed):
    """Bodies and surfaces by name from a file: CAD, .msh, .xdmf, or another format that meshio reads."""

    file: PlaceOfFile = Field(description="the file, relative to the folder of the scene file")
    bodies: BodyGroups | None = Field(
        None, description="groups of cells that are bodies; or body to group, groups or regions (all)"
    )
    surfaces: SurfaceGroups | None = Field(
        None,
        description="groups of facets that are surfaces; or surface to group or groups, of CAD files also to "
        "tables that choose faces (all)",
    )
    size: PositiveFloat | None = Field(
        None, description="largest edge of a cell, for CAD files, which gmsh meshes, [length]"
    )
    order: Literal[1, 2] = Field(1, description="order of the cells that CAD files are meshed with")
    labels: str | None = Field(
        None,
        description="not for CAD, .msh and .xdmf: sets, blocks, pieces, or cell data that say which cells "
        "belong together",
    )
    corners_only: bool = Field(
        False, description="drop all nodes but the corners of quadratic cells (not for CAD, .msh and .xdmf)"
    )

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Read the file on rank 0. Collective.

        Raises:
            InvalidInputError: If it is missing, of unknown format, or lacks the requested groups.
        """
        return {name: Shaped(mesh) for name, mesh in self._read(folder / self.file, comm).items()}

    def _read(self, path: Path, comm: MPI.Comm) -> Mapping[str, BodyMesh]:
        kind, groups = path.suffix.lower(), (self.bodies, made_choice(self.surfaces))
        if kind in (*CAD, ".msh", ".xdmf") and (self.labels is not None or self.corners_only):
            raise InvalidInputError(
                f"labels and corners_only are for other formats than CAD, .msh and .xdmf, got {self.file!r}: "
                "choose groups with bodies and surfaces"
            )
        if kind in CAD:
            return mesh_io.read_cad(path, self.size, *groups, order=self.order, comm=comm)
        if by_place(self.surfaces):
            raise InvalidInputError(
                f"faces are chosen by where they lie in CAD files ({', '.join(CAD)}), got {self.file!r}: "
                "choose groups by their names or numbers"
            )
        if self.size is not None or self.order > 1:
            raise InvalidInputError(
                f"size and order are for CAD files ({', '.join(CAD)}), got {self.file!r}: leave it away, or "
                "mesh the body anew"
            )
        if kind == ".msh":
            return mesh_io.read_msh(path, *groups, comm=comm)
        if kind == ".xdmf":
            return mesh_io.read_xdmf(path, *groups, comm=comm)
        return mesh_io.read_mesh(path, *groups, labels=self.labels, corners_only=self.corners_only, comm=comm)
