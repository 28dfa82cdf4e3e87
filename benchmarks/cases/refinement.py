"""Shear, press fit and Hertz' ball on meshes that do not match, each refined twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.measuring import state_record
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact.gallery import block, box_lattice, hemisphere, rectangle
from fenics_contact.gallery.blocks import extrude
from fenics_contact.materials import IsotropicElasticity

#: Cells of both bodies by scene, of each of three meshes.
MESHES = {
    "shear": ((7, 5), (14, 11), (22, 17)),
    "press": ((6, 15, 8, 18, 2), (12, 30, 16, 36, 4), (20, 48, 26, 58, 6)),
    "hertz": ((5, 7), (9, 13), (15, 22)),
}
STEEL, SOFT = IsotropicElasticity(2.1e5, 0.3), IsotropicElasticity(1.0, 0.3)


def shear(low: int, high: int) -> Scene:
    """A block of 0.6 on one of 1, pressed by 0.02 and sheared by 0.01, μ = 0.3."""
    meshes = {
        "low": block((0, 0, 0), (1, 1, 1), (low,) * 3),
        "high": block((0.2, 0.2, 1), (0.8, 0.8, 1.6), (high,) * 3),
    }
    held = [Support("low", "z0"), Support("high", "z1", (0.01, 0.0, -0.02))]
    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.3), "mortar")
    return Scene({name: Body(mesh, SOFT) for name, mesh in meshes.items()}, held, contacts=[pair])


def press(inside: int, around: int, outside: int, beyond: int, slices: int) -> Scene:
    """A quarter of a ring pressed on a shaft, overlap of the radii 0.05, plane strain, μ = 0.3."""
    meshes = {
        "shaft": _ring(10.0, 30.0, (inside, around), slices),
        "hub": _ring(29.95, 60.0, (outside, beyond), slices),
    }
    cuts = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "top": (None, None, 0.0)}
    cuts["bottom"] = cuts["top"]
    held = [Support(name, side, value) for name in meshes for side, value in cuts.items()]
    pair = ContactPair(
        Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.3), "mortar", interference="measured"
    )
    return Scene({name: Body(mesh, STEEL) for name, mesh in meshes.items()}, held, contacts=[pair])


def hertz(ball: int, ticks: int) -> Scene:
    """A quarter of a ball of radius 10 on a block, 15 kN in all, cells graded towards the contact."""
    along = 10.0 * np.expm1(3 * np.linspace(0, 1, ticks)) / np.expm1(3)
    meshes = {
        "ball": hemisphere(10.0, ball, grading=3.0),
        "block": box_lattice([1.05 * along, along, -along[::-1]]),
    }
    cuts = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    held = [Support(name, side, value) for name in meshes for side, value in cuts.items()]
    return Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [*held, Support("block", "z0", (None, None, 0.0))],
        [TotalForce("ball", "top", (0.0, 0.0, -3750.0))],
        [ContactPair(Surface("block", "z1"), Surface("ball", "contact"), discretisation="mortar")],
    )


def _ring(inner: float, outer: float, cells: tuple[int, int], slices: int) -> BodyMesh:
    flat = rectangle((inner, 0.0), (outer, np.pi / 2), cells)
    radius, angle = flat.points.T
    sides = {"inner": "x0", "outer": "x1", "y0": "y0", "x0": "y1"}
    bent = flat.moved(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    named = {name: flat.surfaces[side] for name, side in sides.items()}
    return extrude(replace(bent, surfaces=named), np.linspace(0.0, 10.0, slices + 1))


SCENES: dict[str, Callable[..., Scene]] = {"shear": shear, "press": press, "hertz": hertz}


def measure(comm: MPI.Comm, scene: str, level: int) -> dict[str, Any]:
    """Return the record of a cold state at default settings, with its processor seconds. Collective.

    Args:
        comm: Communicator.
        scene: One of `SCENES`.
        level: Which of its `MESHES`, from 0.
    """
    start = process_time()
    state = solve_scene(SCENES[scene](*MESHES[scene][level]), comm)
    return {**state_record(state), "seconds": process_time() - start}
