"""Chains and blocks whose contact surfaces move, in every regime of contact, and objectives that judge them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact.contact import ContactResult
from fenics_contact.geometry import (
    PULL_AXIS,
    BodyMesh,
    DesignSurface,
    LinkShape,
    TwoLinks,
    box_partition,
    mutual_clearance,
    two_links,
)
from fenics_contact.qp import FaceNewton
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    IsotropicElasticity,
    Scene,
    Support,
    Surface,
    TotalForce,
    Tresca,
)
from fenics_contact.shape import (
    ContactForces,
    Objective,
    SurfaceDesign,
    TotalPotential,
    VolumeIntegral,
)
from tests.shape.quotients import Remembering

#: Tight enough for difference quotients with steps of 1e-5.
SOLVER = FaceNewton(tolerance=1e-11)
Friction = Coulomb | Tresca | None

#: A short-link chain, coarse; soft enough that ten nodes touch.
LINK = LinkShape(inner_radius=10.0, n_around=24, n_a=2, n_b=8)
BRONZE = IsotropicElasticity(4.2e4, 0.3)
PULL = 80e3
BOXES = (4, 1, 1)


@lru_cache(maxsize=None)
def crossed_links() -> TwoLinks:
    """Two links in touch, the second a little turned and shifted: no node lies on an edge of a facet."""
    links = two_links(LINK)
    tilted = links.second.placed(Rotation.from_euler("xyz", [2.0, 1.0, -1.5], degrees=True).as_matrix(), np.zeros(3))
    tilted = tilted.placed(np.eye(3), np.array([0.0, 0.25, 0.2]))
    first = links.first.mesh
    touching = tilted.placed(np.eye(3), mutual_clearance(first, tilted.mesh) * PULL_AXIS)
    return TwoLinks(links.first, touching, mutual_clearance(first, touching.mesh), links.faceting)


def chain(friction: Friction) -> Scene:
    """Link 1 is held at its far crown, link 2 pulled at its own; without friction a guide keeps it from turning."""
    links = crossed_links()
    guide = [] if friction else [Support("link2", "grip", (None, 0.0, 0.0))]
    return Scene(
        {"link1": Body(links.first.mesh, BRONZE), "link2": Body(links.second.mesh, BRONZE)},
        [Support("link1", "grip"), *guide],
        [TotalForce("link2", "grip", (PULL, 0.0, 0.0))],
        [ContactPair(Surface("link2", "contact"), Surface("link1", "contact"), friction)],
    )


def chain_designs() -> tuple[SurfaceDesign, SurfaceDesign]:
    """Both crowns move: the master's with 12 and the slave's with 6 control points."""
    links = crossed_links()
    return SurfaceDesign("link1", links.first.crown, (4, 3)), SurfaceDesign("link2", links.second.crown, (3, 2))


def chain_problem(friction: Friction, comm: MPI.Comm = MPI.COMM_SELF, **more: Any) -> Remembering:
    scene = chain(friction)
    partitions = {name: box_partition(body.mesh, BOXES) for name, body in scene.bodies.items()}
    return Remembering(scene, partitions, chain_designs(), TotalPotential(), comm, solver=SOLVER, **more)


def _squares(forces: np.ndarray) -> tuple[float, np.ndarray]:
    return float((forces**2).sum()), 2 * forces


def normal_forces(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    value, by_normal = _squares(contact.normal_force)
    return value, by_normal, np.zeros((len(by_normal), 2))


def friction_forces(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    value, by_friction = _squares(contact.friction_force)
    return value, np.zeros(len(by_friction)), by_friction


def misfit(u: Any, x: Any, stress: Any) -> Any:
    """Displacement along x beside a given field."""
    return (u[0] - 0.01 * ufl.sin(x[1] + x[2])) ** 2


def squared_stress(u: Any, x: Any, stress: Any) -> Any:
    return ufl.inner(stress, stress) * (1 + 0.01 * x[0])


def objectives(body: str) -> dict[str, Objective]:
    """Functions of everything: energy, stress, displacement, normal and friction forces."""
    return {
        "energy": TotalPotential(),
        "stress": VolumeIntegral("squared stress", squared_stress, body),
        "displacement": VolumeIntegral("misfit", misfit, body),
        "normal forces": ContactForces(normal_forces),
        "friction forces": ContactForces(friction_forces),
    }
