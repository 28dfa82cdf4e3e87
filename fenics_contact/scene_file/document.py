"""A whole scene file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from fenics_contact.scene_file.contacts import AutomaticPart, ContactPart, TiePart
from fenics_contact.scene_file.design import DesignPart
from fenics_contact.scene_file.loads import AnyLoad, AnySupportPart
from fenics_contact.scene_file.materials import AnyMaterial
from fenics_contact.scene_file.meshes import Mesh
from fenics_contact.scene_file.mistakes import Mistake
from fenics_contact.scene_file.own_python import is_reference
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.places import Path as Keys
from fenics_contact.scene_file.places import as_toml, branches, written
from fenics_contact.scene_file.solver import SolverPart
from fenics_contact.scene_file.source import Source
from fenics_contact.scene_file.steps import StepPart
from fenics_contact.scene_file.values import PlaceOfFile, Read, with_message

FileKind: TypeAlias = Literal["vtu", "vtx", "xdmf"]
DesignFileKind: TypeAlias = Literal["csv", "stl", "step"]
PictureKind: TypeAlias = Literal["stress", "pressure", "status", "decomposition", "error"]
_ByRegion = Annotated[dict[str, str], Field(min_length=1)]
Materials: TypeAlias = Annotated[
    Any,
    Read(Annotated[str | _ByRegion, with_message("the name of a material, or a table: region = material")]),
]


class UnitNames(Part):
    """Names of the units of all numbers of the file; labels use them, nothing is converted."""

    length: str = Field(default="mm", description="unit of coordinates and displacements")
    force: str = Field(default="N", description="unit of forces")
    stress: str = Field(default="MPa", description="unit of stresses, moduli and pressures: force / length²")


class BodyPart(Part):
    """A body: a mesh and what it is made of."""

    mesh: str = Field(description="name of a mesh of [meshes]")
    part: str | None = Field(
        None, description="which body of a mesh that has several, such as a group of a file"
    )
    material: Materials = Field(
        description="name of a material of [materials], or one for each region of the mesh"
    )


class OutputPart(Part):
    """What is written, and where."""

    folder: PlaceOfFile | None = Field(
        default=None,
        description="folder of the results, relative to where the command runs (output/NAME of the file)",
    )
    files: list[FileKind] = Field(
        default=["vtu"], description="files of fields, for ParaView; vtx needs ADIOS2"
    )
    design: list[DesignFileKind] = Field(
        default=["csv"],
        description="files of an optimised surface: a table, the body as triangles, for CAD programs",
    )
    pictures: list[PictureKind] = Field(default=["stress"], description="pictures as PNG files")
    checkpoint: bool = Field(
        default=True, description="keep a file from which interrupted load steps or optimisations go on"
    )


class Document(Part):
    """A scene of fenics_contact: bodies that may touch, what holds and loads them, how it is solved."""

    title: str = Field("", description="title of pictures and tables")
    units: UnitNames = Field(UnitNames(), description="names of the units, for labels")
    meshes: dict[str, Mesh] = Field(min_length=1, description="meshes by name: shapes, or files")
    materials: dict[str, AnyMaterial] = Field(min_length=1, description="materials by name")
    bodies: dict[str, BodyPart] = Field(min_length=1, description="bodies by name")
    supports: list[AnySupportPart] = Field([], description="prescribed displacements")
    loads: list[AnyLoad] = Field([], description="forces and changes of temperature")
    contacts: list[ContactPart] = Field([], description="pairs that may touch")
    automatic_contact: AutomaticPart | None = Field(
        None, description="pairs that are found where boundaries face each other, in place of [[contacts]]"
    )
    ties: list[TiePart] = Field([], description="pairs that stay together")
    steps: list[StepPart] = Field([], description="load steps; without them all acts at once")
    solver: SolverPart = Field(SolverPart(), description="how it is solved")
    output: OutputPart = Field(OutputPart(), description="what is written, and where")
    design: DesignPart | None = Field(None, description="a shape optimisation, for `fenics-contact optimize`")


def references(document: Document) -> Iterator[tuple[Keys, str]]:
    """Yield the references of a scene file to Python files, with their keys: all of these files are run."""
    for name, material in document.materials.items():
        if is_reference(material.model):
            yield ("materials", name, "model"), material.model
    for path, part in branches(document.design, ("design",)):
        objective = getattr(part, "objective", None) if isinstance(part, Part) else None
        if isinstance(objective, str) and is_reference(objective):
            yield (*path, "objective"), objective


def refused_python(source: Source, document: Document) -> list[Mistake]:
    """Return a mistake for every reference of a scene file to a Python file."""
    return [
        source.mistake(
            path,
            f"{written(path)} must not be Python code (--no-python), got {as_toml(reference)}: read that "
            "file, and leave --no-python out if you trust it",
        )
        for path, reference in references(document)
    ]
