"""Projected Krylov methods on a face: conjugate gradients, and GMRES where friction grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact.qp.face_system import CoupledSystem, FaceSystem
from fenics_contact.qp.reductions import Vector, global_sum


class Stop(Enum):
    """Why the inner iteration ended."""

    CONVERGED = "converged"
    ITERATION_LIMIT = "iteration limit"
    NO_CURVATURE = "direction without curvature: the operator is singular on this face"
    BAD_PRECONDITIONER = "preconditioner is not positive"
    STAGNATION = "stagnation: rounding has eaten the residual"
    ENOUGH = "what is left is not linear"


@dataclass(frozen=True, eq=False)
class FaceStep:
    """The result of an inner solver on a face.

    Attributes:
        step: δ on the face with G Z δ = 0, shape (n_face,), owned.
        product: F Z δ, owned, updated by recursion.
        residual: P_F (g + (Zᵀ F Z + κ) δ), shape (n_face,), owned, updated by recursion.
        measure: Weighted norm of `residual`, the quantity compared with the tolerance.
    """

    step: Vector
    product: Vector
    residual: Vector
    iterations: int
    measure: float
    stop: Stop


#: Whether a step is accurate enough, from δ, F Z δ and its measure: more may be missing than the face knows.
Enough: TypeAlias = Callable[[Vector, Vector, float], bool]


class _Rows:
    """Growing sets of vectors, one for each kind, in blocks that are never copied: they fill the memory."""

    def __init__(self, *lengths: int, rows: int = 16) -> None:
        """Start empty; lengths are those of this rank's vectors of each kind, `rows` those of a block."""
        self.count = 0
        self._rows, self._blocks = rows, [(length, list[Vector]()) for length in lengths]

    def append(self, *rows: Vector) -> None:
        """Append one vector of each kind."""
        number, place = divmod(self.count, self._rows)
        for (length, blocks), row in zip(self._blocks, rows, strict=True):
            if number == len(blocks):
                blocks.append(np.zeros((self._rows, length)))
            blocks[number][place] = row
        self.count += 1

    def dot(self, kind: int, vector: Vector) -> Vector:
        """Return this rank's products of all vectors of a kind with one, shape (count,)."""
        parts = [np.zeros(0), *(block @ vector for block in self._blocks[kind][1])]
        return np.concatenate(parts)[: self.count]

    def combined(self, kind: int, factors: Vector) -> Vector:
        """Return the sum of factor times vector over all vectors of a kind; factors of shape (count,)."""
        length, blocks = self._blocks[kind]
        total = np.zeros(length)
        for number, block in enumerate(blocks):
            part = factors[number * self._rows : (number + 1) * self._rows]
            total += part @ block[: len(part)]
        return total


