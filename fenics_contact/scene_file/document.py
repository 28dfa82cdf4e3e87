"""A whole scene file."""

from __future__ import annotations

from pydantic import Field

from fenics_contact.scene_file.bodies import BodyPart
from fenics_contact.scene_file.contacts import ContactPart, TiePart
from fenics_contact.scene_file.design import DesignPart
from fenics_contact.scene_file.loads import AnyLoad
from fenics_contact.scene_file.materials import AnyMaterial
from fenics_contact.scene_file.meshes import Mesh
from fenics_contact.scene_file.output import OutputPart
from fenics_contact.scene_file.solver import SolverPart
from fenics_contact.scene_file.steps import StepPart
from fenics_contact.scene_file.supports import SupportPart
from fenics_contact.scene_file.units import UnitNames
from fenics_contact.scene_file.values import Part


class Document(Part):
    """A scene of fenics_contact: bodies that may touch, what holds and loads them, how it is solved."""

    title: str = Field("", description="title of pictures and tables")
    units: UnitNames = Field(UnitNames(), description="names of the units, for labels")
    meshes: dict[str, Mesh] = Field(min_length=1, description="meshes by name: shapes, or files")
    materials: dict[str, AnyMaterial] = Field(min_length=1, description="materials by name")
    bodies: dict[str, BodyPart] = Field(min_length=1, description="bodies by name")
    supports: list[SupportPart] = Field(default_factory=list, description="prescribed displacements")
    loads: list[AnyLoad] = Field(default_factory=list, description="forces and changes of temperature")
    contacts: list[ContactPart] = Field(default_factory=list, description="pairs that may touch")
    ties: list[TiePart] = Field(default_factory=list, description="pairs that stay together")
    steps: list[StepPart] = Field(
        default_factory=list, description="load steps; without them all acts at once"
    )
    solver: SolverPart = Field(SolverPart(), description="how it is solved")
    output: OutputPart = Field(OutputPart(), description="what is written, and where")
    design: DesignPart | None = Field(None, description="a shape optimisation, for `fenics-contact optimize`")
