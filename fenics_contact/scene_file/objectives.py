"""What a shape optimisation minimises: an objective by its name, a table with its arguments, or a sum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import Discriminator, Field, Tag

from fenics_contact import shape
from fenics_contact.scene_file.own_python import is_reference
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import MARK, Read, Vector, one_of, with_message
from fenics_contact.shape import Objective

_Exponent: TypeAlias = Annotated[float, Field(ge=2, le=100)]
_Pair: TypeAlias = Annotated[int, Field(ge=0)] | None


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


@keys_of(shape.TotalPotential)
class TotalPotentialPart(ObjectivePart):
    """½ uᵀK u − fᵀu."""

    kind: Literal["total_potential"]


@keys_of(shape.StrainEnergy)
class StrainEnergyPart(ObjectivePart):
    """½ uᵀK u."""

    kind: Literal["strain_energy"]


@keys_of(shape.LargestPressure)
class LargestPressurePart(ObjectivePart):
    """The largest pressure of a slave node."""

    kind: Literal["largest_pressure"]
    pair: _Pair


@keys_of(shape.PressureNorm)
class PressureNormPart(ObjectivePart):
    """A smooth bound of the largest pressure."""

    kind: Literal["pressure_norm"]
    pair: _Pair
    p: _Exponent


@keys_of(shape.PressureUnevenness)
class PressureUnevennessPart(ObjectivePart):
    """The square of the relative standard deviation of the pressure over the slave surface."""

    kind: Literal["pressure_unevenness"]
    pair: _Pair


@keys_of(shape.ContactArea)
class ContactAreaPart(ObjectivePart):
    """The area in contact, smooth; a negative weight enlarges it."""

    kind: Literal["contact_area"]
    pair: _Pair


@keys_of(shape.FrictionWork)
class FrictionWorkPart(ObjectivePart):
    """The work dissipated by friction."""

    kind: Literal["friction_work"]
    pair: _Pair


@keys_of(shape.LargestStress)
class LargestStressPart(ObjectivePart):
    """A smooth bound of the largest von Mises stress of a body."""

    kind: Literal["largest_stress"]
    p: _Exponent


@keys_of(shape.Movement)
class MovementPart(ObjectivePart):
    """The mean displacement of a surface along a direction, or that of a node."""

    kind: Literal["movement"]
    at: Annotated[str | int, with_message("the name of a surface in quotes, or the number of a node")]
    direction: Vector


#: Objectives that need no more than their names.
_ALONE = (
    TotalPotentialPart,
    StrainEnergyPart,
    LargestPressurePart,
    PressureNormPart,
    PressureUnevennessPart,
    ContactAreaPart,
    FrictionWorkPart,
)
#: By their names.
BY_NAME: dict[str, type[ObjectivePart]] = {
    get_args(part.model_fields["kind"].annotation)[0]: part for part in _ALONE
}
_TABLE: Any = Annotated[Any, one_of("kind", *_ALONE, LargestStressPart, MovementPart)]


class LargestPart(ObjectivePart):
    """The largest of several objectives."""

    kind: Literal["largest"]
    objectives: list[_TABLE] = Field(min_length=1, description="tables of objectives with their weights")

    def made(self, **other: Any) -> Objective:
        """Build the objective."""
        return shape.Maximum(tuple(part.objective for part in self.objectives))


_ANY: Any = Annotated[Any, one_of("kind", *_ALONE, LargestStressPart, MovementPart, LargestPart)]


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
        return shape.WeightedSum(tuple((part.weight, part.made()) for part in given))
    objective: Objective = given.objective
    return objective
