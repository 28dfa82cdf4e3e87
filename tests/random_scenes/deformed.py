"""From a seed to a small history of large deformations: rubber and metal, sliding, tools, cycles, folds.

A recipe holds plain numbers; built in another frame, cut into other subdomains or on other ranks it must have
the same answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.gallery import half_disc, hemisphere, rectangle
from fenics_contact.mesh import BodyMesh, quadratic
from fenics_contact.partition import bisection_partition, graph_partition
from fenics_contact.scene import (
    AnySupport,
    Body,
    ContactPair,
    Coulomb,
    FinitePlasticity,
    Friction,
    IsotropicElasticity,
    J2Plasticity,
    Load,
    LoadStep,
    Material,
    MooneyRivlin,
    MovingObstacle,
    NeoHooke,
    Ogden,
    PlaneStrain,
    Pressure,
    RigidCylinder,
    RigidObstacle,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    Scene,
    StVenantKirchhoff,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
)
from tests.random_scenes.dice import Dice
from tests.random_scenes.frame import Frame

Built = tuple[Scene, list[LoadStep]]


@dataclass(frozen=True)
class Recipe:
    """A history that can be built in any frame.

    Attributes:
        dim: 2 or 3.
        build: Returns scene and load steps in a frame.
        open: Whether supports leave components open, so that a frame may be turned by quarters only.
        held: Whether something holds every body.
        remembers: Whether forces depend on the way: metal, friction, loads that follow.
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


# -------------------------------------------------------------------------------------------------- materials

Made = Callable[[Frame], Material]


def _rubber(dice: Dice, dim: int, size: float, mesh: BodyMesh) -> tuple[Made, bool]:
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


def _metal(dice: Dice, dim: int, size: float, mesh: BodyMesh, small: bool = True) -> tuple[Made, bool]:
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


def _linear(dice: Dice, dim: int, size: float, mesh: BodyMesh) -> tuple[Made, bool]:
    dice.say(f"linear E={size:.3g}")
    law = PlaneStrain if dim == 2 else IsotropicElasticity
    return lambda f: law(size * f.stress_unit, 0.3), False


def _material(
    dice: Dice, dim: int, mesh: BodyMesh, size: float = 1.0, *, soft: bool = False
) -> tuple[Made, bool]:
    weights = {_rubber: 5.0} if soft else {_rubber: 5.0, _metal: 2.0, _linear: 0.7}
    return dice.weighted(weights)(dice, dim, size, mesh)


def _friction(dice: Dice) -> tuple[Friction, bool]:
    law = dice.weighted({None: 3.0, Coulomb(0.2): 2.0, Coulomb(0.5): 2.0, Coulomb(1.0): 0.5})
    dice.say(f"friction {law.friction_coefficient}" if law else "frictionless")
    return law, law is not None


# ----------------------------------------------------------------------------------------------------- bodies


def _pad(dice: Dice, dim: int, low: Sequence[float], high: Sequence[float], across: int) -> BodyMesh:
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
    from fenics_contact.gallery import box_lattice, rectangle_lattice

    ticks = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    mesh = (rectangle_lattice if dim == 2 else box_lattice)(ticks, lattice_cell)
    return mesh if cell == lattice_cell else quadratic(mesh)


def _round(dice: Dice, dim: int, radius: float) -> BodyMesh:
    """Mesh half a disc or ball, its pole at the origin, with or without its true shape."""
    n = dice.one_of((3, 4, 5) if dim == 2 else (2, 3))
    mesh = (half_disc if dim == 2 else hemisphere)(radius, n)
    true = dice.chance(0.6)
    dice.say(f"half a {'disc' if dim == 2 else 'ball'} n={n}{' of true shape' if true else ''}")
    if dice.chance(0.2):
        mesh = quadratic(mesh)
        dice.say("quadratic")
    return mesh if true else mesh.with_shapes({})


def _sides(dim: int) -> tuple[str, str]:
    return ("y0", "y1") if dim == 2 else ("z0", "z1")


def _vector(dim: int, along: float, up: float, aside: float = 0.0) -> tuple[float, ...]:
    return (along, up) if dim == 2 else (along, aside, up)


def _stages(dice: Dice, depth: float, way: float) -> list[tuple[float, float]]:
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


# ------------------------------------------------------------------------------------------------------ kinds


