"""Who may touch whom, and with which friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.loads import Vector


@dataclass(frozen=True)
class Surface:
    """A named surface of a named body."""

    body: str
    name: str


@dataclass(frozen=True)
class RigidPlane:
    """An immovable half space.

    Attributes:
        point: Any point of the plane, [length].
        normal: Direction from the obstacle into the free side; scaled to unit length.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        """Scale the normal, refuse one without direction."""
        length = float(np.linalg.norm(self.normal))
        vectors = len(self.point) == len(self.normal) == 3 and np.all(np.isfinite(self.point))
        if not (vectors and np.isfinite(length) and length > 0):
            raise InvalidInputError(
                "RigidPlane needs a point and a normal of three finite numbers, the normal not zero, got "
                f"point {self.point!r} and normal {self.normal!r}: for a floor give normal (0, 0, 1)"
            )
        object.__setattr__(self, "normal", tuple(float(c / length) for c in self.normal))


@dataclass(frozen=True)
class Coulomb:
    """Coulomb friction: ‖τ‖ ≤ friction_coefficient · λ_N.

    Attributes:
        friction_coefficient: μ ≥ 0, dimensionless. Zero is frictionless contact.
    """

    friction_coefficient: float

    def __post_init__(self) -> None:
        """Refuse a negative coefficient."""
        if not (np.isfinite(self.friction_coefficient) and self.friction_coefficient >= 0):
            raise InvalidInputError(
                f"friction_coefficient must be zero or positive, got {self.friction_coefficient!r}: "
                "steel on steel has about 0.3; leave friction away for a frictionless pair"
            )


@dataclass(frozen=True)
class Tresca:
    """Friction with a slip bound that does not depend on the pressure.

    Attributes:
        traction: Bound on the tangential traction, ≥ 0, [force / length²].
    """

    traction: float

    def __post_init__(self) -> None:
        """Refuse a negative bound."""
        if not (np.isfinite(self.traction) and self.traction >= 0):
            raise InvalidInputError(
                f"Tresca.traction must be zero or positive, got {self.traction!r}: give the largest "
                "tangential force a unit of area that the surfaces can carry"
            )


@dataclass(frozen=True)
class ContactPair:
    """Two surfaces that may touch. Every node of the slave is kept out of the master.

    Attributes:
        slave: Surface whose nodes carry the contact forces.
        master: Surface of another body, or a rigid obstacle.
        friction: Friction law, or None for frictionless contact.
    """

    slave: Surface
    master: Surface | RigidPlane
    friction: Coulomb | Tresca | None = None

    def __post_init__(self) -> None:
        """Refuse self-contact by name."""
        if isinstance(self.master, Surface) and self.master.body == self.slave.body:
            raise InvalidInputError(
                f"contact of body {self.slave.body!r} with itself is not supported: "
                "slave and master must belong to different bodies; split the body if its parts may touch"
            )

    @property
    def has_friction(self) -> bool:
        """Whether tangential forces can be transmitted at all."""
        match self.friction:
            case Coulomb(friction_coefficient=value) | Tresca(traction=value):
                return value > 0
        return False
