"""Plane states to draw, and one with obstacles of all shapes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    DistanceObstacle,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))


def arched(mesh: BodyMesh, rise: float) -> BodyMesh:
    """Bend the lower edge of a rectangle upwards towards its ends."""
    x, y = mesh.points.T
    along = 2 * (x - x.min()) / np.ptp(x) - 1
    return mesh.moved(np.column_stack([x, y + rise * along**2 * (y.max() - y) / np.ptp(y)]))


@lru_cache(maxsize=4)
def plane_block(cell: str = "quadrilateral", friction: float = 0.4) -> State:
    """A plane block pressed on a floor and dragged along it, with open, sticking and slipping points."""
    mesh = arched(rectangle((0.0, 0.0), (2.0, 1.0), (24, 8), cell), 0.02)
    scene = Scene(
        {"block": Body(mesh, PlaneStrain(100.0, 0.3))},
        [Support("block", "y1", (0.006, -0.02))],
        contacts=[ContactPair(Surface("block", "y0"), FLOOR, Coulomb(friction))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    if friction:
        assert all(state.contact.count(status) > 0 for status in Status), "some status is missing"
    return state


def flat_pad(push: float = 0.01, thickness: float | None = None) -> State:
    """A pad three times as long as high, pressed on a floor and pushed along it."""
    return _pad(6.0, 2.0, push, thickness)


def tall_pad() -> State:
    """A pad three times as high as long, pressed on a floor."""
    return _pad(2.0, 6.0, 0.01)


@lru_cache(maxsize=4)
def _pad(width: float, height: float, push: float, thickness: float | None = None) -> State:
    cells = round(2 * width), round(2 * height)
    scene = Scene(
        {
            "pad": Body(
                rectangle((0.0, 0.0), (width, height), cells), PlaneStrain(100.0, 0.3, thickness=thickness)
            )
        },
        [Support("pad", "y1", (push, -0.02))],
        contacts=[ContactPair(Surface("pad", "y0"), FLOOR, Coulomb(0.3))],
    )
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


@lru_cache(maxsize=1)
def hung_block() -> State:
    """A plane block pressed against a ceiling."""
    scene = Scene(
        {"block": Body(rectangle((0.0, 0.0), (2.0, 1.0), (6, 3)), PlaneStrain(100.0, 0.3))},
        [Support("block", "y0", (0.0, 0.01))],
        contacts=[ContactPair(Surface("block", "y1"), RigidPlane((0.0, 1.0), (0.0, -1.0)), Coulomb(0.3))],
    )
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


def ring(inner: float, outer: float, around: int = 24) -> BodyMesh:
    """A ring of two layers of cells with surfaces "inner" and "outer"."""
    angles = 2 * np.pi * np.arange(around) / around
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    number = np.arange(3 * around).reshape(3, around)
    ahead = np.roll(number, -1, axis=1)
    cells = np.stack([number[:-1], number[1:], ahead[1:], ahead[:-1]], axis=-1).reshape(-1, 4)
    surfaces = {
        "inner": np.column_stack([ahead[0], number[0]]),
        "outer": np.column_stack([number[-1], ahead[-1]]),
    }
    points = (np.linspace(inner, outer, 3)[:, None, None] * circle).reshape(-1, 2)
    return BodyMesh(points, cells, surfaces)


@lru_cache(maxsize=1)
def pin_in_ring() -> State:
    """A ring squeezed onto another one: contact all around."""
    material = PlaneStrain(100.0, 0.3)
    scene = Scene(
        {"pin": Body(ring(0.5, 1.0), material), "ring": Body(ring(1.0, 2.0), material)},
        [
            Support("pin", "inner", (0.0, 0.0)),
            Support("ring", "outer", (lambda x: -0.01 * x[:, 0], lambda x: -0.01 * x[:, 1])),
        ],
        contacts=[ContactPair(Surface("ring", "inner"), Surface("pin", "outer"), Coulomb(0.2))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    assert np.all(state.contact.normal_force > 0)
    return state


@lru_cache(maxsize=1)
def caged_block() -> State:
    """A block in space between a floor, a ball, a bar and a wall given by its distance."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    obstacles = {
        "z0": RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        "x1": RigidSphere((2.5, 0.5, 0.5), 0.499),
        "x0": RigidCylinder((-0.4, 0.0, 0.5), (0.0, 1.0, 0.0), 0.399),
        "y1": DistanceObstacle(lambda x: 1.001 - x[:, 1]),
        "y0": RigidPlane((0.0, -0.001, 0.0), (0.0, 1.0, 0.0)),
    }
    scene = Scene(
        {"block": Body(mesh, IsotropicElasticity(100.0, 0.3))},
        [Support("block", "z1", (0.0, 0.0, -0.02))],
        contacts=[ContactPair(Surface("block", side), obstacle) for side, obstacle in obstacles.items()],
    )
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
