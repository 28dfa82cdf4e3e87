"""Constants that are hardly meant: moduli and wear in other units than lengths, friction in per cent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fenics_contact._scene.pairs import ContactPair
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
        yield from _odd_wear(scene, pair)


def _odd_wear(scene: Scene, pair: ContactPair, most: float = 10.0) -> Iterator[str]:
    """Return words on a coefficient of wear that takes a body away as fast as it slides.

    E k has no dimension: under a pressure of E that much is lost of each length of sliding. Dry mild steel on
    itself, which wears fast (Archard 1953), has about 1. `most`: a larger one is hardly meant.
    """
    bodies = (scene.bodies[side.body] for side in pair.surfaces)
    moduli = [(isotropic_constants(each) or (0.0, 0.0))[0] for body in bodies for each in body.materials]
    softest = min((young for young in moduli if young > 0.0), default=0.0)
    for wear in pair.wears:
        k = wear.coefficient
        if isinstance(k, int | float) and wear.exponent == 1.0 and k / wear.hardness * softest > most:
            depth = k / wear.hardness
            remedy = f"{1e-3 * k:g} if it is meant in mm³/(N m), of which 1 is 1e-3 mm²/N"
            if wear.hardness != 1.0:
                remedy = "hardness has the units of Young's modulus"
            yield (
                f"odd wear in {pair.place}? a coefficient of {depth:g} times Young's modulus {softest:g} is "
                f"{depth * softest:.3g}, more than of any materials; of metals and plastics k is "
                f"1e-9 to 1e-5 mm²/N; {remedy}"
            )
