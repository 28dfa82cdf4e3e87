"""The bundle: cutting planes of the objective, seen from the current centre."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """A subgradient of one function at a point, in scaled variables, with what is known of it.

    Attributes:
        gradient: The subgradient, shape (n,).
        value: Value of the function there.
        noise: Error of the value.
        pushes: Multiples of gradients of equalities that the subgradient contains, shape (r,).
        steepness: Length of the subgradient without them.
        doubtful: Whether it may not be a subgradient, see `Kinked`.
    """

    gradient: Array
    value: float = 0.0
    noise: float = 0.0
    pushes: Array = field(default_factory=lambda: np.zeros(0))
    steepness: float = 0.0
    doubtful: bool = False

    @property
    def length(self) -> float:
        """Length of the subgradient."""
        return float(np.linalg.norm(self.gradient))


@dataclass(frozen=True)
class Bundle:
    r"""Cutting planes of the objective, all expressed at the centre x of the model.

    A subgradient g_i found at y_i gives the plane J(y_i) + g_i·(z - y_i). At the centre it lies
    below J(x) by the linearisation error α_i = J(x) - J(y_i) - g_i·(x - y_i), which is not
    negative for a convex J. For a nonconvex one a plane far away can lie above J(x); the
    subgradient locality measure β_i = max(\|α_i\|, c s_i²), with the distance s_i travelled since
    y_i, pushes it below again, the further the older it is. The model at x + y is J(x) + max_i (g_i·y - β_i).
    Row 0 belongs to the centre itself: α_0 = s_0 = 0, which makes the model exact there.

    Attributes:
        gradients: g_i in scaled variables, shape (m, n).
        errors: α_i, shape (m,), units of J.
        distances: s_i in scaled variables, shape (m,).
        locality: c, units of J; 0 for a convex objective.
        noise: Error e_i of the value of plane i, shape (m,), units of J. A plane may lie too high by e_i,
            seen from a centre whose value is too low by e_0, and is lowered by both: an inexact plane
            predicts no less decrease than possible.
        doubtful: Marks of planes whose slope may not be a subgradient, see `Kinked`, shape (m,).
        pushes: Multiples of the gradients of r equality constraints that g_i contains, shape (m, r).

    References:
        K. C. Kiwiel, Methods of Descent for Nondifferentiable Optimization, Lecture Notes in
        Mathematics 1133, Springer, 1985 (aggregation and locality measures, chapter 3).
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152.
    """

    gradients: Array
    errors: Array
    distances: Array
    locality: float
    noise: Array
    doubtful: NDArray[np.bool_]
    pushes: Array

    @classmethod
    def of_centre(cls, plane: Plane, locality: float) -> Bundle:
        """Return the bundle that holds only the centre's own plane."""
        zero = np.zeros(1)
        marks, noise = np.array([plane.doubtful]), np.array([plane.noise])
        return cls(plane.gradient[None], zero, zero, locality, noise, marks, plane.pushes[None])

    @property
    def size(self) -> int:
        """Number of cutting planes."""
        return int(self.errors.size)

    @property
    def measures(self) -> Array:
        """Subgradient locality measures β_i, shape (m,), not negative."""
        away = self.noise + self.noise[0]
        away[0] = 0.0
        return np.maximum(np.abs(self.errors), self.locality * self.distances**2) + away

    def model(self, step: Array) -> float:
        """Return the predicted change of J, max_i (g_i·y - β_i), for a step y of shape (n,)."""
        return float(np.max(self.gradients @ step - self.measures))

    def with_cut(self, plane: Plane, error: float, distance: float) -> Bundle:
        """Return the bundle with one more plane at the end."""
        return Bundle(
            np.vstack([self.gradients, plane.gradient]),
            np.append(self.errors, error),
            np.append(self.distances, distance),
            self.locality,
            np.append(self.noise, plane.noise),
            np.append(self.doubtful, plane.doubtful),
            np.vstack([self.pushes, plane.pushes]),
        )

    def refined(self, plane: Plane, change: float) -> Bundle:
        """Return the bundle after its centre was re-evaluated: its plane, and the change of its value."""
        gradients, errors, noises = self.gradients.copy(), self.errors + change, self.noise.copy()
        doubts, pushes = self.doubtful.copy(), self.pushes.copy()
        errors[0], noises[0], doubts[0] = 0.0, plane.noise, plane.doubtful
        gradients[0], pushes[0] = plane.gradient, plane.pushes
        return Bundle(gradients, errors, self.distances, self.locality, noises, doubts, pushes)

    def moved(self, step: Array, change: float, locality: float, own: int = 1) -> Bundle:
        """Return the bundle seen from a new centre, whose own plane is the last one.

        Args:
            step: Move of the centre, shape (n,), scaled variables.
            own: Number of planes at the end that were found at the new centre.

        Returns:
            The same planes with new errors and longer distances, the centre's plane first.
        """
        errors = self.errors + change - self.gradients @ step
        distances = self.distances + np.linalg.norm(step)
        errors[-1] = distances[-own:] = 0.0
        order = np.roll(np.arange(self.size), 1)
        return replace(
            self.chosen(order), errors=errors[order], distances=distances[order], locality=locality
        )

    def reduced(self, weights: Array, room: int) -> Bundle:
        """Return a bundle with at most ``room`` planes that has the same solution of the step's programme.

        Planes without weight are dropped first, those with the largest locality measure before the others.
        Where even the weighted ones are too many, their convex combination with ``weights``, the aggregate
        plane, replaces the lightest of them: it alone preserves the predicted decrease, so that the method
        converges with any ``room`` of at least two.

        Args:
            weights: Multipliers of the planes, shape (m,), not negative, sum one.

        Returns:
            The reduced bundle; row 0 stays where it is.
        """
        if self.size <= room:
            return self
        carrying = weights > 1e-8
        order = 1 + np.lexsort((self.measures[1:], -weights[1:]))
        if np.count_nonzero(carrying[1:]) < room:
            return self.chosen(np.concatenate([[0], np.sort(order[: room - 1])]))
        remaining = self.chosen(np.concatenate([[0], np.sort(order[: room - 2])]))
        share = weights / weights.sum()
        aggregate = Plane(
            share @ self.gradients,
            noise=float(share @ self.noise),
            pushes=share @ self.pushes,
            doubtful=bool(np.any(self.doubtful & carrying)),
        )
        return remaining.with_cut(aggregate, float(share @ self.errors), float(share @ self.distances))

    def chosen(self, rows: NDArray[np.intp]) -> Bundle:
        """Return the bundle of some planes, given by their numbers."""
        return Bundle(
            self.gradients[rows],
            self.errors[rows],
            self.distances[rows],
            self.locality,
            self.noise[rows],
            self.doubtful[rows],
            self.pushes[rows],
        )
