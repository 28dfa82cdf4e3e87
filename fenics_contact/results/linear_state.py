"""The state of a scene with linear materials and small strains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._base.threads import one_thread
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.solution import DualSolution
from fenics_contact.results.adjoint_starts import AdjointStart
from fenics_contact.results.contact import RowValues
from fenics_contact.results.dual_solve import contact_result, row_values, solve_dual
from fenics_contact.results.rigid_motions import UnheldMotion, idle_motions, unheld_motions
from fenics_contact.results.state import State, comm_of

if TYPE_CHECKING:
    from fenics_contact._accuracy.state_errors import StateErrors


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearState(State):
    """The equilibrium of linear materials and small strains.

    Attributes:
        system: The dual system that was solved.

    Example:
        >>> print(state.estimate_errors())  # doctest: +SKIP
    """

    solution: DualSolution
    system: DualSystem

    @property
    def counts(self) -> dict[str, int]:
        """Those of every state, and the ``kinds`` of subdomains whose factors those alike share, by rank."""
        return {**super().counts, "kinds": self.system.kinds}

    def _errors_in_words(self) -> dict[str, str]:
        if self.known_errors is None:
            return {"errors": "not estimated yet: call state.estimate_errors()"}
        return {f"error, {name}": words for name, words in self.known_errors.in_words.items()}

    @property
    def dual(self) -> DualSystem:
        """The dual system.

        Raises:
            InvalidInputError: If the state was computed without one.
        """
        return self.system

    @property
    def dual_solution(self) -> DualSolution:
        """The result of the dual solver; raises as `dual` does."""
        return self.solution

    @property
    def reusable(self) -> DualSystem | None:
        """The dual system."""
        return self.system

    def adjoint_start(self, multiplier: np.ndarray) -> AdjointStart:
        """Return what adjoints of states nearby start from, given one of this state, owned. Collective."""
        return AdjointStart.of(self.torn, self.solution.multiplier, multiplier)

    @property
    def products(self) -> int:
        """Products with F so far."""
        return self.system.products

    @cached_property
    def rows(self) -> RowValues:
        """Multipliers, residuals and steps of the natural map by row; raises as `dual` does."""
        return row_values(self.dual, self.dual_solution)

    @collectively("LinearState.estimate_errors", comm_of)
    def estimate_errors(self, *, geometry: bool = True) -> StateErrors:
        """Bound or estimate the errors by solver, friction law, mesh and geometry, in energy norm.

        Collective. Costs at most one product and recovery of the stress, which a balanced solve has done
        already; the error by the geometry up to two solutions of the contact problem with the same factors,
        unless surfaces are flat or their shapes known and used. Estimates are kept in `known_errors`.

        Args:
            geometry: Whether to estimate that, too; else it is NaN unless it is known.

        Raises:
            ConvergenceError: If the solver fails on the better geometry.
        """
        from fenics_contact._accuracy.discretisation import discretisation_error
        from fenics_contact._accuracy.state_errors import solver_errors, state_errors

        with Task("errors"), one_thread(comm_of(self)):
            errors = self.known_errors
            if errors is None:
                solver = solver_errors(self.system, self.solution)
                estimate = discretisation_error(self.torn, self.conforming_displacement)
                errors = state_errors(solver, estimate, self.energies.norm)
            if geometry and np.isnan(errors.geometry):
                errors = errors.with_geometry(*self._geometry_error())
        object.__setattr__(self, "known_errors", errors)
        return errors

    @cached_property
    def unheld(self) -> tuple[UnheldMotion, ...]:
        """See `State.unheld`. Collective on first use."""
        return unheld_motions(self.system) + idle_motions(self.system, self.solution)

    @cached_property
    @collectively("LinearState.conforming_displacement", comm_of)
    def conforming_displacement(self) -> np.ndarray:
        """See `State.conforming_displacement`; without iteration. Collective on first use."""
        return self.system.conforming(self.torn_displacement)

    def _geometry_error(self) -> tuple[float, float]:
        """Estimate the distance to the state of the true surfaces on the same mesh. Collective.

        The contact problem is solved once more with the gaps between surfaces that are known better: the
        shapes that the meshes carry, where facets or reconstructed surfaces were used; where there are none,
        reconstructed surfaces of the next order. Factors, coarse problem and preconditioner are those of the
        system. It is not a bound: the error of the facets' normals is left out, which matters where their
        gaps happen to be right, as between mirrored bodies by mortar. Returns distance in energy norm,
        [√(force · length)], and change of the largest contact pressure, relative to that of the better
        geometry; zeros where shapes are known and used, and between flat surfaces.
        """
        torn, system = self.torn, self.system
        if not torn.points.count:
            return 0.0, 0.0
        gap = torn.finer_gap()
        if np.array_equal(gap, torn.points.gap):
            return 0.0, 0.0
        solver = FaceNewton(tolerance=GEOMETRY_TOLERANCE)
        present = solve_dual(system, solver, self.solution)
        finer = DualSystem(torn.with_gap(gap), previous=system)
        better = solve_dual(finer, solver, present)
        way = better.multiplier - present.multiplier
        square = float(finer.problem.comm.allreduce(way @ finer.apply(way)))
        peaks = [_peak(system, present), _peak(finer, better)]
        by_geometry = abs(peaks[0] - peaks[1]) / peaks[1] if peaks[1] > 0.0 else 0.0
        return float(np.sqrt(max(square, 0.0))), by_geometry

    @cached_property
    def _least_force(self) -> float:
        return _rounding_force(self.torn, self.torn_displacement)


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class DirectState(LinearState):
    """The state of one body that supports hold, whose stiffness was factored: there are no multipliers."""

    solution: DirectSolution  # type: ignore[assignment]
    system: DirectSystem  # type: ignore[assignment]

    @property
    def counts(self) -> dict[str, int]:
        """Those of every state."""
        return super(LinearState, self).counts

    @property
    def dual(self) -> DualSystem:
        """None; raises `InvalidInputError`."""
        raise _no_multipliers()

    @property
    def dual_solution(self) -> DualSolution:
        """None; raises `InvalidInputError`."""
        raise _no_multipliers()

    @property
    def reusable(self) -> DualSystem | None:
        """None."""
        return None

    @cached_property
    def unheld(self) -> tuple[UnheldMotion, ...]:
        """None: supports hold the body."""
        return ()

    def _geometry_error(self) -> tuple[float, float]:
        return 0.0, 0.0


def _no_multipliers() -> InvalidInputError:
    return InvalidInputError(
        "this needs multipliers, but the state of one body that supports hold was solved directly: solve "
        "with design=True"
    )


def as_linear(state: State, what: str) -> LinearState:
    """Return a state as that of linear materials, which something needs."""
    if isinstance(state, LinearState):
        return state
    raise InvalidInputError(
        f"{what} need small strains and linear materials, this state has nonlinear materials: compare states "
        "on two meshes instead"
    )


#: Relative residual of the state of the better geometry: differences between states are a few percent of them
#: or not worth reporting.
GEOMETRY_TOLERANCE = 1e-6


def _peak(system: DualSystem, solution: DualSolution) -> float:
    displacement = system.displacement(solution.multiplier, solution.alpha)
    return float(contact_result(system.torn, row_values(system, solution), displacement).pressure.max())


def _rounding_force(torn: TornSystem, displacement: np.ndarray) -> float:
    """Return a force far above what rounding makes of a displacement, and far below one that strains by it.

    Collective.

    `displacement`: u of this rank, torn, shape (torn_size,), [length].
    """
    comm = torn.decomposition.comm
    stiff = max((float(part.stiffness.diagonal().max()) for part in torn.subdomains), default=0.0)
    square, count = comm.allreduce(np.array([displacement @ displacement, displacement.size]))
    return float(np.sqrt(ROUNDING * square / count) * comm.allreduce(stiff, op=MPI.MAX))
