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
from types import TracebackType
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact._base.progress import PhaseTimer, Task
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


#: Returns a configuration near the equilibrium at a load, from the one where its load step begins.
Near: TypeAlias = Callable[[Loading, Configuration], Configuration]

_LOG = logging.getLogger(__name__)
NO_EFFORT = Effort()


@displayed
@dataclass(frozen=True)
class Snap:
    """A motion from one equilibrium to another one at the same load.

    `fraction`: part of the load step at which it took place, in (0, 1]; `way`: largest distance by which a
    node moved; `dissipated`: work against the drag, to first order in the steps of the motion, [force ·
    length].
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

    `first`: first α; `more`: factor on α after a stage that failed; `less`: the same after each of the first
    ``careful`` stages in a row that did not; `much_less`: and after later ones; `careful`: number of those
    first ones; `tolerance`: tolerance of stages, which need not be exact; `tighter`: factor on it where
    bodies do not move at it, and on the drag before the next trial; `max_steps`: Newton steps after which a
    stage counts as failed; `little`: drag, relative to all forces, below which an equilibrium is tried;
    `most`: largest number of stages, those that fail included.
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


@dataclass(frozen=True, eq=False)
class Motion:
    """Bodies on their way through the medium.

    `tried`: drag, relative to all forces, when an equilibrium was tried last; `effort`: that of all stages,
    those that failed included.
    """

    at: Configuration
    torn: TornSystem
    known: Linearisation | None
    drag: float
    tolerance: float
    in_a_row: int = 0
    tried: float = np.inf
    stages: int = 0
    dissipated: float = 0.0
    effort: Effort = NO_EFFORT
    end: NonlinearEquilibrium | None = None


@dataclass(frozen=True, eq=False)
class Snapping:
    """How bodies move on through the medium."""

    newton: TangentNewton
    equations: Equations
    load: Callable[[Configuration, TornSystem], Loading]
    timer: PhaseTimer
    by = Stages()

    def follow(self, at: Configuration, torn: TornSystem, known: Linearisation | None) -> Motion:
        """Return the motion until bodies rest, or after the last stage. Collective."""
        now = Motion(at, torn, known, self.by.first, self.by.tolerance)
        for _ in range(self.by.most):
            now = self.step(now)
            if now.end is not None:
                break
        return now

    def step(self, now: Motion) -> Motion:
        """Return the motion after another stage. Collective."""
        by, exact = self.by, self.newton
        loose = replace(exact, max_steps=by.max_steps, tolerance=now.tolerance)
        drag = Drag(now.drag * self.equations.diagonal, now.at.displacement)
        now, found = self._tried(now, loose, replace(self.load(now.at, now.torn), drag=drag))
        if found is None:
            return replace(now, drag=by.more * now.drag, in_a_row=0)
        if not found.effort.history and now.tolerance > exact.tolerance:
            return replace(now, tolerance=max(by.tighter * now.tolerance, exact.tolerance))
        displacement, force = found.evaluation.at.displacement, drag.on(found.evaluation.at.displacement)
        work, square = global_sum(
            found.evaluation.torn.numbering.comm, force @ (displacement - now.at.displacement), force @ force
        )
        now = replace(
            now, at=found.configuration, torn=found.evaluation.torn, known=found.linearisation,
            in_a_row=now.in_a_row + 1, stages=now.stages + 1, dissipated=now.dissipated + float(work),
        )  # fmt: skip
        part = float(np.sqrt(square)) / found.evaluation.residuals.force_scale
        safe_log(_LOG.info, "stage %d of a snap: drag %.1e of the forces", now.stages, part)
        if part < min(by.little, by.tighter * now.tried):
            now, end = self._tried(replace(now, tried=part), exact, self.load(now.at, now.torn))
            if end is not None:
                return replace(now, end=end)
        return replace(now, drag=now.drag * (by.less if now.in_a_row <= by.careful else by.much_less))

    def _tried(
        self, now: Motion, newton: TangentNewton, load: Loading
    ) -> tuple[Motion, NonlinearEquilibrium | None]:
        """Return the motion after a trial, and the equilibrium if there is one near. Collective."""
        try:
            found = newton.solve(self.equations, load, now.at, self.timer, now.known)
        except ConvergenceError as failure:
            return replace(now, effort=now.effort.followed_by(Effort.until(failure))), None
        return replace(now, effort=now.effort.followed_by(found.effort)), found


@displayed
@dataclass(frozen=True, eq=False)
class Path:
    """The equilibria from one load to the next.

    `start`: these in material coordinates of the master, of others where they were first found; `fractions`:
    parts of the load at which equilibria were found, the last one being 1; `since`: the part from which slip
    and the histories of materials are one step up to the end: 0, unless parts are steps of their own or
    bodies snapped; `earlier_friction_work`: that before the last step of histories, zero where the whole load
    is one, [force · length]; `effort`: that of all parts, those that were cut included.
    """

    load: Loading
    end: NonlinearEquilibrium
    begun: ContactConfiguration | None
    start: MaterialPoints
    fractions: tuple[float, ...]
    since: float
    snaps: tuple[Snap, ...]
    earlier_friction_work: float
    effort: Effort


class PathEndsError(ConvergenceError):
    """A load step that cannot be cut any further.

    `path`: the way up to there; None if there is no equilibrium after the start.
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
        before: Loading,
        target: Loading,
        start: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None = None,
        *,
        held: bool = True,
        near: Near | None = None,
    ) -> Path:
        """Return the equilibrium at a load, with the path to it. Collective.

        Args:
            equations: Internal forces, and contact.
            before: What acts at the start.
            target: What acts at the end.
            start: The configuration at the start.
            timer: Collects the wall time.
            known: A linearisation near the start, or None.
            held: Whether supports and contacts resist every motion of the bodies at rest.
            near: Finds where Newton's method tries to begin at the whole load, before the load is followed.

        Raises:
            PathEndsError: The smallest step fails.
            NotHeldError: They do not, and the first step fails for that.
        """
        way = _LoadStepFollower(self, equations, before, target, start.contact, timer)
        now = Progress(start, before.torn, known, (start, before.torn), start.contact.slip_start)
        if near is not None:
            now = way.from_near(now, near)
        with _Parts() as parts:
            return way.path(self._followed(way, now, parts, held=held))

    def _followed(self, way: _LoadStepFollower, now: Progress, parts: _Parts, *, held: bool) -> Progress:
        """Return the progress at the end of the way. Collective."""
        equations, first, target = way.equations, way.first, way.target
        part = self.first
        longest = min(each.longest_part(first, target) for each in (equations.contact, equations.rigid_start))
        smallest = max(self.smallest, self.smallest_before_snap) if self.snaps else self.smallest
        while now.reached < 1.0:
            left = 1.0 - now.reached
            part = left / np.ceil(left / min(part, longest) - 1e-9)
            fraction = 1.0 if now.reached + part > 1.0 - 1e-12 else now.reached + part
            now, failure = way.advance(now, fraction)
            if failure is not None:
                if not held and isinstance(failure, NotHeldError) and now.reached == 0.0:
                    raise failure
                part *= 0.5
                parts.fail(now, fraction, failure)
                if part >= smallest:
                    safe_log(_LOG.info, "load step cut to %.3g: %s", part, failure)
                    continue
                now = way.snapped(now, fraction, 2 * part, failure)
            assert now.end is not None
            parts.reach(now)
            part *= 2.0 if len(now.end.effort.history) <= self.easy else 1.0
        return now


