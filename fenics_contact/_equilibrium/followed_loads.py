"""Loads that are taken off bodies which friction may hold: the answer near the last one is looked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.progress import PhaseTimer
from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.solution import DualSolution
from fenics_contact.qp.solve import DualSolver, may_grip
from fenics_contact.results.dual_solve import solve_dual

#: Parts of the change of the loads whose equilibria lead to that of all of it.
PARTS = (0.5, 0.875, 1.0)


@dataclass(frozen=True)
class FollowedLoads:
    """Solves as `solve_dual` does, and follows the change of loads where the answer lets go of all.

    With Coulomb's friction a body that was driven in may stay when its load is taken off, or bear a pull. The
    state without any force is an equilibrium, too, and Newton's method may jump there, or end where nothing
    is left to hold the body. Then equilibria with parts of the change are found one after the other, each
    with slip measured from the start of the load step.
    """

    before: DualSystem
    timer: PhaseTimer

    def solve(
        self, system: DualSystem, solver: DualSolver, start: DualSolution | np.ndarray | None = None
    ) -> DualSolution:
        """Solve; arguments and errors as for `solve_dual`. Collective."""
        spent = system.products
        try:
            solution = solve_dual(system, solver, start)
        except (ConvergenceError, InfeasibleError):
            found = self._followed(system, solver, start)
            if found is None:
                raise
        else:
            if solution.released or system.problem.norm(solution.multiplier) > 0.0:
                return solution
            found = self._followed(system, solver, start) or solution
        return replace(found, products=system.products - spent)

    def _followed(
        self, system: DualSystem, solver: DualSolver, start: DualSolution | np.ndarray | None
    ) -> DualSolution | None:
        """Return the solution found from part to part, None if there is none. Collective."""
        if not isinstance(start, np.ndarray) or not self._may_hold(system, start):
            return None
        try:
            for part in PARTS:
                between = system
                if part < 1.0:
                    between = DualSystem(self._partly(system.torn, part), self.timer, previous=system)
                found, before = solve_dual(between, solver, start), start
                start = found.multiplier
                if between is not system:
                    system.products += between.products
                if part == PARTS[0] and self._falls(system, before, start):
                    return None
        except (ConvergenceError, InfeasibleError):
            return None
        return found

    def _may_hold(self, system: DualSystem, start: np.ndarray) -> bool:
        """Return whether loads change on bodies that rub on each other. Collective."""
        law = system.torn.law
        if isinstance(law, TrescaLaw):
            return False
        pressed = np.maximum(start[system.problem.layout.tangential_frictional], 0.0)
        change = system.torn.load - self.before.torn.load
        sizes = (np.sum(law.growth(start) * pressed), np.abs(change).sum())
        rubs, changes = system.torn.numbering.comm.allreduce(np.array(sizes))
        moved = np.abs(system.torn.free.load - self._free_load(system.torn)).sum()
        if rubs == 0.0 or changes + moved == 0.0:
            return False
        problem = system.problem
        return problem.is_loaded or may_grip(problem.with_law(law), start)

    @staticmethod
    def _falls(system: DualSystem, before: np.ndarray, after: np.ndarray, held: float = 0.05) -> bool:
        """Return whether contact forces have fallen as all loads would that are taken off. Collective.

        `held`: contact forces that fall with the loads, but for this part, are not held by friction.
        """
        if system.problem.is_loaded:
            return False
        rows = system.problem.layout.normal
        was, now = (system.problem.norm(forces[rows]) for forces in (before, after))
        return now <= (1.0 - PARTS[0] + held) * was

    def _partly(self, torn: TornSystem, part: float) -> TornSystem:
        """Return the system with a part of the change of its loads."""

        def mixed(old: np.ndarray, new: np.ndarray) -> np.ndarray:
            return np.asarray((1.0 - part) * old + part * new)

        pairs = zip(self.before.torn.subdomains, torn.subdomains, strict=True)
        subdomains = tuple(replace(new, load=mixed(old.load, new.load)) for old, new in pairs)
        free = replace(torn.free, load=mixed(self._free_load(torn), torn.free.load))
        return replace(torn, subdomains=subdomains, free=free)

    def _free_load(self, torn: TornSystem) -> np.ndarray:
        """Return the loads of free motions before, those of now where other sections are free."""
        before = self.before.torn
        free = [[each.is_free for each in at.scene.preloads] for at in (before, torn)]
        alike = free[0] == free[1] and before.free.count == torn.free.count
        return before.free.load if alike else torn.free.load
