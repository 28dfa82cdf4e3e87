"""Loads on surfaces and volumes."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, Tag

from fenics_contact import scene
from fenics_contact.scene import Load
from fenics_contact.scene_file.expression import Expression, VectorExpression
from fenics_contact.scene_file.values import Part, Scalar, Vector, VectorOrFormulas, kind_of

#: What a load is given as: one number or formula, or one a component.
LoadValue: TypeAlias = float | str | tuple[float | str, ...]


class _Load(Part):
    name: str | None = Field(None, description="how load steps call it")
    body: str = Field(description="name of the body")

    @property
    def size(self) -> LoadValue:
        """What load steps change."""
        return getattr(self, "value")  # type: ignore[no-any-return]


class TractionLoad(_Load):
    """Force a reference area on a surface."""

    kind: Literal["traction"]
    surface: str = Field(description="name of its surface")
    value: VectorOrFormulas = Field(description="numbers, or formulas in x, y, z, [force / length²]")

    def build(self, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        return scene.Traction(self.body, self.surface, vector(value or self.value))


class TotalForceLoad(_Load):
    """A resultant, spread evenly over a surface."""

    kind: Literal["total_force"]
    surface: str = Field(description="name of its surface")
    value: Vector = Field(description="resultant along x, y and z, [force]")

    def build(self, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        return scene.TotalForce(self.body, self.surface, value or self.value)


class PressureLoad(_Load):
    """Pressure, normal to the surface; positive presses on the body."""

    kind: Literal["pressure"]
    surface: str = Field(description="name of its surface")
    value: Scalar = Field(description="number, or formula in x, y, z, [force / length²]")

    def build(self, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        return scene.Pressure(self.body, self.surface, scalar(self.value if value is None else value))


class BodyForceLoad(_Load):
    """Force a volume."""

    kind: Literal["body_force"]
    value: VectorOrFormulas = Field(description="numbers, or formulas in x, y, z, [force / length³]")

    def build(self, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        return scene.BodyForce(self.body, vector(value or self.value))


class GravityLoad(_Load):
    """Weight of a body."""

    kind: Literal["gravity"]
    density: float = Field(gt=0, description="mass a volume, in the units of the file")
    acceleration: Vector = Field(description="of gravity along x, y and z, [length / time²]")

    @property
    def size(self) -> LoadValue:
        """The acceleration is what load steps change."""
        return self.acceleration

    def build(self, value: Any = None) -> Load:
        """Return the load, with the acceleration of a load step if given."""
        return scene.gravity(self.body, self.density, value or self.acceleration)


class ThermalLoad(_Load):
    """A change of temperature."""

    kind: Literal["thermal"]
    value: Scalar = Field(
        description="change against the temperature without stress, in degrees: number, or formula in x, y, z"
    )

    def build(self, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        return scene.ThermalStrain(self.body, scalar(self.value if value is None else value))


KINDS = ("traction", "total_force", "pressure", "body_force", "gravity", "thermal")
AnyLoad: TypeAlias = Annotated[
    Annotated[TractionLoad, Tag("<traction>")]
    | Annotated[TotalForceLoad, Tag("<total_force>")]
    | Annotated[PressureLoad, Tag("<pressure>")]
    | Annotated[BodyForceLoad, Tag("<body_force>")]
    | Annotated[GravityLoad, Tag("<gravity>")]
    | Annotated[ThermalLoad, Tag("<thermal>")],
    kind_of("kind", KINDS),
]


def scalar(value: float | str) -> float | Expression:
    """Return a number as it is, a formula as a function of points."""
    return Expression(value) if isinstance(value, str) else value


def vector(value: tuple[float | str, ...]) -> Any:
    """Return numbers as they are, with formulas a function of points."""
    if not any(isinstance(entry, str) for entry in value):
        return value
    return VectorExpression(tuple(map(scalar, value)))
