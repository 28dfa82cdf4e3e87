"""A scene of the comparison by this package."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.scene_data import PLANE_HEIGHT
from benchmarks.peers.evaluation import Whole, evaluated, taken
from benchmarks.peers.scenes import SCENES, PeerScene
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tolerance,
    Traction,
    solve_scene,
)
from fenics_contact._scene.pairs import AnyDiscretisation
from fenics_contact.materials import IsotropicElasticity


def in_ours(scene: PeerScene, discretisation: AnyDiscretisation = "best") -> Scene:
    """Return the scene of this package; by default it chooses how surfaces are coupled."""
    material = IsotropicElasticity(scene.young, scene.poisson)
    master = RigidPlane((0, 0, PLANE_HEIGHT), (0, 0, 1)) if scene.master is None else Surface(*scene.master)
    friction = Coulomb(scene.friction) if scene.friction else None
    # Meshes that overlap are a press fit; the circle through their nodes says by how much.
    pair = ContactPair(
        Surface(*scene.slave),
        master,
        friction,
        discretisation,
        interference="measured" if "hub" in scene.bodies else None,
    )
    loads = [] if scene.traction is None else [Traction(*scene.traction[0], scene.traction[1])]
    bodies = {name: Body(mesh, material) for name, mesh in scene.bodies.items()}
    return Scene(bodies, [Support(*side, value) for side, value in scene.held], loads, [pair])


def measure(
    comm: MPI.Comm, scene: str, discretisation: AnyDiscretisation = "best", tolerance: Tolerance = None
) -> dict[str, Any]:
    """Return the record of a scene's state; processor seconds from the meshes to the state."""
    start, given = process_time(), SCENES[scene]()
    state = solve_scene(in_ours(given, discretisation), comm, tolerance=tolerance)
    record = taken(start, state.counts["f_products"], True)  # or it raises
    displacement = np.concatenate([state.gather_displacement(name) for name in given.bodies])
    return {**record, **evaluated(Whole(given), displacement)}