def tool_on_pad(dice: Dice, dim: int) -> Recipe:
    """A rigid tool that moves is pressed into a pad, drawn along it, and lifted."""
    pad = _pad(dice, dim, (0.0,) * dim, _vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9, 11)))
    made, plastic = (
        _metal(dice, dim, 1.0, pad, small=False) if dice.chance(0.25) else _rubber(dice, dim, 1.0, pad)
    )
    law, rubs = _friction(dice)
    radius, depth, way = dice.between(0.5, 1.5), dice.between(0.05, 0.2), dice.between(0.1, 0.6)
    shape = dice.weighted({"plane": 1.0, "ball": 3.0, "bar": 1.0 if dim == 3 else 0.0})
    turns = dice.one_of((0.0, 0.0, 0.5)) if shape != "plane" else 0.0
    start = _vector(dim, dice.between(1.0, 2.0), 1.0, 0.5)
    dice.say(f"rigid {shape} of {radius:.3g}{' that turns' if turns else ''}")
    ends = [(0.0, 0.0), *_stages(dice, depth, way)]
    bottom, top = _sides(dim)

    def build(frame: Frame) -> Built:
        centre = np.add(start, _vector(dim, 0.0, radius))
        tool: RigidObstacle
        if shape == "plane":
            tool = RigidPlane(frame.point(start), frame.along(_vector(dim, 0.0, -1.0)))
        elif shape == "ball":
            tool = RigidSphere(frame.point(centre), frame.length * radius)
        else:
            tool = RigidCylinder(frame.point(centre), frame.along((0.0, 1.0, 0.0)), frame.length * radius)

        def path(time: float) -> tuple[object, object]:
            number = np.arange(len(ends))
            x, d = (float(np.interp(time, number, values)) for values in zip(*ends, strict=True))
            shift = np.asarray(frame.along(_vector(dim, x, -d), frame.length))
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
    bed = _pad(dice, dim, (0.0,) * dim, _vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9, 13)))
    upper = _pad(dice, dim, _vector(dim, 0.9, 1.0, 0.1), _vector(dim, 1.9, 1.8, 0.8), dice.one_of((3, 5, 7)))
    below, plastic = _material(dice, dim, bed)
    above, more = _material(dice, dim, upper, dice.one_of((1.0, 3.0, 30.0)), soft=True)
    law, rubs = _friction(dice)
    depth, way, turn = dice.between(0.03, 0.12), dice.between(0.05, 0.3), dice.between(-0.1, 0.1)
    remote, kind = dice.chance(0.35), _chosen(dice, bed, upper)
    lower_slave = dice.chance(0.15)
    dice.say(f"{'by a remote point' if remote else 'by its top'}{', bed is slave' if lower_slave else ''}")
    ends = _stages(dice, depth, way)
    bottom, top = _sides(dim)

    def build(frame: Frame) -> Built:
        def supports(along: float, down: float) -> list[AnySupport]:
            motion = frame.way(_vector(dim, along, -down))
            if not remote:
                return [Support("bed", bottom), Support("slider", top, motion)]
            angle = turn * down / depth
            spin = angle if dim == 2 else frame.along((0.0, angle, 0.0))
            at = frame.point(_vector(dim, 1.4, 2.5, 0.45))
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
    bed = _pad(
        dice, dim, _vector(dim, -1.5, -1.0, -0.5), _vector(dim, 1.5, 0.0, 0.5), dice.one_of((7, 9, 13))
    )
    ball = _round(dice, dim, 1.0)
    below, plastic = _material(dice, dim, bed)
    above, more = _material(dice, dim, ball, dice.one_of((1.0, 10.0)), soft=True)
    law, rubs = _friction(dice)
    depth, way, roll = dice.between(0.03, 0.12), dice.between(0.05, 0.3), dice.one_of((0.0, 0.0, 0.2))
    kind = _chosen(dice, bed, ball)
    ends = _stages(dice, depth, way)
    dice.say("rolled" if roll else "not turned")
    bottom, top = _sides(dim)

    def build(frame: Frame) -> Built:
        def supports(along: float, down: float) -> list[AnySupport]:
            motion = frame.way(_vector(dim, along, -down))
            angle = -roll * along / way
            spin = angle if dim == 2 else frame.along((0.0, -angle, 0.0))
            at = frame.point(_vector(dim, 0.0, 1.0))
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
    mesh = _part(whole, keep)
    made, plastic = _rubber(dice, 2, 1.0, mesh)
    law, rubs = _friction(dice)
    ends = [dice.between(0.15, 0.3), dice.between(0.3, 0.45)]
    whole_slot = dice.chance(0.5)
    dice.say(
        f"slot of {1.4 / rows:.2g} pressed by {ends[-1]:.2g}, {'one surface' if whole_slot else 'two'}"
    )
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


