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

    `step`: δ on the face with G Z δ = 0, owned; `product`: F Z δ, owned, updated by recursion; `residual`:
    P_F (g + (Zᵀ F Z + κ) δ), owned, updated by recursion; `measure`: weighted norm of `residual`, the
    quantity compared with the tolerance.
    """

    step: Vector
    product: Vector
    residual: Vector
    iterations: int
    measure: float
    stop: Stop


#: Whether a step is accurate enough, from δ, F Z δ and its measure: more may be missing than the face knows.
Enough: TypeAlias = Callable[[Callable[[], tuple[Vector, Vector]], float], bool]


def never(*_: object) -> bool:
    """Return that a step is not accurate enough before its measure is."""
    return False


class _Rows:
    """Growing sets of vectors, one for each kind, in blocks that are never copied: they fill the memory.

    In single precision each is stored over its largest entry, as the range does not suffice for all units.
    """

    def __init__(self, rows: int = 16, *, single: bool = False) -> None:
        """Start empty; `rows` are those of a block, `single` stores them in single precision."""
        self.count = 0
        self._rows, self._type = rows, np.float32 if single else np.float64
        self._blocks: list[list[np.ndarray]] = []
        self._scales: list[Vector] = []

    def append(self, *rows: Vector) -> None:
        """Append one vector of each kind, each of the length that those of its kind have on this rank."""
        number, place = divmod(self.count, self._rows)
        if place == 0:
            self._blocks.append([np.zeros((self._rows, len(row)), dtype=self._type) for row in rows])
        scales = np.ones(len(rows))
        if self._type is np.float32:
            sizes = np.array([np.abs(row).max(initial=0.0) for row in rows])
            scales[sizes > 0.0] = sizes[sizes > 0.0]
        for block, row, scale in zip(self._blocks[number], rows, scales, strict=True):
            np.divide(row, scale, out=block[place], casting="same_kind")
        self._scales.append(scales)
        self.count += 1

    def dot(self, kind: int, vector: Vector) -> Vector:
        """Return this rank's products of all vectors of a kind with one, shape (count,)."""
        given, scale = self._rounded(vector)
        parts = [np.zeros(0), *(block[kind] @ given for block in self._blocks)]
        products = np.concatenate(parts)[: self.count]
        return products * (scale * np.array([scales[kind] for scales in self._scales]))

    def combined(self, kind: int, factors: Vector) -> Vector:
        """Return the sum of factor times vector over the first vectors of a kind, one for each factor."""
        scales = np.array([scales[kind] for scales in self._scales[: len(factors)]])
        given, scale = self._rounded(factors * scales)
        total = np.zeros(self._blocks[0][kind].shape[1] if self._blocks else 0)
        for number, block in enumerate(self._blocks):
            part = given[number * self._rows : (number + 1) * self._rows]
            total += part @ block[kind][: len(part)]
        return total if scale == 1.0 else scale * total

    def _rounded(self, vector: Vector) -> tuple[np.ndarray, float]:
        """Return a vector in the precision of the rows, over a scale, and the scale."""
        if self._type is np.float64:
            return vector, 1.0
        scale = float(np.abs(vector).max(initial=0.0)) or 1.0
        return (vector / scale).astype(np.float32), scale


def projected_cg(
    system: FaceSystem,
    gradient: Vector,
    weights: Vector,
    tolerance: float,
    max_iterations: int,
    enough: Enough = never,
    asked_every: int = 4,
) -> FaceStep:
    """Minimise ½ δᵀA δ + gᵀδ over G Z δ = 0 with A = Zᵀ F Z + κ. Collective.

    Each iteration applies F once, the preconditioner once, and combines its sums in three messages: the
    coarse right side and all conjugation coefficients of the new direction in the first, those of its product
    in the second, the norm of the residual in the third. Conjugation against all previous directions is two
    matrix–vector products. Returns the step and why the iteration ended; nothing is raised, the caller
    decides what a failure means. `gradient`: g = Zᵀ(F λ − d) + κ y at the starting point, owned; `weights`:
    positive weights of the stopping norm ‖weights · P_F(g + A δ)‖, owned; `enough`: ends the iteration before
    the tolerance is reached, asked every few iterations.

    References:
        C. Farhat, F.-X. Roux, A method of finite element tearing and interconnecting and its parallel
        solution algorithm, IJNME 32 (1991).
    """
    residual = system.coarse.project(gradient)
    step, product = np.zeros_like(gradient), np.zeros(system.face.layout.size)
    # Directions p and images P A p, and their curvatures pᵀA p.
    rows, curvatures = _Rows(single=system.single), list[float]()
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
        if asked and enough(lambda: (step, product), size):
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
    if rows.count:
        projected = projected - rows.combined(0, sums[m:-1] / np.array(curvatures))
    return -projected, float(sums[-1])


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
    enough: Enough = never,
    *,
    restart_at: float = 1e-5,
    longest: int = 40,
) -> FaceStep:
    """Solve (Wᵀ F Z + κ) δ = −g + (G W)ᵀ α with G Z δ = 0. Collective.

    Right preconditioned, in the norm ‖weights · r‖ of the projected residual, which is minimised and compared
    with the tolerance. Without restart, but where memory is short and directions are stored in single
    precision: there after some of them, and at each residual that their rounding would reach. Returns the
    step in face coordinates (the multiplier moves by Z δ) and why the iteration ended. `gradient`: g = Wᵀ(F λ
    − d) + κ y at the starting point, owned; `weights`: positive weights, owned; `enough`: ends the iteration
    before the tolerance is reached; `restart_at`: residual at which a restart begins, relative to the one
    before; `longest`: directions.

    References:
        Y. Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), algorithms 6.9 and 9.5.
    """
    step, product = np.zeros(len(gradient)), np.zeros(coupled.moving.shape[0])
    residual, iterations, size = coupled.oblique(gradient), 0, 0.0
    while True:
        first, goal, most = -weights * residual, tolerance, max_iterations - iterations
        if coupled.system.single:
            size = float(np.sqrt(global_sum(coupled.system.comm, first @ first)[0]))
            goal, most = max(tolerance, restart_at * size), min(most, longest)
        found, step, product = _krylov_step(coupled, first, weights, goal, most, (step, product), enough)
        iterations += found.iterations
        residual = coupled.oblique(gradient + coupled.operate(step, product))
        weighted = weights * residual
        left = float(np.sqrt(global_sum(coupled.system.comm, weighted @ weighted)[0]))
        restarts = found.stop is Stop.CONVERGED and goal > tolerance
        restarts = restarts or (found.stop is Stop.ITERATION_LIMIT and iterations < max_iterations)
        if not (coupled.system.single and restarts and left <= 0.9 * size):
            break
    stop = found.stop
    if stop is Stop.ITERATION_LIMIT and restarts:
        stop = Stop.STAGNATION
    if stop is Stop.CONVERGED and left > 10.0 * tolerance:
        # The recursion has lost accuracy: rounding was taken for the image of a direction that has none.
        stop = Stop.NO_CURVATURE
    return FaceStep(step, product, residual, iterations, max(left, found.residual), stop)


