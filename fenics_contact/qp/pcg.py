"""Projected preconditioned conjugate gradients on a face, with full reorthogonalisation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from fenics_contact.qp.face_system import FaceSystem
from fenics_contact.qp.reductions import Vector, global_sum

CURVATURE_TOLERANCE = 1e-14
DIVERGENCE_FACTOR = 1e6


class Stop(Enum):
    """Why the inner iteration ended."""

    CONVERGED = "converged"
    ITERATION_LIMIT = "iteration limit"
    NO_CURVATURE = "direction without curvature: the operator is singular on this face"
    BAD_PRECONDITIONER = "preconditioner is not positive"
    STAGNATION = "stagnation: rounding has eaten the residual"
    DIVERGENCE = "divergence: the system is inconsistent or nearly so"


@dataclass(frozen=True, eq=False)
class FaceStep:
    """The answer of an inner solver on a face.

    Attributes:
        step: δ on the face with G Z δ = 0, shape (n_face,), owned.
        product: F Z δ, owned, carried by recursion.
        residual: P_F (g + (Zᵀ F Z + κ) δ), shape (n_face,), owned, carried by recursion.
        iterations: Number of operator applications.
        measure: Weighted norm of `residual`, the quantity compared with the tolerance.
        stop: Why the iteration ended.
    """

    step: Vector
    product: Vector
    residual: Vector
    iterations: int
    measure: float
    stop: Stop


class DirectionStore:
    """Directions p and projected products q = P A p as rows of two growing blocks."""

    def __init__(self, size: int) -> None:
        """Start empty for vectors of this rank's length ``size``."""
        self._p: Vector = np.empty((32, size))
        self._q: Vector = np.empty((32, size))
        self._curvature: Vector = np.empty(32)
        self._count = 0

    def append(self, p: Vector, q: Vector, curvature: float) -> None:
        """Keep p, q and pᵀq; storage doubles when full."""
        if self._count == len(self._p):
            self._p, self._q = (np.vstack([block, np.empty_like(block)]) for block in (self._p, self._q))
            self._curvature = np.concatenate([self._curvature, np.empty_like(self._curvature)])
        self._p[self._count], self._q[self._count] = p, q
        self._curvature[self._count] = curvature
        self._count += 1

    def local_products(self, y: Vector) -> Vector:
        """Return this rank's share of qᵢᵀ y for all i."""
        return self._q[: self._count] @ y

    def conjugate(self, y: Vector, products: Vector) -> Vector:
        """Subtract from y its components along all p, given the global qᵢᵀ y."""
        return y - (products / self._curvature[: self._count]) @ self._p[: self._count]


def projected_cg(
    system: FaceSystem, gradient: Vector, weights: Vector, tolerance: float, max_iterations: int
) -> FaceStep:
    """Minimise ½ δᵀA δ + gᵀδ over G Z δ = 0 with A = Zᵀ F Z + κ. Collective.

    Each iteration applies F once, the preconditioner once, and joins its sums in three messages: the
    coarse right side and all conjugation coefficients of the new direction in the first, those of its
    product in the second, the norm of the residual in the third. Conjugation against all previous
    directions is two matrix–vector products.

    Args:
        system: The face, its operator, coarse space and preconditioner.
        gradient: g = Zᵀ(F λ − d) + κ y at the starting point, shape (n_face,), owned.
        weights: Positive weights of the stopping norm ‖weights · P_F(g + A δ)‖, shape (n_face,), owned.
        tolerance: Stop when that norm is at most this.
        max_iterations: Largest number of operator applications.

    Returns:
        The step and why the iteration ended; nothing is raised, the caller knows what failure means.

    References:
        C. Farhat, F.-X. Roux, A method of finite element tearing and interconnecting and its parallel
        solution algorithm, IJNME 32 (1991).
    """
    residual = system.coarse.project(gradient)
    step, product = np.zeros_like(gradient), np.zeros(system.face.layout.size)
    store = DirectionStore(len(gradient))
    size = system.weighted_norm(residual, weights)
    first, best, since_best, iterations, stop = size, size, 0, 0, Stop.CONVERGED
    while not size <= tolerance:
        if iterations == max_iterations:
            stop = Stop.ITERATION_LIMIT
            break
        direction, descent = _next_direction(system, residual, store)
        if not descent > 0.0:
            stop = Stop.BAD_PRECONDITIONER
            break
        full = system.operator(system.face.prolong(direction))
        image, slope, curvature, smallest = _image(system, residual, direction, full)
        iterations += 1
        if not curvature > smallest:
            stop = Stop.NO_CURVATURE
            break
        store.append(direction, image, curvature)
        length = -slope / curvature
        step += length * direction
        product += length * full
        residual = residual + length * image
        size = system.weighted_norm(residual, weights)
        best, since_best = (size, 0) if size < 0.9 * best else (best, since_best + 1)
        if since_best > system.patience or not size <= DIVERGENCE_FACTOR * first:
            stop = Stop.STAGNATION if since_best > system.patience else Stop.DIVERGENCE
            break
    return FaceStep(step, product, residual, iterations, size, stop)


def _next_direction(system: FaceSystem, residual: Vector, store: DirectionStore) -> tuple[Vector, float]:
    """Return the new direction and its product with the residual, both of the sign that descends."""
    z = system.precondition(residual)
    m = system.coarse.m
    sums = global_sum(system.comm, system.coarse.local(z), store.local_products(z), residual @ z)
    projected = z - system.coarse.transpose(system.coarse.solve(sums[:m]))
    return -store.conjugate(projected, sums[m:-1]), float(sums[-1])


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
    return projected, slope, curvature, CURVATURE_TOLERANCE * float(lengths[0] * lengths[1])
