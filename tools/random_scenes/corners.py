"""Plane scenes with corners, contrasts and contact at random, and what their quantities really are.

Bodies are made of rectangular blocks, so that every place where a solution may be singular lies on a line of
blocks: meshes of quadratic cells that are graded towards these lines have quantities to many digits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
    quantity,
)
from fenics_contact._adaptive.goal_errors import value_of
from fenics_contact.gallery import rectangle_lattice
from fenics_contact.materials import Material, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.faces import boundary_faces
from tools.random_scenes.dice import Dice

#: Coordinates of mesh lines along an axis, from those of blocks.
Ticks = Callable[[np.ndarray], np.ndarray]


def even(count: int) -> Ticks:
    """Divide every block into so many equal cells along each axis."""
    return lambda lines: np.unique(np.concatenate([np.linspace(*ends, count + 1) for ends in _ends(lines)]))


def graded(layers: int, ratio: float, widest: float = 1.0) -> Ticks:
    """Divide every block into layers that get wider by a ratio from its sides to its middle.

    `widest`: largest width of a layer, relative to a block; wider ones are cut into equal parts.
    """
    half = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(layers))])
    whole = np.concatenate([half, 2.0 * half[-1] - half[-2::-1]]) / (2.0 * half[-1])
    parts = np.ceil(np.diff(whole) / widest - 1e-9).astype(int)
    cut = [np.linspace(*ends, count + 1)[1:] for ends, count in zip(_ends(whole), parts, strict=True)]
    whole = np.concatenate([whole[:1], *cut])
    return lambda lines: np.concatenate(
        [lines[:1], *(low + (high - low) * whole[1:] for low, high in _ends(lines))]
    )


def _ends(lines: np.ndarray) -> list[tuple[float, float]]:
    return list(zip(lines[:-1].tolist(), lines[1:].tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Blocks:
    """A body of rectangular blocks.

    Attributes:
        lines: Coordinates of the sides of blocks along x and y, (m + 1,) and (n + 1,), [length].
        modulus: Young's modulus of each block, zero where there is none, shape (m, n).
        poisson: Poisson's ratio.
        law: Returns a material by its Young's modulus and Poisson's ratio.
    """

    lines: tuple[np.ndarray, np.ndarray]
    modulus: np.ndarray
    poisson: float
    law: Callable[[float, float], Material] = PlaneStrain

    def body(self, ticks: Ticks, cell: str, order: int, more: tuple[float, ...] = ()) -> Body:
        """Return the body on a mesh; `more`: lines along x that it has, too."""
        along = np.union1d(self.lines[0], more), self.lines[1]
        mesh = rectangle_lattice([ticks(each) for each in along], cell)
        modulus = self._modulus_of(mesh)
        used, cells = np.unique(mesh.cells[modulus > 0.0], return_inverse=True)
        points, cells = mesh.points[used], cells.reshape(-1, mesh.cells.shape[1])
        left = BodyMesh(points, cells, self._surfaces(points, boundary_faces(cells, 2)[0]))
        left = quadratic(left) if order == 2 else left
        values, part = np.unique(modulus[modulus > 0.0], return_inverse=True)
        regions = {f"E{k}": np.flatnonzero(part == k) for k in range(len(values))}
        materials = {f"E{k}": self.law(value, self.poisson) for k, value in enumerate(values)}
        whole = BodyMesh(left.points, left.cells, left.surfaces, regions=regions)
        return Body(whole, materials if len(values) > 1 else materials["E0"])

    def _modulus_of(self, mesh: BodyMesh) -> np.ndarray:
        middle = mesh.points[mesh.cells].mean(axis=1)
        place = [np.searchsorted(lines, middle[:, k]) - 1 for k, lines in enumerate(self.lines)]
        return np.asarray(self.modulus[tuple(place)])

    def _surfaces(self, points: np.ndarray, facets: np.ndarray) -> dict[str, np.ndarray]:
        """Return the sides of the box, as "x0", and those of single blocks, as "x0 1"."""
        found: dict[str, np.ndarray] = {}
        for axis, lines in enumerate(self.lines):
            other = self.lines[1 - axis]
            for end in (0, 1):
                own = facets[np.all(points[facets][..., axis] == lines[-end], axis=1)]
                part = np.searchsorted(other, points[own].mean(axis=1)[:, 1 - axis]) - 1
                name = f"{'xy'[axis]}{end}"
                found[name] = own
                found |= {f"{name} {k}": own[part == k] for k in np.unique(part)}
        return found


@dataclass(frozen=True, eq=False)
class Corners:
    """A scene on any mesh, and a quantity of it.

    Attributes:
        words: What it is.
        singular: Whether its solution is singular somewhere.
        bodies: By their names.
        parts: Supports, loads and contacts of the scene.
        quantity: Name of the quantity, and what it takes.
        coarse: Cells along a block, their type and order.
        more: Lines along x of reference meshes, where a contact may end.
        tolerance: Residual of the states on these.
    """

    words: str
    singular: bool
    bodies: Mapping[str, Blocks]
    parts: Mapping[str, Any]
    quantity: tuple[str, Mapping[str, Any]]
    coarse: tuple[int, str, int]
    more: tuple[float, ...] = ()
    tolerance: float = 1e-9

    def start(self) -> Scene:
        """Return the scene on its coarse mesh."""
        count, cell, order = self.coarse
        return self._on(even(count), cell, order, ())

    def _on(self, ticks: Ticks, cell: str, order: int, more: tuple[float, ...]) -> Scene:
        bodies = {name: blocks.body(ticks, cell, order, more) for name, blocks in self.bodies.items()}
        return Scene(bodies, **self.parts)

    def value(self, layers: int, widest: float, ratio: float = 2.0) -> float:
        """Return the quantity on a graded mesh of quadratic cells."""
        scene = self._on(graded(layers, ratio, widest), "quadrilateral", 2, self.more)
        name, where = self.quantity
        state = ContactProblem(scene, MPI.COMM_SELF, tolerance=self.tolerance).solve()
        return float(value_of(state, quantity(name, scene, **where)))

    def reference(self, layers: int = 6, widest: float = 0.05) -> tuple[float, float]:
        """Return what the quantity tends to, and by how much that may be off.

        What singular places add falls by the same ratio with every layer, so that three meshes tell the
        rest. Layers twice as wide tell what the widest ones miss: a sixteenth of the difference with
        quadratic cells, of which an eighth counts, and all of it in contact, whose rim lies between nodes.
        `layers`: of the first mesh; `widest`: width of a layer relative to a block.
        """
        values = [self.value(count * layers, widest) for count in (1, 2, 3)]
        wide = abs(self.value(2 * layers, 2.0 * widest) - values[1])
        before, last = np.diff(values)
        falls = last / before if before != 0.0 else 0.0
        rest = last * falls / (1.0 - falls) if 0.0 < falls < 0.95 else 0.0
        doubt = 0.2 * abs(rest) if rest != 0.0 else abs(last)
        return values[-1] + rest, doubt + (wide if self.parts.get("contacts") else wide / 8.0)


def corners(seed: int) -> Corners:
    """Return a scene of a seed; every other one is singular."""
    dice = Dice(seed)
    singular = seed % 2 == 1
    make = dice.one_of((_alone, _alone, _on_plane, _on_another) if singular else (_smooth, _smooth, _on_ball))
    return make(dice)


def _blocks(dice: Dice, counts: tuple[int, int], origin: tuple[float, float] = (0.0, 0.0)) -> Blocks:
    """Return blocks of one material about one long."""
    lines = [
        first + np.concatenate([[0.0], np.cumsum([dice.between(0.5, 1.5) for _ in range(count)])])
        for first, count in zip(origin, counts, strict=True)
    ]
    return Blocks((lines[0], lines[1]), np.full(counts, dice.power(2, 5)), dice.between(0.0, 0.4))


def _pitted(dice: Dice, blocks: Blocks, *, whole: tuple[str, ...] = ()) -> Blocks:
    """Make some blocks stiffer, or take one away at a corner, not at the sides that shall be whole."""
    modulus, kind = blocks.modulus.copy(), dice.one_of(("cross point", "inclusion", "notch"))
    corner = dice.one_of((0, -1)), dice.one_of((0, -1))
    if "y0" in whole:
        corner = corner[0], -1
    if kind == "notch":
        modulus[corner] = 0.0
        dice.say(f"notch at {corner}")
    else:
        contrast = dice.power(0.5, 4)
        hard = np.indices(modulus.shape).sum(axis=0) % 2 == 0
        if kind == "inclusion":
            hard = np.zeros_like(hard)
            hard[corner] = True
        modulus[hard] *= contrast
        dice.say(f"{kind}, contrast {contrast:.3g}")
    return Blocks(blocks.lines, modulus, blocks.poisson)


def _sides(blocks: Blocks, side: str) -> tuple[str, ...]:
    """Return the names of the parts of a side that are there, and of the whole."""
    edge = {"x0": blocks.modulus[0], "x1": blocks.modulus[-1]}
    edge |= {"y0": blocks.modulus[:, 0], "y1": blocks.modulus[:, -1]}
    return side, *(f"{side} {k}" for k in np.flatnonzero(edge[side]))


def _load(dice: Dice, body: str, surface: str, size: float, *, push: bool = False) -> Traction:
    """Return a traction that presses downwards, and along x where it shall push; linear, as cells have it."""
    slope, along = dice.between(0.0, 1.0), dice.between(0.1, 0.3) if push else 0.0
    vector = size * np.array([along, -1.0])
    return Traction(body, surface, lambda x: (1.0 + slope * x[:, :1]) * vector)


def _some(dice: Dice, wanted: Mapping[str, Mapping[str, Any]]) -> tuple[str, Mapping[str, Any]]:
    name = dice.one_of(sorted(wanted))
    dice.say(name)
    return name, wanted[name]


#: Quantities of every scene, and what they take.
_DOWN = {"direction": (0.0, -1.0)}
_ANY: dict[str, dict[str, Any]] = {
    "strain_energy": {}, "potential": {}, "displacement": {"surface": "a y1", **_DOWN},
}  # fmt: skip


def _coarse(dice: Dice) -> tuple[int, str, int]:
    order = dice.weighted({1: 5.0, 2: 1.0})
    return int(dice.random.integers(1, 4)), dice.one_of(("triangle", "quadrilateral")), order


def _alone(dice: Dice) -> Corners:
    """A body with a corner or a contrast, clamped at a side or a part of one."""
    blocks = _pitted(dice, _blocks(dice, (2, 2)))
    held, side = dice.one_of(_sides(blocks, dice.one_of(("x0", "y0")))), dice.one_of(_sides(blocks, "y1"))
    load = _load(dice, "a", side, 1e-3 * float(blocks.modulus[blocks.modulus > 0.0].min()), push=True)
    dice.say(f"clamped at {held}, loaded at {side}")
    wanted = _some(dice, _ANY)
    parts = {"supports": [Support("a", held, (0.0, 0.0))], "loads": [load]}
    return Corners("; ".join(dice.words), True, {"a": blocks}, parts, wanted, _coarse(dice))


def _smooth(dice: Dice) -> Corners:
    """A rectangle of one material on rollers under a smooth load."""
    blocks = _blocks(dice, (dice.one_of((1, 2)), 1))
    load = _load(dice, "a", "y1", 1e-3 * float(blocks.modulus.max()))
    parts = {"supports": [Support("a", "x0", (0.0, None)), Support("a", "y0", (None, 0.0))], "loads": [load]}
    dice.say("on rollers")
    wanted = _some(dice, _ANY | {"reaction": {"surface": "a x0", "direction": (1.0, 0.0)}})
    return Corners("; ".join(dice.words), False, {"a": blocks}, parts, wanted, _coarse(dice))


def _on_plane(dice: Dice) -> Corners:
    """A body on a rigid plane, held at a side, pressed and pushed."""
    blocks = _pitted(dice, _blocks(dice, (2, 2)), whole=("y0",))
    friction = Coulomb(dice.between(0.1, 0.6)) if dice.chance(0.6) else None
    load = _load(dice, "a", "y1", 1e-3 * float(blocks.modulus[blocks.modulus > 0.0].min()), push=True)
    pair = ContactPair(Surface("a", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), friction)
    held = dice.one_of(_sides(blocks, "x0"))
    dice.say(f"on a plane, friction {friction}, clamped at {held}")
    more = {"contact_force": {"direction": (0.3, 1.0)}, "reaction": {"surface": f"a {held}", **_DOWN}}
    wanted = _some(dice, _ANY | more | ({"friction_work": {}} if friction else {}))
    parts = {"supports": [Support("a", held, (0.0, 0.0))], "loads": [load], "contacts": [pair]}
    return Corners("; ".join(dice.words), True, {"a": blocks}, parts, wanted, _coarse(dice))


def _on_another(dice: Dice) -> Corners:
    """A block pressed and pushed on a wider one."""
    upper, lower = _blocks(dice, (1, 1)), _blocks(dice, (3, 1))
    width = float(upper.lines[0][-1])
    along = np.array([-dice.between(0.3, 1.0), 0.0, width, width + dice.between(0.3, 1.0)])
    lower = Blocks((along, lower.lines[1] - lower.lines[1][-1]), lower.modulus, lower.poisson)
    friction = Coulomb(dice.between(0.2, 0.6))
    load = _load(dice, "a", "y1", 1e-3 * float(upper.modulus.max()), push=True)
    pair = ContactPair(Surface("a", "y0"), Surface("b", "y1"), friction)
    dice.say(f"block on another one, friction {friction}")
    wanted = _some(dice, _ANY | {"friction_work": {}})
    parts = {"supports": [Support("b", "y0", (0.0, 0.0))], "loads": [load], "contacts": [pair]}
    return Corners("; ".join(dice.words), True, {"a": upper, "b": lower}, parts, wanted, _coarse(dice))


def _on_ball(dice: Dice) -> Corners:
    """Half of a block on a rigid cylinder."""
    blocks = _blocks(dice, (1, 1))
    length, modulus = float(blocks.lines[0][-1]), float(blocks.modulus.max())
    half, radius = dice.between(0.1, 0.4) * length, dice.between(4.0, 10.0)
    size = half**2 * np.pi * modulus / (1.0 - blocks.poisson**2) / (8.0 * radius * length)
    pair = ContactPair(Surface("a", "y0"), RigidSphere((0.0, -radius), radius))
    dice.say("on a cylinder")
    wanted = _some(dice, _ANY | {"peak_pressure": {}, "effective_area": {}})
    parts = {
        "supports": [Support("a", "x0", (0.0, None))],
        "loads": [_load(dice, "a", "y1", size)], "contacts": [pair],
    }  # fmt: skip
    return Corners("; ".join(dice.words), False, {"a": blocks}, parts, wanted, _coarse(dice), (half,))
