"""Automatic load steps, from one load to the next as fast as Newton's method follows, and snapping.

Where no equilibrium is near, bodies move on through a viscous medium until they rest again. With the load
as it is, stages u₀, u₁, ... satisfy r(uₖ₊₁) = α D (uₖ₊₁ − uₖ), with the forces out of balance r and the
diagonal D of the tangents at rest: for a large α the tangent K + α D is stable, for a small one a stage is
Newton's method. α falls while stages succeed and rises where they fail; where the drag is little, Newton's
method finds the equilibrium without it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._large_deformations.equations import Configuration, Equations, Linearisation
from fenics_contact._large_deformations.loading import Drag, Loading
from fenics_contact._large_deformations.moving_contact import ContactConfiguration
from fenics_contact._large_deformations.newton import (
    Effort,
    NonlinearEquilibrium,
    NotHeldError,
    TangentNewton,
)
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.reductions import global_max, global_sum
from fenics_contact.qp.solution import SolverStep

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.slip import MaterialPoints


_LOG = logging.getLogger(__name__)


@displayed
@dataclass(frozen=True)
class Snap:
    """A motion from one equilibrium to another one at the same load.

    Attributes:
        fraction: Part of the load step at which it took place, in (0, 1].
        way: Largest distance by which a node moved, [length].
        dissipated: Work against the drag, to first order in the steps of the motion, [force · length].
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


@dataclass(frozen=True)
class Stages:
    """Stages of a snap: how the drag α, relative to the stiffness of bodies, falls from one to the next.

    Attributes:
        first: First α.
        more: Factor on α after a stage that failed.
        less: The same after each of the first ``careful`` stages in a row that did not,
        much_less: and after later ones.
        careful: Number of those first ones.
        tolerance: Tolerance of stages, which need not be exact.
        tighter: Factor on it where bodies do not move at it, and on the drag before the next trial.
        max_steps: Newton steps after which a stage counts as failed.
        little: Drag, relative to all forces, below which an equilibrium is tried.
        most: Largest number of stages, those that fail included.
    """

    first: float = 0.01
    more: float = 4.0
    less: float = 0.8
    much_less: float = 0.5
    careful: int = 3
    tolerance: float = 1e-4
    tighter: float = 0.1
    max_steps: int = 12
    little: float = 3e-3
    most: int = 200


class Snapping:
    """One such motion.

    Attributes:
        by: How its drag falls.
        effort: That of all stages, those that failed included.
    """

    by = Stages()

    def __init__(
        self,
        newton: TangentNewton,
        equations: Equations,
        load: Callable[[Configuration, TornSystem], Loading],
        timer: PhaseTimer,
    ) -> None:
        """Prepare; ``load`` returns what acts, with slip from a configuration and its system."""
        self._newton, self._equations, self._load, self._timer = newton, equations, load, timer
        self.effort, self.stages, self.dissipated = Effort(), 0, 0.0

    def to_rest(
        self, at: Configuration, torn: TornSystem, known: Linearisation | None
    ) -> NonlinearEquilibrium:
        """Return the equilibrium where bodies come to rest. Collective."""
        by, exact = self.by, self._newton
        loose = replace(exact, max_steps=by.max_steps, tolerance=by.tolerance)
        size, tried, in_a_row = by.first, np.inf, 0
        for _ in range(by.most):
            drag = Drag(size * self._equations.diagonal, at.displacement)
            load = self._load(at, torn)
            found = self._tried(loose, replace(load, drag=drag), at, known)
            if found is None:
                size, in_a_row = by.more * size, 0
                continue
            if not found.effort.history and loose.tolerance > exact.tolerance:
                loose = replace(loose, tolerance=max(by.tighter * loose.tolerance, exact.tolerance))
                continue
            self.stages, in_a_row = self.stages + 1, in_a_row + 1
            part = self._dragged(drag, at, found)
            at, torn, known = found.configuration, found.evaluation.torn, found.linearisation
            if part < min(by.little, by.tighter * tried):
                tried = part
                end = self._tried(exact, self._load(at, torn), at, known)
                if end is not None:
                    return end
            size *= by.less if in_a_row <= by.careful else by.much_less
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


