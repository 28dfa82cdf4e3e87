"""One design under several loads: the largest objective of all load cases, or a weighted sum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fenics_contact.contact import AnyState
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.scene import Scene
from fenics_contact.shape.design_function import DesignProblem
from fenics_contact.shape.linearised_face import WeakPoints
from fenics_contact.shape.memory import DesignPoint, JointPoint, record_of_values
from fenics_contact.shape.problem import ShapeProblem


class JointProblem(DesignProblem[JointPoint]):
    """A design problem with several states a design.

    Attributes:
        problems: Name of each case or step -> its problem; all are made of the first by `ShapeProblem.case`.
    """

    problems: dict[str, ShapeProblem]

    @property
    def _parts(self) -> Sequence[ShapeProblem]:
        return list(self.problems.values())

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        """Return the coordinates of the designed bodies, see `DesignGeometry.points_of`. Collective."""
        return self._parts[0].points_of(alpha)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        known = {name: problem.fingerprint() for name, problem in self.problems.items()}
        return {f"{name}.{key}": text for name, each in known.items() for key, text in each.items()}


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
        self.problems, self.weights = dict(problems), None if weights is None else dict(weights)
        if not self.problems:
            raise InvalidInputError("LoadCases needs a problem, got none: give {'name': problem}")
        self._memory = record_of_values(self._at)
        first = self._parts[0]
        with together(first.comm):
            for name, problem in self.problems.items():
                if not isinstance(problem, ShapeProblem) or not problem.shares_with(first):
                    raise InvalidInputError(
                        f"load cases must share designs and meshes, {name!r} shares nothing with "
                        f"{next(iter(self.problems))!r}: make it by problem.case(scene)"
                    )
            self._check_weights()

    def _check_weights(self) -> None:
        if self.weights is None:
            return
        if set(self.weights) != set(self.problems):
            raise InvalidInputError(
                f"LoadCases.weights must name the cases {sorted(self.problems)}, got {sorted(self.weights)}: "
                "give each a weight, or none for the largest"
            )
        if not np.isfinite(list(self.weights.values())).all():
            raise InvalidInputError(
                f"LoadCases.weights must be finite numbers, got {self.weights}: give numbers such as 0.5"
            )

    def _facts(self) -> dict[str, Any]:
        how = "largest" if self.weights is None else f"weighted sum, {self.weights}"
        return {"cases": list(self.problems), "objective": how, "first": self._parts[0]}

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `ShapeProblem.within`."""
        return all(problem.inexact for problem in self.problems.values())

    def pieces(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J_k and gradients of the cases beside the largest, for `optimize`. Collective.

        Args:
            alpha: The design evaluated last, shape (size,), [length].

        Returns:
            Values, shape (k,), and gradients, shape (k, size); none of a weighted sum.
        """
        known = None if self.weights is not None else self.known(alpha)
        points = sorted(known.parts.values(), key=lambda each: -each.value)[1:] if known else []
        gradients = np.array([each.gradient for each in points]).reshape(len(points), self.size)
        return np.array([each.value for each in points]), gradients

    def evaluate(self, alpha: np.ndarray) -> JointPoint:
        """Evaluate all cases. Collective; raises as `ShapeProblem.evaluate` does."""
        point = self._joined({name: problem.evaluate(alpha) for name, problem in self.problems.items()})
        self._memory.record(point)
        return point

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return J(α), a subgradient and the estimated error of J, see `ShapeProblem.within`. Collective."""
        share = 1.0 if self.weights is None else sum(map(abs, self.weights.values())) or 1.0
        for problem in self.problems.values():
            problem.within(alpha, value / share, subgradient)
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

    def scene_of(self, alpha: np.ndarray) -> Scene:
        """Return the scene of the first case in the shape of a design. Collective; raises as `evaluate`."""
        return self._parts[0].scene_of(alpha)

    def may_be_invalid(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient. Collective."""
        known = self.known(alpha)
        return known is not None and any(
            known.parts[name].weak.may_be_invalid for name in self._active(_values(known))
        )

    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near α, see `ShapeProblem.gradient_near`. Collective."""
        known = self.known(alpha)
        names = self._active(self.values_of(alpha) if known is None else _values(known))
        gradients = {name: self.problems[name].gradient_near(alpha, end) for name in names}
        return gradients[names[0]] if self.weights is None else self._sum(gradients)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        return {**super().fingerprint(), "weights": str(self.weights)}

    def _at(self, alpha: np.ndarray) -> JointPoint:
        """Return a design of the parts as they are known, or evaluated again. Collective."""
        return self._joined({name: problem.at(alpha) for name, problem in self.problems.items()})

    def _joined(self, parts: Mapping[str, DesignPoint]) -> JointPoint:
        values = {name: part.value for name, part in parts.items()}
        errors = {name: part.error for name, part in parts.items()}
        names = self._active(values)
        first, weak = parts[names[0]], WeakPoints.joined([parts[name].weak for name in names])
        if self.weights is None:
            return JointPoint(first.alpha, first.value, first.gradient, weak, parts, max(errors.values()))
        gradient = self._sum({name: part.gradient for name, part in parts.items()})
        error = self._sum(errors, absolute=True)
        return JointPoint(first.alpha, self._sum(values), gradient, weak, parts, error)

    def _sum(self, parts: Mapping[str, Any], *, absolute: bool = False) -> Any:
        assert self.weights is not None
        return sum(
            (abs(self.weights[name]) if absolute else self.weights[name]) * parts[name] for name in parts
        )

    def _active(self, values: Mapping[str, float]) -> list[str]:
        """Return the load cases that contribute to the subgradient, from their values."""
        return list(self.problems) if self.weights is not None else [max(values, key=values.__getitem__)]


def _values(point: JointPoint) -> dict[str, float]:
    return {name: part.value for name, part in point.parts.items()}
