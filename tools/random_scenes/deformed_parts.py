"""Materials, bodies and ways of random histories of large deformations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fenics_contact import BodyMesh, Coulomb
from fenics_contact.gallery import box_lattice, half_disc, hemisphere, rectangle_lattice
from fenics_contact.materials import (
    FinitePlasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    Ogden,
    PlaneStrain,
    StVenantKirchhoff,
)
from fenics_contact.mesh import boundary_faces, quadratic
from tests.scenes import Friction
from tools.random_scenes.dice import Dice
from tools.random_scenes.frame import Frame

Made = Callable[[Frame], Material]


def rubber(dice: Dice, dim: int, size: float, mesh: BodyMesh) -> tuple[Made, bool]:
    """Choose rubber of a size of stress; whether forces depend on the way."""
    nu = dice.weighted({0.3: 4.0, 0.45: 2.0, 0.49: 1.0, 0.499: 0.7})
    mu, bulk = size / (2 * (1 + nu)), size / (3 * (1 - 2 * nu))
    mean = nu > 0.46 or dice.chance(0.2)
    simple = mesh.cell_type.rstrip("0123456789") in ("triangle", "tetrahedron")
    mean = mean and not simple
    if simple and nu > 0.46:
        nu, bulk = 0.45, size / 0.3
    kind = dice.weighted({"NeoHooke": 4.0, "MooneyRivlin": 1.5, "Ogden": 1.5, "StVenantKirchhoff": 0.7})
    dice.say(f"{kind} E={size:.3g} nu={nu}{' mean dilatation' if mean else ''}")
    made: dict[str, Made] = {
        "NeoHooke": lambda f: NeoHooke(size * f.stress_unit, nu, mean),
        "MooneyRivlin": lambda f: MooneyRivlin(
            0.4 * mu * f.stress_unit, 0.1 * mu * f.stress_unit, bulk * f.stress_unit, mean
        ),
        "Ogden": lambda f: Ogden((2 * mu / 1.8 * f.stress_unit,), (1.8,), bulk * f.stress_unit, mean),
        "StVenantKirchhoff": lambda f: StVenantKirchhoff(size * f.stress_unit, 0.3),
    }
    return made[kind], False


def metal(dice: Dice, dim: int, size: float, mesh: BodyMesh, small: bool = True) -> tuple[Made, bool]:
    kind = dice.weighted({"J2Plasticity": 2.0 if small else 0.0, "FinitePlasticity": 2.0})
    strength, hard = size * dice.one_of((0.02, 0.05)), size * dice.one_of((0.05, 0.2))
    dice.say(f"{kind} E={size:.3g} yields at {strength:.2g}")
    if kind == "J2Plasticity":
        kinematic = hard if dice.chance(0.5) else 0.0
        return lambda f: J2Plasticity(
            size * f.stress_unit,
            0.3,
            strength * f.stress_unit,
            hard * f.stress_unit,
            kinematic * f.stress_unit,
        ), True
    return lambda f: FinitePlasticity(
        size * f.stress_unit, 0.3, strength * f.stress_unit, hard * f.stress_unit
    ), True


def linear_law(dice: Dice, dim: int, size: float, mesh: BodyMesh) -> tuple[Made, bool]:
    dice.say(f"linear E={size:.3g}")
    law = PlaneStrain if dim == 2 else IsotropicElasticity
    return lambda f: law(size * f.stress_unit, 0.3), False


def any_material(
    dice: Dice, dim: int, mesh: BodyMesh, size: float = 1.0, *, soft: bool = False
) -> tuple[Made, bool]:
    weights = {rubber: 5.0} if soft else {rubber: 5.0, metal: 2.0, linear_law: 0.7}
    return dice.weighted(weights)(dice, dim, size, mesh)


def friction_law(dice: Dice) -> tuple[Friction, bool]:
    law = dice.weighted({None: 3.0, Coulomb(0.2): 2.0, Coulomb(0.5): 2.0, Coulomb(1.0): 0.5})
    dice.say(f"friction {law.friction_coefficient}" if law else "frictionless")
    return law, law is not None


def pad_mesh(dice: Dice, dim: int, low: Sequence[float], high: Sequence[float], across: int) -> BodyMesh:
    """Mesh a box with odd numbers of cells, of any type."""
    cell = dice.weighted(
        {"quadrilateral": 5.0, "triangle": 2.0, "quadrilateral9": 1.0, "triangle6": 1.0}
        if dim == 2
        else {"hexahedron": 5.0, "tetrahedron": 1.0, "hexahedron27": 0.7}
    )
    if cell.endswith(("7", "9", "6")):
        across = max(across // 2, 2)
    size = np.subtract(high, low)
    counts = [max(round(across * s / size[0]), 2) for s in size]
    if dim == 3:
        counts = [
            min(count, 5 if cell == "hexahedron" else 3 if cell == "tetrahedron" else 2) for count in counts
        ]
    lattice_cell = cell.rstrip("0123456789")
    dice.say(f"{cell} {'x'.join(map(str, counts))}")
    ticks = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    mesh = (rectangle_lattice if dim == 2 else box_lattice)(ticks, lattice_cell)
    return mesh if cell == lattice_cell else quadratic(mesh)


def round_mesh(dice: Dice, dim: int, radius: float) -> BodyMesh:
    """Mesh half a disc or ball, its pole at the origin, with or without its true shape."""
    n = dice.one_of((3, 4, 5) if dim == 2 else (2, 3))
    mesh = (half_disc if dim == 2 else hemisphere)(radius, n)
    true = dice.chance(0.6)
    dice.say(f"half a {'disc' if dim == 2 else 'ball'} n={n}{' of true shape' if true else ''}")
    if dice.chance(0.2):
        mesh = quadratic(mesh)
        dice.say("quadratic")
    return mesh if true else mesh.with_shapes({})


def sides(dim: int) -> tuple[str, str]:
    return ("y0", "y1") if dim == 2 else ("z0", "z1")


def vector(dim: int, along: float, up: float, aside: float = 0.0) -> tuple[float, ...]:
    return (along, up) if dim == 2 else (along, aside, up)


def stages(dice: Dice, depth: float, way: float) -> list[tuple[float, float]]:
    """Choose where a body goes: pressed, drawn, back, lifted."""
    kind = dice.weighted({"pressed": 3.0, "drawn": 3.0, "to and fro": 2.0, "lifted": 1.5})
    dice.say(f"{kind} by {depth:.3g}" + ("" if kind == "pressed" else f" and {way:.3g}"))
    drawn = [(0.0, depth), (0.5 * way, depth), (way, depth)]
    ends = {
        "pressed": [(0.0, depth)],
        "drawn": drawn,
        "to and fro": [*drawn, (0.5 * way, depth), (0.0, depth)],
        "lifted": [*drawn, (way, -0.3 * depth)],
    }
    return ends[kind]


def slotted(whole: BodyMesh, keep: np.ndarray) -> BodyMesh:
    """Return some cells of a plane mesh; new rims are "slot", and above and below "roof" and "ground".

    The ends of the arms belong to "slot", too: nodes that left the end of a facing arm would lose force.
    """
    cells = whole.cells[keep]
    used, flat = np.unique(cells, return_inverse=True)
    points, cells = whole.points[used], flat.reshape(cells.shape)
    number = np.full(whole.n_nodes, -1)
    number[used] = np.arange(len(used))
    old = {
        name: facets[(facets >= 0).all(axis=1)]
        for name, facets in ((n, number[f]) for n, f in whole.surfaces.items())
    }
    rim, _ = boundary_faces(cells, 2)
    outer = {tuple(sorted(facet)) for facet in rim}
    old = {name: np.array([f for f in facets if tuple(sorted(f)) in outer]) for name, facets in old.items()}
    known = {tuple(sorted(facet)) for facets in old.values() for facet in facets}
    slot = np.array([facet for facet in rim if tuple(sorted(facet)) not in known])
    middle = points[slot].mean(axis=1)
    level = np.abs(points[slot[:, 0], 1] - points[slot[:, 1], 1]) < 1e-9
    half = 0.5 * (middle[level, 1].min() + middle[level, 1].max())
    top = old["y1"]
    tip = top[points[top].mean(axis=1)[:, 0] > 2.0]
    roof, ground = (slot[level & (sign * (middle[:, 1] - half) > 0.0)] for sign in (1.0, -1.0))
    slot = np.concatenate([slot, old["x1"]])
    return BodyMesh(points, cells, {**old, "slot": slot, "roof": roof, "ground": ground, "tip": tip})
