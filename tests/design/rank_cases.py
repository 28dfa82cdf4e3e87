"""Designs whose answers must not depend on the number of ranks: run it under mpirun, or call `collect`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import BodyForce, Coulomb, Surface, ThermalStrain, TotalForce, Tresca
from fenics_contact.design import PressureNorm
from fenics_contact.design.motion import MeshMotion
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from tests.design.aims import aims
from tests.design.blocks import block_on_block, problem
from tests.design.chains import chain_problem
from tests.design.deformed_blocks import design_problem, pressed
from tests.design.loaded_blocks import loaded, warm
from tests.design.mortar_lines import chain_problem_by_mortar
from tests.design.objectives import objectives
from tests.design.plane_blocks import on_block, plane_problem
from tests.design.quotients import Remembering
from tests.design.tied_blocks import capped

#: Four subdomains, two of each body: on four ranks every rank lacks a body. A chain of eight subdomains.
PROBLEMS: dict[str, Callable[[MPI.Comm], Remembering]] = {
    "blocks, tetrahedra": lambda comm: problem(
        block_on_block(Coulomb(0.38), "tetrahedron", load=(0.6, 0.12, -2.0)), comm
    ),
    "blocks, Tresca": lambda comm: problem(block_on_block(Tresca(0.8), load=(0.6, 0.12, -2.0)), comm),
    "chain": lambda comm: chain_problem(Coulomb(0.3), comm),
    "plane, quadratic": lambda comm: plane_problem(on_block(Coulomb(0.38), "quadrilateral", 2), comm),
    "chain by mortar": chain_problem_by_mortar,
    "loaded": lambda comm: plane_problem(
        loaded(
            "triangle",
            [
                TotalForce("block", "y1", (0.6, -4.0), moment=0.2, at=(1.1, 1.2)),
                BodyForce("block", lambda points: 0.2 * np.sin(points)),
                ThermalStrain("block", warm),
            ],
        ),
        comm,
        also=[Surface("block", "y1")],
        cuts=4,
    ),
    "tied": lambda comm: plane_problem(capped("triangle", sliding=True), comm, also=[Surface("block", "y1")]),
    "rubber": lambda comm: design_problem(
        pressed("disc", 0.6, 0.03), PressureNorm(), tolerance=1e-11, comm=comm
    ),
}
#: Who judges: between them they ask everything of a state.
JUDGES = {
    "blocks, tetrahedra": ("stress", "friction forces", "largest stress", "movement", "friction work"),
    "blocks, Tresca": ("displacement", "largest pressure", "unevenness"),
    "chain": ("energy", "normal forces", "largest of two"),
    "plane, quadratic": ("displacement", "friction forces", "largest stress"),
    "chain by mortar": ("energy", "stress", "unevenness"),
    "tied": ("stress", "normal forces"),
    "loaded": ("energy", "stress"),
    "rubber": ("normal forces", "pressure norm", "movement"),
}
BODY = {
    "chain": "link2",
    "plane, quadratic": "block",
    "chain by mortar": "link2",
    "tied": "cap",
    "loaded": "block",
    "rubber": "block",
}
SURFACE = {
    "chain": "contact",
    "plane, quadratic": "y0",
    "chain by mortar": "contact",
    "tied": "y0",
    "loaded": "y0",
    "rubber": "x1",
}
SIZE = {"chain": 0.03, "plane, quadratic": 0.004, "chain by mortar": 0.03, "tied": 0.004, "loaded": 0.004}


def same_bits(comm: MPI.Comm, *arrays: np.ndarray | float) -> bool:
    """Whether all ranks hold the same numbers, bit by bit."""
    mine = b"".join(np.asarray(array).tobytes() for array in arrays)
    return len(set(comm.allgather(mine))) == 1


def design_case(name: str, comm: MPI.Comm) -> dict[str, Any]:
    """Value and gradient for some objectives, and the volume."""
    moving = PROBLEMS[name](comm)
    alpha = SIZE.get(name, 0.01) * np.random.default_rng(1).standard_normal(moving.size)
    found: dict[str, Any] = {"same bits": True}
    for judge in JUDGES[name]:
        body = BODY.get(name, "upper")
        objective = {**objectives(body), **aims(body, SURFACE.get(name, "z0"), moving.scene.dim)}[judge]
        point = moving.evaluate_by(objective, alpha)
        found[judge] = [point.value, point.gradient.tolist()]
        found["same bits"] &= same_bits(comm, point.value, point.gradient, moving.value_by(objective, alpha))
    volume, gradient = moving.volume(alpha)
    found["same bits"] &= same_bits(comm, volume, gradient, *moving.points_of(alpha).values())
    found["volume"] = [volume, gradient.tolist()]
    found["status"] = point.state.contact.status.tolist()
    found["weak"] = [point.weak.contacts, point.weak.discs]
    return found


def motion_case(comm: MPI.Comm) -> dict[str, Any]:
    """The extension of one displacement into each block, and of one derivative back."""
    moving = PROBLEMS["blocks, tetrahedra"](comm)
    rng, found = np.random.default_rng(2), {}
    bodies = {mesh.body for mesh in moving.contact.decomposition.meshes}
    motion: MeshMotion
    for design, motion in zip(moving.designs, moving.geometry.motions, strict=True):
        given = rng.standard_normal((len(motion.moving), 3))
        by_points = rng.standard_normal((moving.scene.bodies[design.body].mesh.n_nodes, 3))
        moved, pulled = motion.extend(given), motion.pull_back(by_points)
        found[design.body] = {
            "moved": moved.tolist(),
            "pulled": pulled.tolist(),
            "forth and back": [float(np.sum(moved * by_points)), float(np.sum(given * pulled))],
            "ranks without it": comm.allreduce(int(design.body not in bodies)),
        }
    return found


def refusals(comm: MPI.Comm) -> list[str]:
    """What each rank is told of a design that inverts cells and of one that is no design."""
    moving = PROBLEMS["blocks, Tresca"](comm)
    said = []
    for alpha in (np.full(moving.size, -2.0), np.zeros(moving.size + 1), np.full(moving.size, np.nan)):
        try:
            moving.evaluate(alpha)
            said.append("nothing")
        except (InvalidDesignError, InvalidInputError) as error:
            said.append(f"{type(error).__name__}: {error}")
    return [words for rank in comm.allgather(said) for words in rank]


def collect(comm: MPI.Comm) -> dict[str, Any]:
    """Run all cases. Collective."""
    return {
        "ranks": comm.size,
        "designs": {name: design_case(name, comm) for name in PROBLEMS},
        "motion": motion_case(comm),
        "refusals": refusals(comm),
    }


if __name__ == "__main__":
    answer = collect(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
