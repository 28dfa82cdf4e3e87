"""Pairs of surfaces that may touch or stay together, and rigid obstacles."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Tag

from fenics_contact import scene
from fenics_contact.scene import ContactPair, Friction, RigidObstacle, Surface, Tie
from fenics_contact.scene_file.expression import Expression
from fenics_contact.scene_file.values import Part, Scalar, Triple, Vector, chooser, kind_of
from fenics_contact.surfaces import Geometry


class SurfaceOfBody(Part):
    """A surface of a body."""

    body: str = Field(description="name of the body")
    surface: str = Field(description="name of its surface")

    def build(self) -> Surface:
        """Return the surface."""
        return Surface(self.body, self.surface)


class Plane(Part):
    """A rigid half space, in the plane a half plane."""

    obstacle: Literal["plane"]
    point: Vector = Field(description="any point of its surface, [length]")
    normal: Vector = Field(description="direction from the obstacle into the free side")

    def build(self) -> RigidObstacle:
        """Return the obstacle."""
        return scene.RigidPlane(self.point, self.normal)


class Sphere(Part):
    """A rigid ball, in the plane a disc."""

    obstacle: Literal["sphere"]
    centre: Vector = Field(description="its centre, [length]")
    radius: float = Field(gt=0, description="its radius, [length]")
    hollow: bool = Field(False, description="the obstacle is all that lies outside the radius: a socket")

    def build(self) -> RigidObstacle:
        """Return the obstacle."""
        return scene.RigidSphere(self.centre, self.radius, self.hollow)


class Cylinder(Part):
    """A rigid endless round bar."""

    obstacle: Literal["cylinder"]
    point: Triple = Field(description="any point of its axis, [length]")
    axis: Triple = Field(description="direction of its axis")
    radius: float = Field(gt=0, description="its radius, [length]")
    hollow: bool = Field(False, description="the obstacle is all that lies outside the radius: a hole")

    def build(self) -> RigidObstacle:
        """Return the obstacle."""
        return scene.RigidCylinder(self.point, self.axis, self.radius, self.hollow)


class Distance(Part):
    """A rigid obstacle given by its signed distance."""

    obstacle: Literal["distance"]
    formula: Scalar = Field(
        description="signed distance, negative inside, as a formula in x, y, z whose gradient has length "
        "one, [length]"
    )

    def build(self) -> RigidObstacle:
        """Return the obstacle."""
        return scene.DistanceObstacle(Expression(str(self.formula)))


def _master_tag(value: object) -> str | None:
    kind = value.get("obstacle") if isinstance(value, dict) else getattr(value, "obstacle", None)
    if kind is None:
        return "<surface>" if isinstance(value, dict | SurfaceOfBody) else None
    return f"<{kind}>" if kind in OBSTACLES else None


OBSTACLES = ("plane", "sphere", "cylinder", "distance")
Master: TypeAlias = Annotated[
    Annotated[SurfaceOfBody, Tag("<surface>")]
    | Annotated[Plane, Tag("<plane>")]
    | Annotated[Sphere, Tag("<sphere>")]
    | Annotated[Cylinder, Tag("<cylinder>")]
    | Annotated[Distance, Tag("<distance>")],
    chooser(_master_tag, "obstacle", OBSTACLES),
]


class NoFriction(Part):
    """Contact without friction."""

    law: Literal["none"]

    def build(self) -> Friction:
        """Return None."""
        return None


class CoulombFriction(Part):
    """Coulomb's law: the friction force is at most the coefficient times the normal force."""

    law: Literal["coulomb"]
    coefficient: float = Field(ge=0, description="friction coefficient μ, dimensionless")

    def build(self) -> Friction:
        """Return the law."""
        return scene.Coulomb(self.coefficient)


class TrescaFriction(Part):
    """Friction with a bound that does not depend on the pressure."""

    law: Literal["tresca"]
    traction: float = Field(ge=0, description="largest tangential traction, [force / length²]")

    def build(self) -> Friction:
        """Return the law."""
        return scene.Tresca(self.traction)


LAWS = ("none", "coulomb", "tresca")
AnyFriction: TypeAlias = Annotated[
    Annotated[NoFriction, Tag("<none>")]
    | Annotated[CoulombFriction, Tag("<coulomb>")]
    | Annotated[TrescaFriction, Tag("<tresca>")],
    kind_of("law", LAWS),
]
GEOMETRY = (
    "what gaps are measured between; best: the true shapes that the meshes know, else smooth surfaces "
    "through the nodes; reconstructed: always the latter; faceted: the flat facets, for comparison"
)
DISCRETISATION = "node: every slave node stays out of its master facet; mortar: weighted means of the gap do"


class ContactPart(Part):
    """Two surfaces that may touch, or a surface and a rigid obstacle."""

    slave: SurfaceOfBody = Field(
        description="surface whose nodes carry the contact forces: the finer or softer"
    )
    master: Master = Field(description="surface of another body, or a rigid obstacle")
    friction: AnyFriction | None = Field(None, description="law of friction, none by default")
    discretisation: Literal["node", "mortar"] = Field("node", description=DISCRETISATION)
    geometry: Geometry = Field("best", description=GEOMETRY)

    def build(self) -> ContactPair:
        """Return the pair."""
        friction = None if self.friction is None else self.friction.build()
        return ContactPair(
            self.slave.build(), self.master.build(), friction, self.discretisation, self.geometry
        )


class TiePart(Part):
    """Two surfaces that stay together."""

    slave: SurfaceOfBody = Field(description="surface whose nodes carry the forces; the finer mesh is better")
    master: SurfaceOfBody = Field(description="surface of another body")
    sliding: bool = Field(False, description="the surfaces may shift along each other")
    discretisation: Literal["node", "mortar"] = Field("mortar", description=DISCRETISATION)

    def build(self) -> Tie:
        """Return the tie."""
        return Tie(self.slave.build(), self.master.build(), self.sliding, self.discretisation)
