"""A ring on a hollow shaft: Lamé's pressure for an interference, in plane strain."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, Scene, State, Support, Surface
from fenics_contact.gallery.blocks import extrude
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.shapes import Sphere

BORE, SEAT, RIM = 10.0, 30.0, 60.0  # mm
YOUNG, NU = 2.1e5, 0.3  # N/mm²
INTERFERENCE = 0.05  # mm, of the radius
Disc = Literal["node", "mortar"]


def ring(
    inner: float, outer: float, around: int, through: int, *, shapes: bool = True, part: float = 1.0
) -> BodyMesh:
    """A ring with ``around`` cells around it; surfaces "inner", "outer", of a part also "start", "end".

    Args:
        inner: Radius.
        outer: Radius.
        around: Number of cells around the whole ring.
        through: Number of cells from inside to outside.
        shapes: Whether the mesh knows that it is round.
        part: 1, or the part of the ring that is meshed, from the x axis on.
    """
    count = round(part * around)
    radii = inner * (outer / inner) ** np.linspace(0.0, 1.0, through + 1)
    angles = 2 * np.pi * np.arange(count + (part < 1.0)) / around
    circle = np.round(np.column_stack([np.cos(angles), np.sin(angles)]), 15)
    number = np.arange(len(radii) * len(angles)).reshape(len(radii), len(angles))
    ahead = np.roll(number, -1, axis=1)
    here, there = number[:, :count], ahead[:, :count]
    cells = np.stack([here[:-1], here[1:], there[1:], there[:-1]], axis=-1).reshape(-1, 4)
    surfaces = {
        "inner": np.column_stack([there[0], here[0]]),
        "outer": np.column_stack([here[-1], there[-1]]),
    }
    if part < 1.0:
        surfaces["start"] = np.column_stack([number[:-1, 0], number[1:, 0]])
        surfaces["end"] = np.column_stack([number[1:, -1], number[:-1, -1]])
    round_ = {
        "inner": Sphere((0.0, 0.0), inner, hollow=True),
        "outer": Sphere((0.0, 0.0), outer),
    }
    points = (radii[:, None, None] * circle).reshape(-1, 2)
    return BodyMesh(points, cells, surfaces, shapes=round_ if shapes else {})


def press_fit(
    around: int,
    through: int,
    *,
    outside: int | None = None,
    overlap: float = 0.0,
    shapes: bool = True,
    part: float = 1.0,
    **pair: Any,
) -> Scene:
    """A ring on a shaft with a bore.

    Args:
        around: Number of cells around the shaft.
        through: Number of cells through shaft and ring.
        outside: Number of cells around the ring; by default as many.
        overlap: By how much the meshes overlap.
        shapes: Whether the meshes know that they are round.
        part: 1, or 0.25 for a quarter between planes of symmetry.
        **pair: Arguments of the contact pair.
    """
    shaft = ring(BORE, SEAT + overlap / 2, around, through, shapes=shapes, part=part)
    hub = ring(SEAT - overlap / 2, RIM, outside or around, through, shapes=shapes, part=part)
    rollers = [("start", (None, 0.0)), ("end", (0.0, None))] if part < 1.0 else []
    return Scene(
        {name: Body(mesh, PlaneStrain(YOUNG, NU)) for name, mesh in (("shaft", shaft), ("hub", hub))},
        [Support(name, side, value) for name in ("shaft", "hub") for side, value in rollers],
        contacts=[ContactPair(Surface("hub", "inner"), Surface("shaft", "outer"), **pair)],
    )


def thick_press_fit(around: int, through: int, thickness: float, **pair: Any) -> Scene:
    """A quarter of the same in space, one layer of cells between rollers."""
    plane = press_fit(around, through, part=0.25, **pair)
    steel = IsotropicElasticity(YOUNG, NU)
    meshes = {name: extrude(body.mesh, [0.0, thickness]) for name, body in plane.bodies.items()}
    faces = [(side, (None, None, 0.0)) for side in ("bottom", "top")]
    return Scene(
        {name: Body(mesh, steel) for name, mesh in meshes.items()},
        [Support(s.body, s.surface, (*s.value, None)) for s in plane.supports]
        + [Support(name, *face) for name in meshes for face in faces],
        contacts=plane.contacts,
    )


def mean_pressure(state: State, part: float = 1.0, thickness: float = 1.0) -> float:
    """The mean pressure on the round seat."""
    return float(state.contact.normal_force.sum()) / (2 * np.pi * SEAT * part * thickness)


def lame(interference: float = INTERFERENCE) -> float:
    """Lamé's pressure between a shaft with a bore and a ring, long in z."""
    young, nu = YOUNG / (1 - NU**2), NU / (1 - NU)
    hub = ((RIM**2 + SEAT**2) / (RIM**2 - SEAT**2) + nu) / young
    shaft = ((SEAT**2 + BORE**2) / (SEAT**2 - BORE**2) - nu) / young
    return interference / SEAT / (hub + shaft)


def clamped_pressure() -> float:
    """The pressure where bore and rim are held: u = A r + B / r vanishes there in both bodies."""

    def compliance(held: float) -> float:
        # σ_r = E / ((1 + ν)(1 - 2ν)) (A - (1 - 2ν) B / r²), and B = -A held².
        stress = YOUNG / ((1 + NU) * (1 - 2 * NU)) * (1 + (1 - 2 * NU) * (held / SEAT) ** 2)
        return abs((SEAT - held**2 / SEAT) / stress)

    return INTERFERENCE / (compliance(BORE) + compliance(RIM))
