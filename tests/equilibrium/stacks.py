"""Stacks of blocks that can slide on each other."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.graph_partition import graph_partition
from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, Traction, Tresca
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

RUBBER = IsotropicElasticity(100.0, 0.3)


#: No axis of the turned bodies is one of the coordinates', no corner is exact in binary.
TURN = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()


SHIFT = np.array([0.7, -1.1, 0.3])


def turned_stack(friction: Coulomb | Tresca | None = None, discretisation: str = "node") -> Scene:
    """A block pressed on another one, both turned and shifted."""
    lower = block((0.0, 0.0, 0.0), (1.3, 1.1, 0.7), (3, 5, 3))
    upper = block((0.15, 0.1, 0.7), (1.15, 1.0, 1.3), (5, 3, 3))
    meshes = {"lower": lower, "upper": upper}
    return Scene(
        {name: Body(mesh.moved(mesh.points @ TURN.T + SHIFT), RUBBER) for name, mesh in meshes.items()},
        [Support("lower", "z0")],
        [Traction("upper", "z1", tuple(TURN @ [0.0, 0.0, -0.01]))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation)],
    )


def cut(scene: Scene, parts: int) -> dict[str, np.ndarray]:
    """Cut every body by METIS."""
    return {name: graph_partition(body.mesh, parts) for name, body in scene.bodies.items()}
