"""From a seed to a small history of large deformations: rubber and metal, sliding, tools, cycles, folds.

A recipe holds plain numbers; built in another frame, cut into other subdomains or on other ranks it must have
the same answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    Scene,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
)
from fenics_contact.gallery import rectangle
from fenics_contact.mesh import bisection_partition
from tests.scenes import AnySupport, Load, RigidObstacle
from tools.random_scenes.deformed_parts import (
    any_material,
    friction_law,
    metal,
    pad_mesh,
    round_mesh,
    rubber,
    sides,
    slotted,
    stages,
    vector,
)
from tools.random_scenes.dice import Dice
from tools.random_scenes.frame import Frame

Built = tuple[Scene, list[LoadStep]]


@dataclass(frozen=True)
class Recipe:
    """A history that can be built in any frame.

    Attributes:
        dim: 2 or 3.
        build: Returns scene and load steps in a frame.
        open: Whether supports leave components open, so that a frame may be turned by quarters only.
        held: Whether something holds every body.
        remembers: Whether forces depend on more than the last displacement: metal, friction, loads.
    """

    dim: int
    build: Callable[[Frame], Built]
    open: bool = False
    held: bool = True
    remembers: bool = False


@dataclass(frozen=True)
class History:
    """A recipe, and another frame and partition in which its answer must be the same.

    Attributes:
        seed: Where it comes from.
        words: What it is.
        recipe: What is built.
        frame: Another frame.
        pieces: Kind and number of subdomains of every body, of the first solution and of the second; None for
            the default.
    """

    seed: int
    words: str
    recipe: Recipe
    frame: Frame
    pieces: tuple[tuple[str, int] | None, tuple[str, int]]


def history(seed: int) -> History:
    """Return the history of a seed, the same on every machine."""
    dice = Dice(seed)
    dim = dice.weighted({2: 7.0, 3: 3.0})
    kind = dice.weighted(KINDS)
    dim = 2 if kind is fold else dim
    dice.say("plane" if dim == 2 else "space")
    dice.say(f"{kind.__name__.replace('_', ' ')}:")
    recipe = kind(dice, dim)
    quarters = recipe.open or dice.chance(0.3)
    frame = Frame(
        dice.quarter_turn(dim) if quarters else dice.turn(dim),
        dice.weighted({0.0: 3.0, 1.0: 3.0, 100.0: 1.0}) * dice.direction(dim),
        dice.power(-4.0, 4.0) if dice.chance(0.5) else 1.0,
        dice.power(-4.0, 4.0) if dice.chance(0.5) else 1.0,
    )
    dice.say(
        f"{'turned by quarters' if quarters else 'turned'}, units {frame.length:.2g} and {frame.force:.2g}"
    )
    first = dice.weighted({None: 3.0, ("bisected", 1): 1.0, ("graph", 3): 1.0})
    second = (dice.one_of(("bisected", "graph")), 2 + int(dice.random.integers(5)))
    dice.say(f"cut {first or 'as default'} and {second}")
    return History(seed, ", ".join(dice.words), recipe, frame, (first, second))


def cut(scene: Scene, pieces: tuple[str, int] | None) -> dict[str, np.ndarray] | None:
    """Return the subdomain of every cell of every body; None for the default."""
    if pieces is None:
        return None
    kind, number = pieces
    found = {}
    for name, body in scene.bodies.items():
        few = min(number, body.mesh.n_cells)
        found[name] = (
            graph_partition(body.mesh, few, name) if kind == "graph" else bisection_partition(body.mesh, few)
        )
    return found


def tool_on_pad(dice: Dice, dim: int) -> Recipe:
    """A rigid tool that moves is pressed into a pad, drawn along it, and lifted."""
    pad = pad_mesh(dice, dim, (0.0,) * dim, vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9, 11)))
    made, plastic = (
        metal(dice, dim, 1.0, pad, small=False) if dice.chance(0.25) else rubber(dice, dim, 1.0, pad)
    )
    law, rubs = friction_law(dice)
    radius, depth, way = dice.between(0.5, 1.5), dice.between(0.05, 0.2), dice.between(0.1, 0.6)
    shape = dice.weighted({"plane": 1.0, "ball": 3.0, "bar": 1.0 if dim == 3 else 0.0})
    turns = dice.one_of((0.0, 0.0, 0.5)) if shape != "plane" else 0.0
    start = vector(dim, dice.between(1.0, 2.0), 1.0, 0.5)
    dice.say(f"rigid {shape} of {radius:.3g}{' that turns' if turns else ''}")
    ends = [(0.0, 0.0), *stages(dice, depth, way)]
    bottom, top = sides(dim)

    def build(frame: Frame) -> Built:
        centre = np.add(start, vector(dim, 0.0, radius))
        tool: RigidObstacle
        if shape == "plane":
            tool = RigidPlane(frame.point(start), frame.along(vector(dim, 0.0, -1.0)))
        elif shape == "ball":
            tool = RigidSphere(frame.point(centre), frame.length * radius)
        else:
            tool = RigidCylinder(frame.point(centre), frame.along((0.0, 1.0, 0.0)), frame.length * radius)

        def path(time: float) -> tuple[object, object]:
            number = np.arange(len(ends))
            x, d = (float(np.interp(time, number, values)) for values in zip(*ends, strict=True))
            shift = np.asarray(frame.along(vector(dim, x, -d), frame.length))
            if not turns:
                return None, tuple(shift)
            c, s = np.cos(turns * time), np.sin(turns * time)
            spin = np.eye(dim)
            spin[np.ix_((0, dim - 1), (0, dim - 1))] = [[c, -s], [s, c]]
            spin = frame.turn @ spin @ frame.turn.T
            middle = np.asarray(frame.point(centre))
            return spin, tuple(middle - spin @ middle + shift)

        pair = ContactPair(Surface("pad", top), MovingObstacle(tool, path), law)
        scene = Scene({"pad": Body(frame.mesh(pad), made(frame))}, [Support("pad", bottom)], contacts=[pair])
        return scene, [LoadStep(str(k), time=float(k)) for k in range(1, len(ends))]

    return Recipe(dim, build, remembers=plastic or rubs)


def slider_on_bed(dice: Dice, dim: int) -> Recipe:
    """A body is pressed on another one and drawn along it, by its top or by a remote point, in cycles."""
    bed = pad_mesh(dice, dim, (0.0,) * dim, vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9, 13)))
    corners = vector(dim, 0.9, 1.0, 0.1), vector(dim, 1.9, 1.8, 0.8)
    upper = pad_mesh(dice, dim, *corners, dice.one_of((3, 5, 7)))
    below, plastic = any_material(dice, dim, bed)
    above, more = any_material(dice, dim, upper, dice.one_of((1.0, 3.0, 30.0)), soft=True)
    law, rubs = friction_law(dice)
    depth, way, turn = dice.between(0.03, 0.12), dice.between(0.05, 0.3), dice.between(-0.1, 0.1)
    remote, kind = dice.chance(0.35), _chosen(dice, bed, upper)
    lower_slave = dice.chance(0.15)
    dice.say(f"{'by a remote point' if remote else 'by its top'}{', bed is slave' if lower_slave else ''}")
    ends = stages(dice, depth, way)
    bottom, top = sides(dim)

    def build(frame: Frame) -> Built:
        def supports(along: float, down: float) -> list[AnySupport]:
            motion = frame.way(vector(dim, along, -down))
            if not remote:
                return [Support("bed", bottom), Support("slider", top, motion)]
            angle = turn * down / depth
            spin = angle if dim == 2 else frame.along((0.0, angle, 0.0))
            at = frame.point(vector(dim, 1.4, 2.5, 0.45))
            return [Support("bed", bottom), RigidSurface("slider", top, at, motion, spin)]

        surfaces = (Surface("slider", bottom), Surface("bed", top))
        slave, master = surfaces[::-1] if lower_slave else surfaces
        bodies = {"bed": Body(frame.mesh(bed), below(frame)), "slider": Body(frame.mesh(upper), above(frame))}
        scene = Scene(bodies, supports(*ends[0]), contacts=[ContactPair(slave, master, law, **kind)])
        return scene, [LoadStep(str(k), supports=supports(*end)) for k, end in enumerate(ends)]

    return Recipe(dim, build, remembers=plastic or more or rubs)


def _chosen(dice: Dice, *meshes: BodyMesh) -> dict[str, str]:
    """Choose a discretisation, or leave it to the package."""
    mortar = 1.5 if all(mesh.order == 1 for mesh in meshes) else 0.0
    kind = dice.weighted({"best": 5.0, "node": 1.5, "mortar": mortar})
    dice.say(kind)
    return {"discretisation": kind}


def round_on_bed(dice: Dice, dim: int) -> Recipe:
    """Half a disc or ball is pressed into a bed and rolled or drawn."""
    bed = pad_mesh(
        dice, dim, vector(dim, -1.5, -1.0, -0.5), vector(dim, 1.5, 0.0, 0.5), dice.one_of((7, 9, 13))
    )
    ball = round_mesh(dice, dim, 1.0)
    below, plastic = any_material(dice, dim, bed)
    above, more = any_material(dice, dim, ball, dice.one_of((1.0, 10.0)), soft=True)
    law, rubs = friction_law(dice)
    depth, way, roll = dice.between(0.03, 0.12), dice.between(0.05, 0.3), dice.one_of((0.0, 0.0, 0.2))
    kind = _chosen(dice, bed, ball)
    ends = stages(dice, depth, way)
    dice.say("rolled" if roll else "not turned")
    bottom, top = sides(dim)

    def build(frame: Frame) -> Built:
        def supports(along: float, down: float) -> list[AnySupport]:
            motion = frame.way(vector(dim, along, -down))
            angle = -roll * along / way
            spin = angle if dim == 2 else frame.along((0.0, -angle, 0.0))
            at = frame.point(vector(dim, 0.0, 1.0))
            return [Support("bed", bottom), RigidSurface("ball", "top", at, motion, spin)]

        pair = ContactPair(Surface("ball", "contact"), Surface("bed", top), law, **kind)
        bodies = {"bed": Body(frame.mesh(bed), below(frame)), "ball": Body(frame.mesh(ball), above(frame))}
        scene = Scene(bodies, supports(*ends[0]), contacts=[pair])
        return scene, [LoadStep(str(k), supports=supports(*end)) for k, end in enumerate(ends)]

    return Recipe(dim, build, remembers=plastic or more or rubs)


def fold(dice: Dice, dim: int) -> Recipe:
    """The arms of a slotted block are pressed together until they meet each other."""
    columns, rows = dice.one_of((7, 9, 11)), dice.one_of((5, 7))
    whole = rectangle((0.0, 0.0), (3.0, 1.4), (columns, rows))
    x, y = whole.points[whole.cells].mean(axis=1).T
    keep = ~((np.abs(y - 0.7) < 0.7 / rows + 0.01) & (x > 0.8))
    mesh = slotted(whole, keep)
    made, plastic = rubber(dice, 2, 1.0, mesh)
    law, rubs = friction_law(dice)
    ends = [dice.between(0.15, 0.3), dice.between(0.3, 0.45)]
    whole_slot = dice.chance(0.5)
    dice.say(f"slot of {1.4 / rows:.2g} pressed by {ends[-1]:.2g}, {'one surface' if whole_slot else 'two'}")
    back = dice.chance(0.3)

    def build(frame: Frame) -> Built:
        def supports(down: float) -> list[AnySupport]:
            return [Support("arms", "y0"), Support("arms", "tip", frame.way((0.0, -down)))]

        placed = frame.mesh(mesh)
        slave, master = ("slot", "slot") if whole_slot else ("roof", "ground")
        pair = ContactPair(Surface("arms", slave), Surface("arms", master), law)
        scene = Scene({"arms": Body(placed, made(frame))}, supports(ends[0]), contacts=[pair])
        values = [*ends, 0.1] if back else ends
        return scene, [LoadStep(str(k), supports=supports(end)) for k, end in enumerate(values)]

    return Recipe(2, build, remembers=plastic or rubs)


def blown_on_plane(dice: Dice, dim: int) -> Recipe:
    """A pad on a plane under a pressure that follows, in cycles, drawn by a shear."""
    pad = pad_mesh(dice, dim, (0.0,) * dim, vector(dim, 2.0, 1.0, 1.0), dice.one_of((5, 7, 9)))
    made, _ = any_material(dice, dim, pad)
    law, _ = friction_law(dice)
    pressure, dead = dice.between(0.005, 0.03), dice.chance(0.3)
    gap = dice.one_of((0.0, 0.0, 0.02))
    up = dice.chance(0.5)
    dice.say(
        f"pressure {pressure:.3g}{' dead' if dead else ''}, gap {gap}{', two levels and back' if up else ''}"
    )
    bottom, top = sides(dim)
    levels = [1.0, 2.0, 0.5] if up else [1.0]
    rollers = dice.chance(0.5)

    def build(frame: Frame) -> Built:
        def loads(level: float) -> list[Load]:
            return [Pressure("pad", top, level * pressure * frame.stress_unit, dead=dead)]

        plane = RigidPlane(frame.point(vector(dim, 0.0, -gap)), frame.along(vector(dim, 0.0, 1.0)))
        value = (0.0,) + (None,) * (dim - 1) if rollers else (0.0,) * dim
        held: list[AnySupport] = [Support("pad", "x0", frame.way(value))]
        if rollers and dim == 3:
            held.append(Support("pad", "y0", frame.way((None, 0.0, None))))
        pair = ContactPair(Surface("pad", bottom), plane, law)
        scene = Scene({"pad": Body(frame.mesh(pad), made(frame))}, held, loads(1.0), [pair])
        return scene, [LoadStep(str(level), loads=loads(level)) for level in levels]

    return Recipe(dim, build, open=rollers, remembers=True)


def pressed_by_force(dice: Dice, dim: int) -> Recipe:
    """One body on another under dead forces, with a guide or without: some are not held."""
    bed = pad_mesh(dice, dim, (0.0,) * dim, vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9)))
    upper = pad_mesh(dice, dim, vector(dim, 0.9, 1.0, 0.1), vector(dim, 1.9, 1.8, 0.8), dice.one_of((3, 5)))
    below, _ = any_material(dice, dim, bed)
    above, _ = any_material(dice, dim, upper, soft=True)
    law, _ = friction_law(dice)
    guided = dice.chance(0.6) or law is None
    unheld = dice.chance(0.12)
    size, shear = dice.between(0.01, 0.05), dice.between(-0.05, 0.05)
    kind = _chosen(dice, bed, upper)
    total = dice.chance(0.5)
    dice.say("unheld" if unheld else "guided" if guided else "held by friction")
    dice.say(f"{'force' if total else 'traction'} {size:.2g}")
    bottom, top = sides(dim)
    levels = dice.one_of(([1.0], [1.0, 2.0], [1.0, 2.0, 0.3]))

    def build(frame: Frame) -> Built:
        def loads(level: float) -> list[Load]:
            push = vector(dim, 0.0 if guided and not unheld else shear * size, -size)
            area = 1.0 if dim == 2 else 0.7
            if total:
                return [TotalForce("upper", top, frame.along(push, level * area * frame.force))]
            return [Traction("upper", top, frame.along(push, level * frame.stress_unit))]

        held: list[AnySupport] = [Support("bed", bottom)]
        if guided and not unheld:
            held.append(Support("upper", "x0", frame.way((0.0,) + (None,) * (dim - 1))))
            if dim == 3:
                held.append(Support("upper", "y0", frame.way((None, 0.0, None))))
        pair = ContactPair(Surface("upper", bottom), Surface("bed", top), None if unheld else law, **kind)
        bodies = {"bed": Body(frame.mesh(bed), below(frame)), "upper": Body(frame.mesh(upper), above(frame))}
        scene = Scene(bodies, held, loads(levels[0]), [pair])
        return scene, [LoadStep(str(level), loads=loads(level)) for level in levels]

    return Recipe(dim, build, open=guided, held=not unheld, remembers=True)


def tie_beside_contact(dice: Dice, dim: int) -> Recipe:
    """Half of a surface is tied, its other half may slide and open."""
    bed = pad_mesh(dice, dim, (0.0,) * dim, vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9)))
    upper = pad_mesh(dice, dim, vector(dim, 0.3, 1.0, 0.1), vector(dim, 2.7, 1.8, 0.9), dice.one_of((5, 7)))
    facets = bed.surfaces[sides(dim)[1]]
    left = bed.points[facets].mean(axis=1)[:, 0] < 1.5
    bed = replace(bed, surfaces={**bed.surfaces, "tied": facets[left], "loose": facets[~left]})
    below, _ = any_material(dice, dim, bed)
    above, _ = any_material(dice, dim, upper, soft=True)
    law, _ = friction_law(dice)
    sliding = dice.chance(0.3)
    lift = dice.one_of((-0.05, 0.05))
    kind = _chosen(dice, bed, upper) if bed.order == upper.order == 1 else {"discretisation": "node"}
    dice.say(f"{'sliding ' if sliding else ''}tie, {'pressed' if lift > 0 else 'lifted'}")
    bottom, top = sides(dim)

    def build(frame: Frame) -> Built:
        def supports(down: float) -> list[AnySupport]:
            return [Support("bed", bottom), Support("upper", top, frame.way(vector(dim, 0.3 * down, -down)))]

        bodies = {"bed": Body(frame.mesh(bed), below(frame)), "upper": Body(frame.mesh(upper), above(frame))}
        pair = ContactPair(Surface("bed", "loose"), Surface("upper", bottom), law)
        tie = Tie(Surface("bed", "tied"), Surface("upper", bottom), sliding, **kind)
        scene = Scene(bodies, supports(lift), contacts=[pair], ties=[tie])
        return scene, [LoadStep("1", supports=supports(lift)), LoadStep("2", supports=supports(1.5 * lift))]

    return Recipe(dim, build, remembers=True)


Kind = Callable[[Dice, int], Recipe]
KINDS: dict[Kind, float] = {
    tool_on_pad: 4.0, slider_on_bed: 5.0, round_on_bed: 3.0, fold: 2.0, blown_on_plane: 2.0,
    pressed_by_force: 2.5, tie_beside_contact: 1.5,
}  # fmt: skip
