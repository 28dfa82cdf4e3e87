"""The shape optimisation of a scene file: surfaces, objectives, constraints, optimiser."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from pydantic import (
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
from fenics_contact._scene.body import Body
from fenics_contact._scene.obstacles import DistanceObstacle
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.supports import Roller, Support
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
    one_of,
    with_message,
)
from fenics_contact.design import objective as objective_module
from fenics_contact.design import objectives as objectives_module
from fenics_contact.design.objective import Objective
from fenics_contact.errors import InvalidInputError
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


#: A name, that of an object in a Python file, a table, or a list of tables, the sum of which is meant.
AnyObjective: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            Annotated[Literal[tuple(BY_NAME)], Tag(f"{MARK}name")]  # type: ignore[valid-type]
            | Annotated[str, Field(pattern=r"\.py:"), Tag(f"{MARK}own")]
            | Annotated[_ANY, Tag(f"{MARK}table")]
            | Annotated[list[_ANY], Field(min_length=1), Tag(f"{MARK}list")],
            Discriminator(_form),
        ]
    ),
]


def in_words(given: Any) -> str:
    """Return an objective of a scene file for a line of text."""
    if isinstance(given, str):
        return given
    return " + ".join(part.in_words for part in given) if isinstance(given, list) else str(given.in_words)


def objective_of(given: Any) -> Objective:
    """Return the objective of a scene file, unless it is the user's own."""
    if isinstance(given, str):
        return BY_NAME[given](kind=given).objective  # type: ignore[call-arg]
    if isinstance(given, list):
        return objective_module.WeightedSum(tuple((part.weight, part.made()) for part in given))
    objective: Objective = given.objective
    return objective


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


def design_surface(shape: Shaped, surface: str, body: str) -> DesignSurface:
    """Return a surface with its smooth coordinates."""
    if shape.crown is not None and surface == "contact":
        return shape.crown
    try:
        return side_of(shape.mesh, surface)
    except InvalidInputError as error:
        raise InvalidInputError(f"body {body!r}: {error}") from error


def check_formulas(part: Any, bodies: Mapping[str, Body]) -> None:
    """Evaluate the formulas of a support, load or pair at the nodes, as solvers will."""
    if isinstance(part, Support):
        if any(map(callable, part.value)):
            part.values(_nodes(bodies[part.body], part.surface))
    elif isinstance(part, Roller):
        if callable(part.displacement):
            part.amounts(_nodes(bodies[part.body], part.surface))
    elif isinstance(part, ContactPair):
        if isinstance(part.master, DistanceObstacle):
            part.master.distance(_nodes(bodies[part.slave.body], part.slave.name))
    elif callable(value := getattr(part, "value", None)):
        body = bodies[part.body]
        named = getattr(part, "surface", getattr(part, "nodes", None))
        value(body.mesh.points if named is None else _nodes(body, named))


def check_pair(pair: ContactPair, key: str, bodies: Mapping[str, Body]) -> None:
    """Evaluate the friction, gap or interference of a pair, whichever the key is, at the slave's nodes."""
    nodes = _nodes(bodies[pair.slave.body], pair.slave.name)
    if key == "friction":
        pair.friction_at(nodes)
        pair.limit_at(nodes)
    elif getattr(pair, key) is not None:
        pair.gap_at(nodes)


def _nodes(body: Body, surface: str) -> np.ndarray:
    return np.asarray(body.mesh.points[body.mesh.nodes_of(surface)])
