"""Blocks and chain links that meet by mortar, on lines of designs that move both surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, Coulomb, Scene, Surface, Tresca, box_partition
from fenics_contact.design import Objective, TotalPotential
from fenics_contact.gallery import block
from tests.design.aims import aims
from tests.design.blocks import PLASTIC, RUBBER, block_on_block, problem
from tests.design.chains import BOXES, SOLVER, chain, chain_designs
from tests.design.moved_blocks import DRAG
from tests.design.objectives import objectives
from tests.design.plane_blocks import line_of, on_block
from tests.design.quotients import Line, Remembering
from tests.scenes import crowned


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


def beyond_the_rim() -> Scene:
    """The slave is the larger block below; some of its nodes hardly face the upper one."""
    scene = block_on_block(Coulomb(0.38), load=DRAG)
    lower = block((-0.6, -0.3, -1.0), (2.13, 1.5, 0.0), (7, 6, 2))
    bodies = {"lower": Body(lower, PLASTIC), "upper": scene.bodies["upper"]}
    (pair,) = scene.contacts
    assert isinstance(pair.master, Surface)
    turned = replace(pair, slave=pair.master, master=pair.slave, geometry="faceted")
    return by_mortar(replace(scene, bodies=bodies, contacts=[turned]))


BLOCKS: dict[str, Callable[[], Scene]] = {
    "hexahedra": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG)),
    "tetrahedra": lambda: by_mortar(block_on_block(Coulomb(0.38), "tetrahedron", load=DRAG)),
    "facets": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG), geometry="faceted"),
    "Tresca": lambda: by_mortar(block_on_block(Tresca(0.8), load=DRAG)),
    "matching": lambda: by_mortar(matching(), geometry="faceted"),
    "adjusted": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG), adjust=0.01),
    "rim": beyond_the_rim,
    "given gap": lambda: by_mortar(block_on_block(Coulomb(0.38), load=DRAG), gap=bowl),
}
PLANE: dict[str, Callable[[], Scene]] = {
    "plane": lambda: by_mortar(on_block(Coulomb(0.38), "quadrilateral")),
    "plane, Tresca": lambda: by_mortar(on_block(Tresca(0.8), "triangle")),
    "plane, facets": lambda: by_mortar(on_block(Coulomb(0.38), "triangle"), geometry="faceted"),
}
NAMES = (*BLOCKS, *PLANE, "chain")
#: The body that objectives are about, and its surface in contact.
PLACE = {
    **dict.fromkeys(BLOCKS, ("upper", "z0")), **dict.fromkeys(PLANE, ("block", "y0")),
    "chain": ("link1", "contact"),
}  # fmt: skip
#: What depends on the areas of the nodes, too.
PRESSURES = ("unevenness", "area")


def judges(name: str) -> dict[str, Objective]:
    """Functions of everything."""
    more = aims(*PLACE[name], 2 if name in PLANE else 3)
    return objectives(PLACE[name][0]) | {each: more[each] for each in PRESSURES}


OBJECTIVES = {name: judges(name) for name in NAMES}


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
    if name in PLANE:
        return line_of(PLANE[name]())
    blocks = problem(BLOCKS[name]())
    alpha = 0.01 * rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, rng(6).standard_normal(blocks.size), 1e-5)
