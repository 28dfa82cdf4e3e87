"""One design under several loads: load cases, of which the largest or a sum counts, and load paths."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.fingerprint import described
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.design.adjoint import LaterSteps, WeakPoints
from fenics_contact.design.base import DesignProblem, comm_of, with_fewest_weak_points
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.memory import DesignPoint, JointPoint, record_of_values
from fenics_contact.design.objective import Objective, Partials, finite_value, guarded_user_call
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.results.deformed_state import AnyState


class PathObjective(ABC):
    """J of all load steps of a path together, such as one of the range of stresses in a cycle.

    `steps`: names of those on which it depends.
    """

    steps: Sequence[str]

    @abstractmethod
    def at(self, states: Mapping[str, AnyState], forms: ShapeForms) -> Mapping[str, Objective]:
        """Return objectives of steps whose values, and derivatives at these states, add up to J's.

        Collective.
        """


class _OfSteps(dict[str, Objective], PathObjective):
    """J = Σ J_n, by the names of steps."""

    def __init__(self, by_step: Mapping[str, Objective]) -> None:
        super().__init__(by_step)
        self.steps = list(by_step)

    def at(self, states: Mapping[str, AnyState], forms: ShapeForms) -> Mapping[str, Objective]:
        return self


class JointProblem(DesignProblem[JointPoint]):
    """A design problem with several states a design."""

    problems: dict[str, ShapeProblem]
    objectives: Mapping[str, Objective] | PathObjective

    @property
    def scene(self) -> Scene:
        """The scene of the last case or step, in its reference shape."""
        return self._parts[-1].scene

    @property
    def _parts(self) -> Sequence[ShapeProblem]:
        return list(self.problems.values())

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        """Return the coordinates of the designed bodies, see `DesignGeometry.points_of`. Collective."""
        return self._parts[0].points_of(alpha)

    def scene_of(self, alpha: np.ndarray) -> Scene:
        """Return `scene` in the shape of a design; raises as `evaluate` does. Collective."""
        return self._parts[-1].scene_of(alpha)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        known = {name: problem.fingerprint() for name, problem in self.problems.items()}
        return {f"{name}.{key}": text for name, each in known.items() for key, text in each.items()}


class _LargestCase:
    """The largest of several objectives, by the name of their cases."""

    in_words = "largest"
    #: Sum of the factors on objectives.
    size = 1.0

    def check(self, cases: Mapping[str, object]) -> None:
        """Reject what does not fit the cases."""

    def active(self, values: Mapping[str, float]) -> list[str]:
        """Return the load cases that contribute to the subgradient."""
        return [max(values, key=values.__getitem__)]

    def value(self, values: Mapping[str, float]) -> float:
        """Return the objective of all."""
        return max(values.values())

    def gradient(self, values: Mapping[str, float], gradients: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return a subgradient, from the gradients of those that contribute at least."""
        return gradients[self.active(values)[0]]

    def error(self, errors: Mapping[str, float]) -> float:
        """Return the estimated error of the objective."""
        return max(errors.values())

    def others(self, known: Callable[[], JointPoint | None]) -> list[DesignPoint]:
        """Return the cases beside the largest of the design evaluated last. Collective."""
        point = known()
        return sorted(point.parts.values(), key=lambda each: -each.value)[1:] if point else []