@displayed
@dataclass(frozen=True, eq=False)
class Path:
    """The equilibria from one load to the next.

    Attributes:
        begun: Contact points at the start; None where they are not known.
        start: These in material coordinates of the master, of others where they were first found; None where
            contact is that of the undeformed bodies.
        fractions: Parts of the load at which equilibria were found, the last one being 1.
        since: The part from which slip and the histories of materials are one step up to the end: 0, unless
            parts are steps of their own or bodies snapped.
        rubbed: Work of friction before the last step of histories, zero where the whole load is one,
            [force · length].
        effort: That of all parts, those that were cut included.
    """

    load: Loading
    end: NonlinearEquilibrium
    begun: ContactConfiguration | None
    start: MaterialPoints | None
    fractions: tuple[float, ...]
    since: float
    snaps: tuple[Snap, ...]
    rubbed: float
    effort: Effort


class PathEndsError(ConvergenceError):
    """A load step that cannot be cut any further.

    Attributes:
        path: The way up to there; None if there is no equilibrium after the start.
    """

    def __init__(self, message: str, history: Sequence[SolverStep], path: Path | None) -> None:
        """Store how far the path went."""
        super().__init__(message, history)
        self.path = path


@displayed
@dataclass(frozen=True)
@checked()
class AutomaticSteps:
    """Load steps that are halved where Newton's method fails, and doubled after easy ones.

    Parts only help Newton's method to the end of a load step: slip, plastic strain and every other history
    are those of one step of backward Euler from its start to its end, whatever its parts were. So results do
    not depend on how it was cut, which meshes, tolerances and computers decide.

    Attributes:
        newton: Solves each of them.
        first: First part of the load that is tried, in (0, 1].
        smallest: Smallest part of the load; a step that fails there ends the path.
        snaps: Whether bodies that have no equilibrium near, as where structures snap through or an edge jumps
            over another one, move on through a viscous medium to the next one; see `DeformedState.snaps`.
            The medium takes the work that inertia and radiation would, and like them may decide where bodies
            come to rest. Histories begin anew at each stage of that motion.
        finer_history: Whether each part is a step of its own for slip and the histories of materials. A path
            that turns within a load step is then followed more closely, and results depend on the parts, see
            `DeformedState.fractions`; more load steps do the same for certain.
        easy: Newton steps of an easy part: the next one is twice as long.
        smallest_before_snap: Smallest part of a load step that is tried before bodies may snap.
    """

    newton: TangentNewton = field(default_factory=TangentNewton)
    first: float = 1.0
    smallest: float = 1.0 / 256
    snaps: bool = False
    finer_history: bool = False
    easy: int = 6
    smallest_before_snap: float = 1.0 / 16

    def __post_init__(self) -> None:
        """Check the parts.

        Raises:
            InvalidInputError: If they are not in (0, 1], or the smallest is larger than the first.
        """
        if not 0.0 < self.smallest <= self.first <= 1.0:
            raise InvalidInputError(
                "the smallest and first part of a load step must be in (0, 1] and the smallest not larger "
                f"than the first, got {self.smallest!r} and {self.first!r}: give parts such as 1/256 and 1"
            )

    def follow(
        self,
        equations: Equations,
        before: Loading | None,
        target: Loading,
        start: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None = None,
        *,
        held: bool = True,
    ) -> Path:
        """Return the equilibrium at a load, with the path to it. Collective.

        Args:
            equations: Internal forces, and contact.
            before: What acts at the start; None for bodies at rest without loads.
            target: What acts at the end.
            start: The configuration at the start.
            timer: Collects the wall time.
            known: A linearisation near the start, or None.
            held: Whether supports and contacts resist every motion of the bodies at rest.

        Raises:
            PathEndsError: The smallest step fails.
            NotHeldError: They do not, and the first step fails for that.
        """
        first = target.removed() if before is None else before
        # Slip begins where bodies are before supports and obstacles move.
        at = start if start.contact else start.on(equations.contact.at(first, start.displacement, None))
        stepper = _LoadStepper(self, equations, first, target, at, timer, known)
        part, longest = self.first, equations.contact.longest_part(first, target)
        smallest = max(self.smallest, self.smallest_before_snap) if self.snaps else self.smallest
        while stepper.reached < 1.0:
            left = 1.0 - stepper.reached
            part = left / np.ceil(left / min(part, longest) - 1e-9)
            fraction = 1.0 if stepper.reached + part > 1.0 - 1e-12 else stepper.reached + part
            try:
                steps = stepper.advance(fraction)
            except ConvergenceError as failure:
                if not held and isinstance(failure, NotHeldError) and stepper.reached == 0.0:
                    raise
                part *= 0.5
                if part >= smallest:
                    safe_log(_LOG.info, "load step cut to %.3g: %s", part, failure)
                    continue
                if not self.snaps:
                    raise stepper.ends(
                        f"a further {2 * part:.1e} of it fails: {failure}, or let bodies snap where no "
                        "equilibrium is near (snaps=True)"
                    ) from failure
                try:
                    steps = stepper.snap(fraction)
                except ConvergenceError as unrest:
                    raise stepper.ends(f"{failure}; {unrest}") from unrest
            part *= 2.0 if steps <= self.easy else 1.0
        return stepper.path()


