"""The step: minimise the cutting-plane model within the constraints and a trust region."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fenics_contact._optimize.bundle import (
    Bundle,
    QuadraticProgram,
    QuadraticSolution,
    SubproblemError,
    solve,
)
from fenics_contact._optimize.constraints import LocalFeasibleSet
from fenics_contact._optimize.nonlinear import SoftConstraint
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import safe_log

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """Solution of the step's programme, in scaled variables.

    `decrease`: predicted decrease w = -max_i (g_i·y - β_i) of J, not negative; with nonlinear constraints
    that of J + Σ ρ_k max(c_k, 0); `aggregate_norm`: ‖z‖ = ‖y‖/t, length of the aggregate subgradient (with
    the constraints' normals); `aggregate_error`: σ = Σ λ_i β_i + Σ μ_k room_k, and Σ_ki θ_ki ρ_k (β_ki - c_k)
    + Σ_k ρ_k max(c_k, 0); w = σ + t ‖z‖²; `soft_weights`: multipliers θ_ki of the planes of each nonlinear
    inequality in units of its penalty; `violations`: predicted max(c_k, 0) after the move; `stuck`: whether
    no penalty makes a step reduce the violations.
    """

    move: Array
    decrease: float
    weights: Array
    aggregate_norm: float
    aggregate_error: float
    t: float
    soft_weights: tuple[Array, ...] = ()
    violations: tuple[float, ...] = ()
    equality_multipliers: Array = field(default_factory=lambda: np.zeros(0))
    stuck: bool = False

    @property
    def length(self) -> float:
        """Length of the move in scaled variables."""
        return float(np.linalg.norm(self.move))


@dataclass(frozen=True)
class Model:
    """What the programme of a step knows of the problem at the centre."""

    bundle: Bundle
    near: LocalFeasibleSet
    soft: Sequence[SoftConstraint] = ()

    def chosen(self, rows: NDArray[np.intp], soft_rows: Sequence[NDArray[np.intp]]) -> Model:
        """Return the model of some planes only."""
        soft = [
            replace(one, bundle=one.bundle.chosen(own)) for one, own in zip(self.soft, soft_rows, strict=True)
        ]
        return replace(self, bundle=self.bundle.chosen(rows), soft=soft)


def solve_step(
    bundle: Bundle,
    near: LocalFeasibleSet,
    t: float,
    soft: Sequence[SoftConstraint] = (),
    *,
    sharpenings: int = 2,
    blurred: float = 1e-2,
    vanished: float = 1e-7,
) -> Step:
    """Minimise v + Σ ρ_k s_k + ‖y‖²/(2t) subject to g_i·y - β_i ≤ v, C y ≤ room and E y = 0.

    Each nonlinear inequality adds c_k + a_ki·y - β_ki ≤ s_k for its planes, and s_k ≥ 0.

    The programme is solved in units of its own solution, lengths in t γ and decreases in t γ², so that
    objective and variables may have any size. γ is the length of a subgradient at first. Near a minimum the
    aggregate z is much shorter than that and is lost in the solver's tolerance: then the programme is solved
    again with γ = ‖z‖, without the planes that lie too deep to affect the solution, and the sharper result is
    used if the solver reports success. `blurred`: ‖z‖ in units of the programme below which a further solve
    sharpens it; `vanished`: ‖z‖ relative to the longest subgradient below which it is rounding and cannot be
    sharpened.

    References:
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152, section 2.
    """
    model = Model(bundle, near, soft)
    lengths = np.sqrt((bundle.gradients**2).sum(axis=1))
    step, unit = _solved(model, t, lengths)
    for _ in range(sharpenings):
        if not vanished * lengths.max() < step.aggregate_norm < blurred * unit:
            break
        unit = step.aggregate_norm
        sharper = _refined(model, step, lengths)
        if sharper is None:
            break
        step = sharper
    return step


def _solved(model: Model, t: float, lengths: Array) -> tuple[Step, float]:
    """Solve in the units of the shortest subgradient or, where that fails, of a longer one."""
    steepest = [np.linalg.norm(one.gradients, axis=1).max() for one in model.soft]
    candidates = (lengths.min(), lengths[0], lengths.max(), *steepest)
    units = [float(unit) for unit in candidates if unit > 0.0] or [1.0]
    for unit in units[:-1]:
        try:
            return _step(model, _solution(model, t, unit), t, unit), unit
        except SubproblemError as error:
            safe_log(_LOG.debug, "step's programme not solved in units of %g: %s", unit, error)
    return _step(model, _solution(model, t, units[-1]), t, units[-1]), units[-1]


def _solution(model: Model, t: float, unit: float) -> QuadraticSolution:
    try:
        return solve(_program(model, t, unit))
    except InvalidInputError as error:
        # The centre itself satisfies the programme: the solver is mistaken.
        raise SubproblemError(f"the quadratic programme of a step cannot be solved: {error}") from error


def _refined(model: Model, step: Step, lengths: Array) -> Step | None:
    # Plane i is active at a move y only if β_i ≤ g_i·y - g_0·y; the factor two is a margin.
    bundle = model.bundle
    live = np.flatnonzero(bundle.measures <= 2.0 * (lengths + lengths[0]) * step.length)
    reached = [np.flatnonzero(_reaching(one, step.length)) for one in model.soft]
    unit = step.aggregate_norm
    smaller = model.chosen(live, reached)
    try:
        solution = _solution(smaller, step.t, unit)
    except SubproblemError:
        return None
    if not solution.exact:
        return None
    sizes = [bundle.size, *(one.bundle.size for one in model.soft)]
    multipliers, to, of = np.zeros(sum(sizes) + model.near.room.size + len(model.soft)), 0, 0
    for size, rows in zip(sizes, [live, *reached], strict=True):
        multipliers[to + rows] = solution.multipliers[of : of + rows.size]
        to, of = to + size, of + rows.size
    multipliers[to:] = solution.multipliers[of:]
    return _step(model, replace(solution, multipliers=multipliers), step.t, unit)


def _reaching(one: SoftConstraint, length: float) -> NDArray[np.bool_]:
    """Mark the planes that a move of this length can take to the limit, and that of the centre."""
    marks = one.depths <= 2.0 * np.linalg.norm(one.gradients, axis=1) * length
    marks[0] = True
    return np.asarray(marks)


def _program(model: Model, t: float, unit: float) -> QuadraticProgram:
    """Return the programme in the variables y/(t γ), v/(t γ²) and ρ s/(t γ²)."""
    bundle, near, soft = model.bundle, model.near, model.soft
    n, k, slacks = bundle.gradients.shape[1], near.room.size, len(soft)
    epigraph = np.eye(1 + slacks)
    gradients = [bundle.gradients, *(one.gradients for one in soft)]
    cuts = np.vstack(
        [np.hstack([rows / unit, np.tile(-epigraph[i], (len(rows), 1))]) for i, rows in enumerate(gradients)]
    )
    walls = np.hstack([near.rows, np.zeros((k, 1 + slacks))])
    positive = np.hstack([np.zeros((slacks, n)), -epigraph[1:]])
    equalities = np.hstack([near.equality_rows, np.zeros((near.miss.size, 1 + slacks))])
    depths = np.concatenate([bundle.measures, *(one.depths for one in soft)])
    limits = [depths / (t * unit**2), np.maximum(near.room, 0.0) / (t * unit), np.zeros(slacks)]
    return QuadraticProgram(
        curvature=np.append(np.ones(n), np.zeros(1 + slacks)),
        slope=np.append(np.zeros(n), np.ones(1 + slacks)),
        equality_rows=equalities,
        equality_values=np.zeros(near.miss.size),
        rows=np.vstack([cuts, walls, positive]),
        limits=np.concatenate(limits),
    )


def _step(model: Model, solution: QuadraticSolution, t: float, unit: float) -> Step:
    bundle, near, soft = model.bundle, model.near, model.soft
    move = t * unit * solution.point[: bundle.gradients.shape[1]]
    ends = np.cumsum([bundle.size, *(one.bundle.size for one in soft)])
    weights = solution.multipliers[: bundle.size]
    weights = weights / weights.sum()
    shares = tuple(np.split(solution.multipliers, ends)[1:-1])
    pushes = unit * solution.multipliers[ends[-1] : ends[-1] + near.room.size]
    violations = tuple(one.predicted(move) for one in soft)
    gained = sum(one.penalty * (one.violation - rest) for one, rest in zip(soft, violations, strict=True))
    penalties = sum(
        share @ one.depths + one.penalty * one.violation for share, one in zip(shares, soft, strict=True)
    )
    error = float(weights @ bundle.measures + pushes @ np.maximum(near.room, 0.0))
    return Step(
        move=move,
        decrease=max(-bundle.model(move) + gained, 0.0),
        weights=weights,
        aggregate_norm=float(np.linalg.norm(move)) / t,
        aggregate_error=error + float(penalties),
        t=t,
        soft_weights=shares,
        violations=violations,
        equality_multipliers=unit * solution.equality_multipliers,
    )


@dataclass(frozen=True)
class Trial:
    """A trial step and the response of the objective.

    `slope`: g·y with the subgradient at the trial point; `measure`: locality measure β of the trial's plane,
    seen from the centre; `growth`: largest factor on t after one serious step.
    """

    growth: ClassVar[float] = 10.0
    step: Step
    change: float
    slope: float
    measure: float

    @property
    def error(self) -> float:
        """Linearisation error α of the trial's plane, seen from the centre."""
        return self.slope - self.change

    @property
    def agreement(self) -> float:
        """Fraction of the predicted decrease that was achieved."""
        return -self.change / self.step.decrease

    @property
    def parabola(self) -> float:
        """Factor on t that leads to the minimiser of the parabola through both values and the prediction."""
        return 0.5 / max(1.0 - self.agreement, 0.5 / self.growth)


@dataclass(frozen=True)
class Trust:
    """Proximal parameter and trust region with the counts that adapt them.

    A large t makes a long step. t follows the parabola that the predicted and the actual change define
    [Kiwiel 1990], within the bracket of Schramm and Zowe: it grows after a step that descends as predicted,
    and shrinks after one whose cutting plane says little about the centre. Unlike in their method, a trial
    that descends is never discarded for a longer one: evaluations dominate the cost, so the step is taken and
    the next one is longer.

    The radius only guards against steps into regions where the objective does not exist. `t_least`: below it
    no descent can be expected; `radius_least`: below it the design practically cannot move; `streak`:
    consecutive serious steps after which t at least doubles; `shrinkage`: smallest and largest factor on t
    after a bad null step; `patience`: null steps that may be far off before t shrinks; `far`: A null step is
    far off if its error exceeds this many predicted decreases; `cut`: fraction of the predicted decrease that
    a new plane must remove, else the step was too long.

    References:
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152, inner iteration of section 3.
        K. C. Kiwiel, Math. Program. 46 (1990) 105-122, procedure 2.2.
    """

    streak: ClassVar[int] = 2
    shrinkage: ClassVar[tuple[float, float]] = (0.1, 0.5)
    patience: ClassVar[int] = 1
    far: ClassVar[float] = 3.0
    cut: ClassVar[float] = 0.5
    t: float
    radius: float
    t_least: float
    t_most: float
    radius_least: float
    serious: int = 0
    nulls: int = 0

    @property
    def exhausted(self) -> bool:
        """Whether t is as small as it may be."""
        return self.t <= self.t_least

    @property
    def cornered(self) -> bool:
        """Whether the radius is as small as it may be."""
        return self.radius <= self.radius_least

    def after_serious(self, trial: Trial) -> Trust:
        """Return the trust after a serious step: t grows where the prediction was good or steps repeat."""
        length, serious = trial.step.length, self.serious + 1
        t = max(1.0, trial.parabola) * self.t
        if serious > self.streak:
            t = max(t, 2.0 * self.t)
        radius = 2.0 * self.radius if length > 0.5 * self.radius else self.radius
        return replace(self, t=min(t, self.t_most), radius=radius, serious=serious, nulls=0)

    def after_null(self, trial: Trial) -> Trust:
        """Return the trust after a null step: t shrinks where the new plane does not improve the model.

        It improves the model if at the trial point it removes enough of the predicted decrease despite its
        locality measure. If it does, but lies far below the centre's value, t shrinks only after a second
        such step.
        """
        nulls, predicted = self.nulls + 1, trial.step.decrease
        improves = trial.slope - trial.measure >= -self.cut * predicted
        far = trial.error > max(self.far * predicted, trial.step.aggregate_error)
        t = self.t
        if not improves or (far and nulls > self.patience):
            t *= min(max(trial.parabola, self.shrinkage[0]), self.shrinkage[1])
        return replace(self, t=max(t, self.t_least), serious=0, nulls=nulls)

    def after_rejection(self, length: float) -> Trust:
        """Return the trust after a step of this length led to an invalid design: half of it at most."""
        return replace(self, radius=0.5 * length, serious=0)
