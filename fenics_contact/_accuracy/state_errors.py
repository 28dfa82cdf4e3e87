"""The errors of a state, all in one norm: solver, friction law, mesh and geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from fenics_contact._accuracy.certificate import Certificate, certify, direct_error
from fenics_contact._accuracy.discretisation import DiscretisationError
from fenics_contact._base.display import Table, tabled
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.solution import DualSolution


def friction_error(system: DualSystem, solution: DualSolution, certificate: Certificate) -> float:
    """Estimate the error due to inexact slip bounds. Collective; no product.

    The slip bounds of a solution follow its normal forces, Ψ = Ψ₀ + μ λ_N, and have an error μ δλ_N where
    these have an error δλ_N. The certificate approximates δλ_N by one preconditioned step. At slipping points
    friction then changes by μ δλ_N along its direction, which deforms the bodies by about √Σ F_ii (μ δλ_i)².
    Where the preconditioner overestimates, it is limited to μ times the bound.

    It is an estimate, not a bound: Coulomb's law does not minimise an energy. It measures the distance from
    the solution of Tresca's problem with the slip bounds of the certificate, to which that bound refers, to
    that of Coulomb's law, including the raise of slip bounds for the certificate. Zero where nothing slips,
    and where slip bounds do not follow the normal forces.
    """
    torn, layout, known = system.torn, system.problem.layout, certificate.known
    coefficient = torn.law.growth(solution.multiplier)
    change = np.where(known.statuses.slip, coefficient * certificate.error[layout.tangential_frictional], 0.0)
    raised = known.slip_bound - solution.slip_bound
    flexibility = system.problem.diagonal[layout.tangential].mean(axis=1)
    squares = global_sum(system.problem.comm, flexibility @ change**2, flexibility @ raised**2)
    by_law, by_limit = (float(part) for part in np.sqrt(squares))
    largest = float(torn.groups.slips.coefficient.max(initial=0.0))
    return min(by_law, largest * certificate.bound) + by_limit


@tabled
@dataclass(frozen=True, eq=False)
class StateErrors:
    """Errors of a state in energy norm, relative to that of the displacement, ‖u‖ = √(uᵀK u).

    Attributes:
        algebraic: Upper bound of the solver's error, by duality: both of the fields,
            `State.conforming_displacement`, and of the torn displacement. Without Coulomb's law that is the
            distance to the solution; with it, the distance to the solution of Tresca's problem with the
            state's own slip bounds, and `friction` estimates the rest. Infinite where no bound is known, see
            `certify`.
        friction: Estimate, not a bound, of the distance from there to the solution of Coulomb's law, see
            `friction_error`; zero without it.
        discretisation: Estimate, not a bound, of the error of the mesh, see `discretisation_error`.
        geometry: Estimate, not a bound, of the error by the geometry of contact surfaces:
            the distance to the state of the true surfaces on the same mesh; NaN if not estimated, see
            `LinearState.estimate_errors`.
        peak_by_geometry: Its effect on the largest contact pressure, relative to it, or NaN.
        norm: ‖u‖, [√(force · length)].
        by_body: Body name -> its part of `discretisation`; the sum of squares is its square.
        own_bounds: Whether slip bounds follow normal forces, so that `algebraic` refers to those of the
            state.

    Example:
        >>> print(state.estimate_errors())  # doctest: +SKIP
        algebraic       0.0120 % (at most, at the slip bounds of the state)
        friction        0.0031 % (estimate)
        discretisation  4.2 % (estimate)
        geometry        0.81 % (estimate), 2.3 % in peak pressure
    """

    algebraic: float
    friction: float
    discretisation: float
    norm: float
    by_body: Mapping[str, float]
    own_bounds: bool
    _estimate: DiscretisationError = field(repr=False)
    geometry: float = np.nan
    peak_by_geometry: float = np.nan

    def with_geometry(self, energy: float, peak_pressure: float) -> StateErrors:
        """Return the errors with that of the geometry.

        Args:
            energy: Distance in energy norm, [√(force · length)].
            peak_pressure: Relative change of the largest contact pressure.
        """
        return replace(self, geometry=_ratio(energy, self.norm), peak_by_geometry=peak_pressure)

    def by_cell(self, body: str) -> np.ndarray:
        """Return the part of each cell of a body of `discretisation`, shape (n_cells,), replicated.

        The sum of squares over the cells of all bodies is its square. Collective.
        """
        values = self._estimate.by_cell(body)
        return values / self.norm if self.norm > 0.0 else values

    @property
    def in_words(self) -> dict[str, str]:
        """Name of each error -> its size and what is known of it."""
        parts = {
            "algebraic": (self.algebraic, f"at most{', at the slip bounds of the state' * self.own_bounds}"),
            "friction": (self.friction, "estimate"),
            "discretisation": (self.discretisation, "estimate"),
            "geometry": (self.geometry, "estimate"),
        }
        words = {name: _in_percent(value, kind) for name, (value, kind) in parts.items()}
        if self.geometry > 0.0:
            words["geometry"] += f", {100 * self.peak_by_geometry:.2g} % in peak pressure"
        return words

    def _tables(self) -> list[Table]:
        """Return a table with one line for each error."""
        return [Table(list(self.in_words.items()), 2, headed=False)]


@dataclass(frozen=True)
class SolverErrors:
    """Errors of a solver, in energy norm, [√(force · length)].

    Attributes:
        algebraic: Upper bound of its error at the slip bounds of its solution.
        friction: Estimate of the error due to these slip bounds.
        own_bounds: Whether slip bounds follow normal forces; else those of the solution are given.
    """

    algebraic: float
    friction: float
    own_bounds: bool = False

    @property
    def together(self) -> float:
        """The sum of both: a bound of the distance to the solution, with Coulomb's law an estimate of it."""
        return self.algebraic + self.friction


