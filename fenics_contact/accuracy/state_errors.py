"""The errors of a state, all in one norm: solver, friction law, mesh and geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from fenics_contact.accuracy.certificate import certify, direct_error
from fenics_contact.accuracy.discretisation import DiscretisationError
from fenics_contact.accuracy.fixed_point import friction_error
from fenics_contact.feti import DirectSolution, DirectSystem, DualSystem
from fenics_contact.qp import DualSolution


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
        geometry: Estimate, not a bound, of the error by the geometry of contact surfaces, see
            `geometry_error`: the distance to the state of the true surfaces on the same mesh; NaN if not
            estimated.
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

    def __str__(self) -> str:
        """Return one line for each error."""
        return "\n".join(f"{name:15s} {words}" for name, words in self.in_words.items())


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
    own_bounds = bool(np.any(system.torn.friction_coefficient > 0.0))
    return SolverErrors(certificate.bound, friction_error(system, solution, certificate), own_bounds)


def state_errors(solver: SolverErrors, estimate: DiscretisationError, norm: float) -> StateErrors:
    """Combine the errors of a state.

    Args:
        solver: Errors of the solver.
        estimate: Discretisation error.
        norm: Energy norm of the displacement, [√(force · length)].
    """
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
