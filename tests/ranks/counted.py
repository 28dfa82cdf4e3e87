"""A bar whose costs are counted."""

from __future__ import annotations

from fenics_contact import Body, Scene, Support, Traction
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain


def bar() -> Scene:
    """Return a plane bar that is clamped at one end and pulled at the other, without contact."""
    body = Body(rectangle((0, 0), (4, 1), (16, 4)), PlaneStrain(1.0, 0.3))
    return Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.0, 1e-4))])
