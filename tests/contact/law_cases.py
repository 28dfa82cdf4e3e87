"""Blocks on floors under laws of surfaces, and what they do by formula."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    FrictionCurve,
    FrictionTable,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

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


def dragged_block(friction: Coulomb, pressure: float, shift: float = 1.0) -> Scene:
    """A block without lateral contraction on a floor, pressed uniformly and dragged along x and y."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, HEIGHT), (4, 2, 2))
    way = (0.6 * shift, 0.8 * shift, -pressure * HEIGHT / MODULUS)
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene(
        {"block": Body(mesh, IsotropicElasticity(MODULUS, 0.0))},
        [Support("block", "z1", way)],
        contacts=[pair],
    )


def solved(scene: Scene, **more: object) -> State:
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-9, **more)
