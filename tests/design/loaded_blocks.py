"""Blocks on a floor whose loaded top is a design, too, and whose loads vary in space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import ufl

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    Pressure,
    SampledField,
    Scene,
    Surface,
    ThermalStrain,
    TotalForce,
    Traction,
    Ufl,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from tests.design.objectives import objectives
from tests.design.plane_blocks import FLOOR as GROUND
from tests.design.plane_blocks import line_of
from tests.design.quotients import Line
from tests.scenes import FLOOR, Load, crowned


def _mesh(cell: str, order: int) -> BodyMesh:
    if cell in ("quadrilateral", "triangle"):
        mesh = rectangle((0.0, 0.0), (2.0, 1.0), (10, 4) if order == 1 else (5, 2), cell)
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3) if order == 1 else (4, 2, 2), cell)
    mesh = crowned(quadratic(mesh) if order == 2 else mesh, 0.02)
    # No edge of the top is straight.
    x, height = mesh.points[:, 0], mesh.points[:, -1]
    return mesh.moved(mesh.points + (0.05 * np.sin(2.0 * x) * height)[:, None] * np.eye(mesh.dim)[-1])


def loaded(cell: str, loads: Sequence[Load], order: int = 1) -> Scene:
    """A crowned block that nothing but a floor holds."""
    mesh = _mesh(cell, order)
    stuff = PlaneStrain(100.0, 0.3, 1e-3) if mesh.dim == 2 else IsotropicElasticity(100.0, 0.3, 1e-3)
    bottom, floor = ("y0", GROUND) if mesh.dim == 2 else ("z0", FLOOR)
    pair = ContactPair(Surface("block", bottom), floor, Coulomb(0.3))
    return Scene({"block": Body(mesh, stuff)}, loads=list(loads), contacts=[pair])


def falling(points: np.ndarray) -> np.ndarray:
    """A traction down and to the side that varies with the place."""
    down = -2.0 - 0.5 * np.sin(points[:, -1:]) * points[:, :1]
    side = 0.2 + 0.1 * points[:, -1:]
    nothing = np.zeros((len(points), points.shape[1] - 2))
    return np.hstack([side, nothing, down])


def warm(points: np.ndarray) -> np.ndarray:
    return np.asarray(3.0 * points[:, -1] ** 2 * (1.0 + points[:, 0]))


def measured_pressure() -> SampledField:
    """A pressure that is known at some points around the top."""
    x, y = np.meshgrid(np.linspace(-0.21, 2.23, 9), np.linspace(0.85, 1.15, 3), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    return SampledField(places, 2.0 + 0.4 * places[:, 0] * places[:, 1] ** 2, reach=0.5)


PLANE_PUSH, PUSH = BodyForce("block", (0.3, 0.0)), BodyForce("block", (0.25, 0.05, 0.0))
SCENES: dict[str, Callable[[], Scene]] = {
    "plane, pressure": lambda: loaded("quadrilateral", [Pressure("block", "y1", 2.0), PLANE_PUSH]),
    "plane, measured pressure": lambda: loaded(
        "triangle", [Pressure("block", "y1", measured_pressure()), PLANE_PUSH]
    ),
    "plane, force": lambda: loaded("quadrilateral", [TotalForce("block", "y1", (0.7, -4.0))]),
    "plane, force and moment": lambda: loaded(
        "triangle", [TotalForce("block", "y1", (0.6, -4.0), moment=0.2, at=(1.1, 1.2))], 2
    ),
    "traction": lambda: loaded("hexahedron", [Traction("block", "z1", (0.3, 0.1, -2.0))]),
    "pressure in UFL": lambda: loaded(
        "tetrahedron", [Pressure("block", "z1", Ufl(lambda x: 2.0 + 0.3 * ufl.sin(x[2]) * x[0])), PUSH]
    ),
    "tractions of position": lambda: loaded("hexahedron", [Traction("block", "z1", falling)]),
    "pressure, quadratic": lambda: loaded("tetrahedron", [Pressure("block", "z1", 2.0), PUSH], 2),
    "force and moment": lambda: loaded(
        "hexahedron",
        [TotalForce("block", "z1", (0.4, 0.1, -4.0), moment=(0.1, -0.2, 0.15), at=(1.1, 0.4, 1.1))],
    ),
    "moment, quadratic": lambda: loaded(
        "tetrahedron", [TotalForce("block", "z1", (0.4, 0.1, -4.0), moment=(0.1, -0.2, 0.15))], 2
    ),
    "volume": lambda: loaded(
        "hexahedron",
        [
            BodyForce("block", falling),
            ThermalStrain("block", warm),
            Traction("block", "z1", (0.45, 0.0, -0.5)),
        ],
    ),
}
OBJECTIVES = objectives("block")


@cache
def line(name: str) -> Line:
    scene = SCENES[name]()
    top = "y1" if scene.dim == 2 else "z1"
    return line_of(scene, 7, [Surface("block", top)])
