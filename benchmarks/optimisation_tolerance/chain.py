"""The chain of the demo as a design problem, with states of any tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from mpi4py import MPI

from fenics_contact.contact import ContactProblem
from fenics_contact.gallery import TwoLinks
from fenics_contact.optimize import BundleTrust, LinearConstraints, Result, minimize
from fenics_contact.partition import box_partition
from fenics_contact.shape import AdaptiveTolerance, ShapeProblem, SurfaceDesign, TotalPotential
from fenics_contact.study.scenes.chain_links import chain, graded_links

#: Cells around, through and across each link.
SIZES = {"small": (36, 6, 14), "paper": (48, 8, 20)}
#: Largest distance of a control point from its place, [mm].
BOUND = 0.25


@dataclass(frozen=True)
class Chain:
    """The chain of one size."""

    size: str

    def problem(self, tolerance: float | AdaptiveTolerance) -> ShapeProblem:
        """Return the design problem."""
        links = _links(self.size)
        scene = chain(links)
        partitions = {name: box_partition(body.mesh, (8, 1, 2)) for name, body in scene.bodies.items()}
        design = SurfaceDesign("link 1", links.first.crown, net=(7, 4))
        return ShapeProblem(
            ContactProblem(scene, MPI.COMM_SELF, partitions=partitions),
            design,
            TotalPotential(),
            tolerance=tolerance,
        )

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
    return graded_links(SIZES[size], MPI.COMM_SELF)
