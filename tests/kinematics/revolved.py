"""Bodies of revolution with known answers: stacked cylinders, a ring on a shaft, a ball on a flat face."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Tie,
)
from fenics_contact.gallery import half_disc, rectangle
from fenics_contact.gallery.blocks import rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, NeoHooke, OrthotropicElasticity
from fenics_contact.materials.elastic import Material
from fenics_contact.mesh import quadratic

Kind = Literal["triangle", "quadrilateral", "triangle6", "quadrilateral9"]
KINDS: tuple[Kind, ...] = ("triangle", "quadrilateral", "triangle6", "quadrilateral9")
PRESSURE = 10.0
STEEL = IsotropicElasticity(2.1e5, 0.3, thermal_expansion=1.2e-5)  # N/mm²
#: Fibres around the circumference.
WOUND = OrthotropicElasticity((1e4, 1e4, 1.4e5), (0.3, 0.02, 0.02), (4e3, 5e3, 5e3))
#: Fibres along the axis, alike in all directions across.
STRANDS = OrthotropicElasticity((1e4, 1.4e5, 1e4), (0.02, 0.3, 0.28), (5e3, 1e4 / 2.6, 5e3))


def section(
    lower: tuple[float, float], upper: tuple[float, float], counts: tuple[int, int], kind: Kind
) -> BodyMesh:
    """Half the section of a ring, skewed inside so that no cell is a rectangle."""
    plane: BodyMesh = rectangle(lower, upper, counts, "triangle" if "tri" in kind else "quadrilateral")
    (r0, z0), (r1, z1) = lower, upper
    s, t = ((plane.points - lower) / (r1 - r0, z1 - z0)).T
    away = 0.1 * np.sin(np.pi * s) * np.sin(np.pi * t)
    moved = plane.moved(plane.points + np.column_stack([away * (r1 - r0), -away * (z1 - z0)]))
    return quadratic(moved) if kind in ("triangle6", "quadrilateral9") else moved


def stacked(
    kind: Kind,
    discretisation: Literal["node", "mortar"],
    counts: tuple[int, int],
    *,
    inner: float = 0.0,
    tied: bool = False,
    friction: float = 0.0,
    material: Material = STEEL,
) -> Scene:
    """Two cylinders, one on the other, pressed together; ``counts``: cells along the radius of each."""
    bodies = {
        "lower": Body(section((inner, 0), (3, 1), (counts[0], 3), kind), material, axisymmetric=True),
        "upper": Body(section((inner, 1), (3, 2), (counts[1], 2), kind), material, axisymmetric=True),
    }
    faces = Surface("upper", "y0"), Surface("lower", "y1")
    supports, loads = [Support("lower", "y0", (None, 0.0))], [Pressure("upper", "y1", PRESSURE)]
    if tied:
        return Scene(bodies, supports, loads, ties=[Tie(*faces, discretisation=discretisation)])
    law = Coulomb(friction) if friction else None
    return Scene(bodies, supports, loads, [ContactPair(*faces, law, discretisation)])


#: Bore, seat and rim of a ring on a hollow shaft, [mm], and the interference of the radii.
BORE, SEAT, RIM, INTERFERENCE = 10.0, 30.0, 60.0, 0.05


def press_fit(
    kind: Kind, through: int, discretisation: Literal["node", "mortar"], friction: float = 0.0
) -> Scene:
    """A slice of a long press fit, held between two planes."""
    shaft, ring = (
        rectangle(lower, upper, (through, count), "triangle" if "tri" in kind else "quadrilateral")
        for lower, upper, count in (
            ((BORE, 0), (SEAT, 6), 4),
            ((SEAT, 0), (RIM, 6), 4 if discretisation == "node" else 5),
        )
    )
    if kind in ("triangle6", "quadrilateral9"):
        shaft, ring = quadratic(shaft), quadratic(ring)
    bodies = {n: Body(mesh, STEEL, axisymmetric=True) for n, mesh in (("shaft", shaft), ("ring", ring))}
    supports = [Support(name, side, (None, 0.0)) for name in bodies for side in ("y0", "y1")]
    law = Coulomb(friction) if friction else None
    pair = ContactPair(
        Surface("ring", "x0"), Surface("shaft", "x1"), law, discretisation, interference=INTERFERENCE
    )
    return Scene(bodies, supports, contacts=[pair])


def twisted_fit(
    kind: Kind, through: int, discretisation: Literal["node", "mortar"], turn: float, friction: float = 0.2
) -> Scene:
    """The same with torsion: the bore is held, the rim turned by an angle."""
    scene = press_fit(kind, through, discretisation, friction)
    bodies = {name: replace(body, torsion=True) for name, body in scene.bodies.items()}
    supports = [Support(name, side, (None, 0.0, None)) for name in bodies for side in ("y0", "y1")]
    supports.append(Support("shaft", "x0", (None, None, 0.0)))
    supports.append(Support("ring", "x1", (None, None, lambda x: turn * x[:, 0])))
    return replace(scene, bodies=bodies, supports=supports)


def press_fit_pressure() -> float:
    """Lamé's pressure in plane strain."""
    E, nu = STEEL.young_modulus, STEEL.poisson_ratio
    young, ratio = E / (1 - nu**2), nu / (1 - nu)
    ring = (RIM**2 + SEAT**2) / (RIM**2 - SEAT**2) + ratio
    shaft = (SEAT**2 + BORE**2) / (SEAT**2 - BORE**2) - ratio
    return INTERFERENCE * young / (SEAT * (ring + shaft))


