"""Control of the step length: the proximal parameter t and the radius of the trust region."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fenics_contact.optimize.subproblem import Step

_GROWTH = 10.0  # largest factor on t after one serious step
_STREAK = 2  # consecutive serious steps after which t at least doubles
_SHRINKAGE = (0.1, 0.5)  # smallest and largest factor on t after a bad null step
_PATIENCE = 1  # null steps that may be far off before t shrinks
_FAR = 3.0  # a null step is far off when its error exceeds this many predicted decreases
_CUT = 0.5  # fraction of the predicted decrease that a new plane must remove, else the step was too long


@dataclass(frozen=True)
class Trial:
    """A trial step and the response of the objective.

    Attributes:
        step: The step with its prediction.
        change: J at the trial point minus J at the centre.
        slope: g·y with the subgradient at the trial point.
        measure: Locality measure β of the trial's plane, seen from the centre.
    """

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
        return 0.5 / max(1.0 - self.agreement, 0.5 / _GROWTH)


@dataclass(frozen=True)
class Trust:
    """Proximal parameter and trust region with the counts that adapt them.

    A large t makes a long step. t follows the parabola that the predicted and the actual change define
    [Kiwiel 1990], within the bracket of Schramm and Zowe: it grows after a step that descends as
    predicted, and shrinks after one whose cutting plane says little about the centre. Unlike in their method,
    a trial that descends is never discarded for a longer one: evaluations dominate the cost, so the step is
    taken and the next one is longer.

    The radius only guards against steps into regions where the objective does not exist.

    Attributes:
        t: Proximal parameter.
        radius: Longest step in scaled variables.
        t_least: Below it no descent can be expected.
        t_most: t never exceeds it.
        radius_least: Below it the design practically cannot move.
        serious: Consecutive serious steps.
        nulls: Consecutive null steps.

    References:
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152, inner iteration of section 3.
        K. C. Kiwiel, Math. Program. 46 (1990) 105-122, procedure 2.2.
    """

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
        if serious > _STREAK:
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
        improves = trial.slope - trial.measure >= -_CUT * predicted
        far = trial.error > max(_FAR * predicted, trial.step.aggregate_error)
        t = self.t
        if not improves or (far and nulls > _PATIENCE):
            t *= min(max(trial.parabola, _SHRINKAGE[0]), _SHRINKAGE[1])
        return replace(self, t=max(t, self.t_least), serious=0, nulls=nulls)

    def after_rejection(self, length: float) -> Trust:
        """Return the trust after a step of this length led to an invalid design: half of it at most."""
        return replace(self, radius=0.5 * length, serious=0)
