"""A block over a plate that a pair, a tie or nothing keeps apart."""

from __future__ import annotations

from fenics_contact import Body, BodyMesh, ContactPair, Scene, Support, Surface, Tie
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

STEEL = IsotropicElasticity(1000.0, 0.3)


def pressed(gap: float, force: float, *, pair: str = "none", side: float = 0.0) -> Scene:
    """A block over a wider plate, pressed down, and a post beside them that is in nobody's way."""
    cells = (2, 2, 2)
    upper = block((side, 0, 1 + gap), (side + 1, 1, 2 + gap), cells)
    half = upper.surfaces["z0"][upper.points[upper.surfaces["z0"]][..., 0].max(axis=1) < side + 0.6]
    upper = BodyMesh(upper.points, upper.cells, {**upper.surfaces, "half": half})
    bodies = {
        "upper": Body(upper, STEEL),
        "lower": Body(block((-0.5, -0.5, 0), (1.5, 1.5, 1), (3, 3, 2)), STEEL),
        "post": Body(block((4, 4, 0), (5, 5, 1), (1, 1, 1)), STEEL),
    }
    supports = [Support("upper", "z1", (0.0, 0.0, -force)), Support("lower", "z0"), Support("post", "z0")]
    sides = Surface("upper", "half" if pair == "half" else "z0"), Surface("lower", "z1")
    contacts = [ContactPair(*sides, discretisation="node")] if pair in ("whole", "half") else []
    return Scene(bodies, supports, [], contacts, ties=[Tie(*sides)] if pair == "tie" else [])
