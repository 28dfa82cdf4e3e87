"""Bodies that contact could hold, but at which no force acts: where they rest, and how they may move.

Where contact carries no force any distance will do, and the iteration would decide. Such bodies go back to
the distances and slips at which they were before anything moved, as far as they then do not overlap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.linalg

from fenics_contact._base.sparse import ROUNDING
from fenics_contact.qp.problem import NO_COMPLIANT_ROWS, DualProblem
from fenics_contact.qp.reductions import Vector, global_max
from fenics_contact.qp.rigid_motions import RigidMotionCorrection

#: Normal forces below this part of all forces are none.
LEAST_FORCE = 1e-10


@dataclass(frozen=True, eq=False)
class LooseMotions:
    """Motions of bodies that no force resists, but contact without a force might.

    `motions`: orthonormal coefficients, shape (m, k), replicated; `rows`: by how much each closes the contact
    rows without a force, of all ranks, shape (n, k), [length]; `distance`: gaps, and slips as they are in
    tangential rows; `given`: the same before anything moves.
    """

    motions: Vector
    rows: Vector
    distance: Vector
    given: Vector
    normal: npt.NDArray[np.bool_]
    size: float

    @classmethod
    def of(cls, problem: DualProblem, multiplier: Vector, residual: Vector) -> LooseMotions:
        """Return those of a multiplier and r, owned. Collective."""
        nothing, marks = np.zeros(0), np.zeros(0, dtype=bool)
        none = cls(np.zeros((problem.coarse.m, 0)), np.zeros((0, 0)), nothing, nothing, marks, 0.0)
        if problem.given is None:
            return none
        held_alike = replace(problem, compliant=NO_COMPLIANT_ROWS)  # rows that give way hold, too
        correction = RigidMotionCorrection.build(held_alike)
        if correction.motions.shape[1] == 0:
            return none
        layout, comm = problem.layout, problem.comm
        pressed = multiplier[layout.normal] > LEAST_FORCE * problem.norm(multiplier)
        carried = np.zeros(layout.size, dtype=bool)
        carried[layout.normal] = pressed
        bound, size = problem.law.bound(multiplier), np.linalg.norm(multiplier[layout.tangential], axis=1)
        carried[layout.tangential] = ((bound > 0.0) & (size < bound * (1.0 - 1e-9)))[:, None]
        free = _unresisted(comm.allreduce(correction.rows[carried].T @ correction.rows[carried]))
        if free.shape[1] == 0:
            return none
        contact = layout.contact
        idle = contact[~carried[contact] & ~problem.between_supports[contact]]
        normal = np.zeros(layout.size, dtype=bool)
        normal[layout.normal] = True
        rows = correction.rows @ free
        mine = rows[idle], residual[idle], problem.given[idle], normal[idle]
        parts = zip(*comm.allgather(mine), strict=True)
        rows, distance, given, marks = (np.concatenate(part) for part in parts)
        reach = max(np.abs(distance).max(initial=0.0), np.abs(given).max(initial=0.0))
        scale = global_max(comm, float(np.abs(problem.rhs).max(initial=0.0)))
        return cls(correction.motions @ free, rows, distance, given, marks, max(float(reach), scale))

    def settled(self) -> Vector | None:
        """Return the motion to where bodies were, shape (m,), without overlap; None if that is not possible.

        By least squares of what changes in the rows, under the gaps as constraints.

        References:
            C. L. Lawson, R. J. Hanson, Solving least squares problems, SIAM (1995), chapter 23.
        """
        wanted = np.where(self.normal, np.maximum(self.given, 0.0), self.given)
        scale = max(self.size, float(np.finfo(float).tiny))
        # Open by rounding: what touches without a force is not closed by chance.
        least, change = ROUNDING * scale * self.normal, self.distance - wanted
        if (np.abs(change) <= least.max(initial=0.0)).all():
            return None
        left, size, right = np.linalg.svd(self.rows, full_matrices=False)
        kept = size > ROUNDING * size.max(initial=0.0)
        left, back = left[:, kept], right[kept].T / size[kept]
        aim = left.T @ (change - least)
        room = (self.distance - least - left @ aim)[self.normal]
        if (room >= -0.5 * ROUNDING * scale).all():
            return np.asarray(self.motions @ (back @ aim))
        from scipy.optimize import nnls  # only where bodies overlap that no force holds apart

        matrix = np.vstack([-left[self.normal].T, -room[None] / scale])
        target = np.append(np.zeros(len(aim)), 1.0)
        push, _ = nnls(matrix, target, maxiter=30 * matrix.shape[1])
        rest = target - matrix @ push
        if rest[-1] <= ROUNDING:
            return None  # bodies overlap wherever they are
        return np.asarray(self.motions @ (back @ (aim - scale * rest[:-1] / rest[-1])))

    def opening(self, near: float = 1e-6) -> Vector:
        """Return motions that open or close contact that touches without a force, shape (m, n)."""
        touching = self.normal & (np.abs(self.distance) <= near * self.size)
        _, size, ways = np.linalg.svd(self.rows[touching], full_matrices=False)
        ways = ways[size > 1e-9 * size.max(initial=0.0)].T
        if ways.shape[1] == 0:
            return self.motions @ ways
        # Each in terms of a mode of its own, for words, and outwards.
        found = self.motions @ ways
        order = scipy.linalg.qr(found.T, mode="r", pivoting=True)[-1]
        ways = ways @ np.linalg.inv(found[order[: found.shape[1]]])
        closing = (self.rows[touching] @ ways).sum(axis=0)
        return np.asarray(self.motions @ (ways * np.where(closing > 0.0, -1.0, 1.0)))


def _unresisted(gram: Vector, least: float = 1e-10) -> Vector:
    """Return an orthonormal basis of what rows with this Gram matrix do not resist, shape (k, n)."""
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(vectors[:, values <= least * max(float(values.max(initial=0.0)), 0.0)])
