"""Joints whose bolts are uniform bars, so that their forces are known."""

from __future__ import annotations

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    LoadStep,
    Preload,
    Scene,
    Section,
    Support,
    Surface,
    Tie,
    TotalForce,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

#: Without lateral contraction bars are uniform: forces are those of springs E A / L.
SOFT, STIFF = IsotropicElasticity(1000.0, 0.0), IsotropicElasticity(1e9, 0.0)
LENGTH = 4.0
MIDDLE = Section((0.5, 0.5, 1.9), (0.0, 0.0, 1.0))
#: Of sleeve and bolt in the public case, at these loads on the head, after tightening to 50.
LOADS, SLEEVE, BOLT = (0.0, 20.0, 60.0, 100.0), (50.0, 38.0, 14.0, 0.0), (50.0, 58.0, 74.0, 100.0)


def bar() -> BodyMesh:
    return block((0, 0, 0), (1, 1, LENGTH), (2, 2, 8))


def joint(preload: Preload) -> Scene:
    """A bolt, a sleeve one and a half times as stiff, and a stiff head on both: load factor 0.4."""
    head = block((0, 0, LENGTH), (3.5, 1, LENGTH + 1), (7, 2, 2))
    bodies = {
        "bolt": Body(bar(), SOFT),
        "sleeve": Body(block((2, 0, 0), (3.5, 1, LENGTH), (3, 2, 8)), SOFT),
        "head": Body(head, STIFF),
    }
    supports = [
        Support("bolt", "z0"),
        Support("sleeve", "z0"),
        *(Support("head", side, (0.0, None, None)) for side in ("x0", "x1")),
        *(Support(body, "y0", (None, 0.0, None)) for body in bodies),
    ]
    ties = [Tie(Surface("bolt", "z1"), Surface("head", "z0"))]
    contacts = [ContactPair(Surface("sleeve", "z1"), Surface("head", "z0"))]
    return Scene(bodies, supports, contacts=contacts, ties=ties, preloads=[preload])


def pulled(load: float) -> LoadStep:
    return LoadStep(f"pull {load}", loads=[TotalForce("head", "z1", (0, 0, load))], preloads=[])


def clamped(*preloads: Preload) -> Scene:
    """A bar between walls."""
    supports = [Support("bar", "z0"), Support("bar", "z1")]
    return Scene({"bar": Body(bar(), SOFT)}, supports, preloads=preloads)


def plate_with_four_bolts() -> Scene:
    """A stiff plate on an elastic block, and four bars that press it down when they get longer."""
    under = block((0, 0, 0), (4, 4, 2), (4, 4, 2))
    plate = block((0, 0, 2), (4, 4, 3), (4, 4, 1))
    places = [(1.1, 1.1), (2.1, 1.1), (2.1, 2.1), (1.1, 2.1)]
    bolts = {
        f"bolt {k}": Body(block((x, y, 3), (x + 0.8, y + 0.8, 7), (1, 1, 4)), SOFT)
        for k, (x, y) in enumerate(places)
    }
    bodies = {"under": Body(under, IsotropicElasticity(300.0, 0.2)), "plate": Body(plate, STIFF), **bolts}
    supports = [Support("under", "z0"), *(Support(name, "z1") for name in bolts)]
    ties = [Tie(Surface(name, "z0"), Surface("plate", "z1")) for name in bolts]
    contacts = [ContactPair(Surface("plate", "z0"), Surface("under", "z1"))]
    sections = [
        Preload(name, Section((x + 0.4, y + 0.4, 5.0), (0, 0, -1)))
        for name, (x, y) in zip(bolts, places, strict=True)
    ]
    return Scene(bodies, supports, contacts=contacts, ties=ties, preloads=sections)
