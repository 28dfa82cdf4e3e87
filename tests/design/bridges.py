"""Half a bridge under its own weight, of which the upper side moves far; as a script, on ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
)
from fenics_contact.design import Remeshed, StrainEnergy
from fenics_contact.errors import InvalidDesignError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.readers import refilled

STONE = IsotropicElasticity(100.0, 0.2)
COUNTS = (8, 2, 6)
#: The upper side sinks by two thirds of the height at the pier.
FAR = np.array([-0.3, -0.4, -0.6, -0.67])


def bridge(cell: str, counts: tuple[int, int, int] = COUNTS) -> Scene:
    """A beam with planes of symmetry at x = 0 and y = 0 that nothing but a pier at its end carries."""
    beam = block((0.0, 0.0, 0.0), (4.0, 0.6, 1.0), counts, cell)
    pier = block((3.13, 0.0, -0.6), (3.83, 0.7, 0.0), (3, 3, 2))
    return Scene(
        {"beam": Body(beam, STONE), "pier": Body(pier, STONE)},
        [
            Support("beam", "x0", (0.0, None, None)), Support("beam", "y0", (None, 0.0, None)),
            Support("pier", "z0"),
        ],
        [BodyForce("beam", (0.0, 0.0, -1.0))],
        [ContactPair(Surface("pier", "z1"), Surface("beam", "z0"), Coulomb(0.3), discretisation="node")],
    )  # fmt: skip


def bridge_problem(scene: Scene, comm: MPI.Comm = MPI.COMM_SELF, **more: Any) -> ShapeProblem:
    """The upper side moves; the sides follow within a narrow strip."""
    design = SurfaceDesign("beam", "z1", net=(4, 1), transition=0.15)
    return ShapeProblem(ContactProblem(scene, comm, tolerance=1e-9), design, StrainEnergy(), **more)


def farthest(problem: ShapeProblem, alpha: np.ndarray) -> float:
    """Return the largest multiple of a design, up to 2, that inverts no cell."""
    low, high = 0.0, 2.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        try:
            problem.scene_of(middle * alpha)
            low = middle
        except InvalidDesignError:
            high = middle
    return low


if __name__ == "__main__":
    far = Remeshed(bridge_problem(bridge("tetrahedron"), MPI.COMM_WORLD), refilled)
    value, gradient = far(FAR)
    alike = len(set(MPI.COMM_WORLD.allgather((value, gradient.tobytes())))) == 1
    if MPI.COMM_WORLD.rank == 0:
        print(int(alike), len(far.problems), value, *gradient)
