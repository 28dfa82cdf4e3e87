"""From a seed to a small scene: everything that users combine, combined at random.

Built in the plane or in space with lengths and stresses about one, then turned, shifted and written in other
units. Scenes stay so small that most are solved in less than half a second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ElasticFoundation,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Roller,
    Scene,
    Support,
    ThermalStrain,
    TotalForce,
    Traction,
    box_partition,
)
from fenics_contact.materials import OrthotropicElasticity, OrthotropicPlaneStress
from fenics_contact.materials.elastic import can_expand
from fenics_contact.mesh import bisection_partition
from tests.scenes import Load
from tools.hard_cases.transform import in_units
from tools.random_scenes.arrangements import ARRANGEMENTS, Arrangement
from tools.random_scenes.bodies import body, with_surface
from tools.random_scenes.dice import Dice
from tools.random_scenes.effects import may_be_oblique, with_effects
from tools.random_scenes.whole import on_axis

#: Weights of tolerances: the default, a number as for derivatives, and a small one.
TOLERANCES = {None: 6.0, 1e-6: 2.5, 1e-8: 1.5}


@dataclass(frozen=True)
class Sample:
    """A scene and how it shall be solved.

    Attributes:
        seed: Where it comes from.
        words: What it is.
        scene: The scene.
        cut: Subdomain of every cell of every body, None for the default.
        tolerance: None for the default.
        plain: The same scene before it was turned, whose supports hold components; None if those of the
            scene do.
        turn: How it was turned, shape (dim, dim).
    """

    seed: int
    words: str
    scene: Scene
    cut: Mapping[str, np.ndarray] | None
    tolerance: float | None
    plain: Scene | None = None
    turn: np.ndarray | None = None

    @property
    def unturned(self) -> Sample:
        """The scene with supports that hold components."""
        return self if self.plain is None else replace(self, scene=self.plain, plain=None, turn=None)


def sample(seed: int) -> Sample:
    """Return the scene of a seed, the same on every machine."""
    dice = Dice(seed)
    dim = dice.weighted({2: 4.0, 3: 6.0})
    dice.say("plane" if dim == 2 else "space")
    level = dice.power(-5.0, -1.0)
    made = Arrangement(dim, level)
    arrange = dice.weighted(ARRANGEMENTS)
    dice.say(f"{arrange.__name__.replace('_', ' ')}:")
    arrange(dice, made)
    bodies = {
        name: body(dice, grown.mesh, dice.power(-2.0, 2.0) if dice.chance(0.4) else 1.0)
        for name, grown in made.bodies.items()
    }
    scene = Scene(bodies, contacts=made.contacts, ties=made.ties)
    scene = supported(dice, scene, made)
    scene = replace(scene, loads=loads(dice, scene, made))
    scene = with_effects(seed, dice, scene, level)
    scene, plain, turn = _placed(dice, scene, rollers=may_be_oblique(seed))
    parts = cut(dice, scene)
    tolerance = dice.weighted(TOLERANCES)
    dice.say(f"tolerance {tolerance}")
    return Sample(seed, ", ".join(dice.words), scene, parts, tolerance, plain, turn)


# -------------------------------------------------------------------------------------------------- supports


def supported(dice: Dice, scene: Scene, made: Arrangement) -> Scene:
    for index, name in enumerate(made.bodies):
        upper = made.floor or index > 0
        kinds = UPPER if upper else LOWER
        for _ in range(2 if dice.chance(0.2) else 1):
            scene = dice.weighted(kinds)(dice, scene, made, name)
        if all(support.body != name for support in scene.supports) and dice.chance(0.6):
            scene = _guided(dice, scene, made, name)
    return scene


def _no_support(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    dice.say(f"{name} free")
    return scene


def _clamped(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    side = _side(dice, made, name) if dice.chance(0.2) else _bottom(made, name)
    dice.say(f"{name} clamped at {side}")
    return _held(dice, scene, name, side, (0.0,) * scene.dim)


def _roller(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    """Hold some sides in the direction of their normals."""
    mesh = made.bodies[name].mesh
    count = 1 + int(dice.random.integers(scene.dim))
    axes = dice.random.permutation(scene.dim)[:count]
    for axis in sorted(int(a) for a in axes):
        side = f"{'xyz'[axis]}0"
        if side not in mesh.surfaces or (axis == scene.dim - 1 and made.floor):
            side = made.bodies[name].above if axis == scene.dim - 1 else next(iter(mesh.surfaces))
        value: list[float | None] = [None] * scene.dim
        value[axis] = 0.0
        dice.say(f"{name} roller {side}")
        scene = _held(dice, scene, name, side, tuple(value))
    return scene


def _guided(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    """Leave a body no way but up and down, so that contact alone has to carry it."""
    mesh = made.bodies[name].mesh
    for axis in range(scene.dim - 1):
        side = f"{'xyz'[axis]}0" if f"{'xyz'[axis]}0" in mesh.surfaces else "side"
        value: list[float | None] = [None] * scene.dim
        value[axis] = 0.0
        dice.say(f"guided on {side}")
        scene = _held(dice, scene, name, side, tuple(value))
    return scene


def _patch(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    """Hold a single facet, in some directions or all."""
    mesh = scene.bodies[name].mesh
    side = dice.one_of(sorted(mesh.surfaces))
    facet = int(dice.random.integers(len(mesh.surfaces[side])))
    patch = f"patch{len(scene.supports)}"
    old = scene.bodies[name]
    body_ = replace(old, mesh=with_surface(mesh, patch, mesh.surfaces[side][facet : facet + 1]))
    value = tuple(0.0 if dice.chance(0.6) else None for _ in range(scene.dim))
    if not any(v is not None for v in value):
        value = (0.0,) * scene.dim
    dice.say(f"{name} one facet of {side} held {_pattern(value)}")
    return _held(dice, replace(scene, bodies={**scene.bodies, name: body_}), name, patch, value)


def _pushed(dice: Dice, scene: Scene, made: Arrangement, name: str) -> Scene:
    """Prescribe the motion of the top, in some directions or all."""
    grown = made.bodies[name]
    size = made.level * float((grown.high - grown.low)[-1])
    way = size * np.append(dice.random.uniform(-1.0, 1.0, size=scene.dim - 1), -dice.between(0.2, 2.0))
    if dice.chance(0.15):
        way[-1] *= -1.0
    free = [dice.chance(0.4) for _ in way[:-1]] + [dice.chance(0.05)]
    value = tuple(None if f else float(w) for f, w in zip(free, way, strict=True))
    if all(free):
        value = (*value[:-1], float(way[-1]))
    dice.say(f"{name} top moved {_pattern(value)}")
    return _held(dice, scene, name, grown.above, value)


def _pattern(value: tuple[float | None, ...]) -> str:
    return "(" + " ".join("-" if v is None else f"{v:.2g}" for v in value) + ")"


def _held(dice: Dice, scene: Scene, name: str, side: str, value: tuple[float | None, ...]) -> Scene:
    """Add a support, but mostly not where another one contradicts it."""
    added = replace(scene, supports=[*scene.supports, Support(name, side, value)])
    if _contradicting(added, name) and dice.chance(0.97):
        dice.say("(not: contradicts another)")
        return scene
    return added


def _contradicting(scene: Scene, name: str) -> bool:
    mesh = scene.bodies[name].mesh
    low, high = np.full(mesh.points.shape, np.inf), np.full(mesh.points.shape, -np.inf)
    if scene.axisymmetric:
        axis = on_axis(mesh.points)
        low[axis, 0] = high[axis, 0] = 0.0
    for support in scene.supports:
        if support.body == name:
            nodes = np.unique(mesh.surfaces[support.surface])
            for component, value in enumerate(support.value):
                if value is not None:
                    assert not callable(value)
                    low[nodes, component] = np.minimum(low[nodes, component], value)
                    high[nodes, component] = np.maximum(high[nodes, component], value)
    return bool(np.any(low < high))


def _bottom(made: Arrangement, name: str) -> str:
    return made.bodies[name].above if made.floor else made.bodies[name].below


def _side(dice: Dice, made: Arrangement, name: str) -> str:
    return dice.one_of(sorted(made.bodies[name].mesh.surfaces))


Support_ = Callable[[Dice, Scene, Arrangement, str], Scene]
LOWER: dict[Support_, float] = {_clamped: 7.0, _roller: 3.0, _patch: 1.0, _no_support: 0.6}
UPPER: dict[Support_, float] = {_no_support: 3.5, _pushed: 3.5, _roller: 3.0, _patch: 0.7, _clamped: 0.5}

# ----------------------------------------------------------------------------------------------------- loads


def loads(dice: Dice, scene: Scene, made: Arrangement) -> list[Load]:
    loads: list[Load] = []
    for index, name in enumerate(made.bodies):
        share = 0.7 if index == len(made.bodies) - 1 else 0.2
        while dice.chance(share) and len(loads) < 4:
            kind = dice.weighted(LOADS)
            loads += kind(dice, scene, made, name)
            share = 0.2
    if not loads:
        dice.say("no load")
    return loads


def _push(dice: Dice, scene: Scene, made: Arrangement) -> np.ndarray:
    """Return a traction, mostly downwards, often oblique."""
    value = np.zeros(scene.dim)
    value[-1] = -dice.between(0.3, 2.0)
    if dice.chance(0.5):
        value[:-1] = dice.one_of((0.15, 0.15, 0.8)) * dice.random.uniform(-1.0, 1.0, size=scene.dim - 1)
    if dice.chance(0.05):
        value[-1] *= -1.0
    return made.level * value


def _traction(dice: Dice, scene: Scene, made: Arrangement, name: str) -> list[Load]:
    side = made.bodies[name].above if dice.chance(0.75) else _side(dice, made, name)
    value = _push(dice, scene, made)
    dice.say(f"traction {_pattern(tuple(value))} on {side} of {name}")
    if dice.chance(0.2):
        slope = dice.random.uniform(-1.0, 1.0, size=scene.dim)
        dice.say("of position")
        return [Traction(name, side, lambda x: np.outer(1.0 + np.sin(x @ slope), value))]
    return [Traction(name, side, tuple(value))]


def _total(dice: Dice, scene: Scene, made: Arrangement, name: str) -> list[Load]:
    side, value = made.bodies[name].above, _push(dice, scene, made)
    dice.say(f"force {_pattern(tuple(value))} on {side} of {name}")
    return [TotalForce(name, side, tuple(value))]


def _pressure(dice: Dice, scene: Scene, made: Arrangement, name: str) -> list[Load]:
    side = made.bodies[name].above if dice.chance(0.6) else _side(dice, made, name)
    value = made.level * dice.between(0.2, 2.0)
    dice.say(f"pressure {value:.2g} on {side} of {name}")
    return [Pressure(name, side, value)]


def _weight(dice: Dice, scene: Scene, made: Arrangement, name: str) -> list[Load]:
    value = 0.5 * _push(dice, scene, made)
    dice.say(f"body force {_pattern(tuple(value))} on {name}")
    return [BodyForce(name, tuple(value))]


def _heat(dice: Dice, scene: Scene, made: Arrangement, name: str) -> list[Load]:
    if not all(can_expand(material) for material in scene.bodies[name].materials):
        return _traction(dice, scene, made, name)
    change = 1e3 * made.level * dice.between(-1.0, 1.0)
    dice.say(f"{name} {change:.2g} degrees warmer")
    return [ThermalStrain(name, change)]


Load_ = Callable[[Dice, Scene, Arrangement, str], list[Load]]
LOADS: dict[Load_, float] = {_traction: 5.0, _total: 2.0, _pressure: 2.0, _weight: 2.0, _heat: 1.5}

# ----------------------------------------------------------------------------------------- places and units


def _placed(dice: Dice, scene: Scene, rollers: bool) -> tuple[Scene, Scene | None, np.ndarray | None]:
    """Turn and shift the scene, and write it in other units.

    `rollers`: whether supports of single components may be turned by any angle, as rollers.

    Returns the scene, the same one unturned if it has such rollers, and how it was turned.
    """
    kind = dice.weighted({"as built": 4.0, "turned by quarters": 2.0, "turned": 4.0})
    turn = {
        "as built": lambda: np.eye(scene.dim),
        "turned by quarters": lambda: dice.quarter_turn(scene.dim),
        "turned": lambda: dice.turn(scene.dim),
    }[kind]()
    open_ = any(None in support.value for support in scene.supports)
    along_axes = any(np.ndim(foundation.stiffness) for foundation in scene.foundations)
    rollers = rollers and open_ and kind == "turned" and not along_axes
    if kind == "turned" and (along_axes or open_) and not rollers:
        kind, turn = "turned by quarters", dice.quarter_turn(scene.dim)
    far = dice.weighted({0.0: 4.0, 1.0: 4.0, 100.0: 1.5, 1e4: 0.5})
    shift = far * dice.direction(scene.dim)
    dice.say(f"{kind}{' on rollers' if rollers else ''}, shifted by {far:g}")
    placed = [moved(scene, turn, shift)]
    if rollers:
        placed.append(moved(_turned_back(scene, turn), np.eye(scene.dim), turn.T @ shift))
    length = dice.power(-6.0, 6.0) if dice.chance(0.5) else 1.0
    force = dice.power(-6.0, 6.0) if dice.chance(0.5) else 1.0
    dice.say(f"units {length:.2g} and {force:.2g}")
    if (length, force) != (1.0, 1.0):
        placed = [in_units(each, length, force) for each in placed]
    return (placed[0], placed[1], turn) if rollers else (placed[0], None, None)


def _turned_back(scene: Scene, turn: np.ndarray) -> Scene:
    """Return the scene with axes of materials that are turned the other way: `moved` leaves them in space."""

    def material(given: Any) -> Any:
        match given:
            case dict():
                return {region: material(part) for region, part in given.items()}
            case OrthotropicElasticity():
                axes = np.array(given.orientation) @ turn
                return replace(given, orientation=tuple(map(tuple, axes)))
            case OrthotropicPlaneStress():
                return replace(given, angle=given.angle - float(np.arctan2(turn[1, 0], turn[0, 0])))
        return given

    bodies = {name: Body(part.mesh, material(part.material)) for name, part in scene.bodies.items()}
    return replace(scene, bodies=bodies)


def moved(scene: Scene, turn: np.ndarray, shift: np.ndarray) -> Scene:
    """Return a scene turned about the origin, then shifted."""

    def place(points: np.ndarray) -> np.ndarray:
        return np.asarray(points @ turn.T + shift)

    bodies = {
        name: replace(part, mesh=part.mesh.moved(place(part.mesh.points)))
        for name, part in scene.bodies.items()
    }
    return replace(
        scene,
        bodies=bodies,
        supports=[turned for support in scene.supports for turned in _turned_supports(support, turn)],
        loads=[_turned_load(load, turn, shift) for load in scene.loads],
        contacts=[_turned_pair(pair, turn, place) for pair in scene.contacts],
        foundations=[_turned_foundation(foundation, turn) for foundation in scene.foundations],
    )


def _turned_foundation(foundation: ElasticFoundation, turn: np.ndarray) -> ElasticFoundation:
    if not np.ndim(foundation.stiffness):
        return foundation
    return replace(foundation, stiffness=tuple(np.abs(turn) @ np.array(foundation.stiffness)))


def _turned_supports(support: Support, turn: np.ndarray) -> list[Support | Roller]:
    """Return a support turned; one that leaves components open as rollers, unless axes remain axes."""
    if None not in support.value:
        return [replace(support, value=tuple(turn @ np.array(support.value, dtype=float)))]
    axes = np.abs(turn).argmax(axis=1)
    if not np.allclose(np.abs(turn)[np.arange(len(turn)), axes], 1.0):
        return [
            Roller(support.body, support.surface, value, tuple(turn[:, axis]))
            for axis, value in enumerate(support.value)
            if value is not None
        ]
    values = [
        None if support.value[axis] is None else float(turn[row, axis] * support.value[axis])  # type: ignore[operator]
        for row, axis in enumerate(axes)
    ]
    return [replace(support, value=tuple(values))]


def _turned_load(load: Any, turn: np.ndarray, shift: np.ndarray) -> Any:
    if isinstance(load, Pressure | ThermalStrain):
        return load
    if callable(load.value):
        value = load.value
        return replace(load, value=lambda x: value((x - shift) @ turn) @ turn.T)
    return replace(load, value=tuple(turn @ np.array(load.value)))


def _turned_pair(
    pair: ContactPair, turn: np.ndarray, place: Callable[[np.ndarray], np.ndarray]
) -> ContactPair:
    def put(point: Any) -> tuple[float, ...]:
        return tuple(place(np.array(point)))

    match pair.master:
        case RigidPlane() as plane:
            return replace(pair, master=RigidPlane(put(plane.point), tuple(turn @ np.array(plane.normal))))
        case RigidSphere() as ball:
            return replace(pair, master=replace(ball, centre=put(ball.centre)))
        case RigidCylinder() as bar:
            axis = tuple(turn @ np.array(bar.axis))
            return replace(pair, master=replace(bar, point=put(bar.point), axis=axis))
    return pair


# ------------------------------------------------------------------------------------------------ partitions


def cut(dice: Dice, scene: Scene) -> dict[str, np.ndarray] | None:
    kind = dice.weighted({"default": 3.0, "boxes": 2.5, "bisected": 2.0, "graph": 2.5})
    if kind == "default":
        dice.say("default partition")
        return None
    cut = {}
    for name, part in scene.bodies.items():
        parts = min(1 + int(dice.random.integers(8)), part.mesh.n_cells)
        if kind == "boxes" and part.mesh.grid is not None:
            layers = part.mesh.grid.max(axis=0) + 1
            boxes = tuple(int(min(dice.one_of((1, 2, 2, 3)), m)) for m in layers)
            cut[name] = box_partition(part.mesh, boxes)
        elif kind == "graph":
            cut[name] = graph_partition(part.mesh, parts, name)
        else:
            cut[name] = bisection_partition(part.mesh, parts)
    dice.say(f"{kind} {'/'.join(str(len(np.unique(part))) for part in cut.values())}")
    return cut
