"""Generalised minimal residuals on a coupled face, keeping equilibrium."""

from __future__ import annotations

import numpy as np

from fenics_contact.qp.coupled import CoupledSystem
from fenics_contact.qp.pcg import FaceStep, Stop
from fenics_contact.qp.reductions import Vector, global_sum

#: A recomputed residual this many times the tolerance is not the one that the recursion told.
FALSE_HOPE = 10.0


def projected_gmres(
    coupled: CoupledSystem, gradient: Vector, weights: Vector, tolerance: float, max_iterations: int
) -> FaceStep:
    """Solve (Wᵀ F Z + κ) δ = −g + (G W)ᵀ α with G Z δ = 0. Collective.

    Right preconditioned, without restart, in the norm ‖weights · r‖ of the projected residual, which is what
    is minimised and compared with the tolerance.

    Args:
        coupled: Tested and moving basis of a face.
        gradient: g = Wᵀ(F λ − d) + κ y at the starting point, shape (n_face,), owned.
        weights: Positive weights, shape (n_face,), owned.
        tolerance: Stop when the weighted norm is at most this.
        max_iterations: Largest number of operator applications.

    Returns:
        The step in face coordinates (the multiplier moves by Z δ) and why the iteration ended.

    References:
        Y. Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), algorithms 6.9 and 9.5.
    """
    comm, operator = coupled.system.comm, coupled.system.operator
    first = -weights * coupled.oblique(gradient)
    size = float(np.sqrt(global_sum(comm, first @ first)[0]))
    basis = _Basis(len(gradient), coupled.moving.shape[0])
    small = _LeastSquares(size)
    stop = Stop.CONVERGED
    vector: Vector = np.asarray(first / (size or 1.0), dtype=np.float64)
    while not small.residual <= tolerance:
        if basis.count == max_iterations:
            stop = Stop.ITERATION_LIMIT
            break
        direction = coupled.precondition(vector / weights)
        full = operator(coupled.moving @ direction)
        image = weights * coupled.image(direction, full)
        basis.append(vector, direction, full)
        image, column = _orthogonalised(comm, basis.vectors, image)
        small.append(column)
        if basis.count - small.last_progress > coupled.system.patience:
            stop = Stop.STAGNATION
            break
        if column[-1] == 0.0:
            # The whole Krylov space is known: what is left lies outside of the operator's range.
            stop = Stop.CONVERGED if small.residual <= tolerance else Stop.NO_CURVATURE
            break
        vector = image / column[-1]
    factors = small.solution()
    step, product = factors @ basis.directions, factors @ basis.products
    residual = coupled.oblique(gradient + coupled.operate(step, product))
    left = float(np.sqrt(global_sum(comm, (weights * residual) @ (weights * residual))[0]))
    if stop is Stop.CONVERGED and left > FALSE_HOPE * tolerance:
        # Rounding passed for the image of a direction that has none.
        stop = Stop.NO_CURVATURE
    return FaceStep(step, product, residual, basis.count, max(left, small.residual), stop)


def _orthogonalised(comm: object, vectors: Vector, image: Vector) -> tuple[Vector, Vector]:
    """Subtract the components along the basis, twice, and return the rest with the Hessenberg column."""
    coefficients = np.zeros(len(vectors))
    for _ in range(2):
        correction = global_sum(comm, vectors @ image)  # type: ignore[arg-type]
        image = image - correction @ vectors
        coefficients += correction
    length = np.sqrt(global_sum(comm, image @ image))  # type: ignore[arg-type]
    return image, np.concatenate([coefficients, length])


class _Basis:
    """Krylov vectors v, preconditioned directions z and products F Z z as rows of growing blocks."""

    def __init__(self, n_face: int, n_owned: int) -> None:
        self.count = 0
        self._blocks: list[Vector] = [np.empty((32, n_face)), np.empty((32, n_face)), np.empty((32, n_owned))]

    def append(self, *rows: Vector) -> None:
        if self.count == len(self._blocks[0]):
            self._blocks = [np.vstack([block, np.empty_like(block)]) for block in self._blocks]
        for block, row in zip(self._blocks, rows, strict=True):
            block[self.count] = row
        self.count += 1

    @property
    def vectors(self) -> Vector:
        return self._blocks[0][: self.count]

    @property
    def directions(self) -> Vector:
        return self._blocks[1][: self.count]

    @property
    def products(self) -> Vector:
        return self._blocks[2][: self.count]


class _LeastSquares:
    """min ‖β e₁ − H y‖ for a Hessenberg matrix that grows by columns, by Givens rotations; replicated."""

    def __init__(self, beta: float) -> None:
        self._columns: list[Vector] = []
        self._rotations: list[tuple[float, float]] = []
        self._right = [beta]
        self._best = beta
        self.last_progress = 0

    @property
    def residual(self) -> float:
        return abs(self._right[-1])

    def append(self, column: Vector) -> None:
        column = column.copy()
        for i, (cosine, sine) in enumerate(self._rotations):
            upper, lower = column[i], column[i + 1]
            column[i], column[i + 1] = cosine * upper + sine * lower, cosine * lower - sine * upper
        length = float(np.hypot(column[-2], column[-1]))
        # A direction without an image leaves the residual what it is: its row changes places with the rest.
        cosine, sine = (float(column[-2] / length), float(column[-1] / length)) if length > 0 else (0.0, 1.0)
        column[-2] = length
        self._columns.append(column[:-1])
        self._rotations.append((cosine, sine))
        last = self._right.pop()
        self._right += [cosine * last, -sine * last]
        if self.residual < 0.9 * self._best:
            self._best, self.last_progress = self.residual, len(self._columns)

    def solution(self) -> Vector:
        size = len(self._columns)
        triangle = np.zeros((size, size))
        for j, column in enumerate(self._columns):
            triangle[: j + 1, j] = column
        # A vanishing pivot belongs to a direction that the operator does not see; it is left out.
        return np.asarray(np.linalg.lstsq(triangle, np.array(self._right[:size]), rcond=None)[0])
