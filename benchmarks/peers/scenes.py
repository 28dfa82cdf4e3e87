"""Scenes that every program of the comparison can have: linear hexahedra, Hooke's law, one pair of surfaces.

Nothing here starts MPI or PETSc, which some of the programs do not bear in their process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.cases.scene_data import (
    FRICTION_COEFFICIENT,
    LOWER,
    POISSON_RATIO,
    TRACTION,
    UPPER,
)
from fenics_contact import BodyMesh
from fenics_contact.gallery import block, box_lattice, hemisphere, rectangle
from fenics_contact.gallery.blocks import extrude

#: Body and side.
Side = tuple[str, str]
#: Displacement by component, None where it is free.
Value = tuple[float | None, float | None, float | None]

#: Steel of the ball and of the press fit, [N/mm²].
STEEL = 2.1e5
#: Cells of the ball through its radius, and ticks of the block, by unknowns.
BALLS = {"2k": (5, 7), "14k": (9, 13)}
#: Displacement of the ball's top, [mm]: 15 kN on the whole ball by Hertz's theory and half the ball's own.
APPROACH = 0.0947
RADIUS = 10.0
#: Radii of shaft, hub and their outer sides, [mm]: the meshes overlap by 0.05.
SHAFT, HUB, INNER, OUTER, HEIGHT = 30.0, 29.95, 10.0, 60.0, 10.0


@dataclass(frozen=True)
class PeerScene:
    """A scene as plain data.

    Attributes:
        bodies: Meshes by name.
        young: Young's modulus of all bodies.
        friction: Coefficient of Coulomb's law.
        held: Sides with their displacement.
        slave: Side that carries the contact forces.
        master: Side that it touches; None: the rigid plane below the block.
        traction: Side with its traction.
    """

    bodies: Mapping[str, BodyMesh]
    young: float
    friction: float
    held: tuple[tuple[Side, Value], ...]
    slave: Side
    master: Side | None = None
    traction: tuple[Side, tuple[float, float, float]] | None = None

    poisson = POISSON_RATIO


def sliding_block(counts: tuple[int, int, int]) -> PeerScene:
    """A block held at one end, pressed on a rigid plane and pulled sideways."""
    mesh = block(LOWER, UPPER, counts)
    return PeerScene(
        {"block": mesh},
        1.0,
        FRICTION_COEFFICIENT,
        ((("block", "x0"), (0.0, 0.0, 0.0)),),
        ("block", "z0"),
        traction=(("block", "z1"), TRACTION),
    )


def cubes(low: int, high: int) -> PeerScene:
    """A cube on a larger one, with cells that do not match, pressed and sheared."""
    bodies = {
        "low": block((0, 0, 0), (1, 1, 1), (low,) * 3),
        "high": block((0.2, 0.2, 1), (0.8, 0.8, 1.6), (high,) * 3),
    }
    held = ((("low", "z0"), (0.0, 0.0, 0.0)), (("high", "z1"), (0.01, 0.0, -0.02)))
    return PeerScene(bodies, 1.0, FRICTION_COEFFICIENT, held, ("high", "z0"), ("low", "z1"))


def ball(cells: int, ticks: int) -> PeerScene:
    """A quarter of a steel ball moved into a block of steel, without friction: Hertz's contact."""
    steps = RADIUS * np.expm1(3 * np.linspace(0, 1, ticks)) / np.expm1(3)
    bodies = {
        "ball": hemisphere(RADIUS, cells, grading=3.0),
        "block": box_lattice([1.05 * steps, steps, -steps[::-1]]),
    }
    planes: tuple[tuple[Side, Value], ...] = tuple(
        ((body, side), value)
        for body in bodies
        for side, value in (("x0", (0.0, None, None)), ("y0", (None, 0.0, None)))
    )
    held = (*planes, (("block", "z0"), (None, None, 0.0)), (("ball", "top"), (None, None, -APPROACH)))
    return PeerScene(bodies, STEEL, 0.0, held, ("block", "z1"), ("ball", "contact"))


def press_fit() -> PeerScene:
    """A quarter of a hub shrunk on a hollow shaft; facets of 3° and 2.5° do not match; plane strain."""
    bodies = {"shaft": _ring(INNER, SHAFT, 12, 30), "hub": _ring(HUB, OUTER, 16, 36)}
    planes: tuple[tuple[str, Value], ...] = (
        ("x0", (0.0, None, None)),
        ("y0", (None, 0.0, None)),
        ("top", (None, None, 0.0)),
        ("bottom", (None, None, 0.0)),
    )
    held = tuple(((body, side), value) for body in bodies for side, value in planes)
    return PeerScene(bodies, STEEL, FRICTION_COEFFICIENT, held, ("hub", "inner"), ("shaft", "outer"))


def _ring(inner: float, outer: float, through: int, around: int) -> BodyMesh:
    """Mesh a quarter of a ring with its sides inner, outer, x0, y0, bottom and top."""
    flat = rectangle((inner, 0.0), (outer, np.pi / 2), (through, around))
    radius, angle = flat.points.T
    sides = {"inner": "x0", "outer": "x1", "y0": "y0", "x0": "y1"}
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    flat = replace(flat, points=points, surfaces={new: flat.surfaces[old] for new, old in sides.items()})
    return extrude(flat, np.linspace(0.0, HEIGHT, 5))


#: Scene by name.
SCENES: dict[str, Callable[[], PeerScene]] = {
    "block-2k": lambda: sliding_block((16, 6, 6)),
    "block-28k": lambda: sliding_block((32, 16, 16)),
    "block-92k": lambda: sliding_block((48, 24, 24)),
    **{f"ball-{size}": partial(ball, *counts) for size, counts in BALLS.items()},
    "cubes": lambda: cubes(14, 11),
    "cubes-finer": lambda: cubes(28, 22),
    "press-fit": press_fit,
}


def lame_force() -> float:
    """Return the hoop force of the press fit by Lamé: p r h with p of plane strain, [N].

    Both rings have the same material, so that with the interference δ

        p = E' δ / r / ((r² + a²)/(r² − a²) + (b² + r²)/(b² − r²)),   E' = E / (1 − ν²).
    """
    radius, plane = SHAFT, STEEL / (1.0 - POISSON_RATIO**2)
    shaft = (radius**2 + INNER**2) / (radius**2 - INNER**2)
    hub = (OUTER**2 + radius**2) / (OUTER**2 - radius**2)
    return plane * (SHAFT - HUB) / (shaft + hub) * HEIGHT


def hertz_peak(quarter: float) -> float:
    """Return the peak pressure of the ball for the force on its quarter, [N/mm²]: (6 F E*² / (π³ R²))^⅓."""
    modulus = STEEL / (2.0 * (1.0 - POISSON_RATIO**2))
    return float(np.cbrt(6.0 * 4.0 * quarter * modulus**2 / (np.pi**3 * RADIUS**2)))
