"""Bodies that contact and friction could hold in terms of forces, but do not once they deform."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.qp.equilibrium import Equilibrium, find_equilibrium
from fenics_contact.qp.iterate import Start, apply_unless_zero, iterate_fitted
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.slip_law import TrescaLaw
from fenics_contact.qp.solution import DualSolution, SolverStep

#: Wedging friction may itself press surfaces together: at most by this factor on the other normal forces.
WEDGED = 100.0
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


class SlidingError(InfeasibleError):
    """The load is more than friction bears while bodies slide.

    Attributes:
        share: Part of the load's work that friction takes up.
        motion: Coefficients of the rigid motion, shape (m,).
    """

    def __init__(self, share: float, motion: Vector, words: str = "bodies slide") -> None:
        """Store the motion; ``words`` say which bodies move."""
        super().__init__(
            f"every body must be held by supports, contact or friction, but {words}, and friction bears only "
            f"{100 * share:.3g} % of the load against it: support what slides, press it, lower the load or "
            "raise the friction coefficient"
        )
        self.share, self.motion = share, motion

    def named(self, words: str) -> SlidingError:
        """Return the error in other words for what moves."""
        return SlidingError(self.share, self.motion, words)


@dataclass(frozen=True, eq=False)
class FrictionAlone:
    """Test whether friction can hold what nothing else holds; used where a solver makes no progress.

    Attributes:
        problem: The unsolved problem.
        solve: Solves it without friction.
    """

    problem: DualProblem
    solve: Callable[[DualProblem, Start], DualSolution]

    def require_enough(self) -> None:
        """Reject a problem whose friction is far from sufficient. Collective.

        If even `WEDGED` times the slip bounds of the forces without friction cannot balance the load,
        friction is taken to hold nothing, as where supports keep the surfaces apart. That is not a proof.

        Raises:
            InfeasibleError: Friction does not suffice.
        """
        if self._forces is None:
            return
        equilibrium = self._under(WEDGED * self.problem.law.bound(self._forces))
        if equilibrium.motion is not None:
            raise InfeasibleError(
                "friction needs surfaces that are pressed together, but without it they are pressed so "
                f"little that even {WEDGED:g} times the forces that it may then bear leave "
                f"{100 * equilibrium.error:.2g} % of the load unbalanced: support bodies that only friction "
                "holds, or press them"
            )

    def require_enough_sliding(self, start: Vector | None, settled: float = 1e-2, times: int = 20) -> None:
        """Reject a problem in which what only friction holds goes on sliding. Collective.

        With friction along the motion that it resists least, bodies are pressed otherwise than without; with
        the slip bounds of these forces that motion is another one, and so on. If friction then bears less
        than the load, bodies accelerate.

        Args:
            start: Forces of the last load, owned, which may hold bodies where they were driven in; None at
                the first load.
            settled: Forces are known once friction bears the same part of the load to this accuracy.
            times: How often they are computed at most; nothing is rejected then.

        Raises:
            SlidingError: They do.
        """
        layout, before = self.problem.layout, np.inf
        forces = self._forces if start is None or self._forces is None else start
        for _ in range(times):
            if forces is None or (equilibrium := self._under(self.problem.law.bound(forces))).motion is None:
                return
            share, motion = self._borne(equilibrium.motion, forces)
            if not share < 1.0:
                return
            if abs(share - before) <= settled * share:
                raise SlidingError(share, motion)
            friction, before = np.zeros(layout.size), share
            friction[layout.tangential] = equilibrium.multiplier[layout.tangential]
            forces = self._pressed(friction)

    def _under(self, bound: Vector) -> Equilibrium:
        """Look for admissible forces in equilibrium under slip bounds. Collective."""
        return find_equilibrium(self.problem.with_law(TrescaLaw(self.problem.layout, bound)))

    def _borne(self, motion: Vector, forces: Vector) -> tuple[float, Vector]:
        """Return the part of the load's work on a motion that friction takes up, and the motion. Collective.

        The motion without what other contacts resist; the part is infinite where little is left of it.
        """
        problem, coarse, unheld = self.problem, self.problem.coarse, self._unheld
        free = unheld @ (unheld.T @ motion)
        free *= np.sign(coarse.load @ free)
        slip = np.linalg.norm(coarse.transpose(free)[problem.layout.tangential], axis=1)
        friction = float(global_sum(problem.comm, problem.law.bound(forces) @ slip)[0])
        work = float(coarse.load @ free)
        return (friction / work if work > 0.5 * abs(coarse.load @ motion) else np.inf), free

    @cached_property
    def _unheld(self) -> Vector:
        """Rigid motions that only friction resists, orthonormal, shape (m, n). Collective on first use."""
        layout, coarse = self.problem.layout, self.problem.coarse
        rows = np.concatenate([layout.equality, layout.normal])
        entries = (np.ones(len(rows)), (rows, np.arange(len(rows))))
        pressing = coarse.restricted(sp.csr_matrix(entries, shape=(layout.size, len(rows))))
        return np.asarray(np.linalg.qr(pressing.gram.null_space)[0])

    @cached_property
    def _forces(self) -> Vector | None:
        """The multiplier without friction; None where no friction grows with it or the solve fails.

        Collective on first use.
        """
        problem = self.problem
        if global_max(problem.comm, float(problem.law.growth.max(initial=0.0))) == 0.0:
            return None
        return self._pressed(np.zeros(problem.layout.size))

    def _pressed(self, friction: Vector) -> Vector | None:
        """Return the multiplier with friction forces, owned; None where the solve fails. Collective.

        The bodies are held in all motions that only friction resists, and nothing rubs otherwise, where no
        friction is given but the part that does not grow with the normal force.
        """
        problem, layout, coarse = self.problem, self.problem.layout, self.problem.coarse
        operator = CountedOperator(problem.operator)
        product = apply_unless_zero(problem, operator, friction)
        rubs = problem.norm(friction) > 0.0
        bound = problem.law.bound(np.zeros(layout.size)) * (not rubs)
        load = coarse.load - coarse.apply(friction)
        loaded = coarse.with_load(load - self._unheld @ (self._unheld.T @ load))
        law = TrescaLaw(layout, bound)
        held = replace(problem, coarse=loaded, rhs=problem.rhs - product, friction=law)
        multiplier = held.coarse.particular()
        product = apply_unless_zero(held, operator, multiplier)
        start = Start(iterate_fitted(held, multiplier, product), operator)
        try:
            return self.solve(held, start).multiplier + friction
        except (ConvergenceError, InfeasibleError):
            return None
