"""Random bodies of revolution: plane arrangements whose first coordinate becomes the radius."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    RigidPlane,
    RigidSphere,
    Scene,
    ThermalStrain,
    TotalForce,
    Traction,
)
from fenics_contact.materials import IsotropicElasticity, Material, OrthotropicElasticity
from tests.scenes import Load
from tools.hard_cases.transform import in_units
from tools.random_scenes.arrangements import ARRANGEMENTS, Arrangement
from tools.random_scenes.bodies import RATIOS, in_halves, in_plane
from tools.random_scenes.dice import Dice
from tools.random_scenes.effects import is_axis, with_effects
from tools.random_scenes.generator import TOLERANCES, Sample, cut, loads, moved, supported


def revolved(seed: int) -> Sample:
    """Return the bodies of revolution of a seed, the same on every machine."""
    dice = Dice(seed)
    level = dice.power(-5.0, -1.0)
    made = Arrangement(2, level)
    arrange = dice.weighted(ARRANGEMENTS)
    dice.say(f"{arrange.__name__.replace('_', ' ')} of revolution:")
    arrange(dice, made)
    _put_beside_axis(dice, made)
    bodies = {
        name: _body(dice, grown.mesh, dice.power(-2.0, 2.0) if dice.chance(0.4) else 1.0)
        for name, grown in made.bodies.items()
    }
    scene = supported(dice, Scene(bodies, contacts=made.contacts, ties=made.ties), made)
    acting = [
        replace(load, value=(0.0, load.value[-1])) if isinstance(load, TotalForce) else load  # type: ignore[index]
        for load in loads(dice, scene, made)
        if isinstance(load, BodyForce | ThermalStrain) or not is_axis(scene.bodies[load.body], load.surface)
    ]
    scene = with_effects(seed, dice, replace(scene, loads=acting), level)
    along = dice.weighted({0.0: 4.0, 1.0: 4.0, 100.0: 2.0})
    scene = moved(scene, np.eye(2), np.array([0.0, along]))
    if dice.chance(0.4):
        scene = _twisted(dice, scene, level)
    length, force = (dice.power(-6.0, 6.0) if dice.chance(0.5) else 1.0 for _ in range(2))
    dice.say(f"shifted by {along:g}, units {length:.2g} and {force:.2g}")
    if (length, force) != (1.0, 1.0):
        scene = in_units(scene, length, force)
    parts = cut(dice, scene)
    tolerance = dice.weighted(TOLERANCES)
    dice.say(f"tolerance {tolerance}")
    return Sample(seed, ", ".join(dice.words), scene, parts, tolerance)


def _twisted(dice: Dice, scene: Scene, level: float) -> Scene:
    """Let bodies twist: supports, tractions and forces get a part around the axis."""
    dice.say("twisted")
    bodies = {name: replace(part, torsion=True) for name, part in scene.bodies.items()}
    supports = [
        replace(support, value=(*support.value, 0.0 if dice.chance(0.6) else None))
        for support in scene.supports
    ]
    loads: list[Load] = []
    for load in scene.loads:
        size = level * dice.between(-0.3, 0.3)
        match load:
            case TotalForce():
                load = replace(load, moment=size)
            case Traction() | BodyForce() if not callable(load.value):
                load = replace(load, value=(*load.value, size))
            case Traction():
                continue
        loads.append(load)
    foundations = [
        replace(each, stiffness=(*each.stiffness, each.stiffness[-1])) if np.ndim(each.stiffness) else each  # type: ignore[misc]
        for each in scene.foundations
    ]
    return replace(scene, bodies=bodies, supports=supports, loads=loads, foundations=foundations)


def _put_beside_axis(dice: Dice, made: Arrangement) -> None:
    """Shift everything outwards until the innermost body reaches the axis, or is a ring."""
    bore = dice.weighted({0.0: 1.0, dice.power(-2.0, 1.0): 1.0})
    dice.say(f"bore {bore:.3g}")
    out = bore - min(float(grown.mesh.points[:, 0].min()) for grown in made.bodies.values())
    made.bodies = {name: in_plane(grown, 0.0, np.array([out])) for name, grown in made.bodies.items()}
    for number, pair in enumerate(made.contacts):
        match pair.master:
            case RigidPlane() as plane:
                place = (plane.point[0] + out, plane.point[1])
                made.contacts[number] = replace(pair, master=replace(plane, point=place))
            case RigidSphere() as ball:
                made.contacts[number] = replace(pair, master=replace(ball, centre=(0.0, ball.centre[1])))


def _material(dice: Dice, modulus: float) -> Material:
    ratio = dice.weighted(RATIOS)
    expansion = 1e-3 if dice.chance(0.2) else None
    wound = dice.chance(0.2)
    dice.say(f"E={modulus:.3g} nu={ratio}{' wound' if wound else ''}")
    if not wound:
        return IsotropicElasticity(modulus, ratio, expansion)
    angle = dice.between(0.0, 3.0)
    c, s = float(np.cos(angle)), float(np.sin(angle))
    moduli, shear = (modulus, 0.5 * modulus, 0.2 * modulus), (0.2 * modulus, 0.15 * modulus, 0.1 * modulus)
    axes = ((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0))
    return OrthotropicElasticity(moduli, (0.2, 0.25, 0.3), shear, axes)


def _body(dice: Dice, mesh: BodyMesh, modulus: float) -> Body:
    return in_halves(dice, mesh, lambda factor: _material(dice, factor * modulus), axisymmetric=True)
