"""Bodies that contact and friction could hold in terms of forces, but do not once they deform."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.qp.equilibrium import find_equilibrium
from fenics_contact.qp.iterate import Start, apply_unless_zero, iterate_fitted
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import Vector, global_max
from fenics_contact.qp.slip_law import TrescaLaw
from fenics_contact.qp.solution import DualSolution, SolverStep

#: Wedging friction may itself press surfaces together: at most by this factor on the other normal forces, and
#: by the second factor once a solver has exhausted its means.
WEDGED, HARDLY_WEDGED = 100.0, 2.0
#: Gaps are reliable if jumps are smaller than this, and bodies are unheld if this much of the load is
#: unbalanced.
PLAIN = 1e-2


def without_contact(history: Sequence[SolverStep], count: int) -> bool:
    """Return whether all contacts stay open while only they could balance the load.

    Args:
        history: Steps of Newton's method and rescues.
        count: Number of last Newton steps that must agree; those before a rescue do not count.
    """
    late = history[-count:]
    return len(late) == count and all(_open(step) for step in late)


def _open(step: SolverStep) -> bool:
    residuals = step.residuals
    lost = step.closed == 0 and residuals.natural == 0.0 and residuals.gluing < PLAIN < residuals.coarse
    return lost and "rescue" not in step.method


def error_without_contact(step: SolverStep) -> InfeasibleError:
    """Return the error of a problem whose contacts stay open, given the last step."""
    return InfeasibleError(
        "every loaded body must be held, but all contacts stay open, and "
        f"{100 * step.residuals.coarse:.2g} % of the load drive motions that only contact or "
        "friction could hold: close the gaps, support the bodies or press them together"
    )


@dataclass(frozen=True, eq=False)
class FrictionAlone:
    """Test whether friction can hold what nothing else holds; used where a solver makes no progress.

    Attributes:
        problem: The unsolved problem.
        solve: Solves it without friction.
    """

    problem: DualProblem
    solve: Callable[[DualProblem, Start], DualSolution]

    def require_enough(self, wedged: float = WEDGED) -> None:
        """Reject a problem whose friction is far from sufficient. Collective.

        If even ``wedged`` times the slip bounds of the forces without friction cannot balance the load,
        friction is taken to hold nothing, as where supports keep the surfaces apart. That is not a proof.

        Args:
            wedged: Factor by which friction may itself press surfaces together.

        Raises:
            InfeasibleError: Friction does not suffice.
        """
        if self._forces is None:
            return
        bound = wedged * self.problem.law.bound(self._forces)
        equilibrium = find_equilibrium(self.problem.with_law(TrescaLaw(self.problem.layout, bound)))
        if equilibrium.motion is not None:
            raise InfeasibleError(
                "friction needs surfaces that are pressed together, but without it they are pressed so "
                f"little that even {wedged:g} times the forces that it may then bear leave "
                f"{100 * equilibrium.error:.2g} % of the load unbalanced: support bodies that only friction "
                "holds, press them, or raise the friction"
            )

    @cached_property
    def _forces(self) -> Vector | None:
        """The multiplier without friction; None where no friction grows with it or the solve fails.

        The bodies are held in all motions that only friction resists. Collective on first use.
        """
        problem, layout, coarse = self.problem, self.problem.layout, self.problem.coarse
        if global_max(problem.comm, float(problem.law.growth.max(initial=0.0))) == 0.0:
            return None
        rows = np.concatenate([layout.equality, layout.normal])
        entries = (np.ones(len(rows)), (rows, np.arange(len(rows))))
        pressing = coarse.restricted(sp.csr_matrix(entries, shape=(layout.size, len(rows))))
        unheld, _ = np.linalg.qr(pressing.gram.null_space)
        loaded = coarse.with_load(coarse.load - unheld @ (unheld.T @ coarse.load))
        given = TrescaLaw(layout, problem.law.bound(np.zeros(layout.size)))
        held = replace(problem, coarse=loaded, friction=given)
        multiplier, operator = held.coarse.particular(), CountedOperator(problem.operator)
        product = apply_unless_zero(held, operator, multiplier)
        start = Start(iterate_fitted(held, multiplier, product), operator)
        try:
            return self.solve(held, start).multiplier
        except (ConvergenceError, InfeasibleError):
            return None