def _part(whole: BodyMesh, keep: np.ndarray) -> BodyMesh:
    """Return some cells of a plane mesh; new rims are "slot", and above and below "roof" and "ground"."""
    from fenics_contact.mesh import boundary_faces

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
    return BodyMesh(points, cells, {**old, "slot": slot, "roof": roof, "ground": ground, "tip": tip})


def blown_on_plane(dice: Dice, dim: int) -> Recipe:
    """A pad on a plane under a pressure that follows, in cycles, drawn by a shear."""
    pad = _pad(dice, dim, (0.0,) * dim, _vector(dim, 2.0, 1.0, 1.0), dice.one_of((5, 7, 9)))
    made, _ = _material(dice, dim, pad)
    law, _ = _friction(dice)
    pressure, dead = dice.between(0.005, 0.03), dice.chance(0.3)
    gap = dice.one_of((0.0, 0.0, 0.02))
    up = dice.chance(0.5)
    dice.say(
        f"pressure {pressure:.3g}{' dead' if dead else ''}, gap {gap}{', two levels and back' if up else ''}"
    )
    bottom, top = _sides(dim)
    levels = [1.0, 2.0, 0.5] if up else [1.0]
    rollers = dice.chance(0.5)

    def build(frame: Frame) -> Built:
        def loads(level: float) -> list[Load]:
            return [Pressure("pad", top, level * pressure * frame.stress_unit, dead=dead)]

        plane = RigidPlane(frame.point(_vector(dim, 0.0, -gap)), frame.along(_vector(dim, 0.0, 1.0)))
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
    bed = _pad(dice, dim, (0.0,) * dim, _vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9)))
    upper = _pad(dice, dim, _vector(dim, 0.9, 1.0, 0.1), _vector(dim, 1.9, 1.8, 0.8), dice.one_of((3, 5)))
    below, plastic = _material(dice, dim, bed)
    above, more = _material(dice, dim, upper, soft=True)
    law, rubs = _friction(dice)
    guided = dice.chance(0.6) or law is None
    unheld = dice.chance(0.12)
    size, shear = dice.between(0.01, 0.05), dice.between(-0.05, 0.05)
    kind = _chosen(dice, bed, upper)
    total = dice.chance(0.5)
    dice.say("unheld" if unheld else "guided" if guided else "held by friction")
    dice.say(f"{'force' if total else 'traction'} {size:.2g}")
    bottom, top = _sides(dim)
    levels = dice.one_of(([1.0], [1.0, 2.0], [1.0, 2.0, 0.3]))

    def build(frame: Frame) -> Built:
        def loads(level: float) -> list[Load]:
            push = _vector(dim, 0.0 if guided and not unheld else shear * size, -size)
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

    return Recipe(dim, build, open=guided, held=not unheld, remembers=plastic or more or rubs)


def tie_beside_contact(dice: Dice, dim: int) -> Recipe:
    """Half of a surface is tied, its other half may slide and open."""
    bed = _pad(dice, dim, (0.0,) * dim, _vector(dim, 3.0, 1.0, 1.0), dice.one_of((7, 9)))
    upper = _pad(dice, dim, _vector(dim, 0.3, 1.0, 0.1), _vector(dim, 2.7, 1.8, 0.9), dice.one_of((5, 7)))
    facets = bed.surfaces[_sides(dim)[1]]
    left = bed.points[facets].mean(axis=1)[:, 0] < 1.5
    bed = replace(bed, surfaces={**bed.surfaces, "tied": facets[left], "loose": facets[~left]})
    below, _ = _material(dice, dim, bed)
    above, _ = _material(dice, dim, upper, soft=True)
    law, _ = _friction(dice)
    sliding = dice.chance(0.3)
    lift = dice.one_of((-0.05, 0.05))
    kind = _chosen(dice, bed, upper) if bed.order == upper.order == 1 else {"discretisation": "node"}
    dice.say(f"{'sliding ' if sliding else ''}tie, {'pressed' if lift > 0 else 'lifted'}")
    bottom, top = _sides(dim)

    def build(frame: Frame) -> Built:
        def supports(down: float) -> list[AnySupport]:
            return [Support("bed", bottom), Support("upper", top, frame.way(_vector(dim, 0.3 * down, -down)))]

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
