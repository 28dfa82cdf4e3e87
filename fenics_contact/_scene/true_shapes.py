"""Which surfaces of contact pairs are curved, but known by their nodes alone."""

from __future__ import annotations

from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import SceneParts, surface_of


def is_without_shape(scene: SceneParts, side: Surface, pair: ContactPair) -> bool:
    """Return whether a surface of a pair is curved, and its true shape unknown or not used."""
    shapes = scene.bodies[side.body].mesh.origin.shapes
    known = pair.geometry == "best" and side.name in shapes
    return not known and surface_of(scene, side, "reconstructed").relief is not None


def sides_without_shape(scene: SceneParts, pair: ContactPair) -> list[Surface]:
    """Return the surfaces of a pair that are curved, and whose true shape is unknown or not used."""
    return [side for side in pair.surfaces if is_without_shape(scene, side, pair)]


def is_approximate(scene: SceneParts, pair: ContactPair) -> bool:
    """Return whether gaps are measured between curved surfaces that are only known by their nodes."""
    # Slave nodes lie on their surface; mortar contact also uses what is between them.
    sides = pair.surfaces[::-1] if pair.by_mortar else pair.surfaces[1:]
    return any(is_without_shape(scene, side, pair) for side in sides)
