"""The errors of a state, all in one norm: how well it was solved, and how well its mesh can tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
        algebraic: Upper bound of the error of the solver, by duality; with Coulomb's law that to the
            solution with the state's own slip bounds, see `certify`.
        friction: Estimate of the error by these slip bounds, see `friction_error`; zero without Coulomb's
            law.
        discretisation: Estimate of the error of the mesh, see `discretisation_error`.
        norm: ‖u‖, [√(force · length)].
        by_body: Body name -> its part of `discretisation`; the sum of squares is its square.

    Example:
        >>> print(state.errors)  # doctest: +SKIP
        algebraic       0.0120 % (at most)
        friction        0.0031 % (estimate)
        discretisation  4.2 % (estimate)
    """

    algebraic: float
    friction: float
    discretisation: float
    norm: float
    by_body: Mapping[str, float]
    _estimate: DiscretisationError = field(repr=False)

    def by_cell(self, body: str) -> np.ndarray:
        """Return the part of each cell of a body of `discretisation`, shape (n_cells,), replicated.

        The sum of squares over the cells of all bodies is its square. Collective.
        """
        values = self._estimate.by_cell(body)
        return values / self.norm if self.norm > 0.0 else values

    def __str__(self) -> str:
        """Return one line for each error."""
        lines = {
            "algebraic": (self.algebraic, "at most"),
            "friction": (self.friction, "estimate"),
            "discretisation": (self.discretisation, "estimate"),
        }
        return "\n".join(f"{name:15s} {100 * value:.2g} % ({kind})" for name, (value, kind) in lines.items())


@dataclass(frozen=True)
class SolverErrors:
    """What a solver left, in energy norm, [√(force · length)].

    Attributes:
        algebraic: Upper bound of its error at the slip bounds of its solution.
        friction: Estimate of the error by these slip bounds.
    """

    algebraic: float
    friction: float

    @property
    def together(self) -> float:
        """The sum of both, which bounds or closely follows the distance to the solution."""
        return self.algebraic + self.friction


def solver_errors(system: DualSystem | DirectSystem, solution: DualSolution | DirectSolution) -> SolverErrors:
    """Return what a solver left. Collective; at most one product and one application of S."""
    if isinstance(system, DirectSystem):
        assert isinstance(solution, DirectSolution)
        return SolverErrors(direct_error(system, solution), 0.0)
    assert isinstance(solution, DualSolution)
    certificate = certify(system, solution)
    return SolverErrors(certificate.bound, friction_error(system, solution, certificate))


def state_errors(solver: SolverErrors, estimate: DiscretisationError, norm: float) -> StateErrors:
    """Join the errors of a state.

    Args:
        solver: What the solver left.
        estimate: What the mesh cannot tell.
        norm: Energy norm of the displacement, [√(force · length)].
    """
    by_body = {name: _ratio(value, norm) for name, value in estimate.by_body.items()}
    parts = (solver.algebraic, solver.friction, estimate.total)
    algebraic, friction, discretisation = (_ratio(part, norm) for part in parts)
    return StateErrors(algebraic, friction, discretisation, norm, MappingProxyType(by_body), estimate)


def _ratio(value: float, norm: float) -> float:
    if value == 0.0:
        return 0.0
    return value / norm if norm > 0.0 else float(np.inf)
