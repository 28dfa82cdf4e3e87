"""From a seed to a small scene in which several features meet, and another way to write it down.

Rigid surfaces that may turn, equations, springs, beds, ties, laws of closure and load steps that unload, in
any combination. A recipe holds plain numbers; turned, mirrored, in units of 1e-9 or 1e9, with other numbers
of nodes and cut otherwise it must have the same answer, or be refused alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ClosureLaw,
    ClosureTable,
    ConstraintTerm,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    ExponentialClosure,
    LinearClosure,
    LinearConstraint,
    LoadStep,
    Pressure,
    RigidPlane,
    RigidSurface,
    Roller,
    Scene,
    Spring,
    Support,
    Surface,
    Tie,
    TotalForce,
    Tresca,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.scenes import AnySupport, Friction, Load
from tools.hard_cases.transform import renumbered_mesh, turned_mesh
from tools.random_scenes.dice import Dice

Numbers = Sequence[float | None]
Built = tuple[Scene, list[LoadStep]]


@dataclass
class Writing:
    """How a scene is written down: points x lie at length · (R x + shift), R turns or mirrors.

    Attributes:
        turn: R, shape (3, 3).
        shift: Shape (3,).
        length: What a length of one becomes.
        force: What a force of one becomes.
        seed: Of other numbers of nodes; None: as they are.
        node: The number of every node as it is, by body; filled by `mesh`.
    """

    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 1.0
    force: float = 1.0
    seed: int | None = None
    node: dict[str, np.ndarray] = field(default_factory=dict)

    def mesh(self, name: str, mesh: BodyMesh) -> BodyMesh:
        """Return a mesh in its place, with its numbers."""
        self.node[name] = np.arange(mesh.n_nodes)
        if self.seed is not None:
            mesh, self.node[name], _ = renumbered_mesh(mesh, self.seed)
        made = turned_mesh(mesh, self.turn)
        return made.moved(self.length * (made.points + self.shift))

    def point(self, at: Sequence[float]) -> tuple[float, ...]:
        """Return the place of a point."""
        return tuple(map(float, self.length * (self.turn @ np.asarray(at) + self.shift)))

    def along(self, vector: Sequence[float], size: float = 1.0) -> tuple[float, ...]:
        """Return a vector."""
        return tuple(map(float, size * self.turn @ np.asarray(vector)))

    def around(self, vector: Sequence[float], size: float = 1.0) -> tuple[float, ...]:
        """Return a rotation or a moment, whose sense a mirror changes."""
        return self.along(vector, size * float(np.sign(np.linalg.det(self.turn))))

    def open(self, vector: Numbers, size: float = 1.0, *, axial: bool = False) -> tuple[float | None, ...]:
        """Return a vector of which components may be open; the turn maps axes on axes then."""
        known = [0.0 if component is None else component for component in vector]
        moved = self.around(known, size) if axial else self.along(known, size)
        axes = np.abs(self.turn).argmax(axis=1)
        return tuple(None if vector[axis] is None else moved[row] for row, axis in enumerate(axes))

    @property
    def stress(self) -> float:
        """What a stress of one becomes."""
        return self.force / self.length**2


@dataclass(frozen=True)
class SlidingPair:
    """A scene of a seed and how it is written a second time.

    Attributes:
        words: What it is.
        build: Returns scene and load steps in a writing.
        other: The second writing.
        pieces: Number of subdomains of each body, first and second.
        periodic: Whether equations join edges, of which one carries the forces of both.
    """

    words: str
    build: Callable[[Writing], Built]
    other: Writing
    pieces: tuple[int, int]
    periodic: bool


def meeting(seed: int) -> SlidingPair:
    """Return the scene of a seed, the same on every machine."""
    dice = Dice(seed)
    meshes = {"low": _mesh(dice, (0.0, 0.0, 0.0), (2.0, 2.0, 1.0))}
    step = dice.one_of((0.0, 0.0, 0.25))
    meshes["up"] = _mesh(dice, (step, step, 1.0), (2.0 - step, 2.0 - step, 1.8))
    periodic = step == 0.0 and dice.chance(0.25)
    moduli = {name: dice.power(-1.0, 1.0) for name in meshes}
    parts = [_held(dice, periodic), _contact(dice, meshes), _between(dice, step), _driven(dice, periodic)]
    if periodic:
        dice.say("periodic along y")

    def build(writing: Writing) -> Built:
        bodies = {
            name: Body(writing.mesh(name, mesh), IsotropicElasticity(writing.stress * moduli[name], 0.3))
            for name, mesh in meshes.items()
        }
        given: dict[str, list[object]] = {
            name: [] for name in ("supports", "contacts", "ties", "springs", "foundations", "constraints")
        }
        for part in parts:
            for name, more in part(writing).items():
                if name in given:
                    given[name] += more
        ways: list[tuple[float, ...]] = [writing.along(way) for way in np.eye(3)]
        if periodic:
            given["constraints"] += [
                LinearConstraint(
                    [ConstraintTerm(name, "y1", way), ConstraintTerm(name, "y0", way, -1.0)],
                    0.0, f"{name} {k}", "translation",
                )
                for name in meshes for k, way in enumerate(ways)
            ]  # fmt: skip
        steps = parts[-1](writing)["steps"]
        scene = Scene(bodies, **given)  # type: ignore[arg-type]
        held = list(scene.supports)
        return scene, [LoadStep(str(k), loads, [*held, *extra]) for k, (loads, extra) in enumerate(steps)]  # type: ignore[misc]

    other, pieces = _other(dice), (_pieces(dice), _pieces(dice))
    return SlidingPair(", ".join(dice.words), build, other, pieces, periodic)


def _mesh(dice: Dice, low: Sequence[float], high: Sequence[float]) -> BodyMesh:
    kind = dice.weighted({"hexahedron": 3.0, "tetrahedron": 1.0})
    along, up = dice.one_of((2, 2, 3)), dice.one_of((1, 2))
    dice.say(f"{kind} {along}x{along}x{up}")
    return block(tuple(low), tuple(high), (along, along, up), kind)  # type: ignore[arg-type]


def _pieces(dice: Dice) -> int:
    pieces = dice.one_of((1, 1, 2, 3, 5, 8, 16))
    dice.say(f"cut in {pieces}")
    return pieces


def _other(dice: Dice) -> Writing:
    turn = dice.quarter_turn(3)
    if dice.chance(0.5):
        turn = turn @ np.diag(dice.one_of(([-1.0, 1.0, 1.0], [1.0, 1.0, -1.0])))
        dice.say("mirrored")
    far = dice.weighted({0.0: 2.0, 1.0: 2.0, 100.0: 1.0})
    length, force = dice.one_of((1e-9, 1e-9, 1.0, 1e9, 1e9)), dice.one_of((1e-9, 1.0, 1.0, 1e9))
    dice.say(f"shifted by {far:g}, units {length:g} and {force:g}")
    return Writing(turn, far * dice.direction(3), length, force, dice.one_of((None, 1, 2, 3)))


Part = Callable[[Writing], dict[str, list]]  # type: ignore[type-arg]


def _held(dice: Dice, periodic: bool) -> Part:
    """What holds the lower block."""
    kind = dice.weighted({"clamped": 3.0, "on a bed": 1.5, "on a rigid foot": 1.5, "on a floor": 1.0})
    kind = "clamped" if periodic else kind
    stiffness, turns = dice.power(-2.0, 1.0), dice.chance(0.5)
    dice.say(kind)

    def part(writing: Writing) -> dict[str, list]:  # type: ignore[type-arg]
        if kind == "clamped":
            return {"supports": [Support("low", "z0")]}
        if kind == "on a bed":
            bed = ElasticFoundation("low", "z0", (writing.stress / writing.length * stiffness,) * 3)
            return {"foundations": [bed]}
        if kind == "on a rigid foot":
            turn = writing.open((0.0, None if turns else 0.0, 0.0), axial=True)
            at = writing.point((1.0, 1.0, 0.0))
            foot = RigidSurface("low", "z0", at, (0.0,) * 3, turn)
            size = stiffness * writing.force / writing.length
            far = Spring(Surface("low", "x0"), writing.point((-1.0, 1.0, 0.5)), size)
            return {"supports": [foot], "springs": [far]}
        floor = RigidPlane(writing.point((0.0, 0.0, 0.0)), writing.along((0.0, 0.0, 1.0)))
        sides = (("x0", (1, 0, 0)), ("y0", (0, 1, 0)))
        guides = [Roller("low", side, 0.0, writing.along(way)) for side, way in sides]
        return {"supports": guides, "contacts": [ContactPair(Surface("low", "z0"), floor)]}

    return part


def _contact(dice: Dice, meshes: dict[str, BodyMesh]) -> Part:
    """What acts between both blocks."""
    law = dice.weighted({"none": 2.0, "Coulomb": 3.0, "Tresca": 1.0, "tied": 0.7})
    level, kind = dice.between(0.05, 0.4), dice.one_of(("node", "mortar"))
    closure = dice.weighted({"exact": 3.0, "linear": 1.0, "exponential": 1.0, "table": 1.0})
    inside = dice.one_of((None, None, 0.0, 0.003))
    swapped = dice.chance(0.3)
    dice.say(f"{law} {level:.2g} by {kind}, {closure}, interference {inside}")
    if swapped:
        dice.say("low is slave")

    def part(writing: Writing) -> dict[str, list]:  # type: ignore[type-arg]
        sides = [Surface("up", "z0"), Surface("low", "z1")]
        slave, master = sides[::-1] if swapped else sides
        if law == "tied":
            return {"ties": [Tie(slave, master)]}
        friction: Friction = {
            "none": None,
            "Coulomb": Coulomb(level),
            "Tresca": Tresca(0.02 * level * writing.stress),
        }[law]  # type: ignore[assignment]
        stress, length = writing.stress, writing.length
        soft: ClosureLaw | None = {
            "exact": None,
            "linear": LinearClosure(stress / length),
            "exponential": ExponentialClosure(0.01 * stress, 0.01 * length),
            "table": ClosureTable((-0.01 * length, 0.0, 0.01 * length), (0.0, 0.005 * stress, 0.02 * stress)),
        }[closure]
        given = None if inside is None else inside * length
        return {"contacts": [ContactPair(slave, master, friction, kind, closure=soft, interference=given)]}  # type: ignore[arg-type]

    return part


def _between(dice: Dice, step: float) -> Part:
    """Springs and equations between parts of the upper block and others."""
    spring, plane = dice.chance(0.25), dice.chance(0.2)
    stiffness = dice.power(-2.0, 1.0)
    if spring:
        dice.say(f"a spring of {stiffness:.2g}")
    if plane:
        dice.say("sides that move alike in the mean")

    def part(writing: Writing) -> dict[str, list]:  # type: ignore[type-arg]
        found: dict[str, list] = {}  # type: ignore[type-arg]
        if spring:
            size = stiffness * writing.force / writing.length
            found["springs"] = [Spring(Surface("up", "x1"), writing.point((3.0, 1.0, 1.4)), size)]
        if plane:
            way = writing.along((1.0, 0.0, 0.0))
            sides = (("x1", 1.0), ("x0", -1.0))
            mean = LinearConstraint([ConstraintTerm("up", side, way, sign, 0) for side, sign in sides])
            found["constraints"] = [mean]
        return found

    return part


def _driven(dice: Dice, periodic: bool) -> Part:
    """What presses the upper block, and its load steps: pressed, then drawn, turned or unloaded."""
    kind = dice.weighted({"rigid top": 3.0, "force": 2.0, "moved": 2.0})
    kind = "moved" if periodic else kind
    free = [dice.chance(0.3) for _ in range(2)]
    turns = [dice.chance(0.5), dice.chance(0.5), dice.chance(0.3)]
    push, side = dice.between(0.005, 0.03), dice.between(-0.1, 0.1)
    moment = dice.between(-0.1, 0.1)
    then = dice.weighted({"no more": 1.0, "unloaded": 1.5, "half": 1.0, "drawn": 1.0})
    at = (dice.between(0.7, 1.3), dice.between(0.7, 1.3), dice.between(1.8, 2.5))
    open_ = "".join(axis for axis, each in zip("xy", free, strict=True) if each)
    dice.say(f"{kind} {push:.2g}, free {open_ or 'down'}, turns {turns}, then {then}")
    ends = {"no more": [(1.0, 0.0)], "unloaded": [(1.0, 0.0), (0.0, 0.0)], "half": [(1.0, 0.0), (0.5, 0.0)],
            "drawn": [(1.0, 0.0), (1.0, 1.0)]}[then]  # fmt: skip

    def step(writing: Writing, down: float, drawn: float) -> tuple[list[Load], list[AnySupport]]:
        if kind == "rigid top":
            way = [None if each else 0.02 * drawn for each in free]
            spin = [None if each else 0.0 for each in turns]
            force = np.array([side * push if free[0] else 0.0, 0.0, -push]) * down
            around = np.array([0.0, moment * push if turns[1] else 0.0, 0.0]) * down
            top = RigidSurface(
                "up", "z1", writing.point(at), writing.open((*way, None), writing.length),
                writing.open(spin, axial=True), writing.along(force, writing.force),
                writing.around(around, writing.force * writing.length),
            )  # fmt: skip
            return [], [top]
        if kind == "moved":
            moved = (0.02 * drawn, 0.0, -0.3 * push * down)
            return [], [Support("up", "z1", writing.along(moved, writing.length))]
        guides: list[AnySupport] = [
            Roller("up", f"{axis}0", 0.0, writing.along(way))
            for axis, way, each in (("x", (1, 0, 0), free[0]), ("y", (0, 1, 0), free[1])) if not each
        ]  # fmt: skip
        loads: list[Load] = [TotalForce("up", "z1", writing.along((0.0, 0.0, -push * down), writing.force))]
        if drawn:
            loads.append(Pressure("up", "x0", 0.05 * push * writing.stress))
        return loads, guides

    return lambda writing: {"steps": [step(writing, *end) for end in ends]}
