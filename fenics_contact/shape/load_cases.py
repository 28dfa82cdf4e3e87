"""One design under several loads: the largest objective of all load cases, or a weighted sum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.contact import State
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.shape.memory import joined_fingerprint, joined_memory, recall_joined
from fenics_contact.shape.problem import ShapeProblem


@displayed
class LoadCases:
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
        first = self._first
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
        return {"cases": list(self.problems), "objective": how, "first": self._first}

    @property
    def _first(self) -> ShapeProblem:
        return next(iter(self.problems.values()))

    @property
    def size(self) -> int:
        """Number of design variables."""
        return self._first.size

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""
        return self._first.comm

    @property
    def products(self) -> int:
        """F-products of states and adjoints of all cases so far."""
        return sum(problem.products for problem in self.problems.values())

    @property
    def evaluations(self) -> int:
        """Number of designs evaluated."""
        return self._first.evaluations

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `ShapeProblem.within`."""
        return all(problem.inexact for problem in self.problems.values())

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return J(α) and a subgradient. Collective; raises as `ShapeProblem` does."""
        return self._joined({name: problem(alpha) for name, problem in self.problems.items()})

    def pieces(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J_k and gradients of the cases beside the largest, for `optimize`. Collective.

        Args:
            alpha: The design evaluated last, shape (size,), [length].

        Returns:
            Values, shape (k,), and gradients, shape (k, size); none of a weighted sum.
        """
        known = [] if self.weights is not None else [each.known(alpha) for each in self.problems.values()]
        points = sorted((each for each in known if each is not None), key=lambda each: -each.value)[1:]
        gradients = np.array([each.gradient for each in points]).reshape(len(points), self.size)
        return np.array([each.value for each in points]), gradients

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return J(α), a subgradient and the estimated error of J, see `ShapeProblem.within`. Collective."""
        share = 1.0 if self.weights is None else sum(map(abs, self.weights.values())) or 1.0
        found = {name: each.within(alpha, value / share, subgradient) for name, each in self.problems.items()}
        errors = {name: error for name, (_, _, error) in found.items()}
        total = max(errors.values()) if self.weights is None else self._sum(errors, absolute=True)
        return *self._joined({name: answer[:2] for name, answer in found.items()}), total

    def values_of(self, alpha: np.ndarray) -> dict[str, float]:
        """Return J_k(α) of every case. Collective."""
        return {name: problem.value_of(alpha) for name, problem in self.problems.items()}

    def states_of(self, alpha: np.ndarray) -> dict[str, State]:
        """Return the equilibrium of every case. Collective."""
        return {name: problem.state_of(alpha) for name, problem in self.problems.items()}

    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design beside its value, see `ShapeProblem.remarks`. Collective."""
        return tuple(words for problem in self.problems.values() for words in problem.remarks(alpha))

    def volume(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        return self._first.volume(alpha)

    def doubtful(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient. Collective."""
        return any(problem.doubtful(alpha) for problem in self._counting(alpha).values())

    def beside(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near α, see `ShapeProblem.beside`. Collective."""
        gradients = {name: each.beside(alpha, end) for name, each in self._counting(alpha).items()}
        return next(iter(gradients.values())) if self.weights is None else self._sum(gradients)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        return {**joined_fingerprint(self.problems), "weights": str(self.weights)}

    def memory(self) -> dict[str, np.ndarray]:
        """Return what the next states depend on. Collective."""
        return joined_memory(self.problems.values())

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Continue from what `memory` returned, also on another number of ranks. Collective."""
        recall_joined(self.problems.values(), memory)

    def _joined(self, answers: Mapping[str, tuple[float, np.ndarray]]) -> tuple[float, np.ndarray]:
        if self.weights is None:
            return max(answers.values(), key=lambda answer: answer[0])
        values = {name: value for name, (value, _) in answers.items()}
        return self._sum(values), self._sum({name: gradient for name, (_, gradient) in answers.items()})

    def _sum(self, parts: Mapping[str, Any], *, absolute: bool = False) -> Any:
        assert self.weights is not None
        return sum(
            (abs(self.weights[name]) if absolute else self.weights[name]) * parts[name] for name in parts
        )

    def _counting(self, alpha: np.ndarray) -> dict[str, ShapeProblem]:
        """Return the cases of which the subgradient at α is made. Collective."""
        if self.weights is not None:
            return self.problems

        def value(name: str) -> float:
            known = self.problems[name].known(alpha)
            return self.problems[name].value_of(alpha) if known is None else known.value

        name = max(self.problems, key=value)
        return {name: self.problems[name]}
