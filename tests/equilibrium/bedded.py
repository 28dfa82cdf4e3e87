"""A block of a material that resists every motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    Scene,
    Surface,
    TotalForce,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, rigid_body_modes
from fenics_contact.results.deformed_state import AnyState

BED, FORCE = 0.05, (300.0, 0.0, -3200.0)  # N/mm⁴, N


@dataclass(frozen=True)
class Bedded(IsotropicElasticity):
    bed: float = BED
    sideways: bool = True

    @property
    def parameters(self) -> tuple[float, ...]:
        return (*super().parameters, self.bed)

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        held = ufl.inner(u, v) if self.sideways else u[2] * v[2]
        return super().stiffness(u, v, parameters) + parameters[2] * held

    def kernel(self, points: np.ndarray) -> np.ndarray:
        # Only what neither lifts nor tilts the body costs nothing on a bed that acts upwards alone.
        return rigid_body_modes(points)[:, :, [] if self.sideways else [0, 1, 5]]


def pushed(material: Bedded, parts: tuple[int, int, int], *, on_floor: bool = True) -> AnyState:
    mesh = block((0.0, 0.0, 0.0), (20.0, 20.0, 40.0), (3, 3, 6))
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    contacts = [floor] if on_floor else []
    scene = Scene({"block": Body(mesh, material)}, [], [TotalForce("block", "z1", FORCE)], contacts)
    return solve_scene(
        scene, MPI.COMM_WORLD, partitions={"block": box_partition(mesh, parts)}, tolerance=1e-9
    )
