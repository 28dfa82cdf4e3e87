"""The bundle trust method: null and serious steps until the model predicts no decrease.

`BundleTrust` has its parameters, `_Run` its steps, `MethodState` what one step hands to the next.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact._base.checkpoint import Checkpoint
from fenics_contact._base.checks import naming_arguments
from fenics_contact._optimize.bundle import Bundle, SubproblemError
from fenics_contact._optimize.constraints import Box, Constraints
from fenics_contact._optimize.merit import (
    correcting_step,
    first_soft,
    merit_planes,
    multipliers,
    penalised_step,
    restored,
    surroundings,
    verified,
    with_pieces,
    with_verified_centre,
)
from fenics_contact._optimize.nonlinear import ConstraintValue, NonlinearConstraint, scaled_constraints
from fenics_contact._optimize.objective import Accuracy, Evaluation, Fun, Remarked, can_be_inexact
from fenics_contact._optimize.problem import (
    CheckedProblem,
    Known,
    OracleAccuracy,
    again,
    demand,
    evaluate_constraint,
    pose,
)
from fenics_contact._optimize.progress import Callback, Progress, StoredProgress
from fenics_contact._optimize.result import MethodState, NotConvergedError, Reason, Record, Result, StepKind
from fenics_contact._optimize.subproblem import Step, Trial, Trust, solve_step
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.errors.kinds import safe_log

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)


def first_centre(problem: CheckedProblem, subgradient: float, feasibility: float) -> Evaluation:
    """Evaluate the starting point, corrected to meet the equalities where it need not be feasible."""
    equal, accuracy = problem.equalities, Accuracy(np.inf, subgradient)
    penalties = dict.fromkeys(problem.inequalities, 1.0)
    try:
        if equal and problem.restore:
            x, known = restored(problem, problem.start, 1, feasibility)
        else:
            x = problem.start
            known = {k: evaluate_constraint(problem.nonlinear[k], x, 1) for k in equal}
            constraints = tuple(problem.nonlinear[k] for k in known)
            _refuse(constraints, [one.value for one in known.values()], feasibility)
        centre = problem.evaluate(x, 1, accuracy, penalties, known)
    except InvalidDesignError as error:
        raise InvalidDesignError(f"the starting design must be valid: {error}") from error
    here = problem.constraints_at(centre)
    if not problem.restore and here.violation > feasibility:
        _refuse(problem.nonlinear, [float(value) for value in centre.constraints], feasibility)
    return centre


def _refuse(constraints: tuple[NonlinearConstraint, ...], values: list[float], feasibility: float) -> None:
    """Raise an error that names the violated constraints, if any."""
    violations = scaled_constraints(constraints, np.array(values)).violations
    words = [
        f"{one.name} is {value:.6g}, limits [{one.lower:.6g}, {one.upper:.6g}]"
        for one, value, violation in zip(constraints, values, violations, strict=True)
        if violation > feasibility
    ]
    if words:
        raise InvalidInputError(
            f"x0 must satisfy nonlinear constraints, but {'; '.join(words)}: change it, or set restore=True"
        )


@dataclass(frozen=True)
class StoppingTest:
    r"""Test on the predicted decrease w and on the certificate σ + r‖z‖.

    For a convex J no feasible point within the distance r is lower than the centre by more than σ + r‖z‖:
    this certificate holds for any t. The predicted decrease w = σ + t‖z‖² could be small only because t is,
    so it is also tested with the first t. `limit`: decrease of J that is not worth a step, ε (s + \|J\|);
    `reach`: least r, in scaled variables; a longer step extends it to its own length; `slack`: largest
    certificate at the stop in units of ``limit``: it bounds J from below within r, more than the predicted
    decrease claims.
    """

    limit: float
    rounding: float
    reach: float
    first_t: float
    slack: float = 10.0

    def reason(self, step: Step, solve: Callable[[float], Step]) -> Reason | None:
        """Return CONVERGED or STATIONARY where the centre is a solution within the tolerance, else None."""
        certificate = step.aggregate_error + max(self.reach, step.length) * step.aggregate_norm
        if certificate <= self.limit:
            return Reason.STATIONARY
        promising = step.decrease > max(self.limit, self.rounding)
        if promising or (certificate > self.slack * self.limit and step.decrease > self.rounding):
            return None
        longer = step if step.t >= self.first_t else solve(self.first_t)
        return Reason.CONVERGED if longer.decrease <= self.limit else None


def stopping_test(
    value: float, *, tolerance: float, value_scale: float, reach: float, first_t: float
) -> StoppingTest:
    """Return the test for a centre with this value of J."""
    rounding = 4.0 * float(np.finfo(float).eps) * abs(value)
    return StoppingTest(tolerance * (value_scale + abs(value)), rounding, reach, first_t)


# Based on subgradients alone.
_OF_THE_MODEL = (Reason.CONVERGED, Reason.STATIONARY, Reason.NO_DESCENT, Reason.INFEASIBLE)
_GRADIENT_NEAR = "a gradient nearby, as the centre lies on a kink"


@dataclass(frozen=True)
class BundleTrust:
    r"""Parameters of the bundle trust method.

    At the centre x with value J the method keeps planes (subgradient g_i, measure β_i ≥ 0) and solves

        min_{y, v}  v + ‖y‖²/(2t)   s.t.   g_i·y - β_i ≤ v,   x + y feasible,

    which predicts the decrease w = -v = σ + t‖z‖², where z = -y/t is the aggregate subgradient (normals of
    the constraints included) and σ its linearisation error. A trial with a decrease of at least ``descent``·w
    is a serious step and becomes the centre. Any other is a null step: the centre stays, the trial's plane is
    added and, where that plane improves the model little, t is reduced. For a convex J no feasible point
    within the distance r is lower than J(x) by more than σ + r‖z‖: the certificate.

    It stops, with a `Reason`,

    * CONVERGED where w ≤ ε (s + \|J\|) at the present t and that of a first step of length r, and
      σ + r‖z‖ ≤ 10 ε (s + \|J\|),
    * STATIONARY where σ + r‖z‖ ≤ ε (s + \|J\|),
    * ITERATION_LIMIT, EVALUATION_LIMIT where ``max_iterations`` or ``max_evaluations`` is reached,
    * NO_DESCENT, INVALID_DESIGNS where t or the radius is practically 0,
    * STEP_FAILED where the quadratic programme cannot be solved,

    with ε ``tolerance``, s ``value_scale`` and r ``reach``, or the length of the present step where that is
    longer. On the published convex test functions the error of J at the stop is below ε (s + \|J\|);
    for a nonconvex one the test implies only stationarity.

    With nonlinear constraints the merit function J + Σ ρ_k max(c_k, 0) takes the place of J; every inequality
    has planes of its own, and the penalties ρ_k grow until the step reduces violations. Equalities are
    linearised at the centre, and trial points corrected until they meet them. It stops as above only where no
    constraint is violated by more than ``feasibility``; INFEASIBLE where violations cannot be reduced.

    A function that can be evaluated inexactly (`Inexact`) is evaluated no more accurately than the predicted
    decrease requires. The centre is re-evaluated where that has fallen so far that its error matters, and
    once more before the method stops: at the end value and subgradient are as accurate as ε requires.

    A function may know points at which its result may not be a subgradient (`Kinked`). Where the method would
    stop on such a result, the centre is given the gradient at a nearby point, planes of other such points are
    dropped, and the method continues; from then on such points are given a nearby gradient at once.

    Attributes:
        tolerance: ε, relative stopping tolerance.
        max_iterations: Largest number of serious steps.
        max_evaluations: Largest number of evaluations, failed ones included.
        max_bundle: Largest number of planes, at least 3; aggregation keeps the method convergent with few.
        first_step: Length of the first step relative to the length scale of the problem: half the diagonal of
            the box, or the larger of 1 and ‖x0/scale‖ where a variable is unbounded.
        reach: Length of the step with which the stop is tested, and distance within which the certificate
            bounds J, relative to the same length; None for that of the first step.
        locality: Weight of the distance in β_i = max(\|α_i\|, c s_i²), c = locality·‖g‖/length: how fast old
            planes of a nonconvex J lose influence. 0 is right, and faster, for a convex J.
        descent: Fraction of the predicted decrease that makes a step serious, in (0, 1).
        inexactness: Errors of J requested from an inexact function, as a fraction of the predicted decrease,
            less than half of ``descent``.
        slope_share: Error of an inexact subgradient along a step, as a fraction of the predicted decrease
            (de Oliveira, Sagastizábal, Lemaréchal 2014: bounded errors along the step suffice).
        first_accuracy: Relative error that the first subgradient of an inexact function may have, when no
            decrease is predicted yet.
        radius: First trust radius in lengths of the problem: more than the diagonal of the box, so that it
            acts only after an invalid design.
        least_radius: Radius in these lengths below which the design practically cannot move.
        least_t: Least t in units of the first one, below which no descent can be expected.
        most_t: Largest t in the same units (the bracket of Schramm and Zowe 1992).
        value_scale: Absolute part of the stopping test, for an objective whose minimum is about 0; None for
            the size of J at the start, but at most 1.
        feasibility: Largest violation of a nonlinear constraint at the stop, relative to its size.
        raise_on_failure: Whether a stop for any other reason than CONVERGED or STATIONARY raises.

    References:
        H. Schramm and J. Zowe, A version of the bundle idea for minimizing a nonsmooth function: conceptual
        idea, convergence analysis, numerical results, SIAM J. Optim. 2 (1992) 121-152.
        W. de Oliveira, C. Sagastizábal, C. Lemaréchal, Convex proximal bundle methods in depth: a unified
        analysis for inexact oracles, Math. Program. 148 (2014) 241-277.
        K. C. Kiwiel, Proximity control in bundle methods for convex nondifferentiable
        minimization, Math. Program. 46 (1990) 105-122.
        R. H. Byrd, J. Nocedal, R. A. Waltz, Steering exact penalty methods for nonlinear programming, Optim.
        Methods Softw. 23 (2008) 197-213.
    """

    tolerance: float = 1e-4
    max_iterations: int = 100
    max_evaluations: int = 500
    max_bundle: int = 100
    first_step: float = 0.3
    reach: float | None = None
    locality: float = 0.1
    descent: float = 0.05
    inexactness: float = 0.02
    value_scale: float | None = None
    feasibility: float = 1e-6
    raise_on_failure: bool = True
    slope_share: float = 0.1
    first_accuracy: float = 0.01
    radius: float = 3.0
    least_radius: float = 1e-8
    least_t: float = 1e-10
    most_t: float = 1e4

    def __post_init__(self) -> None:
        """Reject parameters with which the method cannot work."""
        positive = ("tolerance", "first_step", "value_scale", "feasibility", "slope_share", "first_accuracy")
        for name in (*positive, "reach", "radius", "least_radius", "least_t", "most_t"):
            given = getattr(self, name)
            if given is not None and not 0.0 < given < np.inf:
                raise InvalidInputError(f"{name} must be positive and finite, got {getattr(self, name)}")
        for name, least in (("max_iterations", 0), ("max_evaluations", 1), ("max_bundle", 3)):
            if getattr(self, name) < least:
                raise InvalidInputError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if not 0.0 < self.descent < 1.0:
            raise InvalidInputError(f"descent must lie in (0, 1), got {self.descent}")
        if not 0.0 < self.inexactness < 0.5 * self.descent:
            raise InvalidInputError(
                f"inexactness must be in [0, {0.5 * self.descent}], got {self.inexactness}"
            )
        if not 0.0 <= self.locality < np.inf:
            raise InvalidInputError(f"locality must not be negative (0 for a convex J), got {self.locality}")

    def size_of(self, first: float) -> float:
        """Return s of the stopping test for an objective with a first value."""
        return self.value_scale or min(1.0, abs(first)) or 1.0

    def minimize(
        self, problem: CheckedProblem, callback: Callback | None = None, checkpoint: Checkpoint | None = None
    ) -> Result:
        """Run the method on a checked problem; `fenics_contact.minimize` is the usual entry point.

        Raises:
            NotConvergedError: If the stop is a failure and ``raise_on_failure`` is set.
            InvalidInputError: If the checkpoint cannot be used.
            CheckpointError: If the checkpoint cannot be written.
        """
        progress, run = Progress(self, problem, callback), _Run(self, problem)
        if checkpoint is not None:
            progress = StoredProgress(checkpoint, self, problem, callback)
        with progress.reporting() as task:
            state, reason = run.to_the_stop(progress)
            task.outcome = reason.name.lower().replace("_", " ")
        return run.conclude(state, reason)


@dataclass(frozen=True)
class _Run:
    """The method on a problem: `start`, then `step` until it has a reason to stop, then `conclude`."""

    method: BundleTrust
    problem: CheckedProblem

    def to_the_stop(self, progress: Progress) -> tuple[MethodState, Reason]:
        """Run from where an earlier run ended, or from the start, to the stop."""
        state = progress.recalled()
        if state is None:
            state = self.start()
            progress.evaluated(state)
        reason: Reason | None = None
        while reason is None:
            try:
                state, reason = self.step(state)
            except SubproblemError as error:
                safe_log(_LOG.warning, "%s", error)
                reason = Reason.STEP_FAILED
            if reason is None:
                progress.evaluated(state)
        progress.keep_last(state)
        return state, reason

    def start(self) -> MethodState:
        """Evaluate the starting point; its planes are the bundle."""
        method, problem = self.method, self.problem
        centre = first_centre(problem, method.first_accuracy, method.feasibility)
        planes = merit_planes(problem, centre)
        first, norm, locality = planes[0], planes[0].length, method.locality / problem.length
        t, radius = method.first_step * problem.length / (norm or 1.0), method.radius * problem.length
        bundle = Bundle.of_centre(first, method.locality * norm / problem.length)
        bundle = with_pieces(bundle, problem, centre, centre.value, np.zeros(problem.start.size))
        least_radius = method.least_radius * problem.length
        trust = Trust(t, radius, method.least_t * t, method.most_t * t, least_radius)
        error, violation = centre.error, problem.constraints_at(centre).violation
        values = centre.value, centre.value, 0.0, t, 0.0, norm, 0.0, 1, 1, error, violation
        history = (Record(0, StepKind.START, *values),)
        soft, none = first_soft(planes, locality), np.zeros(len(problem.nonlinear))
        return MethodState(centre, bundle, trust, t, history, False, soft, none)

    def step(self, state: MethodState) -> tuple[MethodState, Reason | None]:
        """Re-evaluate the centre, or try a step from it; or return why the method must stop."""
        step, state = self._guarded_step(state)
        reach = self.method.reach or self.method.first_step
        test = stopping_test(
            state.centre.value,
            tolerance=self.method.tolerance,
            value_scale=self.method.size_of(state.history[0].value),
            reach=reach * self.problem.length,
            first_t=state.first_t * reach / self.method.first_step,
        )
        reason = self.terminate(state, step, test)
        wanted = self._wanted(state, step, test, claim=reason is not None and reason.success)
        if wanted is not None and state.evaluations < self.method.max_evaluations:
            return self._refined(state, step, wanted), None
        if reason in _OF_THE_MODEL and state.doubtful:
            return self._reconsidered(state, step)
        if reason is not None:
            return state, reason
        if step.decrease <= max(test.limit, test.rounding) and self._violated(state):
            step = correcting_step(state.bundle, surroundings(self.problem, state.centre), state.soft, step)
            if step.decrease <= test.rounding:
                return state, Reason.INFEASIBLE
        return self._advanced(state, step, self._demand(state, step, test)), None

    def _evaluated(self, state: MethodState, x: Array, accuracy: Accuracy, known: Known) -> Evaluation:
        """Call the functions, and once more near x where needed."""
        number = state.evaluations + 1
        penalties = {k: one.penalty for k, one in zip(self.problem.inequalities, state.soft, strict=True)}
        evaluation = self.problem.evaluate(x, number, accuracy, penalties, known)
        return verified(self.problem, evaluation, number) if state.careful else evaluation

    def _guarded_step(self, state: MethodState) -> tuple[Step, MethodState]:
        """Solve the step's programme, with t small enough to stay in the trust region."""
        near, trust = surroundings(self.problem, state.centre), state.trust
        step, soft = penalised_step(state.bundle, near, trust.t, state.soft, self.method.feasibility)
        while step.length > 1.001 * trust.radius and not trust.exhausted:
            # A kink can keep the length constant while t falls, so t must be able to fall fast.
            t = trust.t * max(0.05, min(0.5, 0.95 * trust.radius / step.length))
            trust = replace(trust, t=max(t, trust.t_least))
            step = replace(solve_step(state.bundle, near, trust.t, soft), stuck=step.stuck)
        state = replace(state, trust=trust, soft=soft)
        return step, replace(state, multipliers=multipliers(self.problem, state, step))

    def _demand(
        self, state: MethodState, step: Step, test: StoppingTest, reach: float = 0.0
    ) -> OracleAccuracy:
        """Return the accuracy that a trial of the step needs, or a claim about points within ``reach``."""
        norm = float(np.linalg.norm(state.bundle.gradients[0]))
        norm += sum(one.penalty * float(np.linalg.norm(one.bundle.gradients[0])) for one in state.soft)
        worth = max(step.decrease, test.limit if reach else test.rounding)
        shares = self.method.inexactness, self.method.slope_share
        return demand(worth, max(step.length, reach), norm, shares)

    def _wanted(
        self,
        state: MethodState,
        step: Step,
        test: StoppingTest,
        *,
        claim: bool,
    ) -> Accuracy | None:
        """Return the accuracy with which the centre must be re-evaluated, None where it is sufficient."""
        if not can_be_inexact(self.problem.fun):
            return None
        needed = self._demand(state, step, test, test.reach if claim else 0.0)
        if needed.missed_by(state.centre) or (claim and not needed.confirmed_by(state.centre)):
            return needed.sharper_than(state.centre)
        return None

    def _refined(self, state: MethodState, step: Step, accuracy: Accuracy) -> MethodState:
        """Re-evaluate the centre, more accurately."""
        centre, equal = state.centre, self.problem.equalities
        met = {k: replace(centre, value=centre.constraints[k], subgradient=centre.slopes[k]) for k in equal}
        evaluation = again(centre, self._evaluated(state, centre.x, accuracy, met))
        (first, *others), change = merit_planes(self.problem, evaluation), evaluation.value - centre.value
        return replace(
            state,
            centre=evaluation,
            bundle=state.bundle.refined(first, change),
            soft=tuple(one.refined(plane) for one, plane in zip(state.soft, others, strict=True)),
            history=self._recorded(state, step, StepKind.REFINED, evaluation),
        )

    def _reconsidered(self, state: MethodState, step: Step) -> tuple[MethodState, Reason | None]:
        """Drop the doubtful subgradients on which the method would stop, and test again."""
        if not state.centre.doubtful:
            return self.step(with_verified_centre(self.problem, state))
        if state.evaluations >= self.method.max_evaluations:
            return state, Reason.EVALUATION_LIMIT
        sure = with_verified_centre(self.problem, state)
        history = self._recorded(state, step, StepKind.REFINED, sure.centre, _GRADIENT_NEAR)
        return replace(sure, history=history), None

    def terminate(self, state: MethodState, step: Step, test: StoppingTest) -> Reason | None:
        """Return why the method must stop before trying the step, or None."""
        near = surroundings(self.problem, state.centre)
        solved = test.reason(step, lambda t: solve_step(state.bundle, near, t, state.soft))
        if self._violated(state):
            solved = None
            if state.trust.exhausted or step.stuck:
                return Reason.INFEASIBLE
        if solved is not None:
            return solved
        if state.trust.cornered:
            return Reason.INVALID_DESIGNS
        if state.trust.exhausted:
            return Reason.NO_DESCENT
        if state.iterations >= self.method.max_iterations:
            return Reason.ITERATION_LIMIT
        return Reason.EVALUATION_LIMIT if state.evaluations >= self.method.max_evaluations else None

    def _violated(self, state: MethodState) -> bool:
        return self.problem.constraints_at(state.centre).violation > self.method.feasibility

    def _advanced(self, state: MethodState, step: Step, needed: OracleAccuracy) -> MethodState:
        """Try the step and return the state after its null, serious or rejected trial."""
        # The subproblem meets constraints only to its tolerance: the projected step is tried and recorded.
        x = self.problem.allowed.project(state.centre.x + self.problem.scale * step.move)
        step = replace(step, move=(x - state.centre.x) / self.problem.scale)
        try:
            x, known = restored(self.problem, x, state.evaluations + 1, self.method.feasibility)
            evaluation = self._evaluated(state, x, needed.asked, known)
        except InvalidDesignError as error:
            safe_log(_LOG.info, "trial design %d is invalid: %s", state.evaluations + 1, error)
            trust = state.trust.after_rejection(step.length)
            return replace(
                state, trust=trust, history=self._recorded(state, step, StepKind.REJECTED, None, str(error))
            )
        return self._judged(state, step, evaluation)

    def _judged(self, state: MethodState, step: Step, evaluation: Evaluation) -> MethodState:
        """Return the state after a trial that exists: a serious or a null step."""
        first, *others = merit_planes(self.problem, evaluation)
        change, slope = evaluation.value - state.centre.value, float(first.gradient @ step.move)
        error, room = slope - change, self.method.max_bundle - 1
        # Reduced before the cuts are added: the weights belong to the old planes, and the new ones must stay.
        bundle = state.bundle.reduced(step.weights, max(2, room - evaluation.pieces.size))
        bundle = with_pieces(bundle, self.problem, evaluation, state.centre.value, step.move)
        bundle = bundle.with_cut(first, error, step.length)
        cuts = [
            one.reduced(weights, room).with_cut(plane, step.move)
            for one, weights, plane in zip(state.soft, step.soft_weights, others, strict=True)
        ]
        soft, rises = tuple(one for one, _ in cuts), [rise for _, rise in cuts]
        measure = float(bundle.measures[-1]) + sum(rise.slope - rise.predicted for rise in rises)
        merit = change + sum(rise.change for rise in rises)
        trial = Trial(step, merit, slope + sum(rise.slope for rise in rises), measure)
        if merit > -self.method.descent * step.decrease:
            history = self._recorded(state, step, StepKind.NULL, evaluation)
            trust = state.trust.after_null(trial)
            return replace(state, bundle=bundle, soft=soft, trust=trust, history=history)
        locality, nearness = (
            self.method.locality / self.problem.length,
            self.method.locality * first.length / self.problem.length,
        )
        return replace(
            state,
            centre=evaluation,
            bundle=bundle.moved(step.move, change, nearness, 1 + evaluation.pieces.size),
            soft=tuple(
                one.moved(plane, step.move, locality) for one, plane in zip(soft, others, strict=True)
            ),
            trust=state.trust.after_serious(trial),
            history=self._recorded(state, step, StepKind.SERIOUS, evaluation),
        )

    def _recorded(
        self,
        state: MethodState,
        step: Step,
        kind: StepKind,
        evaluation: Evaluation | None,
        note: str = "",
    ) -> tuple[Record, ...]:
        """Return the history with one more evaluation, None for a trial point that does not exist."""
        value, error, violation = np.nan, 0.0, np.nan
        if evaluation is not None:
            value, error = evaluation.value, evaluation.error
            violation = self.problem.constraints_at(evaluation).violation
        record = Record(
            iteration=state.iterations + (kind is StepKind.SERIOUS),
            kind=kind,
            value=value,
            best=value if kind in (StepKind.SERIOUS, StepKind.REFINED) else state.centre.value,
            predicted_decrease=step.decrease,
            t=step.t,
            step_length=step.length,
            aggregate_norm=step.aggregate_norm,
            aggregate_error=step.aggregate_error,
            bundle_size=state.bundle.size,
            evaluations=state.evaluations + 1,
            error=error,
            violation=violation,
            note=note,
        )
        return (*state.history, record)

    def conclude(self, state: MethodState, reason: Reason) -> Result:
        """Return the result at the centre."""
        centre = state.centre
        result = Result(
            x=centre.x,
            value=centre.value,
            subgradient=centre.subgradient,
            reason=reason,
            iterations=state.iterations,
            evaluations=state.evaluations,
            history=state.history,
            error=centre.error,
            constraints=self._constraints(state),
        )
        if isinstance(self.problem.fun, Remarked):
            for words in dict.fromkeys(self.problem.fun.remarks(centre.x.copy())):
                safe_log(_LOG.warning, "at the end of the minimisation: %s", words)
        if reason.success or not self.method.raise_on_failure:
            return result
        refusals = [record.note for record in state.history if record.kind is StepKind.REJECTED]
        last = f"; the last trial: {refusals[-1]}" if reason is Reason.INVALID_DESIGNS else ""
        broken = [str(one) for one in result.constraints if one.violation > 0.0]
        violated = f"; violated: {'; '.join(broken)}" if reason is Reason.INFEASIBLE else ""
        raise NotConvergedError(
            f"{reason.value} (after {result.iterations} serious steps and {result.evaluations} evaluations, "
            f"best value {result.value:.9g}{last}{violated})",
            result.history,
            result,
        )

    def _constraints(self, state: MethodState) -> tuple[ConstraintValue, ...]:
        violations = self.problem.constraints_at(state.centre).violations
        values, multipliers = state.centre.constraints, state.multipliers
        return tuple(
            ConstraintValue(
                one.name, float(values[k]), one.lower, one.upper, float(violations[k]), float(multipliers[k])
            )
            for k, one in enumerate(self.problem.nonlinear)
        )


