"""Two chain links whose crowns both move, in every regime of contact."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    Tresca,
    box_partition,
)
from fenics_contact.design import TotalPotential
from fenics_contact.gallery import LinkShape, TwoLinks, two_links
from fenics_contact.gallery.links import PULL_AXIS
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from tests.design.quotients import Line, Remembering
from tests.scenes import Friction

#: Tight enough for difference quotients with steps of 1e-5.
SOLVER = FaceNewton(tolerance=1e-11)

#: A short-link chain, coarse; soft enough that ten nodes touch.
LINK = LinkShape(inner_radius=10.0, n_around=24, n_a=2, n_b=8)
BRONZE = IsotropicElasticity(4.2e4, 0.3)
PULL = 50e3
BOXES = (4, 1, 1)


@cache
def crossed_links() -> TwoLinks:
    """Two links in touch, the second turned and shifted a little: no node lies over an edge of a facet."""
    links = two_links(LINK)
    rotation = Rotation.from_euler("xyz", [2.0, 1.0, -1.5], degrees=True).as_matrix()
    tilted = links.second.placed(rotation, np.array([0.0, 0.25, 0.2]))
    first = links.first.mesh
    nodes = np.unique(tilted.mesh.surfaces["contact"])
    for _ in range(20):
        gap = first.shapes["contact"].distance(tilted.mesh.points[nodes]).min()
        tilted = tilted.placed(np.eye(3), gap * PULL_AXIS)
    return TwoLinks(links.first, tilted)


def chain(friction: Friction, geometry: str = "best", pull: float = PULL) -> Scene:
    """Link 1 is held at its far crown, link 2 pulled at its own; without friction a guide steadies it."""
    links = crossed_links()
    guide = [] if friction else [Support("link2", "grip", (None, 0.0, 0.0))]
    return Scene(
        {"link1": Body(links.first.mesh, BRONZE), "link2": Body(links.second.mesh, BRONZE)},
        [Support("link1", "grip"), *guide],
        [TotalForce("link2", "grip", (pull, 0.0, 0.0))],
        [ContactPair(Surface("link2", "contact"), Surface("link1", "contact"), friction, "node", geometry)],
    )


def chain_designs() -> tuple[SurfaceDesign, SurfaceDesign]:
    """Both crowns move: the master's with 12 and the slave's with 6 control points."""
    links = crossed_links()
    return SurfaceDesign("link1", links.first.crown, (4, 3)), SurfaceDesign(
        "link2", links.second.crown, (3, 2)
    )


def chain_problem(
    friction: Friction, comm: MPI.Comm = MPI.COMM_SELF, geometry: str = "best", **more: Any
) -> Remembering:
    scene = chain(friction, geometry)
    partitions = {name: box_partition(body.mesh, BOXES) for name, body in scene.bodies.items()}
    contact = ContactProblem(scene, comm, partitions=partitions, solver=SOLVER)
    return Remembering(contact, chain_designs(), TotalPotential(), **more)


#: Friction law and step of the difference quotients. Where every point slips, friction alone holds link 2 and
#: everything depends on the design most nonlinearly.
REGIMES: dict[str, tuple[Friction, float]] = {
    "frictionless": (None, 3e-4),
    "slip": (Coulomb(0.1), 1e-5),
    "mixed": (Coulomb(0.3), 3e-4),
    "stick": (Coulomb(4.0), 3e-4),
    "Tresca": (Tresca(50.0), 1e-4),
}


@cache
def line(regime: str, geometry: str = "best") -> Line:
    """A line of designs without symmetry, on which every point keeps its status."""
    friction, step = REGIMES[regime]
    problem = chain_problem(friction, geometry=geometry)
    alpha = 0.03 * np.random.default_rng(1).standard_normal(problem.size)
    direction = np.random.default_rng(5).standard_normal(problem.size)
    # The small step of all slip would leave some remainders at the level of rounding.
    return Line(problem, alpha, direction, step, (16.0, 32.0) if regime == "slip" else (4.0, 8.0))
