"""Random scenes of heat on coarse meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact import Surface, Tie
from fenics_contact.gallery import block, disc, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    HeatFlux,
    HeatObjective,
    HeatOfContact,
    HeatOfHeld,
    HeatScene,
    HeatSource,
    HeldTemperature,
    JointResistance,
    Radiation,
    TemperatureMean,
    TemperatureTable,
    ThermalContact,
)
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.body_mesh import BodyMesh


def scene_of(seed: int) -> tuple[HeatScene, HeatObjective]:
    """Return two bodies that conduct to each other, what heats them, and a quantity."""
    draw = np.random.default_rng(seed)
    kind = ["plane", "plane", "around", "rings", "space"][seed % 5]
    meshes, faces, far = _bodies(kind, draw)
    conduct = [_conductor(draw) for _ in meshes]
    names = ("first", "second")
    bodies = {
        name: ConductingBody(mesh, k, axisymmetric=kind == "around")
        for name, mesh, k in zip(names, meshes, conduct, strict=True)
    }
    sides = [Surface(name, face) for name, face in zip(names, faces, strict=True)]
    contacts: list[Any] = [ThermalContact(sides[0], sides[1], 10.0 ** draw.uniform(-1.0, 1.5))]
    ties: list[Any] = []
    if kind == "rings":
        contacts = [ThermalContact(sides[0], sides[1], GapConductance(10.0 ** draw.uniform(-1.0, 1.0)))]
    elif draw.random() < 0.25:
        contacts, ties = [], [Tie(*sides)]
    held = [HeldTemperature("first", far[0], 300.0)]
    heating: list[Any] = [
        HeldTemperature("second", far[1], 300.0 + draw.uniform(50.0, 300.0)),
        HeatFlux("second", far[1], draw.uniform(50.0, 300.0)),
        Convection("second", far[1], draw.uniform(0.5, 5.0), 500.0),
    ]
    chosen = heating[draw.integers(3)]
    loads: list[Any] = [HeatSource("first", 100.0)] if draw.random() < 0.4 else []
    if draw.random() < 0.3:
        loads.append(Radiation("second", far[1], 0.9, 300.0))
    if isinstance(chosen, HeldTemperature):
        held.append(chosen)
    else:
        loads.append(chosen)
    scene = HeatScene(bodies, held, loads, contacts, ties)
    goals: list[HeatObjective] = [TemperatureMean("second"), TemperatureMean("second", far[1]),
                                  HeatOfHeld("first", far[0])]  # fmt: skip
    goals += [HeatOfContact(0), JointResistance(0)] if contacts else []
    return scene, goals[draw.integers(len(goals))]


def _bodies(kind: str, draw: np.random.Generator) -> tuple[list[BodyMesh], list[str], list[str]]:
    """Return two meshes that face each other, the surfaces that do, and those far from there."""
    cells = draw.integers(2, 4, size=(2, 3))
    if kind == "rings":
        gap = draw.uniform(0.05, 0.5)
        meshes = [disc(2.0, int(cells[0, 0]), hole=1.0), disc(4.0, int(cells[1, 0]), hole=2.0 + gap)]
        return _some_quadratic(meshes, draw), ["outer", "inner"], ["inner", "outer"]
    width = draw.uniform(0.6, 1.0)  # of the second body, so that there is an edge on the first
    if kind == "space":
        sizes = [((0, 0, 0), (1, 1, 1)), ((0, 0, 1), (width, 1, 1.8))]
        meshes = [block(*ends, tuple(map(int, n))) for ends, n in zip(sizes, cells, strict=True)]
        return meshes, ["z1", "z0"], ["x0", "y1"]
    inner = 0.5 if kind == "around" else 0.0
    shape = ["quadrilateral", "triangle"][draw.integers(2)]
    corners = [((inner, 0.0), (inner + 1.0, 1.0)), ((inner, 1.0), (inner + width, 1.8))]
    meshes = [rectangle(*ends, tuple(map(int, n[:2])), shape) for ends, n in zip(corners, cells, strict=True)]
    return _some_quadratic(meshes, draw), ["y1", "y0"], ["x0", "x1"]


def _some_quadratic(meshes: list[BodyMesh], draw: np.random.Generator) -> list[BodyMesh]:
    return [quadratic(mesh) for mesh in meshes] if draw.random() < 0.3 else meshes


def _conductor(draw: np.random.Generator) -> Conductor:
    k = 10.0 ** draw.uniform(0.0, 1.5)
    return Conductor(TemperatureTable((300.0, 600.0), (k, 0.6 * k)) if draw.random() < 0.3 else k)
