"""Blocks on floors under laws of surfaces, and what they do by formula."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    Coulomb,
    ExponentialClosure,
    FrictionCurve,
    FrictionTable,
    LinearClosure,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, Material

FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
MODULUS, HEIGHT, AREA = 1000.0, 1.0, 2.0
TABLE = FrictionTable(pressure=(2.0, 10.0), coefficient=(0.4, 0.25))


class Saturating(FrictionCurve):
    """t = 0.4 p / (1 + p / 10)."""

    largest_coefficient = 0.4

    def strength(self, pressure: np.ndarray) -> np.ndarray:
        return 0.4 * pressure / (1.0 + pressure / 10.0)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        return 0.4 / (1.0 + pressure / 10.0) ** 2


#: Laws and their friction traction at a pressure.
LAWS: dict[str, tuple[Coulomb, Callable[[float], float]]] = {
    "limit": (Coulomb(0.4, shear_limit=1.5), lambda p: min(0.4 * p, 1.5)),
    "table": (Coulomb(TABLE), lambda p: float(np.interp(p, (2.0, 10.0), (0.4, 0.25))) * p),
    "table and limit": (Coulomb(TABLE, 1.5), lambda p: min(float(TABLE.strength(np.array([p]))[0]), 1.5)),
    "own": (Coulomb(Saturating()), lambda p: 0.4 * p / (1.0 + p / 10.0)),
}


def dragged_block(friction: Coulomb | Tresca, pressure: float, shift: float = 1.0) -> Scene:
    """A block without lateral contraction on a floor, pressed uniformly and dragged along x and y."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, HEIGHT), (4, 2, 2))
    way = (0.6 * shift, 0.8 * shift, -pressure * HEIGHT / MODULUS)
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene(
        {"block": Body(mesh, IsotropicElasticity(MODULUS, 0.0))},
        [Support("block", "z1", way)],
        contacts=[pair],
    )


class Asperities(ClosureLaw):
    """Spheres on a plane: p = (closure / 0.003)^1.5."""

    def closure(self, pressure: np.ndarray) -> np.ndarray:
        return 0.003 * pressure ** (2.0 / 3.0)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        return 0.002 * pressure ** (-1.0 / 3.0)


CLOSURES: dict[str, ClosureLaw] = {
    "linear": LinearClosure(700.0),
    "exponential": ExponentialClosure(5.0, 0.01),
    "table": ClosureTable((-0.002, 0.001, 0.002, 0.02), (0.0, 2.0, 9.0, 30.0)),
    "own": Asperities(),
}


def pressed_block(closure: ClosureLaw | None, down: float) -> Scene:
    """A block without lateral contraction on a floor, pressed uniformly."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, HEIGHT), (4, 2, 2))
    pair = ContactPair(Surface("block", "z0"), FLOOR, closure=closure)
    body = Body(mesh, IsotropicElasticity(MODULUS, 0.0))
    return Scene({"block": body}, [Support("block", "z1", (0.0, 0.0, -down))], contacts=[pair])


def tilted_block(closure: ClosureLaw | None, friction: Coulomb | None) -> Scene:
    """A block on a floor that nothing else holds, pressed obliquely and off its centre."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, HEIGHT), (4, 2, 2))
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction, closure=closure)

    def load(x: np.ndarray) -> np.ndarray:
        return np.column_stack([0.3 + 0 * x[:, 0], 0.1 + 0 * x[:, 0], -6.0 * x[:, 0] ** 2])

    return Scene(
        {"block": Body(mesh, IsotropicElasticity(MODULUS, 0.3))}, [], [Traction("block", "z1", load)], [pair]
    )


def pressed_and_sheared(material: Material, discretisation: str, size: float, cells: int = 2) -> Scene:
    """A block on a wider one, its top moved down and aside; nothing slips."""
    bodies = {
        "low": Body(block((-1.0, -1.0, -1.0), (2.0, 2.0, 0.0), (3, 3, 1)), material),
        "high": Body(block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (cells, 1, 1)), material),
    }
    surfaces = Surface("high", "z0"), Surface("low", "z1")
    pair = ContactPair(*surfaces, Coulomb(0.5, stick_stiffness=20.0), discretisation)
    return Scene(
        bodies, [Support("low", "z0"), Support("high", "z1", (0.4 * size, 0, -size))], contacts=[pair]
    )


def solved(scene: Scene, tolerance: float = 1e-9, **more: object) -> State:
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=tolerance, **more)