class _LoadStepper:
    """Equilibria found so far and their cost."""

    def __init__(
        self,
        steps: AutomaticSteps,
        equations: Equations,
        first: Loading,
        target: Loading,
        at: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None,
    ) -> None:
        assert at.contact is not None
        self._newton, self._finer = steps.newton, steps.finer_history
        self._equations, self._timer = equations, timer
        self._first, self._target, self._at, self._known = first, target, at, known
        self._torn, self._begun, self._start = first.torn, at.contact, at.contact.material_points
        self._end: NonlinearEquilibrium | None = None
        self._fractions, self._snaps, self._effort = list[float](), list[Snap](), Effort()
        # Where the step of histories begins, with the system of then.
        self._origin, self._since = (at, first.torn), 0.0
        # Work of friction of those before it, and whether the last equilibrium ends one.
        self._rubbed, self._ended = 0.0, False
        self.reached = 0.0

    def advance(self, fraction: float) -> int:
        """Go on to a part of the load; return the number of Newton steps. Collective."""
        try:
            load = self._load(fraction, *self._origin)
            assert self._at.contact is not None
            moved = self._equations.rigid_start.moved(
                self._at.contact.prescribed, load, self._at.displacement
            )
            found = self._newton.solve(self._equations, load, self._at, self._timer, self._known, moved)
        except ConvergenceError as failure:
            self._count(Effort.until(failure))
            raise
        self._count(found.effort)
        return self._reach(fraction, found)

    def snap(self, fraction: float) -> int:
        """Go on to an equilibrium that is not near; return the number of its Newton steps. Collective."""
        load = partial(self._load, fraction)
        snapping = Snapping(self._newton, self._equations, load, self._timer)
        before = self._at.displacement
        try:
            at = self._at if self._end is None else self._end.configuration
            found = snapping.to_rest(at, self._torn, self._known)
        finally:
            self._count(snapping.effort)
        moved = (found.evaluation.at.displacement - before).reshape(-1, self._torn.dim)
        way = global_max(self._torn.numbering.comm, np.linalg.norm(moved, axis=1).max(initial=0.0))
        self._snaps.append(Snap(fraction, float(way), snapping.dissipated, snapping.stages))
        safe_log(_LOG.info, "%s", self._snaps[-1])
        return self._reach(fraction, found, anew=True)

    def _load(self, fraction: float, at: Configuration, before: TornSystem) -> Loading:
        """Return the load at a part of the way, with slip that begins at a configuration. Collective."""
        load = self._target.between(self._first, fraction)
        if self._begun.points is not None:
            return load
        slipped = before.relative(at.displacement), before.sliding(at.displacement)
        return replace(load, torn=load.torn.with_slip_from(*slipped))

    def _reach(self, fraction: float, found: NonlinearEquilibrium, anew: bool = False) -> int:
        """Go on from an equilibrium, where histories begin anew or go on; return its Newton steps.

        Collective.
        """
        if self._end is not None and (self._ended or anew):
            self._rubbed += self._end.evaluation.rubbing
        self._ended = anew or self._finer
        if anew:
            self._since = fraction
        elif self._finer:
            self._since = self.reached
        self._fractions.append(fraction)
        self._torn, self._end = found.evaluation.torn, found
        if anew or self._finer:
            self._at = found.configuration
            self._origin = self._at, self._torn
        else:
            self._at = found.continued(self._origin[0])
        self._known, self.reached = found.linearisation, fraction
        new = found.evaluation.contact.start
        self._start = new if self._start is None or new is None else self._start.extended(new)
        return len(found.effort.history)

    def _count(self, effort: Effort) -> None:
        self._effort = self._effort.followed_by(effort, len(self._fractions))

    def path(self) -> Path:
        """Return the path."""
        assert self._end is not None
        return Path(
            self._target.between(self._first, self.reached),
            self._end,
            self._begun,
            self._start,
            tuple(self._fractions),
            self._since,
            tuple(self._snaps),
            self._rubbed,
            self._effort,
        )

    def ends(self, reason: str) -> PathEndsError:
        """Return the error where it ends."""
        path = None if self._end is None else self.path()
        message = f"the load can be followed up to {self.reached:.3g} of this step, but {reason}"
        return PathEndsError(message, self._effort.history, path)
