"""The nearest multiplier within its cone and in equilibrium: the projection on the intersection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.qp import DualProblem, FeasibleSet, Vector, global_sum

#: Newton steps and halvings of one.
STEPS, HALVINGS = 100, 30
#: Fraction of the predicted decrease that a step must achieve, or of the imbalance that it may leave.
ARMIJO, REDUCED = 1e-4, 0.5
#: Largest weight of multipliers at their bounds, relative to free ones.
HELD = 1e-3


@dataclass(frozen=True, eq=False)
class _Point:
    """α with λ₀ − Gᵀα, its multiplier, the remaining G λ − e, and the value of the convex function."""

    alpha: Vector
    trial: Vector
    multiplier: Vector
    lacking: Vector
    value: float


def nearest(problem: DualProblem, feasible: FeasibleSet, start: Vector, enough: float) -> Vector:
    """Return the multiplier of a cone in equilibrium that is nearest to a given one. Collective; no product.

    With P the projection on the cone it is λ(α) = P(λ₀ − Gᵀα), where α minimises the convex function

        −½‖λ(α) − λ₀‖² − α·(G λ(α) − e),

    whose gradient is e − G λ(α): a semismooth Newton method with as many unknowns as there are rigid motions.
    Where the cone has only one multiplier in equilibrium, α grows without bound while G λ − e tends to zero.
    Norms are those of the scaled multipliers.

    Args:
        problem: The dual problem.
        feasible: The cone.
        start: λ₀, owned.
        enough: Norm of G λ − e, measured in multipliers, at which to stop.

    Returns:
        Within the cone, owned; in equilibrium unless there is no such multiplier.
    """
    search = _Search(problem, feasible, start)
    point = search.at(np.zeros(problem.coarse.m))
    for _ in range(STEPS):
        left = search.length(point)
        if left <= enough:
            break
        following = search.step(point, left)
        if following is None:
            break
        point = following
    return point.multiplier


class _Search:
    """The convex function and Newton's steps on it."""

    def __init__(self, problem: DualProblem, feasible: FeasibleSet, start: Vector) -> None:
        self._problem, self._feasible, self._start = problem, feasible, start
        self._coarse = problem.scaled_problem.coarse
        self._factor = evening(problem)
        self._size = problem.norm(start) or 1.0

    def at(self, alpha: Vector) -> _Point:
        trial = self._start - self._factor * self._coarse.transpose(alpha)
        multiplier = self._feasible.project(trial)
        way = (multiplier - self._start) / self._factor
        lacking = self._problem.coarse.residual(multiplier)
        value = -0.5 * float(global_sum(self._problem.comm, way @ way)[0]) - float(alpha @ lacking)
        return _Point(alpha, trial, multiplier, lacking, value)

    def length(self, point: _Point) -> float:
        return self._problem.coarse.norm(point.lacking)

    def step(self, point: _Point, left: float) -> _Point | None:
        """Return a better point along the Newton step, None if there is none. Collective."""
        weight = HELD * min(1.0, left / self._size)
        direction = self._coarse.restricted(self._slope(point, weight)).solve(point.lacking)
        promised = float(point.lacking @ direction)
        share = 1.0
        for _ in range(HALVINGS):
            trial = self.at(point.alpha + share * direction)
            decreases = trial.value <= point.value - ARMIJO * share * promised
            if decreases or self.length(trial) <= REDUCED * left:
                return trial
            share *= 0.5
        return None

    def _slope(self, point: _Point, weight: float) -> sp.csr_matrix:
        """Return a root of P' + weight (1 − P') at a point, shape (size, size), owned."""
        layout, size, trial = self._feasible.layout, len(self._start), point.trial
        root = np.ones(size)
        root[layout.normal] = np.where(trial[layout.normal] > 0.0, 1.0, np.sqrt(weight))
        tau, rows = trial[layout.tangential], layout.tangential
        length = np.linalg.norm(tau, axis=1)
        outside = length > self._feasible.slip_bound
        far = np.where(outside, length, 1.0)
        across = np.where(outside, np.sqrt(self._feasible.slip_bound / far + weight), 1.0)
        along = np.where(outside, np.sqrt(weight), 1.0)
        ray = tau / far[:, None]
        blocks = across[:, None, None] * np.eye(rows.shape[1]) + (along - across)[:, None, None] * (
            ray[:, :, None] * ray[:, None, :]
        )
        root[rows] = 0.0
        i, j = np.broadcast_arrays(rows[:, :, None], rows[:, None, :])
        discs = sp.csr_matrix((blocks.ravel(), (i.ravel(), j.ravel())), shape=(size, size))
        return (sp.diags(root) + discs).tocsr()


def evening(problem: DualProblem) -> Vector:
    """Return the factors of the scaled multipliers, one where stiffness is uniform, owned."""
    return np.ones(problem.layout.size) if problem.scaling is None else problem.scaling.factor
