"""The shape optimisation of a scene file: surfaces, objectives, constraints, optimiser."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    NonPositiveFloat,
    PositiveFloat,
    PositiveInt,
    Tag,
)

from fenics_contact._optimize.bundle_trust import BundleTrust
from fenics_contact._optimize.nonlinear import NonlinearConstraint
from fenics_contact._scene_file.bodies import Shaped
from fenics_contact._scene_file.part import Part, keys_of, table_of
from fenics_contact._scene_file.values import (
    MARK,
    Line,
    Net,
    Read,
    Row,
    Vector,
    is_reference,
    load,
    one_of,
    with_message,
)
from fenics_contact.design import objective as objective_module
from fenics_contact.design import objectives as objectives_module
from fenics_contact.design.objective import Objective
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.design.several import LoadPath
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.kinds import scene_file_code
from fenics_contact.gallery.links import DesignSurface
from fenics_contact.gallery.side import side_of


class ObjectivePart(Part):
    """An objective of a shape optimisation."""

    weight: float = Field(1.0, description="factor of this objective, in a sum of several")

    @property
    def objective(self) -> Objective:
        """The objective with its weight."""
        made: Objective = self.made() if self.weight == 1.0 else self.weight * self.made()
        return made

    @property
    def in_words(self) -> str:
        """Its name, with a weight other than one."""
        kind: str = self.kind  # type: ignore[attr-defined]
        return kind if self.weight == 1.0 else f"{self.weight:g} {kind}"

    def found(self, folder: Path) -> Objective:
        """Return the objective of a scene file in a folder."""
        return self.objective


#: Objectives that need no more than their names.
_ALONE = (
    table_of(objectives_module.TotalPotential, ObjectivePart, kind="total_potential"),
    table_of(objectives_module.StrainEnergy, ObjectivePart, kind="strain_energy"),
    table_of(objectives_module.LargestPressure, ObjectivePart, kind="largest_pressure"),
    table_of(objectives_module.PressureNorm, ObjectivePart, kind="pressure_norm"),
    table_of(objectives_module.PressureNonuniformity, ObjectivePart, kind="pressure_unevenness"),
    table_of(objectives_module.ContactArea, ObjectivePart, kind="contact_area"),
    table_of(objectives_module.FrictionWork, ObjectivePart, kind="friction_work"),
)
_OTHERS = (
    table_of(objectives_module.LargestStress, ObjectivePart, kind="largest_stress"),
    table_of(
        objectives_module.Movement,
        ObjectivePart,
        kind="movement",
        at=Annotated[str | int, with_message("the name of a surface in quotes, or the number of a node")],
        direction=Vector,
    ),
)
#: By their names.
BY_NAME: dict[str, type[ObjectivePart]] = {
    get_args(part.model_fields["kind"].annotation)[0]: part for part in _ALONE
}
_TABLE: Any = Annotated[Any, one_of("kind", *_ALONE, *_OTHERS)]


class LargestPart(ObjectivePart):
    """The largest of several objectives."""

    kind: Literal["largest"]
    objectives: list[_TABLE] = Field(min_length=1, description="tables of objectives with their weights")

    def made(self, **other: Any) -> Objective:
        """Build the objective."""
        return objective_module.Maximum(tuple(part.objective for part in self.objectives))


_ANY: Any = Annotated[Any, one_of("kind", *_ALONE, *_OTHERS, LargestPart)]


def _form(value: Any) -> str:
    table, several = isinstance(value, Mapping), isinstance(value, list)
    return f"{MARK}{'table' if table else 'list' if several else 'own' if is_reference(value) else 'name'}"


class SumOfParts(list[ObjectivePart]):
    """The sum of several objectives."""

    @property
    def in_words(self) -> str:
        """The names with their weights."""
        return " + ".join(part.in_words for part in self)

    def found(self, folder: Path) -> Objective:
        """Return the objective of a scene file in a folder."""
        return objective_module.WeightedSum(tuple((part.weight, part.made()) for part in self))


@dataclass(frozen=True)
class OwnObjective:
    """An object of a Python file, "file.py:NAME"."""

    reference: str

    @property
    def in_words(self) -> str:
        """The reference."""
        return self.reference

    def found(self, folder: Path) -> Objective:
        """Return the object; runs the file, which is relative to the folder."""
        given: Any = load(self.reference, folder)
        with scene_file_code(f"objective {self.reference!r}"):
            missing = [part for part in ("value", "partials") if not hasattr(given, part)]
        if missing or isinstance(given, type):
            raise InvalidInputError(
                f"objective {self.reference!r} must be an object with value and partials, got {given!r}: "
                "give an instance"
            )
        objective: Objective = given
        return objective


def _named(name: str) -> ObjectivePart:
    return BY_NAME[name](kind=name)  # type: ignore[call-arg]


#: A name, that of an object in a Python file, a table, or a list of tables, the sum of which is meant.
AnyObjective: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            Annotated[Literal[tuple(BY_NAME)], AfterValidator(_named), Tag(f"{MARK}name")]  # type: ignore[valid-type]
            | Annotated[str, Field(pattern=r"\.py:"), AfterValidator(OwnObjective), Tag(f"{MARK}own")]
            | Annotated[_ANY, Tag(f"{MARK}table")]
            | Annotated[list[_ANY], Field(min_length=1), AfterValidator(SumOfParts), Tag(f"{MARK}list")],
            Discriminator(_form),
        ]
    ),
]


def _limits(part: VolumeConstraint | ObjectiveConstraint, unit: float = 1.0) -> tuple[float, float]:
    """Return the upper and the lower limit, infinite where it is not given."""
    return (
        np.inf if part.at_most is None else part.at_most * unit,
        -np.inf if part.at_least is None else part.at_least * unit,
    )


class _Constraint(Part):
    def rows(self, size: int) -> list[tuple[np.ndarray, float]]:
        """Return coefficients and largest values of sums of design variables."""
        return []

    def limits(
        self, problem: ShapeProblem | LoadPath, start: np.ndarray, folder: Path
    ) -> list[NonlinearConstraint]:
        """Return limits of other functions of the design. Collective."""
        return []


class VolumeConstraint(_Constraint):
    """The volume of the designed bodies relative to that of the start."""

    kind: Literal["volume"]
    at_least: PositiveFloat | None = Field(None, description="least volume relative to that of the start")
    at_most: PositiveFloat | None = Field(None, description="largest volume relative to that of the start")

    def limits(
        self, problem: ShapeProblem | LoadPath, start: np.ndarray, folder: Path
    ) -> list[NonlinearConstraint]:
        """Return the limits of the volume. Collective."""
        upper, lower = _limits(self, problem.volume(start)[0])
        return [NonlinearConstraint(problem.volume, upper, lower, "volume")]


class LinearConstraint(_Constraint):
    """A linear function of the design variables."""

    kind: Literal["linear"]
    coefficients: Row = Field(description="one for each design variable")
    at_most: float = Field(description="largest value of the sum of coefficients times variables")

    def rows(self, size: int) -> list[tuple[np.ndarray, float]]:
        """Return the coefficients and the largest value."""
        return [(fitting("coefficients", self.coefficients, size), self.at_most)]


class ObjectiveConstraint(_Constraint):
    """Limits of another objective, such as a stress or a movement."""

    kind: Literal["objective"]
    objective: AnyObjective = Field(description="what is limited, given like the objective of the design")
    at_least: float | None = Field(None, description="least value, in the unit of the objective")
    at_most: float | None = Field(None, description="largest value; equal to at_least for an equality")
    step: Line | None = Field(None, description="load step after which it holds; the last by default")
    name: Line = Field("", description="its name in results")

    def limits(
        self, problem: ShapeProblem | LoadPath, start: np.ndarray, folder: Path
    ) -> list[NonlinearConstraint]:
        """Return the limits of the objective. Collective."""
        with together(problem.comm):
            objective = self.objective.found(folder)
        name = self.name or self.objective.in_words
        if isinstance(problem, LoadPath):
            step = self.step or list(problem.problems)[-1]
            return [NonlinearConstraint(problem.function({step: objective}), *_limits(self), name)]
        return [NonlinearConstraint(problem.function(objective, name), *_limits(self), name)]


Constraint: TypeAlias = Annotated[
    Any, one_of("kind", VolumeConstraint, LinearConstraint, ObjectiveConstraint)
]


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
        validate_default=True,
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
        return str(self.objective.in_words)


def fitting(name: str, values: tuple[float, ...], size: int) -> np.ndarray:
    """Return values as an array, which must have one for each design variable."""
    if len(values) != size:
        raise InvalidInputError(
            f"{name} must have {size} entries, one per design variable, got {len(values)}"
        )
    return np.array(values)


def design_surface(shape: Shaped, surface: str, body: str) -> DesignSurface:
    """Return a surface with its smooth coordinates."""
    if shape.crown is not None and surface == "contact":
        return shape.crown
    try:
        return side_of(shape.mesh, surface)
    except InvalidInputError as error:
        raise InvalidInputError(f"body {body!r}: {error}") from error
