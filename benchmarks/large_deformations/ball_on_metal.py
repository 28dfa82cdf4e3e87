"""A cube of metal that a rigid ball presses beyond yield, by symmetry a quarter of it.

J. Frohne, T. Heister, W. Bangerth, Efficient numerical methods for the large-scale, parallel solution of
elastoplastic contact problems, Int. J. Numer. Methods Eng. 105 (2016); tutorial 42 of deal.II.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TangentNewton,
    solve_scene,
)
from fenics_contact.gallery import box_lattice, growing_ticks
from fenics_contact.materials import J2Plasticity
from fenics_contact.mesh import quadratic

#: Edge of the region of equal cells below the ball; the radius of contact is 0.11.
REACH = 0.1
#: Length of a cell by that of the one before, outside that region, where this has one cell.
GROWTH = 16.0


def above_the_pole(points: np.ndarray) -> np.ndarray:
    """Return the height of a ball of radius 0.6 over its lowest point, on the vertical through each point."""
    beside = ((points[:, :2] - 0.5) ** 2).sum(axis=1)
    return np.asarray(0.6 - np.sqrt(0.36 - np.minimum(beside, 0.35)))


def metal() -> J2Plasticity:
    """Return the published metal, in which the deviator, not √(3/2) of it, is bounded by 400."""
    modulus, ratio, bound, growth = 2e5, 0.3, 400.0, 0.01
    slope = 1.5 * modulus / (1.0 + ratio) * growth / (1.0 - growth)
    return J2Plasticity(modulus, ratio, np.sqrt(1.5) * bound, isotropic_hardening=slope)


def pressed(quarter: BodyMesh, means: bool = False) -> Scene:
    """Return a quarter of the unit cube, lifted by 0.01 against the ball above the corner (0.5, 0.5).

    Args:
        quarter: Its mesh.
        means: Whether dilatations are means over cells.
    """
    supports = [
        Support("cube", "z0", (0.0, 0.0, 0.01)),
        *(Support("cube", side, (0.0, 0.0, None)) for side in ("x0", "y0")),
        Support("cube", "x1", (0.0, None, None)),
        Support("cube", "y1", (None, 0.0, None)),
    ]
    plane = RigidPlane((0, 0, 1), (0, 0, -1))
    pair = ContactPair(Surface("cube", "z1"), plane, gap=above_the_pole)
    material = replace(metal(), mean_dilatation=means)
    return Scene({"cube": Body(quarter, material)}, supports, contacts=[pair])


def graded(cells: int, order: int) -> BodyMesh:
    """Mesh the quarter with equal cells near the ball and growing ones elsewhere; twice as many halve all.

    Args:
        cells: Along the edges of the region of equal cells.
        order: Of the hexahedra, 1 or 2.
    """
    near, growth = np.linspace(0.0, REACH, cells + 1), GROWTH ** (1.0 / cells)

    def down(end: float) -> np.ndarray:
        far = growing_ticks(end - REACH, np.sqrt(growth) * REACH / cells, growth)
        return np.concatenate([near, REACH + far[1:]])

    aside = 0.5 - down(0.5)[::-1]
    mesh = box_lattice([aside, aside, 1.0 - down(1.0)[::-1]])
    return quadratic(mesh) if order == 2 else mesh


def measured(comm: MPI.Comm, cells: int, order: int, means: bool = False) -> dict[str, Any]:
    """Return the force of the whole ball on one mesh; arguments as for `graded` and `pressed`.

    The load comes at once, as published: in several load steps the metal flows along another way.
    """
    scene = pressed(graded(cells, order), means)
    began = perf_counter()
    at_once = AutomaticSteps(TangentNewton(forcing=0.01), smallest=1.0)
    state = solve_scene(scene, comm, steps=at_once)
    force = state.contact.force[:, 2]
    return {
        "cells": cells,
        "order": order,
        "dilatations": "means" if means else "points",
        "dofs": 3 * scene.bodies["cube"].mesh.n_nodes,
        "closed": int(np.count_nonzero(force)),
        "force": round(-4.0 * float(force.sum()), 5),
        "newton_steps": len(state.solution.history),
        "seconds": round(perf_counter() - began, 1),
    }
