"""Blocks and chain links that meet by mortar, on lines of designs that move both surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact.contact import ContactProblem
from fenics_contact.gallery import block
from fenics_contact.partition import box_partition
from fenics_contact.scene import (
    Body,
    Coulomb,
    Scene,
    Tresca,
)
from fenics_contact.shape import TotalPotential
from tests.contact.gallery import crowned
from tests.shape.blocks import PLASTIC, RUBBER, block_on_block, problem
from tests.shape.chains import BOXES, SOLVER, chain, chain_designs
from tests.shape.moved_blocks import DRAG
from tests.shape.objectives import objectives
from tests.shape.quotients import Line, Remembering


def by_mortar(scene: Scene, **more: Any) -> Scene:
    """The same scene with mortar contact."""
    (pair,) = scene.contacts
    return replace(scene, contacts=[replace(pair, discretisation="mortar", **more)])


def bowl(points: np.ndarray) -> np.ndarray:
    """A gap that is small in the middle."""
    return np.asarray(0.006 + 0.02 * ((points[:, 0] - 1.02) ** 2 + (points[:, 1] - 0.55) ** 2))


def matching() -> Scene:
    """Two blocks whose nodes lie over one another; the lower one is larger."""
    lower = block((-0.4, -0.25, -1.0), (2.4, 1.25, 0.0), (7, 6, 2))
    upper = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 0.8), (5, 4, 2)), 0.04)
    bodies = {"lower": Body(lower, PLASTIC), "upper": Body(upper, RUBBER)}
    return replace(block_on_block(Coulomb(0.38), load=DRAG), bodies=bodies)


BLOCKS: dict[str, Callable[[], Scene]] = {
    "hexahedra": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG)),
    "tetrahedra": lambda: by_mortar(block_on_block(Coulomb(0.38), "tetrahedron", load=DRAG)),
    "facets": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG), geometry="faceted"),
    "Tresca": lambda: by_mortar(block_on_block(Tresca(0.8), load=DRAG)),
    "matching": lambda: by_mortar(matching(), geometry="faceted"),
    "given gap": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG), gap=bowl),
}
NAMES = (*BLOCKS, "chain")
OBJECTIVES = {name: objectives("link1" if name == "chain" else "upper") for name in NAMES}


def chain_problem_by_mortar(comm: MPI.Comm = MPI.COMM_SELF) -> Remembering:
    """Both crowns move."""
    scene = by_mortar(chain(Coulomb(0.3)))
    partitions = {name: box_partition(body.mesh, BOXES) for name, body in scene.bodies.items()}
    contact = ContactProblem(scene, comm, partitions=partitions, solver=SOLVER)
    return Remembering(contact, chain_designs(), TotalPotential())


@cache
def line(name: str) -> Line:
    """A line on which points stick, slip and are open, each in the same way all along."""
    rng = np.random.default_rng
    if name == "chain":
        links = chain_problem_by_mortar()
        return Line(
            links, 0.03 * rng(1).standard_normal(links.size), rng(5).standard_normal(links.size), 3e-4
        )
    blocks = problem(BLOCKS[name]())
    alpha = 0.01 * rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, rng(6).standard_normal(blocks.size), 1e-5)