RADIUS, SPOT = 10.0, 0.5


def pushed_on_ball(cells: int, order: int = 1) -> Scene:
    """A flat body pushed against a rigid ball; ``cells``: across the expected contact radius."""
    size = SPOT / cells

    def ticks(fine: float) -> np.ndarray:
        places, step = [size * k for k in range(int(fine / size + 0.5) + 1)], size
        while places[-1] < 20 * SPOT:
            step *= 1.15 if order == 1 else 1.3
            places.append(places[-1] + step)
        return np.array(places)

    mesh = rectangle_lattice((ticks(2 * SPOT), -ticks(SPOT)[::-1]))
    mesh = quadratic(mesh) if order == 2 else mesh
    pair = ContactPair(Surface("flat", "y1"), RigidSphere((0.0, RADIUS), RADIUS))
    support = Support("flat", "y0", (None, SPOT**2 / RADIUS))
    return Scene({"flat": Body(mesh, STEEL, axisymmetric=True)}, [support], contacts=[pair])


def pushed_with_friction() -> Scene:
    """A hollow punch on a disc of another mesh: its edges slip, its middle sticks."""
    bodies = {
        "disc": Body(section((0, 0), (6, 3), (12, 6), "quadrilateral"), STEEL, axisymmetric=True),
        "punch": Body(section((0.5, 3), (3, 6), (7, 6), "quadrilateral"), STEEL, axisymmetric=True),
    }
    supports = [Support("disc", "y0", (None, 0.0)), Support("punch", "y1", (0.0, -0.002))]
    pair = ContactPair(Surface("punch", "y0"), Surface("disc", "y1"), Coulomb(0.2), "mortar")
    return Scene(bodies, supports, contacts=[pair])


def squeezed_ring(cells: int = 5, squeeze: float = 0.3, pressure: float = 0.3) -> Scene:
    """The lower half of an O-ring, squeezed on a plate with friction, pressed outwards by a fluid inside."""
    half = half_disc(1.0, cells, symmetry="", grading=1.0)
    side = half.surfaces["side"]
    inside = side[half.points[side, 0].mean(axis=1) < 0.0]
    lower = half.surfaces["contact"]
    mesh = BodyMesh(
        half.points + np.array([5.0, 0.0]),
        half.cells,
        {"top": half.surfaces["top"], "inside": inside, "lower": lower},
    )
    ring = Body(mesh, NeoHooke(5.0, 0.4), axisymmetric=True)
    return Scene(
        {"ring": ring},
        [Support("ring", "top", (None, -squeeze))],
        [Pressure("ring", "inside", pressure)],
        [ContactPair(Surface("ring", "lower"), RigidPlane((5.0, 0.0), (0.0, 1.0)), Coulomb(0.3))],
    )
