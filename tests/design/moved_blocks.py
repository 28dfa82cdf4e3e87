"""A block with a designed surface, and how its states follow the design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from fenics_contact import (
    ClosureLaw,
    ClosureTable,
    Coulomb,
    ExponentialClosure,
    FluidPressure,
    FrictionTable,
    LinearClosure,
    Scene,
    SlipTable,
    Tresca,
)
from fenics_contact.design import StrainEnergy
from tests.design.blocks import block_on_block, block_on_floor, problem
from tests.design.objectives import objectives
from tests.design.quotients import Line

PUSH, DRAG = (0.35, 0.1, -2.0), (0.6, 0.12, -2.0)


def closing(scene: Scene, law: ClosureLaw) -> Scene:
    """Return the scene with surfaces that give way."""
    return replace(scene, contacts=[replace(pair, closure=law) for pair in scene.contacts])


def wetted(scene: Scene, pressure: float) -> Scene:
    """Return the scene with fluid that enters from the left."""
    fluid = FluidPressure(pressure, "x0")
    return replace(scene, contacts=[replace(pair, fluid=fluid) for pair in scene.contacts])


SCENES: dict[str, Callable[[], Scene]] = {
    "floor": lambda: block_on_floor(Coulomb(0.3), load=PUSH),
    "floor, Tresca": lambda: block_on_floor(Tresca(0.6), load=PUSH),
    "floor, Tresca, tetrahedra": lambda: block_on_floor(Tresca(0.6), "tetrahedron", load=PUSH),
    "blocks, Tresca": lambda: block_on_block(Tresca(0.8), load=DRAG),
    "blocks, tetrahedra": lambda: block_on_block(Coulomb(0.38), "tetrahedron", load=DRAG),
    "floor, shear limit": lambda: block_on_floor(
        Coulomb(0.3, shear_limit=lambda x: 0.5 + 0.05 * x[:, 0]), load=PUSH
    ),
    "floor, closure": lambda: closing(
        block_on_floor(Coulomb(0.3), load=PUSH), ExponentialClosure(1.0, 0.002)
    ),
    "blocks, closure": lambda: closing(
        block_on_block(Coulomb(0.38), "tetrahedron", load=DRAG),
        ClosureTable((0.0, 0.002, 0.003), (0.0, 1.0, 3.0)),
    ),
    "floor, elastic slip": lambda: closing(
        block_on_floor(Coulomb(0.3, stick_stiffness=40.0), load=PUSH), LinearClosure(300.0)
    ),
    "blocks, elastic slip": lambda: block_on_block(Coulomb(0.38, stick_stiffness=60.0), load=DRAG),
    "floor, table": lambda: block_on_floor(
        Coulomb(FrictionTable((0.5, 2.5, 4.0), (0.35, 0.25, 0.22))), load=PUSH
    ),
    "floor, fluid": lambda: wetted(block_on_floor(Coulomb(0.3), load=PUSH), 0.6),
    "blocks, fluid": lambda: wetted(block_on_block(Coulomb(0.38), "tetrahedron", load=DRAG), 0.3),
    "floor, friction by slip": lambda: block_on_floor(
        Coulomb(SlipTable((0.0, 0.004), (0.3, 0.25))), load=PUSH
    ),
    "blocks, friction by slip": lambda: block_on_block(
        Coulomb(SlipTable((0.0, 0.02), (0.3, 0.45))), load=DRAG
    ),
    "weight alone": lambda: block_on_block(Coulomb(0.25), load=(0.0, 0.0, 0.0)),
}


OBJECTIVES = {scene: objectives("block" if scene.startswith("floor") else "upper") for scene in SCENES}
for name in OBJECTIVES:
    if name.endswith("fluid"):  # which has no potential
        OBJECTIVES[name]["energy"] = StrainEnergy()


@cache
def line(name: str) -> Line:
    blocks = problem(SCENES[name]())
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(6).standard_normal(blocks.size), 1e-5)
