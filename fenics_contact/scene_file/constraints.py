"""What must hold of a design: its volume, linear functions of its variables, limits of objectives."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, PositiveFloat

from fenics_contact.scene_file.objectives import AnyObjective
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import Line, Row, one_of


class VolumeConstraint(Part):
    """The volume of the designed bodies relative to that of the start."""

    kind: Literal["volume"]
    at_least: PositiveFloat | None = Field(None, description="least volume relative to that of the start")
    at_most: PositiveFloat | None = Field(None, description="largest volume relative to that of the start")


class LinearConstraint(Part):
    """A linear function of the design variables."""

    kind: Literal["linear"]
    coefficients: Row = Field(description="one for each design variable")
    at_most: float = Field(description="largest value of the sum of coefficients times variables")


class ObjectiveConstraint(Part):
    """Limits of another objective, such as a stress or a movement."""

    kind: Literal["objective"]
    objective: AnyObjective = Field(description="what is limited, given like the objective of the design")
    at_least: float | None = Field(None, description="least value, in the unit of the objective")
    at_most: float | None = Field(None, description="largest value; equal to at_least for an equality")
    step: Line | None = Field(None, description="load step after which it holds; the last by default")
    name: Line = Field("", description="its name in results")


Constraint: TypeAlias = Annotated[
    Any, one_of("kind", VolumeConstraint, LinearConstraint, ObjectiveConstraint)
]
