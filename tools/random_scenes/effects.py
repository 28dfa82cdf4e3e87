"""Effects that few scenes call for, added to random ones: laws of surfaces, foundations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    ExponentialClosure,
    FrictionTable,
    LinearClosure,
    Scene,
    Tresca,
)
from tools.random_scenes.dice import Dice
from tools.random_scenes.whole import on_axis

#: Seeds of what is added lie so far from those of the scenes, which stay what they are without it.
APART = 2**32


def with_effects(seed: int, dice: Dice, scene: Scene, level: float) -> Scene:
    """Return a scene in which some surfaces give way, friction has limits, or bodies lie on springs."""
    added = Dice(seed + APART)
    if not added.chance(0.4):
        return scene
    contacts = [_with_laws(added, pair, level) for pair in scene.contacts]
    foundations = [_foundation(added, scene, name) for name in scene.bodies if added.chance(0.2)]
    dice.words += added.words
    return replace(scene, contacts=contacts, foundations=foundations)


def may_be_oblique(seed: int) -> bool:
    """Return whether rollers of a scene may be turned by any angle."""
    return Dice(seed + 2 * APART).chance(0.5)


def is_axis(part: Body, side: str) -> bool:
    """Return whether a surface is a line on the axis of revolution."""
    return part.axisymmetric and bool(on_axis(part.mesh.points)[part.mesh.surfaces[side]].all())


def _with_laws(dice: Dice, pair: ContactPair, level: float) -> ContactPair:
    friction = pair.friction
    if isinstance(friction, Coulomb):
        if dice.chance(0.3):
            dice.say("by pressure")
            mu = friction.friction_coefficient
            table = FrictionTable((0.0, level * dice.power(-1.0, 1.0)), (mu, mu * dice.between(0.5, 2.0)))
            friction = replace(friction, friction_coefficient=table)
        if dice.chance(0.3):
            dice.say("with a shear limit")
            friction = replace(friction, shear_limit=level * dice.power(-1.5, 0.5))
    if isinstance(friction, Coulomb | Tresca) and dice.chance(0.3):
        friction = replace(friction, stick_stiffness=dice.power(-1.0, 4.0))
        dice.say(f"elastic slip {friction.stick_stiffness:.2g}")
    return replace(pair, friction=friction, closure=_closure(dice, level) if dice.chance(0.5) else None)


def _closure(dice: Dice, level: float) -> ClosureLaw:
    kind = dice.one_of(("linear", "exponential", "table"))
    stiffness = dice.power(-1.0, 4.0)
    dice.say(f"{kind} closure {stiffness:.2g}")
    soft = level / stiffness
    if kind == "linear":
        return LinearClosure(stiffness)
    if kind == "exponential":
        return ExponentialClosure(level, soft)
    start = soft * dice.one_of((0.0, 0.0, -0.3, 0.3))
    steps = np.cumsum([start, soft, 0.3 * soft, 0.2 * soft])
    return ClosureTable(tuple(steps), (0.0, 0.3 * level, level, 3.0 * level))


def _foundation(dice: Dice, scene: Scene, name: str) -> ElasticFoundation:
    part = scene.bodies[name]
    side = dice.one_of([side for side in sorted(part.mesh.surfaces) if not is_axis(part, side)])
    stiffness, total = dice.power(-3.0, 1.0), dice.chance(0.3)
    value = stiffness
    if dice.chance(0.5):
        sideways = (stiffness * dice.one_of((0.0, 0.3, 1.0)) for _ in range(scene.dim - 1))
        value = (*sideways, stiffness)
    dice.say(f"{name} on springs at {side}{' in all' if total else ''}")
    return ElasticFoundation(name, side, value, total)
