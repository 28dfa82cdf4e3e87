"""Random problems with nonsmooth inequalities and smooth equalities, beside quadratic programming."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.optimize

from fenics_contact import minimize
from fenics_contact.design import BundleTrust, NonlinearConstraint, Result
from tests.optimize.functions import Array, Fun

METHOD = BundleTrust(tolerance=1e-6, max_iterations=500, max_evaluations=600)


@dataclass(frozen=True, eq=False)
class Quadratics:
    """max_k of ½ xᵀA_k x + b_k·x + c_k.

    Attributes:
        matrices: A_k, shape (m, n, n), symmetric.
        slopes: b_k, shape (m, n).
        constants: c_k, shape (m,).
    """

    matrices: Array
    slopes: Array
    constants: Array

    def values(self, x: Array) -> Array:
        return 0.5 * np.einsum("kij,i,j->k", self.matrices, x, x) + self.slopes @ x + self.constants

    def __call__(self, x: Array) -> tuple[float, Array]:
        values = self.values(x)
        k = int(np.argmax(values))
        return float(values[k]), self.matrices[k] @ x + self.slopes[k]


@dataclass(frozen=True, eq=False)
class Problem:
    """A random problem; 0 is strictly feasible, or on the surface of the equality."""

    objective: Quadratics
    limits: list[Quadratics]
    equalities: list[Quadratics]
    start: Array
    size: float

    def minimised(self) -> Result:
        def fun(x: Array) -> tuple[float, Array]:
            value, slope = self.objective(x)
            return self.size * value, self.size * slope

        given: list[NonlinearConstraint] = [NonlinearConstraint(limit, 0.0) for limit in self.limits]
        given += [NonlinearConstraint(each, 0.0, 0.0) for each in self.equalities]
        method = BundleTrust(**{**vars(METHOD), "value_scale": self.size})
        return minimize(fun, self.start, method, bounds=(-6.0, 6.0), constraints=given, restore=True)

    def programmed(self, start: Array) -> float:
        """The least value that sequential quadratic programming finds, pieces as constraints."""
        pieces: list[dict[str, Any]] = [
            {"type": "ineq", "fun": lambda z: z[-1] - self.objective.values(z[:-1])},
            *({"type": "ineq", "fun": lambda z, one=one: -one.values(z[:-1])} for one in self.limits),
            *({"type": "eq", "fun": lambda z, one=one: one.values(z[:-1])} for one in self.equalities),
        ]
        bounds = [(-6.0, 6.0)] * start.size + [(None, None)]
        top = float(np.max(self.objective.values(start)))
        options = {"maxiter": 1000, "ftol": 1e-12}
        found = scipy.optimize.minimize(
            lambda z: z[-1], np.append(start, top), constraints=pieces, bounds=bounds, options=options
        )
        assert found.success
        return float(found.fun)


def posed(seed: int, *, convex: bool) -> Problem:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 10))

    def quadratics(count: int, bend: float, least: float) -> Array:
        square = rng.standard_normal((count, n, n))
        positive = square @ square.transpose(0, 2, 1) / n + 0.1 * np.eye(n)
        return bend * (positive if convex else 0.5 * (square + square.transpose(0, 2, 1))) + least * np.eye(n)

    objective = Quadratics(
        quadratics(5, 0.3, 0.3), 2 * rng.standard_normal((5, n)), 3 * rng.standard_normal(5)
    )
    limits = [
        Quadratics(quadratics(4, 1.0, 0.0), rng.standard_normal((4, n)), -1 - rng.uniform(0, 2, 4))
        for _ in range(int(rng.integers(1, 4)))
    ]
    surface = Quadratics(quadratics(1, 0.2, 0.0), rng.standard_normal((1, n)), np.zeros(1))
    start = np.zeros(n) if seed % 2 else rng.uniform(-3.0, 3.0, n)
    return Problem(objective, limits, [surface] * (seed % 3 == 0), start, 10.0 ** rng.uniform(-3.0, 3.0))


def checked(problem: Problem, most: int = 300) -> Result:
    result = problem.minimised()
    assert result.reason.success
    assert result.violation <= 1e-6
    assert result.evaluations < most
    return result


@pytest.mark.parametrize("seed", range(12))
def test_minima_of_convex_functions_are_those_of_quadratic_programming(seed: int) -> None:
    problem = posed(seed, convex=True)
    value = checked(problem).value / problem.size
    least = problem.programmed(np.zeros(problem.start.size))
    # A surface makes the set nonconvex: there may be a lower minimum.
    assert value - least < 1e-5 * (1 + abs(least))
    assert least - value < 1e-5 * (1 + abs(least)) or problem.equalities


@pytest.mark.parametrize("seed", range(4, 16))
def test_quadratic_programming_finds_nothing_lower_near_minima_of_nonconvex_functions(seed: int) -> None:
    problem = posed(seed, convex=False)
    # Rounding decides how such a walk goes: one takes less than 300 evaluations on one processor, 579 on
    # another.
    result = checked(problem, most=800)
    value, least = result.value / problem.size, problem.programmed(result.x)
    assert value - least < 2e-4 * (1 + abs(least))
    violated = [max(0.0, float(one.values(problem.start).max())) for one in problem.limits]
    assert seed % 2 or max(violated) > 0.1, "the start was to be infeasible"


def test_the_problems_have_active_constraints() -> None:
    active = [
        sum(one.active for one in posed(seed, convex=True).minimised().constraints) for seed in range(6)
    ]
    assert sum(active) >= 4


def test_functions_of_the_problems_have_their_gradients() -> None:
    fun: Fun = posed(1, convex=False).objective
    x, step = np.full(posed(1, convex=False).start.size, 0.3), 1e-6
    for axis in np.eye(x.size):
        slope = (fun(x + step * axis)[0] - fun(x - step * axis)[0]) / (2 * step)
        assert fun(x)[1] @ axis == pytest.approx(slope, abs=1e-6)
