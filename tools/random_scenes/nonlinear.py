"""Plane scenes of rubber, metal and large sliding at random, whose quantities graded meshes have, too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fenics_contact import ContactPair, Coulomb, RigidPlane, RigidSphere, Support, Surface, Traction
from fenics_contact.materials import (
    FinitePlasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    StVenantKirchhoff,
)
from tools.random_scenes.corners import Blocks, Corners
from tools.random_scenes.dice import Dice

#: Returns a material by its Young's modulus and Poisson's ratio.
Law = Callable[[float, float], Material]


def nonlinear(seed: int) -> Corners:
    """Return a scene of a seed: rubber and metal that are bent, stretched, pressed, and slide."""
    dice = Dice(seed)
    kinds = {_bent: 2.0, _stretched: 2.0, _pressed: 3.0, _drawn: 3.0, _slider: 2.0}
    return dice.weighted(kinds)(dice)


def _rubber(dice: Dice) -> Law:
    """Choose a law of rubber; nearly incompressible ones have a mean dilatation."""
    nu = dice.weighted({0.3: 3.0, 0.45: 2.0, 0.49: 1.0, 0.4995: 2.0})
    kind = dice.weighted(
        {"NeoHooke": 3.0, "MooneyRivlin": 2.0, "StVenantKirchhoff": 1.0 if nu < 0.4 else 0.0}
    )
    mean = nu > 0.46
    dice.say(f"{kind} nu={nu}")
    laws: dict[str, Law] = {
        "NeoHooke": lambda E, _: NeoHooke(E, nu, mean),
        "MooneyRivlin": lambda E, _: MooneyRivlin(
            0.35 * E / (2 * (1 + nu)), 0.15 * E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu)), mean
        ),
        "StVenantKirchhoff": lambda E, _: StVenantKirchhoff(E, nu),
    }
    return laws[kind]


def _metal(dice: Dice) -> Law:
    strength, hard = dice.one_of((0.003, 0.01)), dice.one_of((0.02, 0.1))
    kind, mean = dice.one_of(("J2Plasticity", "FinitePlasticity")), dice.chance(0.5)
    dice.say(f"{kind} yields at {strength} E, hardens by {hard} E")
    if kind == "J2Plasticity":
        return lambda E, nu: J2Plasticity(E, nu, strength * E, hard * E, mean_dilatation=mean)
    return lambda E, nu: FinitePlasticity(E, nu, strength * E, hard * E)


def _any(dice: Dice) -> tuple[Law, float]:
    """Choose a law, and a strain up to which it is deformed."""
    if dice.chance(0.3):
        return _metal(dice), dice.between(0.01, 0.04)
    return _rubber(dice), dice.between(0.05, 0.2)


def _blocks(dice: Dice, law: Law, counts: tuple[int, int], high: float = 1.0) -> Blocks:
    """Return blocks of one material, less high than wide."""
    wide = np.cumsum([0.0, *(dice.between(0.8, 1.5) for _ in range(counts[0]))])
    tall = np.cumsum([0.0, *(high * dice.between(0.5, 1.0) for _ in range(counts[1]))])
    return Blocks((wide, tall), np.full(counts, dice.power(0, 2)), 0.3, law)


def _coarse(dice: Dice, simplex: bool = True) -> tuple[int, str, int]:
    cells = ("triangle", "quadrilateral") if simplex else ("quadrilateral",)
    return int(dice.random.integers(2, 5)), dice.one_of(cells), 1


def _some(dice: Dice, **wanted: Any) -> tuple[str, dict[str, Any]]:
    name = dice.one_of(sorted(wanted))
    dice.say(name)
    return name.rstrip("_xy"), wanted[name]


def _friction(dice: Dice) -> Coulomb | None:
    law = dice.one_of((None, Coulomb(0.2), Coulomb(0.5)))
    dice.say(f"friction {law.friction_coefficient}" if law else "no friction")
    return law


def _made(dice: Dice, bodies: dict[str, Blocks], wanted: Any, **parts: Any) -> Corners:
    locks = any("nu=0.49" in words or "yields" in words for words in dice.words)
    coarse = _coarse(dice, not locks)
    dice.say(f"{coarse[1]}s")
    return Corners("; ".join(dice.words), True, bodies, parts, wanted, coarse, tolerance=1e-6)


def _bent(dice: Dice) -> Corners:
    """A clamped beam under a dead load at its end."""
    law = _rubber(dice)
    blocks = _blocks(dice, law, (2, 1))
    size = float(blocks.modulus.max()) * dice.between(0.005, 0.03)
    load = Traction("a", "x1", (dice.between(-0.5, 0.5) * size, -size))
    wanted = _some(
        dice, displacement_y={"surface": "a x1", "direction": (0, -1)},
        displacement_x={"surface": "a x1", "direction": (-1, 0)},
    )  # fmt: skip
    dice.say("bent")
    return _made(dice, {"a": blocks}, wanted, supports=[Support("a", "x0")], loads=[load])


def _stretched(dice: Dice) -> Corners:
    """Two blocks, one stiffer or notched, between clamps that move apart or together."""
    law, strain = _any(dice)
    blocks = _blocks(dice, law, (2, dice.one_of((1, 2))))
    modulus = blocks.modulus.copy()
    modulus[-1, -1] *= dice.one_of((1.0, 3.0, 0.0)) if modulus.shape[1] == 2 else dice.one_of((1.0, 2.0))
    blocks = Blocks(blocks.lines, modulus, blocks.poisson, law)
    way = strain * float(blocks.lines[0][-1]) * dice.one_of((1.0, 1.0, -0.5))
    ends = [Support("a", "x0"), Support("a", "x1", (way, dice.between(0.0, 0.5) * way))]
    wanted = _some(
        dice, reaction_x={"surface": "a x1", "direction": (1, 0)},
        reaction_y={"surface": "a x1", "direction": (0, 1)},
        displacement={"surface": "a y0", "direction": (1, 0)},
    )  # fmt: skip
    dice.say(f"stretched by {way:.3g}")
    return _made(dice, {"a": blocks}, wanted, supports=ends)


def _tool(dice: Dice, blocks: Blocks) -> RigidPlane | RigidSphere:
    """Choose what lies below."""
    length = float(blocks.lines[0][-1])
    if dice.chance(0.3):
        dice.say("on a plane")
        return RigidPlane((0.0, 0.0), (0.0, 1.0))
    radius = dice.between(0.8, 3.0) * length
    dice.say(f"on a cylinder of {radius / length:.2g} of its length")
    return RigidSphere((dice.between(0.35, 0.65) * length, -radius), radius)


def _on_tool(dice: Dice, along: float) -> Corners:
    law, strain = _any(dice)
    blocks = _blocks(dice, law, (1, 1))
    tool, height = _tool(dice, blocks), float(blocks.lines[1][-1])
    way = (along * height, -strain * height)
    pair = ContactPair(Surface("a", "y0"), tool, _friction(dice))
    forces = {"reaction_y": {"surface": "a y1", "direction": (0, -1)}, "contact_force": {"direction": (0, 1)}}
    more = {"displacement": {"surface": "a x1", "direction": (1, 0)}}
    if along and pair.has_friction:
        more["reaction_x"] = {"surface": "a y1", "direction": (float(np.sign(along)), 0.0)}
    if isinstance(tool, RigidSphere):
        more["peak_pressure"] = {}
    wanted = _some(dice, **forces, **more)
    dice.say(f"pressed by {-way[1]:.3g}, drawn by {way[0]:.3g}")
    return _made(dice, {"a": blocks}, wanted, supports=[Support("a", "y1", way)], contacts=[pair])


def _pressed(dice: Dice) -> Corners:
    """A block pressed on a tool."""
    return _on_tool(dice, 0.0)


def _drawn(dice: Dice) -> Corners:
    """A block pressed on a tool and drawn along it, over several of its facets."""
    return _on_tool(dice, dice.between(0.2, 0.6) * dice.one_of((1.0, -1.0)))


def _slider(dice: Dice) -> Corners:
    """A stiff block pressed into a soft one and drawn along it."""
    soft, hard = _rubber(dice), _rubber(dice)
    bed = _blocks(dice, soft, (3, 1))
    upper = _blocks(dice, hard, (1, 1))
    wide = float(upper.lines[0][-1])
    along = np.array([-1.0, 0.0, wide, wide + 1.0])
    bed = Blocks((along, bed.lines[1] - bed.lines[1][-1]), bed.modulus, 0.3, soft)
    stiff = dice.one_of((2.0, 10.0)) * float(bed.modulus.max())
    upper = Blocks(upper.lines, np.full((1, 1), stiff), 0.3, hard)
    depth, way = dice.between(0.01, 0.05), dice.between(0.0, 0.3)
    friction = dice.one_of((None, Coulomb(0.2)))
    dice.say(f"friction {friction}")
    pair = ContactPair(Surface("a", "y0"), Surface("b", "y1"), friction, discretisation="mortar")
    held = [Support("b", "y0"), Support("a", "y1", (way, -depth))]
    wanted = _some(
        dice, reaction_y={"surface": "a y1", "direction": (0, -1)}, contact_force={"direction": (0, 1)},
        displacement={"surface": "b y1 1", "direction": (0, -1)},
    )  # fmt: skip
    dice.say(f"slider pressed by {depth:.3g}, drawn by {way:.3g}")
    return _made(dice, {"a": upper, "b": bed}, wanted, supports=held, contacts=[pair])