@naming_arguments
def minimize(
    fun: Fun,
    x0: ArrayLike,
    method: BundleTrust | None = None,
    *,
    bounds: Box | None = None,
    constraints: Constraints | None = None,
    scale: ArrayLike | None = None,
    restore: bool = False,
    callback: Callback | None = None,
    checkpoint: Checkpoint | None = None,
) -> Result:
    """Minimise a locally Lipschitz function, convex or not, over a box, linear and nonlinear constraints.

    The iterates depend only on the arguments: replicated on the ranks of a communicator, with a ``fun`` that
    returns bitwise equal values on all of them, they are bitwise equal, too.

    Args:
        fun: Takes x of shape (n,), returns J(x) and one (Clarke) subgradient of shape (n,). It is only called
            at points within the box, and within the other constraints to rounding. Where J does not exist it
            raises `InvalidDesignError`, and a shorter step is tried.
        x0: Feasible starting point, shape (n,).
        method: Parameters; None for the default ones.
        bounds: Pair (lower, upper), numbers or shape (n,), or SciPy's Bounds; None for no box.
        constraints: `LinearConstraints`, `NonlinearConstraint`, SciPy's of either kind, or a list of them.
            All are met at the stop, linear ones and, after corrections, equalities at every point tried.
        scale: Size of each variable, shape (n,) or a number. None takes the widths of the box where it is
            bounded on all sides, of the narrowest for fixed variables, so choose meaningful bounds; else 1.
        restore: Whether x0 may violate nonlinear constraints; the method then restores them.
        callback: Called after every evaluation with its record and the best point so far, and before the
            checkpoint is written: a run that died in between reports the record again when it continues.
        checkpoint: File that is written after evaluations and from which an interrupted run continues with
            the same iterates; None writes nothing. Limits and tolerance may be changed between.

    Returns:
        The best point, its value and subgradient, the reason for the stop and the history.

    Raises:
        InvalidInputError: If a shape does not fit, x0 is infeasible, a function returns nan or inf, or the
            checkpoint is unreadable or belongs to another problem.
        CheckpointError: If the checkpoint cannot be written; the previous one is unchanged.
        InvalidDesignError: If J does not exist at x0.
        NotConvergedError: If the method stops before its tolerance is met, with the history and the best
            result so far; not if ``method.raise_on_failure`` is False.

    Example:
        >>> import numpy as np
        >>> def largest_component(x):
        ...     k = int(np.argmax(np.abs(x)))
        ...     return abs(x[k]), np.sign(x[k]) * np.eye(x.size)[k]
        >>> result = minimize(largest_component, [3.0, -1.0], bounds=([1.0, -4.0], [5.0, 4.0]))
        >>> round(result.value, 3), result.reason.name
        (1.0, 'STATIONARY')
    """
    problem = pose(fun, x0, bounds, constraints, scale, restore=restore)
    return (method or BundleTrust()).minimize(problem, callback, checkpoint)
