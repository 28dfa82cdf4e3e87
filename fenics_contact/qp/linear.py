"""The linear case: no contact, one face, one run of projected conjugate gradients."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.iterate import Start
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import DualSolution


@dataclass(frozen=True)
class ProjectedCG:
    """Projected preconditioned conjugate gradients for gluing and Dirichlet multipliers alone.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Give up after that many F-products.
        max_restarts: Runs after which to give up; more than one is needed only where rounding makes the
            carried residual differ from the recomputed one.
    """

    tolerance: float = 1e-9
    max_products: int = 5000
    max_restarts: int = 10

    def with_tolerance(self, tolerance: float) -> ProjectedCG:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InvalidInputError: There are contacts.
            ConvergenceError: Restarts or products were used up; carries the history.
        """
        contacts = round(float(global_sum(problem.comm, problem.layout.n_contact)[0]))
        if contacts:
            raise InvalidInputError(
                f"projected CG needs a problem without contact, got {contacts} contacts: use FaceNewton or "
                "Smalse"
            )
        newton = FaceNewton(
            tolerance=self.tolerance,
            max_products=self.max_products,
            max_steps=self.max_restarts,
            forcing=0.0,
            patience=self.max_restarts,
        )
        return newton.run(problem, law, start)