@dataclass(frozen=True, eq=False)
class Progress:
    """Equilibria found so far on the way to a load, and their cost.

    `origin`: where the step of histories begins, with the system of then; `earlier_friction_work`: that
    before the step; `ended`: whether the last equilibrium ends one.
    """

    at: Configuration
    torn: TornSystem
    known: Linearisation | None
    origin: tuple[Configuration, TornSystem]
    start: MaterialPoints
    end: NonlinearEquilibrium | None = None
    reached: float = 0.0
    fractions: tuple[float, ...] = ()
    snaps: tuple[Snap, ...] = ()
    since: float = 0.0
    earlier_friction_work: float = 0.0
    ended: bool = False
    effort: Effort = NO_EFFORT

    def costing(self, effort: Effort) -> Progress:
        """Return it with the effort of a trial."""
        return replace(self, effort=self.effort.followed_by(effort, len(self.fractions)))

    def reaching(self, fraction: float, found: NonlinearEquilibrium, since: float) -> Progress:
        """Return it with another equilibrium within a step of histories. Collective."""
        earlier_friction_work = self.earlier_friction_work
        if self.end is not None and self.ended:
            earlier_friction_work += self.end.evaluation.friction_work
        start = self.start.extended(found.evaluation.contact.slip_start)
        return replace(
            self, at=found.continued(self.origin[0]), torn=found.evaluation.torn, known=found.linearisation,
            start=start, end=found, reached=fraction, fractions=(*self.fractions, fraction), since=since,
            earlier_friction_work=earlier_friction_work, ended=False,
        )  # fmt: skip

    def ending(self, fraction: float, found: NonlinearEquilibrium, since: float) -> Progress:
        """Return it with another equilibrium, which ends a step of histories. Collective."""
        now = self.reaching(fraction, found, since)
        return replace(now, at=found.configuration, origin=(found.configuration, now.torn), ended=True)


class _Parts:
    """Reports how far a load step is followed, once a part of it has failed."""

    def __init__(self) -> None:
        """Begin without a failure."""
        self._task = Task("load step in parts", unit="done")
        self._failed, self._at = "", 0.0

    def fail(self, now: Progress, fraction: float, failure: ConvergenceError) -> None:
        """Report that a part fails, and why."""
        self._failed, self._at = f", {fraction:.3g} of it fails: {str(failure).partition(':')[0]}", fraction
        self.reach(now)

    def reach(self, now: Progress) -> None:
        """Report how far the load is followed, and what failed last."""
        if self._failed:
            ahead = self._failed if now.reached < self._at else ""
            self._task.step(len(now.fractions), words=f"{now.reached:.3g} of the load reached{ahead}")

    def __enter__(self) -> _Parts:
        """Report nothing yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End what has been reported."""
        if self._failed:
            self._task.end(error)


