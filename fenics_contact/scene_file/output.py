"""What is written, and where."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field

from fenics_contact.scene_file.values import Part, PlaceOfFile

FileKind: TypeAlias = Literal["vtu", "vtx", "xdmf"]
PictureKind: TypeAlias = Literal["stress", "pressure", "status", "decomposition", "error"]


def _vtu() -> list[FileKind]:
    return ["vtu"]


def _stress() -> list[PictureKind]:
    return ["stress"]


class OutputPart(Part):
    """What is written, and where."""

    folder: PlaceOfFile | None = Field(
        default=None,
        description="folder of the results, relative to where the command runs (output/NAME of the file)",
    )
    files: list[FileKind] = Field(
        default_factory=_vtu, description="files of fields, for ParaView; vtx needs ADIOS2"
    )
    pictures: list[PictureKind] = Field(default_factory=_stress, description="pictures as PNG files")
    checkpoint: bool = Field(
        default=True, description="keep a file from which interrupted load steps or optimisations go on"
    )