class _SumOfCases:
    """The sum of weighted objectives."""

    def __init__(self, weights: dict[str, float]) -> None:
        self._weights, self.in_words = weights, f"weighted sum, {weights}"

    def check(self, cases: Mapping[str, object]) -> None:
        if set(self._weights) != set(cases):
            raise InvalidInputError(
                f"LoadCases.weights must name the cases {sorted(cases)}, got {sorted(self._weights)}: give "
                "each a weight, or none for the largest"
            )
        if not np.isfinite(list(self._weights.values())).all():
            raise InvalidInputError(
                f"LoadCases.weights must be finite numbers, got {self._weights}: give numbers such as 0.5"
            )

    @property
    def size(self) -> float:
        return sum(map(abs, self._weights.values())) or 1.0

    def active(self, values: Mapping[str, float]) -> list[str]:
        return list(values)

    def value(self, values: Mapping[str, float]) -> float:
        return sum(self._weights[name] * values[name] for name in values)

    def gradient(self, values: Mapping[str, float], gradients: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.asarray(sum(self._weights[name] * gradients[name] for name in gradients))

    def error(self, errors: Mapping[str, float]) -> float:
        return sum(abs(self._weights[name]) * errors[name] for name in errors)

    def others(self, known: Callable[[], JointPoint | None]) -> list[DesignPoint]:
        return []


@displayed
class LoadCases(JointProblem):
    """J(α) = max J_k(α) over load cases of one design, or Σ w_k J_k(α), with a subgradient.

    Each case is a `ShapeProblem`; the others are made of the first by `ShapeProblem.case`. One design costs a
    state and an adjoint for each case, but only one mesh motion, and one assembly and factorisation of what
    moved. The subgradient of a maximum is that of the largest case; `minimize` uses the gradients of the
    others as well. Samples of an uncertain friction coefficient are load cases, too.

    Attributes:
        problems: Name of the case -> its problem.
        weights: Name of the case -> w_k; None for the largest.

    Example:
        >>> designs = SurfaceDesign("link1", links.first.crown, net=(7, 4))  # doctest: +SKIP
        >>> problem = ShapeProblem(ContactProblem(scene, comm), designs, TotalPotential())  # doctest: +SKIP
        >>> pulled = [TotalForce("link2", "grip", (60e3, 2e3, 0.0))]  # doctest: +SKIP
        >>> askew = problem.case(LoadStep("askew", loads=pulled).applied_to(scene))  # doctest: +SKIP
        >>> both = LoadCases({"straight": problem, "askew": askew})  # doctest: +SKIP
        >>> result = minimize(both, np.zeros(both.size), bounds=(-1.0, 1.0))  # doctest: +SKIP
    """

    def __init__(
        self, problems: Mapping[str, ShapeProblem], weights: Mapping[str, float] | None = None
    ) -> None:
        """Check the cases.

        Args:
            problems: Name of the case -> its problem.
            weights: Name of the case -> its weight in the sum; None for the largest of all cases.

        Raises:
            InvalidInputError: If there is no case, a weight is missing or no finite number, or the problems
                do not share their designs.
        """
        self.problems, self.weights = dict(problems), weights
        self._total: _LargestCase | _SumOfCases = _LargestCase()
        if weights is not None:
            self._total = _SumOfCases(dict(weights))
        if not self.problems:
            raise InvalidInputError("LoadCases needs a problem, got none: give {'name': problem}")
        self._memory = record_of_values(self._at)
        self.objectives = {name: problem.objective for name, problem in self.problems.items()}
        first = self._parts[0]
        with together(first.comm):
            for name, problem in self.problems.items():
                if not isinstance(problem, ShapeProblem) or not problem.shares_with(first):
                    raise InvalidInputError(
                        f"load cases must share designs and meshes, not so {name!r}: use problem.case(scene)"
                    )
            self._total.check(self.problems)

    def _facts(self) -> dict[str, Any]:
        return {"cases": list(self.problems), "objective": self._total.in_words, "first": self._parts[0]}

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `ShapeProblem.within`."""
        return all(problem.inexact for problem in self.problems.values())

    def pieces(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J_k and gradients of the cases beside the largest, for the optimiser. Collective.

        Args:
            alpha: The design evaluated last, shape (size,), [length].

        Returns:
            Values, shape (k,), and gradients, shape (k, size); none of a weighted sum.
        """
        points = self._total.others(lambda: self.known(alpha))
        gradients = np.array([each.gradient for each in points]).reshape(len(points), self.size)
        return np.array([each.value for each in points]), gradients

    def evaluate(self, alpha: np.ndarray) -> JointPoint:
        """Evaluate all cases. Collective; raises as `ShapeProblem.evaluate` does."""
        point = self._joined({name: problem.evaluate(alpha) for name, problem in self.problems.items()})
        self._memory.record(point)
        return point

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return J(α), a subgradient and the estimated error of J, see `ShapeProblem.within`. Collective."""
        for problem in self.problems.values():
            problem.within(alpha, value / self._total.size, subgradient)
        point = self._at(alpha)
        self._memory.record(point)
        return point.value, point.gradient, point.error

    def values_of(self, alpha: np.ndarray) -> dict[str, float]:
        """Return J_k(α) of every case. Collective."""
        return {name: problem.value_of(alpha) for name, problem in self.problems.items()}

    def states_of(self, alpha: np.ndarray) -> dict[str, AnyState]:
        """Return the equilibrium of every case. Collective."""
        return {name: problem.state_of(alpha) for name, problem in self.problems.items()}

    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design beside its value, see `ShapeProblem.remarks`. Collective."""
        return tuple(words for problem in self.problems.values() for words in problem.remarks(alpha))

    def may_be_invalid(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient. Collective."""
        known = self.known(alpha)
        return known is not None and any(
            known.parts[name].weak.may_be_invalid for name in self._total.active(_values(known))
        )

    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near α, see `ShapeProblem.gradient_near`. Collective."""
        known = self.known(alpha)
        values = self.values_of(alpha) if known is None else _values(known)
        names = self._total.active(values)
        gradients = {name: self.problems[name].gradient_near(alpha, end) for name in names}
        return self._total.gradient(values, gradients)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        return {**super().fingerprint(), "weights": str(self.weights)}

    def _at(self, alpha: np.ndarray) -> JointPoint:
        """Return a design of the parts as they are known, or evaluated again. Collective."""
        return self._joined({name: problem.at(alpha) for name, problem in self.problems.items()})

    def _joined(self, parts: Mapping[str, DesignPoint]) -> JointPoint:
        values = {name: part.value for name, part in parts.items()}
        errors = {name: part.error for name, part in parts.items()}
        gradients = {name: part.gradient for name, part in parts.items()}
        names, total = self._total.active(values), self._total
        first, weak = parts[names[0]], WeakPoints.joined([parts[name].weak for name in names])
        gradient = total.gradient(values, gradients)
        return JointPoint(first.alpha, total.value(values), gradient, weak, parts, total.error(errors))


def _values(point: JointPoint) -> dict[str, float]:
    return {name: part.value for name, part in point.parts.items()}


@displayed
class LoadPath(JointProblem):
    """J(α) = Σ J_n(α) over quasi-static load steps of one design, with a subgradient.

    Slip of a step is measured from the step before, as by `LoadSequence`, so that its state depends on the
    design through all steps before, too: adjoints are solved from the last step to the first, each with the
    active set of its step and a load along the contact points' tangents from the step after. A design costs a
    state and an adjoint for each step, one mesh motion, and one assembly and factorisation of what moved.

    With `FrictionWork` as objective J is the work that friction dissipates in all steps. What depends on
    several steps at once is one objective of the path, such as `fatigue.FatigueNorm` of a cycle.

    Attributes:
        problems: Name of the step -> its problem, with the loads of the step.
        objectives: Name of the step -> J_n, for steps that have one; or the objective of the path.

    Example:
        >>> designs = SurfaceDesign("block", "z0", net=(4, 3))  # doctest: +SKIP
        >>> problem = ShapeProblem(ContactProblem(scene, comm), designs, FrictionWork())  # doctest: +SKIP
        >>> forth = LoadStep("forth", loads=[TotalForce("block", "z1", (9, 0, -50))])  # doctest: +SKIP
        >>> back = LoadStep("back", loads=[TotalForce("block", "z1", (-9, 0, -50))])  # doctest: +SKIP
        >>> wear = LoadPath(problem, [forth, back])  # doctest: +SKIP
        >>> result = minimize(wear, np.zeros(wear.size), bounds=(-1.0, 1.0))  # doctest: +SKIP

    References:
        P. Michaleris, D. A. Tortorelli, C. A. Vidal, Tangent operators and design sensitivity formulations
        for transient non-linear coupled problems with applications to elastoplasticity, Int. J. Numer.
        Methods Eng. 37 (1994) 2471-2499.
    """

    def __init__(
        self,
        problem: ShapeProblem,
        steps: Sequence[LoadStep],
        objectives: Mapping[str, Objective] | PathObjective | None = None,
    ) -> None:
        """Apply the steps to the problem's scene, one after the other. Collective.

        Args:
            problem: Scene, designs and tolerance.
            steps: The steps in their order, each with a name of its own; slip of the first is measured from
                the undeformed state.
            objectives: Name of the step -> its objective, or one of the path; None for that of the problem in
                every step.

        Raises:
            InvalidInputError: If there is no step, two have the same name, an objective is that of no step or
                none is that of the last one, or the problem has an adaptive tolerance.
        """
        names = [step.name for step in steps]
        with together(problem.comm):
            if problem.inexact:
                raise InvalidInputError(
                    "LoadPath needs states of one tolerance, got an adaptive one: give ShapeProblem a number"
                )
            _check_names(names)
        self._whole = _checked(problem.comm, names, objectives or dict.fromkeys(names, problem.objective))
        with together(problem.comm):
            _check_last(names, self._whole.steps)
        self.objectives = self._whole
        self.problems: dict[str, ShapeProblem] = {}
        scene, last = problem.scene, problem
        for step in steps:
            scene = step.applied_to(scene)
            self.problems[step.name] = last = last.case(scene)
        self._states, self._memory = _States(self.problems), record_of_values(self._point_at)

    def _facts(self) -> dict[str, Any]:
        work = f"{self.evaluations} designs, {self.products} products with F"
        return {"steps": list(self.problems), "objectives": self.objectives, "work": work}

    @property
    def forms(self) -> ShapeForms:
        """Compiled derivatives, which objectives take beside a state."""
        return self._parts[0].geometry.forms

    @collectively("LoadPath.evaluate", comm_of)
    def evaluate(self, alpha: np.ndarray) -> JointPoint:
        """Solve the states of all steps and their adjoints. Collective.

        States of the design solved last are not solved again.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """
        point = self._point_at(alpha)
        self._memory.record(point)
        return point

    @collectively("LoadPath.states_of", comm_of)
    def states_of(self, alpha: np.ndarray) -> dict[str, AnyState]:
        """Return the equilibrium after every step. Collective."""
        return dict(self._states.of(alpha))

    @collectively("LoadPath.values_of", comm_of)
    def values_of(self, alpha: np.ndarray) -> dict[str, float]:
        """Return J_n(α) of every step that has an objective. Collective."""
        states, forms = self._states.of(alpha), self.forms
        with guarded_user_call(self.comm):
            objectives = self._whole.at(states, forms)
            given = {name: each.value(states[name], forms) for name, each in objectives.items()}
            return {name: finite_value(value) for name, value in given.items()}

    def value_of(self, alpha: np.ndarray) -> float:
        """Return J(α) alone, without adjoints. Collective."""
        return sum(self.values_of(alpha).values())

    def function(self, objectives: Mapping[str, Objective] | PathObjective) -> LoadPath:
        """Return other objectives of the same steps as a function of the designs, for a constraint.

        At the design solved last it uses the states and costs the adjoints. Collective.

        Args:
            objectives: Name of the step -> its objective, for some of the steps; or one of the path.
        """
        other = copy(self)
        other.objectives = other._whole = _checked(self.comm, list(self.problems), objectives)
        other._memory = record_of_values(other._point_at)
        return other

    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design after the last step, see `ShapeProblem.remarks`. Collective."""
        return self._parts[-1].contact.overlaps(self.states_of(alpha)[list(self.problems)[-1]])

    @collectively("LoadPath.gradient_near", comm_of)
    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near α, see `ShapeProblem.gradient_near`. Collective."""
        return with_fewest_weak_points(alpha, end, self._point_at).gradient

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        return super().fingerprint() | described(self.objectives, "objectives")

    def _point_at(self, alpha: np.ndarray) -> JointPoint:
        """Solve the adjoints from the last step to the first. Collective."""
        states = self._states.of(alpha)
        with guarded_user_call(self.comm):
            objectives = self._whole.at(states, self.forms)
        found: dict[str, DesignPoint] = {}
        later = LaterSteps.none(states[list(self.problems)[-1]])
        for name in reversed(self.problems):
            problem, state = self.problems[name], states[name]
            if not found and name not in objectives:
                continue
            own = Partials.of(state, 0.0)
            if name in objectives:
                own = problem.partials_of(objectives[name], state)
            found[name], whole = problem.differentiated(state, later.added(state, own) if found else own)
            later = later.before(state, whole, found[name].adjoint_multiplier)
        alpha = np.array(alpha, dtype=float)
        parts = {name: replace(found[name], alpha=alpha) for name in self.problems if name in found}
        value = sum(part.value for part in parts.values())
        gradient = np.sum([part.gradient for part in parts.values()], axis=0)
        return JointPoint(
            alpha, value, gradient, WeakPoints.joined([part.weak for part in parts.values()]), parts
        )


class _States:
    """States of all steps of one design after another; those of the last one are kept."""

    def __init__(self, problems: Mapping[str, ShapeProblem]) -> None:
        self._problems = problems
        self._alpha: np.ndarray = np.zeros(0)
        self._known: dict[str, AnyState] = {}

    def of(self, alpha: np.ndarray) -> Mapping[str, AnyState]:
        """Return the states of a design. Collective."""
        if np.array_equal(self._alpha, alpha):
            return self._known
        states: dict[str, AnyState] = {}
        last = None
        for name, problem in self._problems.items():
            states[name] = last = problem.state_of(alpha, last)
        self._alpha, self._known = np.array(alpha, dtype=float), states
        return states


def _check_names(names: Sequence[str]) -> None:
    """Check that there are steps with different names."""
    if not names:
        raise InvalidInputError("LoadPath needs a load step, got none: give [LoadStep('push', loads=...)]")
    if len(set(names)) < len(names):
        raise InvalidInputError(
            f"LoadPath needs steps with different names, got {list(names)}: number those that recur"
        )


def _check_last(names: Sequence[str], known: Sequence[str]) -> None:
    """Check that no step comes after the last objective, on which nothing depends."""
    if names[-1] not in known:
        raise InvalidInputError(
            f"the last step needs an objective, got those of {list(known)}: leave out later steps"
        )


def _checked(
    comm: MPI.Comm, names: Sequence[str], given: Mapping[str, Objective] | PathObjective
) -> PathObjective:
    """Return the objective of a path, those of steps in the order of the steps."""
    with together(comm):
        if not isinstance(given, Mapping | PathObjective):
            raise InvalidInputError(
                f"LoadPath.objectives must map steps to objectives, got {type(given).__name__}"
            )
        known = list(given.steps if isinstance(given, PathObjective) else given)
        if not known or not set(known) <= set(names):
            raise InvalidInputError(
                f"LoadPath.objectives must be those of steps {list(names)}, got those of {known}"
            )
    if isinstance(given, PathObjective):
        return given
    return _OfSteps({name: given[name] for name in names if name in given})