@dataclass(frozen=True, eq=False)
class _LoadStepFollower:
    """The way from one load to another, in parts."""

    steps: AutomaticSteps
    equations: Equations
    first: Loading
    target: Loading
    begun: ContactConfiguration
    timer: PhaseTimer

    def advance(self, now: Progress, fraction: float) -> tuple[Progress, ConvergenceError | None]:
        """Return the progress after a further part of the load, or why that fails. Collective."""
        contact = self.equations.contact
        before = contact.feedbacks
        try:
            load = self._load(fraction, *now.origin)
            there = load.at_motions(now.at.motions)
            moved = self.equations.rigid_start.moved(now.at.contact.prescribed, there, now.at.displacement)
            found = self.steps.newton.solve(self.equations, load, now.at, self.timer, now.known, moved)
            found = self._settled(load, found)
        except ConvergenceError as failure:
            contact.feedbacks = before
            return now.costing(Effort.until(failure)), failure
        if self.steps.finer_history:
            return now.costing(found.effort).ending(fraction, found, now.reached), None
        return now.costing(found.effort).reaching(fraction, found, now.since), None

    def _settled(self, load: Loading, found: NonlinearEquilibrium) -> NonlinearEquilibrium:
        """Return the equilibrium that agrees with what contact depends on. Collective."""
        newton, contact, passes = self.steps.newton, self.equations.contact, 1
        while changed := contact.changed_by(found, newton.tolerance):
            passes += 1
            if passes > max(each.most for each in changed):
                needed, remedy = changed[0].unsettled
                raise ConvergenceError(
                    f"{needed}, after {passes - 1} passes it does not: {remedy}", found.effort.history
                )
            again = newton.solve(self.equations, load, found.evaluation.at, self.timer, found.linearisation)
            found = replace(again, effort=found.effort.followed_by(again.effort))
        return found

    def from_near(self, now: Progress, near: Near) -> Progress:
        """Return the progress at the whole load from near its end; none where that fails. Collective."""
        load = self._load(1.0, *now.origin)
        try:
            found = self.steps.newton.solve(self.equations, load, near(load, now.at), self.timer, None)
        except ConvergenceError as failure:
            safe_log(_LOG.info, "the start from coarser meshes led nowhere: %s", failure)
            return now.costing(Effort.until(failure))
        return now.costing(found.effort).reaching(1.0, found, now.since)

    def snapped(self, now: Progress, fraction: float, part: float, failure: ConvergenceError) -> Progress:
        """Return the progress after bodies have snapped where a part of the load fails. Collective."""
        if not self.steps.snaps:
            words = f"{failure}, or let bodies snap where no equilibrium is near (snaps=True)"
            raise self._ends(now, f"a further {part:.1e} of it fails: {words}") from failure
        at = now.at if now.end is None else now.end.configuration
        load = partial(self._load, fraction)
        motion = Snapping(self.steps.newton, self.equations, load, self.timer).follow(at, now.torn, now.known)
        now, found = now.costing(motion.effort), motion.end
        if found is None:
            words = (
                f"{failure}; bodies that snap must come to rest, but after {motion.stages} stages they still "
                f"move, the drag being {motion.drag:.1e} of their stiffness: take smaller load steps, or "
                "hold them better"
            )
            raise self._ends(now, words) from failure
        way = (found.evaluation.at.displacement - now.at.displacement).reshape(-1, now.torn.components)
        far = global_max(now.torn.numbering.comm, np.linalg.norm(way, axis=1).max(initial=0.0))
        snap = Snap(fraction, float(far), motion.dissipated, motion.stages)
        safe_log(_LOG.info, "%s", snap)
        now = replace(now, snaps=(*now.snaps, snap), ended=True)  # histories begin anew
        return now.ending(fraction, found, fraction)

    def _load(self, fraction: float, at: Configuration, before: TornSystem) -> Loading:
        """Return the load at a part of the way, with slip that begins at a configuration. Collective."""
        load = self.target.between(self.first, fraction)
        return self.begun.measured(load, lambda: before.slip_origin(at.displacement, at.multiplier))

    def path(self, now: Progress) -> Path:
        """Return the path."""
        assert now.end is not None
        load = self.target.between(self.first, now.reached)
        return Path(
            load,
            now.end,
            self.begun,
            now.start,
            now.fractions,
            now.since,
            now.snaps,
            now.earlier_friction_work,
            now.effort,
        )

    def _ends(self, now: Progress, reason: str) -> PathEndsError:
        """Return the error where it ends."""
        path = None if now.end is None else self.path(now)
        message = f"the load can be followed up to {now.reached:.3g} of this step, but {reason}"
        return PathEndsError(message, now.effort.history, path)
