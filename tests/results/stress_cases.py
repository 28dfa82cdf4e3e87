"""Scenes with known stresses, on the ranks of a communicator."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Pressure,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic

#: Radii, inner pressure.
INNER, OUTER, PRESSURE = 1.0, 2.0, 3.0
POISSON = 0.3
#: Largest pressure below a cylinder, for contact of half width one.
PEAK = 5.0


def cylinder(cells: int, *, order: int = 1) -> Scene:
    """A quarter of a thick cylinder under inner pressure, in plane strain."""
    flat = rectangle((INNER, 0.0), (OUTER, 1.0), (cells, 2 * cells))
    flat = quadratic(flat) if order == 2 else flat
    radius, angle = flat.points[:, 0], 0.5 * np.pi * flat.points[:, 1]
    mesh = replace(flat, points=np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    supports = [Support("ring", "y0", (None, 0.0)), Support("ring", "y1", (0.0, None))]
    load = Pressure("ring", "x0", PRESSURE)
    return Scene({"ring": Body(mesh, PlaneStrain(1000.0, POISSON))}, supports, [load])


def lame(points: np.ndarray) -> np.ndarray:
    """Return Lamé's stress of the cylinder, shape (n, 3, 3)."""
    radius = np.linalg.norm(points, axis=1)
    scale = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    along, around = (
        points / radius[:, None],
        np.stack([-points[:, 1], points[:, 0]], axis=1) / radius[:, None],
    )
    stress = np.zeros((len(points), 3, 3))
    stress[:, :2, :2] = np.einsum("n,ni,nj->nij", scale * (1 - (OUTER / radius) ** 2), along, along)
    stress[:, :2, :2] += np.einsum("n,ni,nj->nij", scale * (1 + (OUTER / radius) ** 2), around, around)
    stress[:, 2, 2] = POISSON * np.trace(stress[:, :2, :2], axis1=1, axis2=2)
    return stress


def punched(cells: int, *, order: int = 1) -> Scene:
    """Half of a block that a rigid cylinder presses; on its far sides act the tractions of a half plane."""
    radius = 1.0 / (2 * PEAK) * 1000.0 / (1 - POISSON**2)
    block = rectangle((0.0, -3.0), (3.0, 0.0), (3 * cells, 3 * cells))
    mesh = quadratic(block) if order == 2 else block
    loads = [
        Traction("block", "x1", lambda x: line_contact(x)[:, :2, 0]),
        Traction("block", "y0", lambda x: -line_contact(x)[:, :2, 1]),
    ]
    cylinder = RigidSphere((0.0, radius), radius)
    return Scene(
        {"block": Body(mesh, PlaneStrain(1000.0, POISSON))},
        [Support("block", "x0", (0.0, None))],
        loads,
        [ContactPair(Surface("block", "y1"), cylinder)],
    )


def line_contact(points: np.ndarray) -> np.ndarray:
    """Return McEwen's stress of a half plane below Hertz's pressure of half width one, shape (n, 3, 3)."""
    x, z = points[:, 0], -points[:, 1]
    half = 1 - x**2 + z**2
    root = np.sqrt(half**2 + 4 * x**2 * z**2)
    m, n = np.sqrt(0.5 * (root + half)), np.sign(x) * np.sqrt(np.maximum(0.5 * (root - half), 0.0))
    share = (z**2 + n**2) / np.maximum(root, 1e-300)
    stress = np.zeros((len(points), 3, 3))
    stress[:, 0, 0] = -PEAK * (m * (1 + share) - 2 * z)
    stress[:, 1, 1] = -PEAK * m * (1 - share)
    stress[:, 0, 1] = stress[:, 1, 0] = PEAK * n * (m**2 - z**2) / np.maximum(root, 1e-300)
    stress[:, 2, 2] = POISSON * (stress[:, 0, 0] + stress[:, 1, 1])
    return stress


def composite() -> Scene:
    """A bar of two materials side by side, pulled evenly far beyond where they differ."""
    mesh = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2))
    low = mesh.points[mesh.cells].mean(axis=1)[:, 1] < 1.0
    mesh = replace(mesh, regions={"low": np.flatnonzero(low), "high": np.flatnonzero(~low)})
    # Without a lateral strain the materials have one stress each.
    materials = {"low": IsotropicElasticity(1000.0, 0.0), "high": IsotropicElasticity(3000.0, 0.0)}
    supports = [
        Support("bar", "x0", (0.0, None, None)),
        Support("bar", "x1", (0.01, None, None)),
        Support("bar", "y0", (None, 0.0, None)),
        Support("bar", "z0", (None, None, 0.0)),
    ]
    return Scene({"bar": Body(mesh, materials)}, supports)


def bent() -> Scene:
    """A clamped block pushed aside."""
    mesh = block((0.3, 0.1, 0.0), (3.4, 1.2, 0.7), (7, 3, 3))
    material = IsotropicElasticity(70.0, 0.3)
    return Scene(
        {"beam": Body(mesh, material)}, [Support("beam", "x0")], [Traction("beam", "z1", (0.3, 0.1, -1.0))]
    )


SCENES = {"cylinder": lambda: cylinder(4), "composite": composite, "bent": bent}


def solved(scene: Scene, comm: MPI.Comm, parts: int = 2) -> State:
    """Return the state with some subdomains."""
    cut = {n: box_partition(b.mesh, (parts, *[1] * (scene.dim - 1))) for n, b in scene.bodies.items()}
    return solve_scene(scene, comm, partitions=cut, tolerance=1e-11)


def figures(case: str, comm: MPI.Comm) -> dict[str, Any]:
    state = solved(SCENES[case](), comm)
    (name,) = state.scene.bodies
    return {
        "cells": state.gather_stress(name).ravel().tolist(),
        "nodes": np.nan_to_num(state.gather_nodal_stress(name), nan=-7.0).ravel().tolist(),
        "principal": float(
            comm.allreduce(state.principal_stress[name].x.array.max(initial=-np.inf), MPI.MAX)
        ),
    }


if __name__ == "__main__":
    answer = {case: figures(case, MPI.COMM_WORLD) for case in sys.argv[1:]}
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
