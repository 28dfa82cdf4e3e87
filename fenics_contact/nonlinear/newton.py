"""Newton's method for one load step: geometry, materials and contact in one loop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.checks import check_count, checked
from fenics_contact.display import counted, displayed
from fenics_contact.errors import ConvergenceError, FoldedFacetsError, InfeasibleError, InvalidInputError
from fenics_contact.nonlinear.equations import Configuration, Equations, Evaluation, Linearisation
from fenics_contact.nonlinear.loading import Loading
from fenics_contact.nonlinear.meeting import Contact, Meeting
from fenics_contact.nonlinear.starts import starts
from fenics_contact.nonlinear.tangent_step import TangentStep, tangent_step
from fenics_contact.nonlinear.tangent_system import TangentSystem
from fenics_contact.qp import (
    FaceNewton,
    Residuals,
    SolverStep,
    Stop,
    Vector,
    apply_unless_zero,
    classify,
    global_sum,
    solve,
)
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.pairing import MaterialPoints

#: Fractions of a step that are tried where it and its contact are worse than at the last two configurations.
FRACTIONS = (0.5, 0.25, 0.1)
#: Factor on the residual of linear systems after each step without progress, and the least of these factors:
#: near a loss of stability a small residual may hide a large error.
CARE, LEAST_CARE = 0.1, 1e-3
#: Errors at contact below this part of the forces out of balance say nothing of the active set.
HIDDEN = 1e-2
#: Residual below which a step without progress is reason enough for that care.
NEAR = 1e-2
#: Part of the slip bound within which a disc counts as slipping at the start of a load step.
SLIPPED = 1e-6
#: Residual of a linear system that is small enough, relative to the tolerance of the step.
FINE = 1e-4
#: Part of the smallest det F that a step must leave.
ROOM = 0.2
#: Steps without half the residual after which systems are solved more accurately, and from the second time
#: on the natural map becomes more cautious, by this factor.
PATIENCE, CAUTION = 4, 0.2
#: Residual of contact problems that are solved as a whole, at the start of a history.
NESTED = 1e-2
#: What to do where closed contacts and supports leave some body free to move.
HOLD = (
    "give each body that slides or turns freely a support in that direction, or its contacts friction; take "
    "smaller load steps only where contacts open that held it"
)


class NotHeldError(ConvergenceError):
    """Contact could not be solved as a whole: perhaps nothing holds some body."""


@displayed
@dataclass(frozen=True, eq=False)
class NonlinearEquilibrium:
    """The end of a load step.

    Attributes:
        evaluation: The equations there; all residuals are below the tolerance.
        linearisation: The last one, from a little before.
        history: One line for each Newton step.
        time: When it is reached.
        products: Applications of F.
        factorisations: Factored tangents, counting all subdomains as one.
    """

    evaluation: Evaluation
    linearisation: Linearisation
    history: tuple[SolverStep, ...]
    time: float
    products: int
    factorisations: int

    @property
    def configuration(self) -> Configuration:
        """The configuration, with histories up to date: the next load step begins here."""
        found = self.evaluation
        at = replace(found.at, history=found.history, meeting=found.meeting.from_here())
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

    References:
        S. C. Eisenstat, H. F. Walker, Choosing the forcing terms in an inexact Newton method, SIAM J. Sci.
        Comput. 17 (1996), choice 2.
    """

    tolerance: float = 1e-8
    max_steps: int = 25
    max_products: int = 400
    forcing: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InvalidInputError: If tolerance or forcing are not between 0 and 1, or a count is not positive.
        """
        for name in ("tolerance", "forcing"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InvalidInputError(
                    f"{name} of TangentNewton must lie between 0 and 1, got {getattr(self, name)!r}: it is a "
                    f"relative residual, by default {getattr(TangentNewton, name)}"
                )
        for name in ("max_steps", "max_products"):
            check_count(getattr(self, name), f"{name} of TangentNewton")

    def solve(
        self,
        equations: Equations,
        contact: Contact,
        load: Loading,
        start: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None,
        moved: Vector | None = None,
    ) -> NonlinearEquilibrium:
        """Return the equilibrium next to a configuration. Collective.

        Args:
            equations: Internal forces.
            contact: How the bodies meet.
            load: What acts, with the origin of slip where bodies do not move far.
            start: Where Newton's method starts, with where nodes stood and with the history of materials
                before the load step.
            timer: Collects the wall time.
            known: A linearisation near the start, or None.
            moved: Displacement to which supports take bodies, see `starts`, torn, shape (torn_size,),
                [length]; None for that of the configuration.

        Raises:
            ConvergenceError: With the history, which ends with the reason.
        """
        return _Run(self, equations, contact, load, timer).to_equilibrium(start, known, moved)


class _Run:
    """One load step."""

    def __init__(
        self, method: TangentNewton, equations: Equations, contact: Contact, load: Loading, timer: PhaseTimer
    ) -> None:
        self._method, self._equations, self._contact, self._load = method, equations, contact, load
        self._timer, self._comm = timer, load.torn.numbering.comm
        self._caution = self._care = 1.0
        self._stalls, self._loose, self._whole_step = 0, False, False
        self._start: MaterialPoints | None = None
        self.history: list[SolverStep] = []
        self._residuals: list[float] = []
        self._forcing = method.forcing
        self.products = self.factorisations = 0

    def to_equilibrium(
        self, at: Configuration, known: Linearisation | None, moved: Vector | None
    ) -> NonlinearEquilibrium:
        evaluation, instead = starts(lambda at: self._from(at, known), at, moved)
        near, earlier, first = known, None, evaluation.residuals
        if near is None and first.force_scale > 0.0 and first.within(self._method.tolerance):
            near = evaluation.linearised(self._timer, None)
            self.factorisations += 1
            evaluation = self._evaluated(evaluation.at, near)  # which tells of gaps only now
        while near is None or not evaluation.residuals.within(self._method.tolerance):
            self._require_progress(evaluation)
            if near is not None and near is not known:
                near.spend()
            near = evaluation.linearised(self._timer, near)
            self.factorisations += 1
            following = self._advanced(evaluation, earlier, near)
            promising = self._whole_step and following.residuals.worst < evaluation.residuals.worst
            if instead is not None and not promising:
                evaluation = self._begins_again(instead, known)
            else:
                evaluation, earlier = following, evaluation.residuals
            instead = None
        return NonlinearEquilibrium(
            evaluation, near, tuple(self.history), self._load.time, self.products, self.factorisations
        )

    def _from(self, at: Configuration, known: Linearisation | None) -> Evaluation:
        """Return the equations at a configuration before the first step. Collective."""
        self._start = None if at.meeting is None else at.meeting.start
        return self._evaluated(at, known)

    def _begins_again(self, instead: Configuration, known: Linearisation | None) -> Evaluation:
        """Forget a first step that failed; return the equations to start from instead. Collective."""
        self.history[-1] = replace(self.history[-1], note=f"{self.history[-1].note}, begun again")
        self._caution, self._care, self._forcing, self._residuals = 1.0, 1.0, self._method.forcing, []
        return self._from(instead, known)

    def _evaluated(
        self, at: Configuration, near: Linearisation | None, origin: Vector | None = None
    ) -> Evaluation:
        """Return the equations at a configuration, with its contact points. Collective."""
        with self._timer.phase("assemble"):
            meeting = self._meeting(at)
            self._start, at = meeting.start, at.meeting_at(meeting)
            step: Vector = np.zeros(meeting.torn.layout.size)
            if near is not None:
                step = near.natural_step(meeting, self._caution)
            return self._equations.evaluate(meeting, meeting.torn.law, at, step, self._load, origin)

    def _meeting(self, at: Configuration) -> Meeting:
        """Return the contact points at a configuration, which must not fold facets. Collective."""
        try:
            return self._contact.at(self._load, at.displacement, self._start, at.meeting)
        except FoldedFacetsError as folded:
            raise ConvergenceError(
                "a Newton step must not fold facets that meet, but after "
                f"{counted(len(self.history), 'step')} {folded}; or take smaller load steps",
                self.history,
            ) from folded

    def _require_progress(self, evaluation: Evaluation) -> None:
        """Adapt the forcing term and ρ. Collective.

        Raises:
            ConvergenceError: Steps are used up, or residuals grow without bound.
        """
        worst, method = evaluation.residuals.worst, self._method
        previous = self._residuals[-1] if self._residuals else None
        self._residuals.append(worst)
        if len(self.history) >= method.max_steps or not worst < 1e6:
            last = self.history[-1] if self.history else "no step"
            raise ConvergenceError(
                f"Newton's method needs residuals below {method.tolerance:.1e}, got after "
                f"{counted(len(self.history), 'step')}: {last}: "
                f"{HOLD if self._loose else 'take smaller load steps'}",
                self.history,
            )
        if not previous or previous >= 1.0:
            self._forcing = method.forcing
        else:
            chosen = 0.9 * (worst / previous) ** 2
            careful = 0.9 * self._forcing**2
            self._forcing = min(method.forcing, max(chosen, careful if careful > 0.1 else 0.0))
        if previous and (self._stalls or worst < NEAR):
            self._care = 1.0 if worst < 0.5 * previous else max(CARE * self._care, LEAST_CARE)
        least = 0.3 * method.tolerance / max(worst, method.tolerance)
        self._forcing = self._care * max(self._forcing, least)
        late = self._residuals[-PATIENCE - 1 :]
        if len(late) > PATIENCE and min(late[1:]) > 0.5 * late[0]:
            self._stalls += 1
            self._caution *= CAUTION if self._stalls > 1 else 1.0
            self._residuals = [worst]

    def _advanced(self, evaluation: Evaluation, earlier: Residuals | None, near: Linearisation) -> Evaluation:
        """Take one step. Collective.

        Args:
            evaluation: The equations at its start.
            earlier: Residuals before the last step, or None.
            near: The tangents at its start.
        """
        at, size, method = evaluation.at, len(evaluation.lacking), self._method
        further = np.zeros(near.further.count)
        step = np.concatenate([near.natural_step(evaluation.meeting, self._caution), further])
        floor = FINE * method.tolerance * evaluation.residuals.gluing_scale
        taken = None
        with self._timer.phase("solve"):
            if self.history or evaluation.torn.points.count == 0 or self._forces_known(evaluation):
                problem = near.problem(evaluation)
                # What slipped in the last load step will mostly go on: its forces are at the bound.
                margin = 0.0 if self.history else SLIPPED
                taken = tangent_step(problem, step, self._forcing, floor, method.max_products, margin=margin)
            whole = taken is None
            self._loose = whole and self._forces_known(evaluation)
            if taken is None:
                taken = self._held_whole(near.system, evaluation, step)
            self.products += taken.products
            change = taken.multiplier - np.concatenate([at.multiplier, further])
            moved = near.system.displacement(change, taken.motions)
            change[:size] += evaluation.passed_on(moved)

        def after(part: float) -> Evaluation:
            displacement, multiplier = at.displacement + part * moved, at.multiplier + part * change[:size]
            following = replace(at, displacement=displacement, multiplier=multiplier)
            return self._evaluated(following, near, at.displacement)

        part = self._room(evaluation, moved)
        best = after(part)
        before = evaluation.residuals
        olds = [old.at_rows for old in (before, earlier) if old is not None]
        worse = all(best.residuals.at_rows.is_worse_than(old) for old in olds)
        hidden = HIDDEN * best.residuals.coarse
        if worse and best.residuals.natural > max(before.natural, hidden):
            # The active set alternates between two faces: the solution lies between them. Forces out of
            # balance are no reason: a step that turns a body strains it until the next one.
            candidates = [(best, part), *((after(f * part), f * part) for f in FRACTIONS)]
            full = best.residuals.at_rows
            best, part = min(candidates, key=lambda c: c[0].residuals.at_rows.worst_beside(full))
        self._whole_step = part == 1.0
        self._record(best, near.system, taken, part, whole)
        return best

    def _forces_known(self, evaluation: Evaluation) -> bool:
        return global_sum(self._comm, np.count_nonzero(evaluation.at.multiplier))[0] > 0.0

    def _held_whole(self, system: TangentSystem, evaluation: Evaluation, step: Vector) -> TangentStep:
        """Solve contact as a whole; a body that nothing holds any more ends the load step. Collective."""
        try:
            return self._whole(system, evaluation, step)
        except InfeasibleError as reason:
            if not self._forces_known(evaluation):  # bodies at rest: nothing holds them from the start
                raise
            raise NotHeldError(
                f"Newton's method needs tangents that the rows of supports and contacts hold, got after "
                f"{counted(len(self.history), 'step')}: {reason}: {HOLD}",
                self.history,
            ) from reason
        except ConvergenceError as reason:
            raise NotHeldError(str(reason), reason.history) from reason

    def _whole(self, system: TangentSystem, evaluation: Evaluation, step: Vector) -> TangentStep:
        """Solve the linearised contact problem as a whole, its rigid motions without stiffness. Collective.

        At the start of a history nothing is known of the active set, and without stress they have none.
        """
        torn, before, problem = system.torn, system.products, system.problem
        multiplier = np.zeros(len(torn.numbering.owned))
        multiplier[: len(evaluation.lacking)] = evaluation.at.multiplier
        load = problem.coarse.load + problem.coarse.apply(multiplier)
        scaling = None if problem.scaling is None else problem.scaling.with_load(load)
        flexed = apply_unless_zero(problem, system.apply, multiplier)
        coarse = problem.coarse.with_load(load)
        problem = replace(problem, rhs=problem.rhs + flexed, coarse=coarse, scaling=scaling, reach=None)
        tresca, coefficient = torn.friction
        solver = FaceNewton(NESTED)
        if self._forces_known(evaluation):  # then a failure cuts the load step, whatever its reason
            solver = replace(solver, max_products=self._method.max_products, doubts=False)
        solution = solve(problem, tresca, solver, multiplier, friction_coefficient=coefficient)
        bound = torn.law.bound(solution.multiplier)
        face = classify(problem.layout, bound, solution.multiplier, solution.residual, step)
        return TangentStep(
            solution.multiplier, solution.alpha, face, system.products - before, Stop.CONVERGED
        )

    def _room(self, evaluation: Evaluation, moved: Vector) -> float:
        """Return the part of a step that keeps cells from being inverted. Collective."""
        part, wanted = 1.0, ROOM * evaluation.least_jacobian
        while part > 1e-3:
            if self._equations.least_jacobian(evaluation.at.displacement + part * moved) > wanted:
                return part
            part *= 0.5
        raise ConvergenceError(
            "a Newton step must not turn cells inside out, but every part of this one does: take smaller "
            "load steps, or refine the mesh where cells are flattened",
            self.history,
        )

    def _record(
        self, evaluation: Evaluation, system: TangentSystem, taken: TangentStep, part: float, whole: bool
    ) -> None:
        face = taken.face
        counts = global_sum(self._comm, *(np.count_nonzero(m) for m in (face.closed, face.stick, face.slip)))
        closed, stick, slip = (round(float(count)) for count in counts)
        notes = ["contact solved as a whole"] if whole else [f"forcing {self._forcing:.1e}"]
        notes += [f"cut to {part:g} of the step"] if part < 1.0 else []
        notes += [taken.stop.value] if taken.stop is not Stop.CONVERGED else []
        notes += [f"{system.softened} soft motions held"] if system.softened else []
        residuals, words = evaluation.residuals, ", ".join(notes)
        line = SolverStep("Newton", len(self.history), self.products, residuals, closed, stick, slip, words)
        self.history.append(line)
