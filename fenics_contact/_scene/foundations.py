"""Elastic foundations: surfaces that rest on springs to the ground."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact._base.checks import GivenVector, checked
from fenics_contact._scene.checks import check_entries, checked_stiffness
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.part import Around, Part, require_surface


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
        remedy = "give the force per area that a unit of displacement causes"
        object.__setattr__(self, "stiffness", checked_stiffness(self._words, self.stiffness, remedy))

    def check(self, scene: Around) -> None:
        """Reject a vector in another space than that of the body."""
        require_surface(scene, self.body, self.surface, "ElasticFoundation")
        if isinstance(self.stiffness, tuple):
            remedy = "give one for each axis, or a number for the normal"
            check_entries(self._words, self.stiffness, scene.kinematics.components, remedy, "entries")

    @property
    def _words(self) -> str:
        """Its stiffness, in words."""
        return f"ElasticFoundation.stiffness of surface {self.surface!r} of body {self.body!r}"

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return f"{self.body} {self.surface}"
