"""Rows of a face that contradict each other: forces on them deform nothing, and one of them must give way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_contact.linalg import ROUNDING
from fenics_contact.qp.face import Face
from fenics_contact.qp.face_system import FaceSystem
from fenics_contact.qp.problem import DualProblem, RowsOfFace
from fenics_contact.qp.reductions import Vector, global_least
from fenics_contact.qp.rigid_motions import NEARLY


@dataclass(frozen=True, eq=False)
class Contradiction:
    """What rows demand of each other where B_Fᵀ N = 0: a node that sticks to a floor and meets a wall.

    There Nᵀr is the same for all multipliers of the face, and zero only where the rows agree. The dual
    objective falls without end along −N Nᵀr: forces grow until a disc slips or a contact opens.

    Attributes:
        excess: The part of the residual on the face that no multiplier changes, shape (n_face,), owned.
        direction: Change of the multiplier that lowers the objective and deforms nothing, owned.
        group: Rows with the same number ≥ 0 are coupled, others are not; shape (n_owned,).
        n_groups: Number of groups on all ranks.
    """

    excess: Vector
    direction: Vector
    group: npt.NDArray[np.int64]
    n_groups: int

    def relieved(self, problem: DualProblem, face: Face, multiplier: Vector, trial: Vector) -> Vector:
        """Return the multiplier with each group moved until the first of its contacts changes. Collective.

        Args:
            problem: The dual problem.
            face: The face.
            multiplier: λ, owned.
            trial: w = λ − ρ r, owned, by which contacts are classified.
        """
        layout, moved, law = problem.layout, self.direction, problem.law
        longest = np.full(self.n_groups, np.inf)
        closed, discs = layout.normal[face.closed], layout.tangential[face.stick]
        pressing = law.growth[face.stick] * moved[layout.tangential_frictional[face.stick]]
        slipping = _until_slip(trial[discs], moved[discs], law.bound(multiplier)[face.stick], pressing)
        opening = _until_open(trial[closed], moved[closed])
        for rows, length in ((closed, opening), *((component, slipping) for component in discs.T)):
            coupled = self.group[rows] >= 0
            np.minimum.at(longest, self.group[rows[coupled]], length[coupled])
        longest = global_least(problem.comm, longest)
        part = np.append(np.where(np.isfinite(longest), longest * (1.0 + ROUNDING), 0.0), 0.0)
        return np.asarray(multiplier + part[self.group] * moved)


def contradiction(problem: DualProblem, system: FaceSystem, gradient: Vector) -> Contradiction | None:
    """Return what no multiplier of a face changes in a residual; None where that is nothing. Collective.

    Args:
        problem: The dual problem.
        system: The system of the face.
        gradient: The residual on the face, shape (n_face,), owned.
    """
    face, rows = system.face, system.preconditioner
    if not isinstance(rows, RowsOfFace):
        return None
    found = rows.contradiction(face.prolong(gradient))
    if found is None:
        return None
    excess, direction, group, count = found
    if problem.coarse.norm(problem.coarse.apply(direction)) > NEARLY * problem.norm(direction):
        return None  # forces that deform nothing may still push rigid surfaces that move freely
    return Contradiction(face.restrict(excess), direction, group, count)


def _until_open(trial: Vector, moved: Vector) -> Vector:
    """Return t ≥ 0 with w + t v = 0 for normal forces, infinite where they grow."""
    falls = moved < 0.0
    return np.where(falls, np.maximum(trial, 0.0) / np.where(falls, -moved, 1.0), np.inf)


def _until_slip(trial: Vector, moved: Vector, bound: Vector, pressing: Vector) -> Vector:
    """Return the least t ≥ 0 with ‖w + t v‖ = Ψ + t ψ for discs, infinite where there is none.

    Args:
        trial: w, shape (n, t).
        moved: v, shape (n, t).
        bound: Ψ, shape (n,).
        pressing: ψ, by which the bound grows, shape (n,).
    """
    a = np.einsum("ia,ia->i", moved, moved) - pressing**2
    b = np.einsum("ia,ia->i", trial, moved) - bound * pressing
    c = np.minimum(np.einsum("ia,ia->i", trial, trial) - bound**2, 0.0)
    root = b * b - a * c
    divisor = b + np.sqrt(np.maximum(root, 0.0))
    meets = (root >= 0.0) & (divisor > 0.0)
    return np.where(meets, -c / np.where(meets, divisor, 1.0), np.inf)
