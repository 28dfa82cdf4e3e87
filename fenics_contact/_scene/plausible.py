"""Constants that are hardly meant: a Young's modulus in other units than lengths, friction in per cent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fenics_contact._scene.scene import Scene
from fenics_contact.materials.elastic import isotropic_constants

#: Young's moduli of metals, [GPa]; plastics and rubber in N/mm² are hardly among these numbers.
METALS = (40.0, 420.0)
#: Size from which a body is one that is measured in millimetres.
LONG = 50.0
#: No pair of materials has a larger coefficient; rubber on dry asphalt has about 1.
LARGEST_FRICTION = 3.0


def odd_modulus(young: float, size: float) -> str:
    """Return words on the modulus of a metal in Pa where lengths are in mm, else nothing."""
    low, high = METALS
    if size < LONG or not low * 1e9 <= young <= high * 1e9:
        return ""
    return (
        f"a Young's modulus of {young:g} is that of a metal in Pa, the body is {size:.4g} long: with it "
        "lengths are in metres"
    )


def odd_values(scene: Scene) -> Iterator[str]:
    """Return words on every constant of a scene that is hardly meant."""
    for name, body in scene.bodies.items():
        size = float(np.ptp(body.mesh.points, axis=0).max())
        for material in body.materials:
            young, _ = isotropic_constants(material) or (0.0, 0.0)
            if words := odd_modulus(young, size):
                yield f"odd units in body {name!r}? {words}; in N/mm² it would be {1e-6 * young:g}"
    for pair in scene.contacts:
        for given in pair.friction.numbers if pair.friction else ():
            if given > LARGEST_FRICTION:
                yield (
                    f"odd friction in {pair.place}? a coefficient of {given:g} is larger than that of any "
                    f"materials, of which rubber on dry asphalt has about 1: {given / 100:g} if it is meant "
                    "in per cent; surfaces that never part nor slip are a Tie"
                )
