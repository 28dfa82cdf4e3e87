"""The chain of the demo as a design problem, with states of any tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from mpi4py import MPI

from fenics_contact.geometry import LinkShape, TwoLinks, box_partition, two_links
from fenics_contact.optimize import BundleTrust, LinearConstraints, Result, minimize
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    IsotropicElasticity,
    Scene,
    Support,
    Surface,
    TotalForce,
)
from fenics_contact.shape import AdaptiveTolerance, ShapeProblem, SurfaceDesign, TotalPotential

SIZES = {"small": LinkShape(n_around=36, n_a=6, n_b=14), "paper": LinkShape(n_around=48, n_a=8, n_b=20)}
#: Largest distance of a control point from its place, [mm].
BOUND = 0.25


@dataclass(frozen=True)
class Chain:
    """The chain of one size."""

    size: str

    def problem(self, tolerance: float | AdaptiveTolerance) -> ShapeProblem:
        """Return the design problem."""
        links = _links(self.size)
        steel = IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)
        scene = Scene(
            bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
            supports=[Support("link 1", "grip")],
            loads=[TotalForce("link 2", "grip", (80e3, 0.0, 0.0))],
            contacts=[
                ContactPair(Surface("link 2", "contact"), Surface("link 1", "contact"), friction=Coulomb(0.3))
            ],
        )
        partitions = {name: box_partition(body.mesh, (8, 1, 2)) for name, body in scene.bodies.items()}
        design = SurfaceDesign("link 1", links.first.crown, net=(7, 4))
        return ShapeProblem(scene, partitions, design, TotalPotential(), MPI.COMM_SELF, tolerance=tolerance)

    def minimised(self, problem: ShapeProblem, tolerance: float) -> Result:
        """Minimise within the box, without losing volume."""
        start = np.zeros(problem.size)
        _, by_volume = problem.volume(start)
        return minimize(
            problem,
            start,
            BundleTrust(tolerance=tolerance, raise_on_failure=False),
            bounds=(start - BOUND, start + BOUND),
            constraints=LinearConstraints(-by_volume[None, :], [0.0]),
        )


@cache
def _links(size: str) -> TwoLinks:
    return two_links(SIZES[size], comm=MPI.COMM_SELF)