def _krylov_step(
    coupled: CoupledSystem,
    first: Vector,
    weights: Vector,
    tolerance: float,
    max_iterations: int,
    before: tuple[Vector, Vector],
    enough: Enough,
) -> tuple[Krylov, Vector, Vector]:
    """Return the Krylov space of a weighted residual, and a step and its product with what is added to them.

    Collective.
    """
    system, operator = coupled.system, coupled.system.operator

    def expand(vector: Vector) -> tuple[Vector, Kept]:
        direction = coupled.precondition(vector / weights)
        full = operator(coupled.moving @ direction)
        return weights * coupled.image(direction, full), (direction, full)

    def both(found: Krylov) -> tuple[Vector, Vector]:
        step, product = (found.combined(kind, len(vector)) for kind, vector in enumerate(before))
        if system.single:  # directions are in equilibrium up to their rounding
            step = coupled.balanced(step, np.zeros(coupled.oblique.moving.m))
        return before[0] + step, before[1] + product

    def ends(found: Callable[[], Krylov], size: float) -> bool:
        return enough(lambda: both(found()), size)

    single, patience = system.single, system.patience
    found = gmres(system.comm, first, expand, tolerance, max_iterations, patience, ends, single=single)
    return found, *both(found)


#: What is kept of each direction of GMRES: vectors whose combination is the solution.
Kept: TypeAlias = tuple[Vector, ...]


@dataclass(frozen=True, eq=False)
class Krylov:
    """The outcome of GMRES: factors of the directions, and what was kept of each."""

    factors: Vector
    kept: _Rows
    residual: float
    stop: Stop

    @property
    def iterations(self) -> int:
        """Number of directions."""
        return len(self.factors)

    def combined(self, kind: int, length: int) -> Vector:
        """Return the sum of factor times vector, of one kind of vectors of a given length."""
        return self.kept.combined(kind, self.factors) if len(self.factors) else np.zeros(length)


def gmres(
    comm: MPI.Comm,
    first: Vector,
    expand: Callable[[Vector], tuple[Vector, Kept]],
    tolerance: float,
    max_iterations: int,
    patience: int,
    enough: Callable[[Callable[[], Krylov], float], bool] = never,
    asked_every: int = 4,
    *,
    single: bool = False,
) -> Krylov:
    """Combine directions whose images sum up to ``first``, by GMRES without restart. Collective.

    `enough`: ends the iteration before the tolerance is reached, asked every few iterations; `single`: stores
    directions in single precision, where images have no more.
    """
    size = float(np.sqrt(global_sum(comm, first @ first)[0]))
    basis, kept = _Rows(single=single), _Rows(single=single)
    small, stop = _LeastSquares(size), Stop.CONVERGED
    vector: Vector = np.asarray(first / (size or 1.0), dtype=np.float64)
    while not small.residual <= tolerance:
        if basis.count == max_iterations:
            stop = Stop.ITERATION_LIMIT
            break
        image, vectors = expand(vector)
        basis.append(vector)
        kept.append(*vectors)
        image, column = _orthogonalised(comm, basis, image)
        small.append(column)
        if basis.count - small.last_progress > patience:
            stop = Stop.STAGNATION
            break
        if column[-1] == 0.0:
            # The Krylov space is exhausted: the remainder lies outside the operator's range.
            stop = Stop.CONVERGED if small.residual <= tolerance else Stop.NO_CURVATURE
            break
        asked = basis.count % asked_every == 0 and small.residual > tolerance
        if asked and enough(lambda: Krylov(small.solution(), kept, small.residual, stop), small.residual):
            stop = Stop.ENOUGH
            break
        vector = image / column[-1]
    return Krylov(small.solution(), kept, small.residual, stop)


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
