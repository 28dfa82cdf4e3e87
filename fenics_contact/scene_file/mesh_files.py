"""Meshes from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import Field, PlainValidator, WithJsonSchema

from fenics_contact import geometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry import BodyMesh
from fenics_contact.scene_file.placing import Placed, Shaped
from fenics_contact.scene_file.values import PlaceOfFile, needs

if TYPE_CHECKING:
    from mpi4py import MPI

#: CAD files that only say what is there; a .geo file is a program, which is for Python to run.
CAD = (".step", ".stp", ".iges", ".igs", ".brep")
_LABEL = {"anyOf": [{"type": "string"}, {"type": "integer"}]}


def _is_label(value: object) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool)


def _is_labels(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(map(_is_label, value))


def _bodies(value: Any) -> Any:
    """Check names of groups, or a table from bodies to groups or to regions."""
    if _is_labels(value):
        return value
    if isinstance(value, Mapping) and value:
        regions = [part for part in value.values() if isinstance(part, Mapping)]
        plain = [part for part in value.values() if not isinstance(part, Mapping)]
        if all(_is_label(part) or _is_labels(part) for part in plain) and all(
            all(map(_is_label, part.values())) for part in regions
        ):
            return value
    raise needs(
        "a list of groups, or a table: body = group, body = [groups], or body = {region = group}, where a "
        "group is a name or a number"
    )


def _surfaces(value: Any) -> Any:
    """Check names of groups, or a table from surfaces to groups."""
    if _is_labels(value):
        return value
    if isinstance(value, Mapping) and all(_is_label(part) or _is_labels(part) for part in value.values()):
        return value
    raise needs("a list of groups, or a table: surface = group, or surface = [groups]")


_LABELS: dict[str, Any] = {"type": "array", "items": _LABEL}
_OF_SURFACES = {"anyOf": [_LABELS, {"type": "object", "additionalProperties": {"anyOf": [_LABEL, _LABELS]}}]}
_REGIONS = {"type": "object", "additionalProperties": _LABEL}
_OF_BODIES = {
    "anyOf": [
        _LABELS,
        {"type": "object", "additionalProperties": {"anyOf": [_LABEL, _LABELS, _REGIONS]}},
    ]
}
BodyGroups: TypeAlias = Annotated[Any, PlainValidator(_bodies), WithJsonSchema(_OF_BODIES)]
SurfaceGroups: TypeAlias = Annotated[Any, PlainValidator(_surfaces), WithJsonSchema(_OF_SURFACES)]


class MeshFile(Placed):
    """Bodies and surfaces by name from a file: CAD, .msh, .xdmf, or another format that meshio reads."""

    file: PlaceOfFile = Field(description="the file, relative to the folder of the scene file")
    bodies: BodyGroups | None = Field(
        None, description="groups of cells that are bodies; or body to group, groups or regions (all)"
    )
    surfaces: SurfaceGroups | None = Field(
        None, description="groups of facets that are surfaces; or surface to group or groups (all)"
    )

    size: float | None = Field(
        None, gt=0, description="largest edge of a cell, for CAD files, which gmsh meshes, [length]"
    )
    labels: str | None = Field(
        None,
        description="not for CAD, .msh and .xdmf: sets, blocks, pieces, or cell data that say which cells "
        "belong together",
    )
    corners_only: bool = Field(
        False, description="drop all nodes but the corners of quadratic cells (not for CAD, .msh and .xdmf)"
    )

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Read the file on rank 0. Collective.

        Raises:
            InvalidInputError: If it is missing, of no known format, or does not hold what is asked for.
        """
        return {name: self.arranged(Shaped(mesh)) for name, mesh in self._read(folder, comm).items()}

    def _read(self, folder: Path, comm: MPI.Comm) -> Mapping[str, BodyMesh]:
        path = folder / self.file
        kind = path.suffix.lower()
        if kind in (*CAD, ".msh", ".xdmf") and (self.labels is not None or self.corners_only):
            raise InvalidInputError(
                f"labels and corners_only are for other formats than CAD, .msh and .xdmf, got {self.file!r}: "
                "choose groups with bodies and surfaces"
            )
        if kind in CAD:
            return geometry.read_cad(path, self.size, self.bodies, self.surfaces, comm=comm)
        if self.size is not None:
            raise InvalidInputError(
                f"size is for CAD files ({', '.join(CAD)}), got {self.file!r}: leave it away, or mesh the "
                "body anew"
            )
        if kind == ".msh":
            return geometry.read_msh(path, self.bodies, self.surfaces, comm=comm)
        if kind == ".xdmf":
            return geometry.read_xdmf(path, self.bodies, self.surfaces, comm=comm)
        return geometry.read_mesh(
            path, self.bodies, self.surfaces, labels=self.labels, corners_only=self.corners_only, comm=comm
        )
