"""Shape optimisation: moving surfaces, what is minimised, and how."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, NonNegativeFloat, NonNegativeInt, NonPositiveFloat, PositiveFloat, PositiveInt

from fenics_contact.optimize import BundleTrust
from fenics_contact.scene_file.constraints import Constraint
from fenics_contact.scene_file.objectives import AnyObjective, in_words
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import Line, Net, Row


class DesignSurfacePart(Part):
    """A surface that a net of control points moves along its normals."""

    body: str = Field(description="name of the body")
    surface: str = Field(
        "contact",
        description='"contact" of a chain link (its crown), a side of a block, or a curve of a plane body',
    )
    net: Net = Field(
        (7, 4),
        description="control points along the surface's two directions, of a plane body along its curve",
    )
    transition: PositiveFloat | None = Field(
        None, description="width of the strip of boundary around it that follows, [length]"
    )
    lower: NonPositiveFloat = Field(description="least displacement of a control point, [length]")
    upper: NonNegativeFloat = Field(description="largest displacement of a control point, [length]")


@keys_of(BundleTrust, only=["tolerance", "max_iterations", "max_evaluations"])
class DesignPart(Part):
    """A shape optimisation of the scene."""

    objective: AnyObjective = Field(
        "total_potential",
        description="what is minimised: a name, a table with its kind and arguments, a list of tables, which "
        'are added, or "file.py:NAME", an Objective',
    )
    over_steps: list[Line] | None = Field(
        None,
        description="names of the load steps whose objectives are added, the last one among them; by default "
        "all",
    )
    surfaces: list[DesignSurfacePart] = Field(min_length=1, description="what moves")
    constraints: list[Constraint] = Field([], description="what must hold")
    restore: bool = Field(False, description="start from a design that may violate limits of objectives")
    start: Row | None = Field(None, description="design variables at the start, [length]; zero by default")
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-4
    max_iterations: NonNegativeInt = 100
    max_evaluations: PositiveInt = 500
    adaptive: bool = Field(
        False,
        description="solve states no more accurately than the optimiser needs; else to solver.tolerance",
    )

    @property
    def objective_in_words(self) -> str:
        """The objective for a line of text."""
        return in_words(self.objective)
