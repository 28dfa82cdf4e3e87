"""Error in a state from the geometry of its contact surfaces, by comparison with better known ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.solution import DualSolution
from fenics_contact.results.dual_solve import contact_result, row_values, solve_dual

#: Relative residual of the state of the better geometry: differences between states are a few percent of them
#: or not worth reporting.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class GeometryError:
    """Distance of a state from that of the true surfaces on the same mesh.

    Attributes:
        energy: Distance in energy norm, [√(force · length)].
        peak_pressure: Change of the largest contact pressure, relative to that of the better geometry.
    """

    energy: float = 0.0
    peak_pressure: float = 0.0


def geometry_error(
    system: DualSystem | DirectSystem, solution: DualSolution | DirectSolution
) -> GeometryError:
    """Estimate the geometry's share in the error of a state. Collective.

    The contact problem is solved once more with the gaps between surfaces that are known better: the shapes
    that the meshes carry, where facets or reconstructed surfaces were used; where there are none,
    reconstructed surfaces of the next order. Factors, coarse problem and preconditioner are those of the
    system. Zero where shapes are known and used, and between flat surfaces. It is not a bound: the error of
    the facets' normals is left out, which matters where their gaps happen to be right, as between mirrored
    bodies by mortar.

    Raises:
        ConvergenceError: If the solver fails on the better geometry.
    """
    torn = system.torn
    if not isinstance(system, DualSystem) or not isinstance(solution, DualSolution) or not torn.points.count:
        return GeometryError()
    gap = torn.finer_gap()
    if np.array_equal(gap, torn.points.gap):
        return GeometryError()
    solver = FaceNewton(tolerance=TOLERANCE)
    present = solve_dual(system, solver, solution)
    finer = DualSystem(torn.with_gap(gap), previous=system)
    better = solve_dual(finer, solver, present)
    way = better.multiplier - present.multiplier
    square = float(finer.problem.comm.allreduce(way @ finer.apply(way)))
    peaks = [_peak(system, present), _peak(finer, better)]
    by_geometry = abs(peaks[0] - peaks[1]) / peaks[1] if peaks[1] > 0.0 else 0.0
    return GeometryError(float(np.sqrt(max(square, 0.0))), by_geometry)


def _peak(system: DualSystem, solution: DualSolution) -> float:
    displacement = system.displacement(solution.multiplier, solution.alpha)
    return float(contact_result(system.torn, row_values(system, solution), displacement).pressure.max())
