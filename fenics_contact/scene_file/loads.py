"""Loads on surfaces and volumes, and prescribed displacements."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field, PositiveFloat

from fenics_contact import scene
from fenics_contact.scene import Load, RigidSurface, Support
from fenics_contact.scene_file.expression import Expression, VectorExpression
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import FREE, Components, Motion, ScalarField, Vector, one_of


class _Named(Part):
    """A part that load steps change.

    Attributes:
        changed: The argument that they change.
    """

    changed: ClassVar[str] = "value"
    name: str | None = Field(None, description="how load steps call it")

    @property
    def size(self) -> Any:
        """A part that load steps change."""
        return getattr(self, self.changed)


class _Load(_Named):
    def build(self, dim: int, value: Any = None) -> Load:
        """Return the load, with the value of a load step if given."""
        value = self.size if value is None else value
        if isinstance(value, tuple) and any(map(callable, value)):
            value = VectorExpression(value)
        return self.made(**{self.changed: value})


@keys_of(scene.Traction)
class TractionLoad(_Load):
    """Force a reference area on a surface."""

    kind: Literal["traction"]


@keys_of(scene.TotalForce)
class TotalForceLoad(_Load):
    """A resultant, spread over a surface."""

    kind: Literal["total_force"]


@keys_of(scene.TotalForce, without=("value", "at"))
class TotalMomentLoad(_Load):
    """A moment, spread over a surface."""

    changed: ClassVar[str] = "moment"
    kind: Literal["total_moment"]
    moment: Vector | float = Field(
        alias="value", description="three numbers, in the plane one, positive from x to y, [force·length]"
    )

    def build(self, dim: int, value: Any = None) -> Load:
        """Return the load, without a force."""
        moment = self.moment if value is None else value
        return self.made(value=(0.0,) * dim, moment=moment)


@keys_of(scene.Pressure)
class PressureLoad(_Load):
    """Pressure, normal to the surface; positive presses on the body."""

    kind: Literal["pressure"]


@keys_of(scene.BodyForce)
class BodyForceLoad(_Load):
    """Force a volume."""

    kind: Literal["body_force"]


@keys_of(scene.gravity)
class GravityLoad(_Load):
    """Weight of a body."""

    changed: ClassVar[str] = "acceleration"
    kind: Literal["gravity"]
    density: PositiveFloat


@keys_of(scene.ThermalStrain)
class ThermalLoad(_Load):
    """A change of temperature."""

    changed: ClassVar[str] = "temperature_change"
    kind: Literal["thermal"]
    temperature_change: ScalarField = Field(alias="value")


@keys_of(Support)
class SupportPart(_Named):
    """Displacement prescribed on a surface, component by component."""

    value: Components | None = Field(
        None,
        description=f'displacement along x, y and z (x, y of a plane body), [length]: a number, "{FREE}", or '
        "a formula in x, y, z in quotes, or a field from a file; zero in all directions by default",
    )

    def build(self, dim: int, value: tuple[Any, ...] | None = None) -> Support:
        """Return the support.

        Args:
            dim: Dimension of the bodies.
            value: What a load step prescribes instead.
        """
        return self.made(value=value or self.value or (0.0,) * dim)


@keys_of(RigidSurface, without=("displacement", "rotation"))
class RigidPart(_Named):
    """A surface that moves as one rigid piece, driven or loaded at a point."""

    kind: Literal["rigid"]
    value: Motion | None = Field(
        None,
        description="displacement of the point along x, y and z, [length], then its rotation about them, in "
        "radians (in the plane along x and y, then one rotation): a number, a formula in t in quotes, or "
        f'"{FREE}"; all free by default',
    )

    @property
    def size(self) -> Any:
        """The motion, with its free components."""
        count = len(self.at)  # type: ignore[attr-defined]
        return self.value or (None,) * (3 * count - 3)

    def build(self, dim: int, value: tuple[Any, ...] | None = None) -> RigidSurface:
        """Return the rigid surface, with the motion of a load step if given."""
        motion = tuple(map(self._number, value or self.size))
        turned = motion[dim:]
        return self.made(
            displacement=motion[:dim], rotation=turned[0] if dim == 2 and len(turned) == 1 else turned
        )

    def _number(self, component: Any) -> float | None:
        """Return a component as a number; a formula has its value at the point."""
        if not isinstance(component, Expression):
            return component
        return float(component(np.array([self.at]))[0])  # type: ignore[attr-defined]


AnySupportPart: TypeAlias = Annotated[
    Any, one_of("kind", RigidPart, other=SupportPart, when=lambda part: "kind" not in part)
]
AnyLoad: TypeAlias = Annotated[
    Any,
    one_of(
        "kind",
        TractionLoad,
        TotalForceLoad,
        TotalMomentLoad,
        PressureLoad,
        BodyForceLoad,
        GravityLoad,
        ThermalLoad,
    ),
]