def projected_cg(
    system: FaceSystem,
    gradient: Vector,
    weights: Vector,
    tolerance: float,
    max_iterations: int,
    enough: Enough | None = None,
    asked_every: int = 4,
) -> FaceStep:
    """Minimise ½ δᵀA δ + gᵀδ over G Z δ = 0 with A = Zᵀ F Z + κ. Collective.

    Each iteration applies F once, the preconditioner once, and combines its sums in three messages: the
    coarse right side and all conjugation coefficients of the new direction in the first, those of its product
    in the second, the norm of the residual in the third. Conjugation against all previous directions is two
    matrix–vector products.

    `gradient`: g = Zᵀ(F λ − d) + κ y at the starting point, shape (n_face,), owned; `weights`: positive
    weights of the stopping norm ‖weights · P_F(g + A δ)‖, shape (n_face,), owned; `enough`: ends the
    iteration before the tolerance is reached, asked every few iterations.

    Returns the step and why the iteration ended; nothing is raised, the caller decides what a failure means.

    References:
        C. Farhat, F.-X. Roux, A method of finite element tearing and interconnecting and its parallel
        solution algorithm, IJNME 32 (1991).
    """
    residual = system.coarse.project(gradient)
    step, product = np.zeros_like(gradient), np.zeros(system.face.layout.size)
    # Directions p and images P A p, and their curvatures pᵀA p.
    rows, curvatures = _Rows(len(gradient), len(gradient)), list[float]()
    size = system.weighted_norm(residual, weights)
    best, since_best, iterations, stop = size, 0, 0, Stop.CONVERGED
    while not size <= tolerance:
        if iterations == max_iterations:
            stop = Stop.ITERATION_LIMIT
            break
        direction, descent = _next_direction(system, residual, rows, curvatures)
        if not descent > 0.0:
            stop = Stop.BAD_PRECONDITIONER
            break
        full = system.operator(system.face.prolong(direction))
        image, slope, curvature, smallest = _image(system, residual, direction, full)
        iterations += 1
        if not curvature > smallest:
            stop = Stop.NO_CURVATURE
            break
        rows.append(direction, image)
        curvatures.append(curvature)
        length = -slope / curvature
        step += length * direction
        product += length * full
        residual = residual + length * image
        size = system.weighted_norm(residual, weights)
        best, since_best = (size, 0) if size < 0.9 * best else (best, since_best + 1)
        if since_best > system.patience:
            stop = Stop.STAGNATION
            break
        asked = iterations % asked_every == 0 and size > tolerance
        if enough is not None and asked and enough(step, product, size):
            stop = Stop.ENOUGH
            break
    return FaceStep(step, product, residual, iterations, size, stop)


def _next_direction(
    system: FaceSystem, residual: Vector, rows: _Rows, curvatures: list[float]
) -> tuple[Vector, float]:
    """Return the new direction and its product with the residual, with the sign of a descent direction."""
    z = system.precondition(residual)
    m = system.coarse.m
    sums = global_sum(system.comm, system.coarse.local(z), rows.dot(1, z), residual @ z)
    projected = z - system.coarse.transpose(system.coarse.solve(sums[:m]))
    conjugate = projected - rows.combined(0, sums[m:-1] / np.array(curvatures))
    return -conjugate, float(sums[-1])


def _image(
    system: FaceSystem, residual: Vector, direction: Vector, full: Vector
) -> tuple[Vector, float, float, float]:
    """Return P_F A p, the slope along p, pᵀA p and the curvature below which p counts as a null vector."""
    image = system.image(direction, full)
    m = system.coarse.m
    sums = global_sum(
        system.comm,
        system.coarse.local(image),
        residual @ direction,
        direction @ image,
        direction @ direction,
        image @ image,
    )
    projected = image - system.coarse.transpose(system.coarse.solve(sums[:m]))
    slope, curvature = float(sums[m]), float(sums[m + 1])
    lengths = np.sqrt(sums[m + 2 :])
    return projected, slope, curvature, LAST_PLACES * float(lengths[0] * lengths[1])


def projected_gmres(
    coupled: CoupledSystem,
    gradient: Vector,
    weights: Vector,
    tolerance: float,
    max_iterations: int,
    enough: Enough | None = None,
) -> FaceStep:
    """Solve (Wᵀ F Z + κ) δ = −g + (G W)ᵀ α with G Z δ = 0. Collective.

    Right preconditioned, without restart, in the norm ‖weights · r‖ of the projected residual, which is
    minimised and compared with the tolerance.

    `gradient`: g = Wᵀ(F λ − d) + κ y at the starting point, shape (n_face,), owned; `weights`: positive
    weights, shape (n_face,), owned; `enough`: ends the iteration before the tolerance is reached.

    Returns the step in face coordinates (the multiplier moves by Z δ) and why the iteration ended.

    References:
        Y. Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), algorithms 6.9 and 9.5.
    """
    comm, operator = coupled.system.comm, coupled.system.operator

    def expand(vector: Vector) -> tuple[Vector, Kept]:
        direction = coupled.precondition(vector / weights)
        full = operator(coupled.moving @ direction)
        return weights * coupled.image(direction, full), (direction, full)

    def both(found: Krylov) -> tuple[Vector, Vector]:
        return found.combined(0, len(gradient)), found.combined(1, coupled.moving.shape[0])

    ends = None if enough is None else lambda found: enough(*both(found), found.residual)
    first = -weights * coupled.oblique(gradient)
    found = gmres(comm, first, expand, tolerance, max_iterations, coupled.system.patience, ends)
    step, product = both(found)
    residual = coupled.oblique(gradient + coupled.operate(step, product))
    left = float(np.sqrt(global_sum(comm, (weights * residual) @ (weights * residual))[0]))
    stop = found.stop
    if stop is Stop.CONVERGED and left > 10.0 * tolerance:
        # The recursion has lost accuracy: rounding was taken for the image of a direction that has none.
        stop = Stop.NO_CURVATURE
    return FaceStep(step, product, residual, found.iterations, max(left, found.residual), stop)


