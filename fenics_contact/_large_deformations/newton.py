"""Newton's method for one load step: geometry, materials and contact in one loop."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact._base.checks import check_count, checked
from fenics_contact._base.display import counted, displayed
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._large_deformations.equations import (
    Configuration,
    Equations,
    Linearisation,
    ResidualState,
)
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._large_deformations.rigid_surfaces import moved_on
from fenics_contact._large_deformations.tangent_step import TangentStep, tangent_step, whole_step
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError
from fenics_contact.errors.kinds import FoldedFacetsError, safe_log
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.krylov import Stop
from fenics_contact.qp.newton_steps import Damped, Forcing, damp, run_newton
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.solution import Residuals, SolverStep

_LOG = logging.getLogger(__name__)

#: What to do where closed contacts and supports leave some body free to move.
HOLD = (
    "give each body that slides or turns freely a support in that direction, or its contacts friction; take "
    "smaller load steps only where contacts open that held it"
)


class NotHeldError(ConvergenceError):
    """Contact could not be solved as a whole: perhaps nothing holds some body."""


@dataclass(frozen=True)
class Effort:
    """What Newton's method has taken.

    `factorisations`: factored tangents, counting all subdomains as one.
    """

    history: tuple[SolverStep, ...] = ()
    products: int = 0
    factorisations: int = 0

    @classmethod
    def until(cls, failure: ConvergenceError) -> Effort:
        """Return the effort of a load step that has failed."""
        history = tuple(failure.history)
        return cls(history, history[-1].products if history else 0, len(history))

    def followed_by(self, other: Effort, outer: int = 0) -> Effort:
        """Return the sum of two efforts, with the number of the solve in the lines of the second."""
        lines = (replace(line, products=self.products + line.products, outer=outer) for line in other.history)
        factorisations = self.factorisations + other.factorisations
        return Effort((*self.history, *lines), self.products + other.products, factorisations)


@displayed
@dataclass(frozen=True, eq=False)
class NonlinearEquilibrium:
    """The end of a load step.

    `linearisation`: the last one, from a little before.
    """

    evaluation: ResidualState
    linearisation: Linearisation
    effort: Effort

    @property
    def time(self) -> float:
        """When it is reached."""
        return self.evaluation.load.time

    @property
    def configuration(self) -> Configuration:
        """The configuration, with histories up to date: the next load step begins here."""
        found = self.evaluation
        at = replace(found.at, history=found.history, contact=found.contact.from_here(found.at.multiplier))
        return replace(at, time=self.time, largest=found.residuals.gluing_scale)

    def continued(self, origin: Configuration) -> Configuration:
        """Return the configuration within a step of histories that began at another one."""
        largest = self.evaluation.residuals.gluing_scale
        return replace(self.evaluation.at, history=origin.history, time=origin.time, largest=largest)


@displayed
@dataclass(frozen=True)
@checked()
class TangentNewton:
    """Newton's method with exact tangents; every step solves one face of the linearised contact problem.

    The face is that which the natural map selects at the present displacement; its linear system is solved
    as accurately as progress warrants. A step is shortened where it would invert cells.

    Attributes:
        tolerance: All relative residuals end below it: forces out of balance, openings of glued rows and
            supports, contact.
        max_steps: Largest number of Newton steps of a load step.
        max_products: Largest number of F-products of one Newton step.
        forcing: Largest residual of a linear system, relative to its start.
        care: Factor on that after each step that does not halve the residual: near a loss of stability a
            small residual may hide a large error.
        patience: Steps in which the residual must halve; else this care begins, and from the second time on
            the natural map becomes more cautious.
        caution: Factor on ρ of the natural map then.
        stalls: How often that may happen while the residual is above `near`,
        softening_stalls: and where it is not half of the first one, while stress has softened more motions
            than at the start: no equilibrium is near then.
        room: Part of the smallest det F that a step must leave.
        near: Residual below which a first step without progress is reason enough for care.
        least_care: Least factor by care, so that linear systems are not solved beyond rounding.
        fine: Residual of a linear system that is always small enough, relative to `tolerance`.
        hidden: Errors at contact below this part of the forces out of balance do not shorten a step: they do
            not depend on the active set then.
        enough: Part of all residuals to which a whole step must reduce them to be taken though contact gets
            worse: loads begin with contact in order and forces out of balance.
        slipped: Part of the slip bound within which a disc counts as slipping at the start of a load step:
            what slipped in the last one mostly goes on.
        nested: Tolerance of contact problems that are solved as a whole, at the start of a history.
        rescues: Rescues of these where the load step is cut instead: active sets that cycle come back to it.
        few: Rows of gluing and supports up to which linear systems without contact are solved to `sharp`:
            there products are cheap beside a tangent, and where a body hardly resists some motion, as a bar
            the tilting of an end that a pressure pulls, a small residual hides a large error.
        sharp: Largest residual of these, relative to its start.

    References:
        S. C. Eisenstat, H. F. Walker, Choosing the forcing terms in an inexact Newton method, SIAM J. Sci.
        Comput. 17 (1996), choice 2.
    """

    tolerance: float = 1e-8
    max_steps: int = 25
    max_products: int = 400
    forcing: float = 0.1
    care: float = 0.1
    patience: int = 4
    caution: float = 0.2
    stalls: int = 4
    softening_stalls: int = 2
    room: float = 0.2
    near: float = 1e-2
    least_care: float = 1e-3
    fine: float = 1e-4
    hidden: float = 1e-2
    enough: float = 0.5
    slipped: float = 1e-6
    nested: float = 1e-2
    rescues: int = 1
    few: int = 500
    sharp: float = 1e-9

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InvalidInputError: If one is not between 0 and 1, or a count is not positive.
        """
        ratios = ("tolerance", "forcing", "care", "caution", "room")
        for name in (*ratios, "near", "least_care", "fine", "hidden", "enough", "slipped", "nested", "sharp"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InvalidInputError(
                    f"{name} of TangentNewton must lie between 0 and 1, got {getattr(self, name)!r}: it is a "
                    f"ratio, by default {getattr(TangentNewton, name)}"
                )
        for name in ("max_steps", "max_products", "patience", "stalls", "softening_stalls", "rescues", "few"):
            check_count(getattr(self, name), f"{name} of TangentNewton")

    def solve(
        self,
        equations: Equations,
        load: Loading,
        start: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None,
        moved: Vector | None = None,
    ) -> NonlinearEquilibrium:
        """Return the equilibrium next to a configuration. Collective.

        Args:
            equations: Internal forces, and contact.
            load: What acts, with the origin of slip where bodies do not move far.
            start: Where Newton's method starts, with the start of slip and with the history of materials
                before the load step.
            timer: Collects the wall time.
            known: A linearisation near the start, or None.
            moved: Displacement to which supports take bodies, see `starts`, torn, shape (torn_size,),
                [length]; None for that of the configuration.

        Raises:
            ConvergenceError: With the history, which ends with the reason.
        """
        run = _Run(self._sharpened(load.torn), equations, load, timer)
        return run_newton(run, run.init(start, known, moved))

    def _sharpened(self, torn: TornSystem) -> TangentNewton:
        """Return the method for a system, in which few rows are solved for sharply."""
        if torn.points.count or torn.n_equality > self.few:
            return self
        return replace(self, forcing=min(self.forcing, self.sharp))


@dataclass(frozen=True)
class _Pace:
    """How accurately a step is solved, and how cautiously its face is chosen."""

    forcing: float  # η, residual of the linear system relative to its start
    late: tuple[float, ...] = ()  # the last residuals since the last stall, oldest first
    care: float = 1.0  # factor on η
    caution: float = 1.0  # factor on ρ of the natural map
    stalls: int = 0  # how often residuals have not halved in time

    def after(self, method: TangentNewton, worst: float) -> _Pace:
        """Return the pace of the next step, given the residual at its start."""
        last, care = self.late[-1] if self.late else None, self.care
        if last and (self.stalls or worst < method.near):
            care = 1.0 if worst < 0.5 * last else max(method.care * care, method.least_care)
        rule = Forcing(method.forcing, np.inf, method.tolerance)
        forcing = rule.by_reduction(worst, last, self.forcing, care)
        late = (*self.late, worst)[-method.patience - 1 :]
        if len(late) <= method.patience or min(late[1:]) <= 0.5 * late[0]:
            return _Pace(forcing, late, care, self.caution, self.stalls)
        caution = self.caution * (method.caution if self.stalls else 1.0)
        return _Pace(forcing, (worst,), care, caution, self.stalls + 1)


@dataclass(frozen=True)
class _Begin:
    """Where a load step began: its first residual, and how many motions the first tangent had softened."""

    worst: float
    softened: int = 0


@dataclass(frozen=True, eq=False)
class _State:
    """The data passed from one Newton step to the next."""

    evaluation: ResidualState
    near: Linearisation | None  # the last one, None before the first
    pace: _Pace  # that of the last step
    begin: _Begin
    before: Residuals | None = None  # before the last step
    instead: Configuration | None = None  # where to start from if the first step fails
    floats: bool = False  # whether the last face did not hold every body
    effort: Effort = field(default_factory=Effort)

    @property
    def history(self) -> tuple[SolverStep, ...]:
        """One line for each step."""
        return self.effort.history

    def after(self, line: SolverStep, taken: TangentStep, floats: bool) -> _State:
        """Return it with another step."""
        effort = self.effort.followed_by(Effort((line,), taken.products, 1))
        return replace(self, instead=None, floats=floats, effort=effort)

    def is_vain(self, method: TangentNewton) -> bool:
        """Return whether further steps are vain: residuals do not fall, or bodies lose stability meanwhile.

        So they do where no equilibrium is near; where one is, more motions are stable as it is approached.
        """
        worst, stalls = self.evaluation.residuals.worst, self.pace.stalls
        if worst <= method.near or self.near is None:
            return False
        softening = self.near.system.softened > self.begin.softened and worst > 0.5 * self.begin.worst
        return stalls >= method.stalls or (stalls >= method.softening_stalls and softening)


@dataclass(frozen=True, eq=False)
class _Run:
    """One load step: the data that all its steps share; a `NewtonMethod`."""

    method: TangentNewton
    equations: Equations
    load: Loading
    timer: PhaseTimer

    def init(self, start: Configuration, known: Linearisation | None, moved: Vector | None) -> _State:
        """Return the state before the first step. Collective."""
        evaluation, instead = starts(self._started, start, moved)
        first = evaluation.residuals
        begin = _Begin(first.worst)
        state = _State(evaluation, known, _Pace(self.method.forcing), begin, instead=instead)
        if known is None and first.force_scale > 0.0 and first.within(self.method.tolerance):
            # Gaps are measured by the diagonal of F, which is known only now.
            near = evaluation.linearised(self.timer, None)
            with self.timer.phase("assemble"):
                evaluation = self.equations.evaluate_at(evaluation.load, near.of(evaluation).at)
            state = replace(state, evaluation=evaluation, near=near, effort=Effort(factorisations=1))
        return state

    def terminate(self, state: _State) -> NonlinearEquilibrium | None:
        """Return the equilibrium, None if a further step is needed. Collective."""
        residuals, method, history = state.evaluation.residuals, self.method, state.history
        if state.near is not None and residuals.within(method.tolerance):
            return NonlinearEquilibrium(state.evaluation, state.near, state.effort)
        if state.is_vain(method) or len(history) >= method.max_steps or not residuals.worst < 1e6:
            raise ConvergenceError(
                f"Newton's method needs residuals below {method.tolerance:.1e}, got after "
                f"{counted(len(history), 'step')}: {history[-1] if history else 'no step'}: "
                f"{HOLD if state.floats else 'take smaller load steps'}",
                history,
            )
        return None

    def step(self, state: _State) -> _State:
        """Take one step. Collective."""
        # (a) The forcing term and ρ.
        pace = state.pace.after(self.method, state.evaluation.residuals.worst)
        # The tangents; factors of those before are refilled, unless they belong to the load step before.
        if state.near is not None and state.effort.factorisations:
            state.near.release_factors()
        near = state.evaluation.linearised(self.timer, state.near)
        evaluation = near.of(state.evaluation)
        begin = state.begin if state.history else replace(state.begin, softened=near.system.softened)
        state = replace(state, evaluation=evaluation, near=near, pace=pace, begin=begin)
        held = [f"{near.system.softened} soft motions held"] if near.system.softened else []
        # (b), (c) The face and its linear system.
        with self.timer.phase("solve"):
            taken, near, whole = self._solved(state, near)
            change = taken.multiplier[: len(evaluation.at.multiplier)] - evaluation.at.multiplier
            further = taken.multiplier[len(change) :]
            moved = near.system.displacement(np.concatenate([change, further]), taken.motions)
            change = change + evaluation.growth.passed_on(evaluation.torn, moved)
        # (d) The step, as far as cells and the active set allow.
        tracked = evaluation.torn.free.tracked
        turned = taken.motions[len(taken.motions) - evaluation.torn.free.count :][:tracked]
        damped = self._damped(state, moved, change, turned)
        # (e) The next state, or the other start if the first step has failed.
        floats, again = whole and self._forces_known(evaluation), state.instead
        how = "contact solved as a whole" if whole else f"forcing {pace.forcing:.1e}"
        line = self._line(state, damped, taken, [how, *held])
        if (damped.fraction == 1.0 and line.residuals.worst < evaluation.residuals.worst) or again is None:
            state = state.after(line, taken, floats)
            return replace(state, evaluation=damped.point, before=evaluation.residuals)
        state = state.after(replace(line, note=f"{line.note}, begun again"), taken, floats)
        evaluation = self._started(again, state.history)
        return replace(state, evaluation=evaluation, pace=_Pace(self.method.forcing))

    def _started(self, at: Configuration, history: tuple[SolverStep, ...] = ()) -> ResidualState:
        """Return the equations where Newton's method starts. Collective."""
        with self._assembling(history):
            return self.equations.evaluate(self.load, at)

    @contextmanager
    def _assembling(self, history: tuple[SolverStep, ...]) -> Iterator[None]:
        """Time an evaluation of the equations, which must not fold facets."""
        try:
            with self.timer.phase("assemble"):
                yield
        except FoldedFacetsError as folded:
            raise ConvergenceError(
                "a Newton step must not fold facets that meet, but after "
                f"{counted(len(history), 'step')} {folded}; or take smaller load steps",
                history,
            ) from folded

    def _forces_known(self, evaluation: ResidualState) -> bool:
        comm = evaluation.torn.numbering.comm
        return global_sum(comm, np.count_nonzero(evaluation.at.multiplier))[0] > 0.0

    def _solved(self, state: _State, near: Linearisation) -> tuple[TangentStep, Linearisation, bool]:
        """Solve the face at the present point, or contact as a whole. Collective.

        At the start of a history nothing is known of the active set. Returns the step, the linearisation that
        it solves, and whether it is that of contact as a whole.
        """
        evaluation, method = state.evaluation, self.method
        step = np.concatenate([evaluation.at.natural_step(state.pace.caution), np.zeros(near.further.count)])
        if state.history or evaluation.torn.points.count == 0 or self._forces_known(evaluation):
            floor = method.fine * method.tolerance * evaluation.residuals.gluing_scale
            # What slipped in the last load step will mostly go on: its forces are at the bound.
            margin = 0.0 if state.history else method.slipped
            problem, forcing = near.problem(evaluation), state.pace.forcing
            taken = tangent_step(problem, step, forcing, floor, method.max_products, margin=margin)
            if taken is not None:
                return taken, near, False
        try:
            return *self._solved_whole(state, near, step), True
        except InfeasibleError as reason:
            if not self._forces_known(evaluation):  # bodies at rest: nothing holds them from the start
                raise
            raise NotHeldError(
                f"Newton's method needs tangents that the rows of supports and contacts hold, got after "
                f"{counted(len(state.history), 'step')}: {reason}: {HOLD}",
                state.history,
            ) from reason
        except ConvergenceError as reason:
            raise NotHeldError(str(reason), reason.history) from reason

    def _solved_whole(
        self, state: _State, near: Linearisation, step: Vector
    ) -> tuple[TangentStep, Linearisation]:
        """Solve contact as a whole, with springs that exert their present forces. Collective.

        Where nothing else holds a tool they are as if they did not give.
        """
        evaluation, solver = state.evaluation, self._whole(state, near)
        if evaluation.load.is_sprung:
            given_way = evaluation.linearised_without_springs(self.timer)
            own = step[: len(evaluation.at.multiplier)]
            own = np.concatenate([own, np.zeros(given_way.further.count)])
            try:
                return whole_step(given_way.system, evaluation.at.multiplier, own, solver), given_way
            except InfeasibleError as failure:
                safe_log(_LOG.info, "springs alone hold a tool: %s", failure)
        return whole_step(near.system, evaluation.at.multiplier, step, solver), near

    def _whole(self, state: _State, near: Linearisation) -> FaceNewton:
        """Return the solver of contact as a whole: soon given up where the load step may be cut.

        So it may where forces are known, and where loads have softened the bodies. Near the end it is as
        accurate as a face would be: bodies that have come loose are held by none.
        """
        method, evaluation = self.method, state.evaluation
        if not self._forces_known(evaluation) and not near.system.softened:
            return FaceNewton(method.nested)
        worst, wanted = evaluation.residuals.worst, method.nested
        if worst <= method.near:
            wanted = max(min(wanted, state.pace.forcing * worst), method.forcing * method.tolerance)
        return FaceNewton(wanted, max_products=method.max_products, doubts=False, max_rescues=method.rescues)

    def _damped(self, state: _State, moved: Vector, change: Vector, turned: Vector) -> Damped[ResidualState]:
        """Return the end of a step as long as cells allow, or a better point of it. Collective.

        Forces out of balance are no reason for that: a step that turns a body strains it until the next one.
        """
        start = state.evaluation
        at, caution = start.at, state.pace.caution
        longest = self._room(state, moved)

        def after(part: float) -> ResidualState:
            part *= longest
            ends = at.displacement + part * moved, at.multiplier + part * change
            with self._assembling(state.history):
                return start.evaluate(*ends, caution, moved_on(start.load.turned, turned, part))

        full, before, method = after(1.0), start.residuals, self.method
        if full.residuals.natural <= max(before.natural, method.hidden * full.residuals.coarse):
            return Damped(full, longest)
        if full.residuals.worst <= method.enough * before.worst:
            return Damped(full, longest)
        earlier = (old.at_rows for old in (before, state.before) if old is not None)
        found = damp(full, after, lambda each: each.residuals.at_rows, earlier)
        return replace(found, fraction=found.fraction * longest)

    def _room(self, state: _State, moved: Vector) -> float:
        """Return the part of a step on whose way no cell is inverted. Collective.

        Two axes of a cell that turn inside out together leave det F positive at its end.
        """
        part, start = 1.0, state.evaluation
        while part > 1e-3:
            least = self.equations.least_jacobian(start.at.displacement, part * moved)
            if least > self.method.room * start.least_jacobian:
                return part
            part *= 0.5
        raise ConvergenceError(
            "a Newton step must not turn cells inside out, but every part of this one does: take smaller "
            "load steps, or refine the mesh where cells are flattened",
            state.history,
        )

    def _line(
        self, state: _State, damped: Damped[ResidualState], taken: TangentStep, remarks: list[str]
    ) -> SolverStep:
        """Return the line of history of a step. Collective."""
        closed, stick, slip = taken.face.counts(state.evaluation.torn.numbering.comm)
        notes = remarks[:1]
        notes += [f"cut to {damped.fraction:g} of the step"] if damped.fraction < 1.0 else []
        notes += [taken.stop.value] if taken.stop is not Stop.CONVERGED else []
        notes += remarks[1:]
        number, residuals = len(state.history), damped.point.residuals
        return SolverStep("Newton", number, taken.products, residuals, closed, stick, slip, ", ".join(notes))


def starts(
    evaluated: Callable[[Configuration], ResidualState],
    at: Configuration,
    moved: Vector | None,
    pressed: float = 0.5,
) -> tuple[ResidualState, Configuration | None]:
    """Return the equations where Newton's method starts, and where else if its first step fails. Collective.

    Bodies that touch nothing, there as here, start where their supports take them as rigid ones. So do bodies
    that slide: with their forces, on surfaces that are found where they come to lie, they are in equilibrium
    but for what lies under them. Where points stick or are pressed, as a relative residual above ``pressed``
    shows, the tangent knows better where bodies go.
    """
    contact = at.contact
    touching = _acts(contact.torn, at.multiplier)
    if moved is None or (touching and not _slides(contact.torn, at.multiplier)):
        return evaluated(at), None
    try:
        there = evaluated(replace(at, displacement=moved))
    except ConvergenceError:
        return evaluated(at), None
    if touching:
        return (there, at) if there.residuals.worst < pressed else (evaluated(at), None)
    if _acts(there.torn, there.torn.law.feasible(there.at.multiplier).project(-there.constraint_residual)):
        return evaluated(at), None
    return there, None


def _acts(torn: TornSystem, forces: Vector) -> bool:
    """Return whether any row of contact has a force. Collective."""
    touching = torn.numbering.owned >= torn.n_equality
    return global_sum(torn.numbering.comm, np.count_nonzero(forces[touching]))[0] > 0.0


def _slides(torn: TornSystem, multiplier: Vector, short: float = 1e-2) -> bool:
    """Return whether all friction is at its bound, but for ``short`` of the largest bound. Collective."""
    comm, bound = torn.numbering.comm, torn.law.bound(multiplier)
    friction = np.linalg.norm(multiplier[torn.layout.tangential], axis=1)
    largest = global_max(comm, float(bound.max(initial=0.0)))
    return global_max(comm, float((bound - friction).max(initial=0.0))) <= short * largest
