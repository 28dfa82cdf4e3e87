"""Pairs of surfaces that may touch or stay together, and rigid obstacles."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from fenics_contact import scene
from fenics_contact.scene import ContactPair, Surface, Tie
from fenics_contact.scene_file.expression import Expression
from fenics_contact.scene_file.moving import ObstaclePart
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import FieldOrMeasured, NotNegativeField, Scalar, Triple, one_of


@keys_of(Surface)
class SurfaceOfBody(Part):
    """A surface of a body."""

    body: str = Field(description="name of the body")
    name: str = Field(alias="surface", description="name of its surface")

    @property
    def surface(self) -> str:
        """The name of the surface, under the name of the key."""
        return self.name


@keys_of(scene.RigidPlane)
class Plane(ObstaclePart):
    """A rigid half space, in the plane a half plane."""

    obstacle: Literal["plane"]


@keys_of(scene.RigidSphere)
class Sphere(ObstaclePart):
    """A rigid ball, in the plane a disc."""

    obstacle: Literal["sphere"]
    radius: PositiveFloat


@keys_of(scene.RigidCylinder)
class Cylinder(ObstaclePart):
    """A rigid endless round bar."""

    obstacle: Literal["cylinder"]
    point: Triple
    axis: Triple
    radius: PositiveFloat


def _function(value: float | Expression) -> Expression:
    return value if isinstance(value, Expression) else Expression(repr(value))


@keys_of(scene.DistanceObstacle, only=["function"])
class Distance(ObstaclePart):
    """A rigid obstacle given by its signed distance."""

    obstacle: Literal["distance"]
    function: Annotated[Scalar, AfterValidator(_function)] = Field(
        alias="formula",
        description="signed distance, negative inside, as a formula in x, y, z whose gradient has length "
        "one, [length]",
    )


class NoFriction(Part):
    """Contact without friction."""

    law: Literal["none"]

    def made(self, **other: Any) -> None:
        """Return None."""


@keys_of(scene.Coulomb)
class CoulombFriction(Part):
    """Coulomb's law: the friction force is at most the coefficient times the normal force."""

    law: Literal["coulomb"]
    friction_coefficient: NotNegativeField = Field(alias="coefficient")


@keys_of(scene.Tresca)
class TrescaFriction(Part):
    """Friction with a bound that does not depend on the pressure."""

    law: Literal["tresca"]
    traction: NotNegativeField


Master: TypeAlias = Annotated[
    Any,
    one_of(
        "obstacle",
        Plane, Sphere, Cylinder, Distance,
        other=SurfaceOfBody,
        when=lambda table: "obstacle" not in table,
    ),
]  # fmt: skip
AnyFriction: TypeAlias = Annotated[Any, one_of("law", NoFriction, CoulombFriction, TrescaFriction)]


@keys_of(ContactPair, without={"reason"})
class ContactPart(Part):
    """Two surfaces that may touch, or a surface and a rigid obstacle."""

    slave: SurfaceOfBody
    master: Master
    friction: AnyFriction | None
    gap: NotNegativeField | None = Field(
        description="clearance in place of the measured one, [length]: a number, a formula in x, y, z in "
        "quotes, or a field from a file"
    )
    interference: FieldOrMeasured | None = Field(
        description="overlap in place of the measured gap, [length], given like gap; 'measured' takes the "
        "one that the geometry has, which counts as a mistake otherwise"
    )
    adjust: NonNegativeFloat | None


@keys_of(scene.AutomaticContact)
class AutomaticPart(Part):
    """Contact wherever boundaries of different bodies face each other, or those of a body that folds."""

    friction: AnyFriction | None
    distance: PositiveFloat | None


@keys_of(Tie, without={"reason"})
class TiePart(Part):
    """Two surfaces that stay together."""

    slave: SurfaceOfBody
    master: SurfaceOfBody