#: What is kept of each direction of GMRES: vectors whose combination is the solution.
Kept: TypeAlias = tuple[Vector, ...]


@dataclass(frozen=True, eq=False)
class Krylov:
    """The outcome of GMRES: factors of the directions, and what was kept of each."""

    factors: Vector
    kept: tuple[Kept, ...]
    residual: float
    stop: Stop

    @property
    def iterations(self) -> int:
        """Number of directions."""
        return len(self.kept)

    def combined(self, kind: int, length: int) -> Vector:
        """Return the sum of factor times vector, of one kind of vectors of a given length."""
        total = np.zeros(length)
        for factor, vectors in zip(self.factors, self.kept, strict=True):  # without a copy of them all
            total += factor * vectors[kind]
        return total


def gmres(
    comm: MPI.Comm,
    first: Vector,
    expand: Callable[[Vector], tuple[Vector, Kept]],
    tolerance: float,
    max_iterations: int,
    patience: int,
    enough: Callable[[Krylov], bool] | None = None,
    asked_every: int = 4,
) -> Krylov:
    """Combine directions whose images sum up to ``first``, by GMRES without restart. Collective.

    `enough`: ends the iteration before the tolerance is reached, asked every few iterations.
    """
    size = float(np.sqrt(global_sum(comm, first @ first)[0]))
    basis, kept, small, stop = _Rows(len(first)), list[Kept](), _LeastSquares(size), Stop.CONVERGED
    vector: Vector = np.asarray(first / (size or 1.0), dtype=np.float64)
    while not small.residual <= tolerance:
        if basis.count == max_iterations:
            stop = Stop.ITERATION_LIMIT
            break
        image, vectors = expand(vector)
        basis.append(vector)
        kept.append(vectors)
        image, column = _orthogonalised(comm, basis, image)
        small.append(column)
        if basis.count - small.last_progress > patience:
            stop = Stop.STAGNATION
            break
        if column[-1] == 0.0:
            # The Krylov space is exhausted: the remainder lies outside the operator's range.
            stop = Stop.CONVERGED if small.residual <= tolerance else Stop.NO_CURVATURE
            break
        if enough is not None and basis.count % asked_every == 0 and small.residual > tolerance:
            if enough(Krylov(small.solution(), tuple(kept), small.residual, stop)):
                stop = Stop.ENOUGH
                break
        vector = image / column[-1]
    return Krylov(small.solution(), tuple(kept), small.residual, stop)


def _orthogonalised(comm: MPI.Comm, basis: _Rows, image: Vector) -> tuple[Vector, Vector]:
    """Subtract the components along the basis, twice, and return the rest with the Hessenberg column."""
    coefficients = np.zeros(basis.count)
    for _ in range(2):
        correction = global_sum(comm, basis.dot(0, image))
        image = image - basis.combined(0, correction)
        coefficients += correction
    length = np.sqrt(global_sum(comm, image @ image))
    return image, np.concatenate([coefficients, length])


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
        # A direction without an image leaves the residual unchanged: its row is swapped with the rest.
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
        # A vanishing pivot belongs to a direction in the operator's kernel; it is left out.
        return np.asarray(np.linalg.lstsq(triangle, np.array(self._right[:size]), rcond=None)[0])
