"""Snapping: where no equilibrium is near, bodies move on through a viscous medium until they rest again.

With the load as it is, stages u₀, u₁, ... satisfy r(uₖ₊₁) = α D (uₖ₊₁ − uₖ), with the forces out of balance r
and the diagonal D of the tangents at rest: for a large α the tangent K + α D is stable, for a small one a
stage is Newton's method. α falls while stages succeed and rises where they fail; where the drag is little,
Newton's method finds the equilibrium without it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import ConvergenceError, safe_log
from fenics_contact.feti import TornSystem
from fenics_contact.nonlinear.equations import Configuration, Equations, Linearisation
from fenics_contact.nonlinear.loading import Drag, Loading
from fenics_contact.nonlinear.newton import TangentNewton
from fenics_contact.nonlinear.starts import Effort, NonlinearEquilibrium
from fenics_contact.qp import global_sum
from fenics_contact.timing import PhaseTimer

_LOG = logging.getLogger(__name__)

#: First α.
FIRST = 0.01
#: Factors on α after a stage that failed, after each of the first ones that did not, and after later ones.
MORE, LESS, MUCH_LESS = 4.0, 0.8, 0.5
#: Number of those first ones.
CAREFUL = 3
#: Tolerance of stages, which need not be exact, and Newton steps after which one counts as failed.
LOOSE, MANY = 1e-4, 12
#: Drag, relative to all forces, below which an equilibrium is tried.
LITTLE = 3e-3
#: Factor on the tolerance where bodies do not move at it, and on the drag before the next trial.
TENTH = 0.1
#: Most stages, those that fail included.
MOST = 200


@displayed
@dataclass(frozen=True)
class Snap:
    """A motion from one equilibrium to another one at the same load.

    Attributes:
        fraction: Part of the load step at which it took place, in (0, 1].
        way: Largest distance by which a node moved, [length].
        dissipated: Work against the drag, to first order in the steps of the motion, [force · length].
        stages: Their number.
    """

    fraction: float
    way: float
    dissipated: float
    stages: int

    def __str__(self) -> str:
        """Return where bodies snapped, how far and with what work."""
        return (
            f"at {self.fraction:.3g} of the load step by up to {self.way:.3g}, in {self.stages} stages; drag "
            f"took {self.dissipated:.2e}"
        )


class Snapping:
    """One such motion.

    Attributes:
        effort: That of all stages, those that failed included.
        dissipated: As in `Snap`.
        stages: As there.
    """

    def __init__(
        self,
        newton: TangentNewton,
        equations: Equations,
        load: Callable[[Configuration, TornSystem], Loading],
        timer: PhaseTimer,
    ) -> None:
        """Prepare; nothing is computed yet.

        Args:
            newton: Solves each stage, and the end as accurately as it asks for.
            equations: Internal forces, and how bodies meet.
            load: What acts, for slip that begins at a configuration, with the system in which it was found.
            timer: Collects the wall time.
        """
        self._newton, self._equations, self._load, self._timer = newton, equations, load, timer
        self.effort, self.stages, self.dissipated = Effort(), 0, 0.0

    def to_rest(
        self, at: Configuration, torn: TornSystem, known: Linearisation | None
    ) -> NonlinearEquilibrium:
        """Return the equilibrium where bodies come to rest. Collective.

        Args:
            at: The configuration at the start.
            torn: The system in which it was found.
            known: A linearisation near it, or None.

        Raises:
            ConvergenceError: They do not; with the history.
        """
        exact, loose = self._newton, replace(self._newton, max_steps=MANY, tolerance=LOOSE)
        size, tried, in_a_row = FIRST, np.inf, 0
        for _ in range(MOST):
            drag = Drag(size * self._equations.diagonal, at.displacement)
            load = self._load(at, torn)
            found = self._tried(loose, replace(load, drag=drag), at, known)
            if found is None:
                size, in_a_row = MORE * size, 0
                continue
            if not found.effort.history and loose.tolerance > exact.tolerance:
                loose = replace(loose, tolerance=max(TENTH * loose.tolerance, exact.tolerance))
                continue
            self.stages, in_a_row = self.stages + 1, in_a_row + 1
            part = self._dragged(drag, at, found)
            at, torn, known = found.configuration, found.evaluation.torn, found.linearisation
            if part < min(LITTLE, TENTH * tried):
                tried = part
                end = self._tried(exact, self._load(at, torn), at, known)
                if end is not None:
                    return end
            size *= LESS if in_a_row <= CAREFUL else MUCH_LESS
        raise ConvergenceError(
            f"bodies that snap must come to rest, but after {self.stages} stages they still move, the drag "
            f"being {size:.1e} of their stiffness: take smaller load steps, or hold them better",
            self.effort.history,
        )

    def _tried(
        self, newton: TangentNewton, load: Loading, at: Configuration, known: Linearisation | None
    ) -> NonlinearEquilibrium | None:
        """Return the equilibrium, None where there is none near. Collective."""
        try:
            found = newton.solve(self._equations, load, at, self._timer, known)
        except ConvergenceError as failure:
            self.effort = self.effort.followed_by(Effort.until(failure))
            return None
        self.effort = self.effort.followed_by(found.effort)
        return found

    def _dragged(self, drag: Drag, at: Configuration, found: NonlinearEquilibrium) -> float:
        """Add the work of a stage; return the drag, relative to all forces. Collective."""
        displacement, residuals = found.evaluation.at.displacement, found.evaluation.residuals
        force = drag.on(displacement)
        work, square = global_sum(
            found.evaluation.torn.numbering.comm, force @ (displacement - at.displacement), force @ force
        )
        self.dissipated += float(work)
        part = float(np.sqrt(square)) / residuals.force_scale
        safe_log(_LOG.info, "stage %d of a snap: drag %.1e of the forces", self.stages, part)
        return part