def solver_errors(system: DualSystem | DirectSystem, solution: DualSolution | DirectSolution) -> SolverErrors:
    """Return the errors of a solver. Collective; at most one product and one application of S."""
    if isinstance(system, DirectSystem):
        assert isinstance(solution, DirectSolution)
        return SolverErrors(direct_error(system, solution), 0.0)
    assert isinstance(solution, DualSolution)
    certificate = certify(system, solution)
    own_bounds = bool(np.any(system.torn.groups.slips.coefficient > 0.0))
    return SolverErrors(certificate.bound, friction_error(system, solution, certificate), own_bounds)


def state_errors(solver: SolverErrors, estimate: DiscretisationError, norm: float) -> StateErrors:
    """Combine the errors of a state."""
    by_body = {name: _ratio(value, norm) for name, value in estimate.by_body.items()}
    parts = (solver.algebraic, solver.friction, estimate.total)
    algebraic, friction, discretisation = (_ratio(part, norm) for part in parts)
    names = MappingProxyType(by_body)
    return StateErrors(algebraic, friction, discretisation, norm, names, solver.own_bounds, estimate)


def _in_percent(value: float, kind: str) -> str:
    if np.isnan(value):
        return "not estimated"
    return f"{100 * value:.2g} % ({kind})" if np.isfinite(value) else "unknown"


def _ratio(value: float, norm: float) -> float:
    if value == 0.0:
        return 0.0
    return value / norm if norm > 0.0 else float(np.inf)


#: Smallest and largest ratio of one tolerance to the one before.
STEP = (1e-4, 0.3)


@dataclass(frozen=True)
class BalancedTolerance:
    """A tolerance that follows the mesh: the solver's error is at most a share of the discretisation's.

    The scene is solved to ``loosest``. Then the error of the discretisation is estimated, that of the solver
    bounded (`StateErrors`), and if the latter is more than its share, the solver continues to a tolerance
    that follows from the ratio. On a mesh that represents the solution exactly it is ``finest``.

    Displacements, contact pressures and energies are then as accurate as the mesh allows, and so are supports
    and gluing, which are enforced by multipliers. Discontinuous results are not: whether a point at the edge
    of the contact is closed, or sticks, may still change, and with it shape derivatives, which depend on
    these statuses. Where statuses or differences between neighbouring states matter, give a number: 1e-6
    settles nearly all, 1e-8 all that are not weakly active.

    Attributes:
        share: Largest error of the solver, law of friction included, relative to that of the mesh.
        loosest: First and largest tolerance.
        finest: Smallest tolerance.
        rounds: Largest number of times that the tolerance is tightened.

    Raises:
        InvalidInputError: If the share or the tolerances are not positive or in the wrong order.

    Example:
        >>> state = solve_scene(scene, comm, tolerance=BalancedTolerance(share=0.01))  # doctest: +SKIP
    """

    share: float = 0.1
    loosest: float = 1e-3
    finest: float = 1e-10
    rounds: int = 4

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (self.share > 0.0 and 0.0 < self.finest <= self.loosest < 1.0 and self.rounds >= 1):
            raise InvalidInputError(
                "BalancedTolerance needs share > 0, 0 < finest <= loosest < 1 and rounds >= 1, got share "
                f"{self.share:g}, finest {self.finest:g}, loosest {self.loosest:g}, rounds {self.rounds}: "
                "keep the defaults of what you do not mean to change"
            )

    def satisfied(self, errors: SolverErrors, discretisation: float) -> bool:
        """Return whether the solver's errors are within their share of the discretisation's."""
        return errors.together <= self.share * discretisation

    def tightened(
        self, reached: float, errors: SolverErrors, discretisation: float, margin: float = 0.5
    ) -> float:
        """Return the next tolerance.

        Args:
            reached: Largest residual so far.
            errors: The solver's errors.
            discretisation: Estimated error of the mesh, [√(force · length)].
            margin: Fraction of the allowed error that the next tolerance aims at: errors do not fall exactly
                as residuals do.
        """
        allowed, have = self.share * discretisation, errors.together
        # For so small an allowed error intermediate tolerances are useless; with an unknown error all are
        # useful.
        if np.isfinite(have) and allowed <= self.finest * have:
            return self.finest
        ratio = margin * allowed / have
        return max(self.finest, reached * min(max(ratio, STEP[0]), STEP[1]))
