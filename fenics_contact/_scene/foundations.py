"""Elastic foundations: surfaces that rest on springs to the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, floats
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.part import Around, Part, require_surface
from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
@checked()
class ElasticFoundation(Part):
    """A surface on springs to the ground, which pull and press: the traction −k u on it.

    It is part of the stiffness, and of the strain energy, of its body. Bodies may be held by it alone.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        stiffness: k, [force / length³] (in the plane: per unit of thickness): a number acts along the normal
            of the undeformed surface alone, a vector along each axis, zero where there is no spring.
        total: Whether the stiffness is that of the whole surface, [force / length], spread evenly over it:
            one spring to the ground.

    Raises:
        InvalidInputError: If a stiffness is negative or not finite, or all are zero.

    Example:
        >>> on_soil = ElasticFoundation("slab", "bottom", 0.05)  # N/mm³
        >>> mount = ElasticFoundation("engine", "foot", (200.0, 200.0, 900.0), total=True)  # N/mm
    """

    effect = EffectName.FOUNDATION
    body: str
    surface: str
    stiffness: float | GivenVector
    total: bool = False

    def __post_init__(self) -> None:
        """Reject what does not hold anything, or pushes away."""
        numbers = np.asarray(self.stiffness, dtype=np.float64)
        if not np.isfinite(numbers).all() or (numbers < 0).any() or not numbers.any():
            raise InvalidInputError(
                f"ElasticFoundation.stiffness of surface {self.surface!r} of body {self.body!r} must be "
                f"positive, or numbers of at least zero along the axes, got {self.stiffness!r}: give the "
                "force per area that a unit of displacement causes"
            )
        object.__setattr__(self, "stiffness", floats(numbers) if numbers.ndim else float(numbers))

    def check(self, scene: Around) -> None:
        """Reject a vector in another space than that of the body."""
        require_surface(scene, self.body, self.surface, "ElasticFoundation")
        dim = scene.kinematics.components
        if isinstance(self.stiffness, tuple) and len(self.stiffness) != dim:
            raise InvalidInputError(
                f"ElasticFoundation.stiffness of surface {self.surface!r} of body {self.body!r} must have "
                f"{dim} entries, got {self.stiffness!r}: give one for each axis, or a number for the normal"
            )

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.surface}"
