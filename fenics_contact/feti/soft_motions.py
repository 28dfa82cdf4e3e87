"""A coarse space of motions that are resisted, but little: of subdomains on foundations, springs, in rings.

Rings resist the radial motion of a small part and its turn in the section by hoop strains alone.

The matrix K of such a subdomain is regular, and the equilibrium G λ = e lacks its rigid motions R, whose
stiffness S = RᵀK R may be small: without a coarse space for them FETI is not scalable. With K⁺ of the
subdomain floating, F = F̃ + Gᵀ S⁻¹ G, and bonds with forces σ hold it in

    min ½ λᵀF̃ λ + ½ σᵀS⁻¹σ − dᵀλ   subject to   G λ + σ = e,

on which Dirichlet preconditioner and projector work as on any floating subdomains. Without σ, which G λ
gives, their product is a preconditioner of F itself. On a face, in multipliers σ / t with t² = ω f S, where f
is a typical flexibility of rows, with T = diag(t), and with W = (1 + ρκ)⁻¹ of rows that a curvature κ holds
and f / C of springs,

    a = Γ⁻¹ G W r,   y = M (r − Gᵀa),   b = Γ⁻¹ (G y − S a),   z = y − W Gᵀ b,   Γ = G W Gᵀ + T².

Motions without stiffness are among those of G, with S = 0: they keep their equilibrium, G z = 0. Where
friction grows with normal forces, the G in Γ and before r and y is that of the basis along which the step
moves, and Gᵀ that of the basis it is tested with.

References:
    C. Farhat, P.-S. Chen, J. Mandel, A scalable Lagrange multiplier based domain decomposition method for
    time-dependent problems, Int. J. Numer. Meth. Eng. 38 (1995) 3831-3853.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact.feti.kernel_basis import TornModes
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.coarse import CoarseSpace, SquareInverse, invert_square, summed_if_small
from fenics_contact.qp.face import Face
from fenics_contact.qp.problem import NO_SECOND_LEVEL, NoSecondLevel, Operator, SecondLevelOfFace
from fenics_contact.qp.reductions import global_max, global_sum

#: Residual after motions, owned, and the soft ones among these, shape (torn_size,).
Moved = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class NoSoftMotions(NoSecondLevel):
    """Without foundations there are none.

    `scaled`: the coarse space of scaled multipliers λ / s; `factor`: s, owned, or one; `size`: of torn
    vectors.
    """

    scaled: CoarseSpace
    factor: np.ndarray | float
    size: int
    count: ClassVar[int] = 0

    def coarse(self, restriction: sp.csr_matrix) -> CoarseSpace:
        """Return the coarse space of some scaled rows Z. Collective."""
        return self.scaled.restricted(restriction)

    def fitted(self, coarse: CoarseSpace, rows: sp.csr_matrix, residual: np.ndarray) -> Moved:
        """Return r after the motions of floating subdomains that close rows best, and zeros. Collective."""
        motion = coarse.fitted(rows.T @ (self.factor * residual))
        return residual - self.scaled.transpose(motion) / self.factor, np.zeros(self.size)

    def resultants(self, lacking: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return ``lacking`` as it is, see `SoftMotions`."""
        return lacking

    def balanced(
        self, multiplier: np.ndarray, rows: np.ndarray, missing: np.ndarray, left: np.ndarray
    ) -> np.ndarray:
        """Return a multiplier as it is, see `SoftMotions`."""
        return multiplier


@dataclass(frozen=True, eq=False)
class SoftMotions:
    """The soft motions of all subdomains, with those that float, in the scaled multipliers λ / s.

    `columns`: this rank's owned columns of G s, shape (m, n_owned); `stiffness`: S, zero of motions that
    float, shape (m,); `flexibility`: f; `factor`: s, owned, or one; `modes`: R of the soft ones; `weight`: w
    of rows, owned: forces that balance bodies belong into springs as little as these are stiff.
    """

    #: ω: by how much bonds of soft motions are more flexible than rows. Forces that cost little energy in
    #: bodies should not pass into stiff bonds: on firm beds 21 products with 10, 29 with 1, 22 with 100.
    more_flexible: ClassVar[float] = 10.0
    #: Motions this many times stiffer than rows hold the subdomain: they need no coarse space.
    firm: ClassVar[float] = 5.0

    comm: MPI.Comm
    columns: sp.csr_matrix
    stiffness: np.ndarray
    flexibility: float
    factor: np.ndarray | float
    modes: TornModes
    weight: np.ndarray

    @classmethod
    def of(
        cls,
        torn: TornSystem,
        floating: sp.csr_matrix,
        flexibility: float,
        factor: np.ndarray | float,
        weight: np.ndarray,
    ) -> SoftMotions:
        """Return those of a torn system, with this rank's columns of its equilibrium. Collective."""
        subdomains, numbering, comm = torn.subdomains, torn.numbering, torn.numbering.comm
        soft = [flexibility * each.resistance < cls.firm for each in subdomains]
        mine = {each.mesh.number: each.resistance[some] for each, some in zip(subdomains, soft, strict=True)}
        every = {number: own for part in comm.allgather(mine) for number, own in part.items()}
        numbers = sorted(every)
        first = np.cumsum([0, *(len(every[number]) for number in numbers)])
        start = dict(zip(numbers, first.tolist(), strict=False))
        column = np.concatenate(
            [np.zeros(0, int), *(start[n] + np.arange(len(own)) for n, own in mine.items())]
        )
        entries = np.ones(len(column)), (np.arange(len(column)), column)
        moved = TornModes(
            tuple(each.resisted[:, some] for each, some in zip(subdomains, soft, strict=True)),
            sp.csr_matrix(entries, shape=(len(column), int(first[-1]))),
        )
        columns = sp.vstack([floating, numbering.sum_rows(sp.csr_matrix(moved.moved_by(torn.B))).T])
        columns = (columns @ sp.diags(factor * np.ones(columns.shape[1]))).tocsr()
        stiffness = np.concatenate([np.zeros(floating.shape[0]), *(every[number] for number in numbers)])
        return cls(comm, columns, stiffness, flexibility, factor, moved, weight)

    @property
    def count(self) -> int:
        """Number of motions that are soft."""
        return int(np.count_nonzero(self.stiffness))

    @cached_property
    def needed(self) -> bool:
        """Whether there are soft motions or soft rows. Collective on first use."""
        return self.count > 0 or global_max(self.comm, 1.0 - self.weight.min(initial=1.0)) > 0.0

    def coarse(self, restriction: sp.csr_matrix) -> CoarseSpace:
        """Return G Z with the inverse of G Z ZᵀGᵀ + T². Collective; `restriction`: Z, of scaled rows."""
        columns = (self.columns @ restriction).tocsr()
        gram = summed_if_small(self.comm, self.bonded(columns @ columns.T))
        return CoarseSpace(self.comm, columns, np.zeros(len(self.stiffness)), gram=gram)

    def bonded(self, share: sp.spmatrix) -> sp.csr_matrix:
        """Return this rank's share of a matrix G Gᵀ with T²."""
        bonds = (self.comm.rank == 0) * self.more_flexible * self.flexibility * self.stiffness
        return (share + sp.diags(bonds)).tocsr()

    def on_face(self, face: Face) -> SecondLevelOfFace:
        """Return the second level of a face; without soft motions there is none. Collective."""
        if not self.needed:
            return NO_SECOND_LEVEL
        weight = face.damping**2 * (face.restriction.power(2).T @ self.weight)
        return SoftMotionsOfFace.build(self, weight, face.restriction, face.restriction)

    def fitted(self, coarse: CoarseSpace, rows: sp.csr_matrix, residual: np.ndarray) -> Moved:
        """Return r after the motions that close rows best, at the price of their energy. Collective.

        `rows`: basis of rows with weights, in scaled multipliers, shape (n_owned, k); `coarse`: that of them.
        """
        motion = coarse.fitted(rows.T @ (self.factor * residual))
        soft = motion[len(motion) - self.modes.shape[1] :]
        return residual - self.columns.T @ motion / self.factor, self.modes @ soft

    def resultants(self, lacking: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return G λ − e with the resultants of a change of λ, owned, on soft motions. Collective."""
        soft = self.columns[len(lacking) :] @ (change / self.factor)
        return np.concatenate([lacking, global_sum(self.comm, soft)])

    def balanced(
        self, multiplier: np.ndarray, rows: np.ndarray, missing: np.ndarray, left: np.ndarray
    ) -> np.ndarray:
        """Return a multiplier changed on some rows by what it leaves unbalanced on all motions. Collective.

        A small part of it would move subdomains far. `rows`: their numbers, owned; `missing`: e − G λ;
        `left`: forces without balance on this rank's torn dofs.
        """
        entries = np.ones(len(rows)), (rows, np.arange(len(rows)))
        free = sp.csr_matrix(entries, shape=(len(multiplier), len(rows)))
        coarse = self.coarse(free)
        wanted = np.concatenate([missing, global_sum(self.comm, self.modes.resultants(left))])
        return np.asarray(multiplier + self.factor * (free @ coarse.transpose(coarse.solve(wanted))))


@dataclass(frozen=True, eq=False)
class SoftMotionsOfFace:
    """The second level of a face. `weight`: W; `tested`, `moving`: G of both bases; `inverse`: of Γ."""

    motions: SoftMotions
    weight: np.ndarray
    tested: sp.csr_matrix
    moving: CoarseSpace
    inverse: SquareInverse

    @classmethod
    def build(
        cls, motions: SoftMotions, weight: np.ndarray, tested: sp.csr_matrix, moving: sp.csr_matrix
    ) -> SecondLevelOfFace:
        """Factor Γ; where it is singular, as bodies float, there is no second level. Collective."""
        columns = (motions.columns @ tested).tocsr()
        along = columns if moving is tested else (motions.columns @ moving).tocsr()
        coarse = CoarseSpace(motions.comm, along, np.zeros(len(motions.stiffness)))
        share = motions.bonded(along @ sp.diags(weight) @ columns.T)
        diagonal = global_sum(motions.comm, share.diagonal())
        scale = 1.0 / np.sqrt(np.maximum(np.abs(diagonal), np.finfo(float).tiny))
        inverse = invert_square(motions.comm, share, scale)
        return NO_SECOND_LEVEL if inverse is None else cls(motions, weight, columns, coarse, inverse)

    def along(self, tested: sp.csr_matrix, moving: sp.csr_matrix) -> SecondLevelOfFace:
        """Return that of two bases, with the damping of the face. Collective."""
        return self.build(self.motions, self.weight, tested, moving)

    def balancing(self, coarse: CoarseSpace, resultant: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return y of a face with G Z y = resultant that costs little energy. Collective.

        Forces of contacts that open would move soft subdomains far: y has the resultants of the change of λ.
        """
        soft = global_sum(self.motions.comm, self.motions.columns[len(resultant) :] @ change)
        return self.weight * (self.tested.T @ self.inverse.solve(np.concatenate([resultant, soft])))

    def __call__(self, inner: Operator, residual: np.ndarray) -> np.ndarray:
        """Return z. Collective."""
        given = self.inverse.solve(self.moving.apply(self.weight * residual))
        solved = inner(residual - self.tested.T @ given)
        left = self.inverse.solve(self.moving.apply(solved) - self.motions.stiffness * given)
        return np.asarray(solved - self.weight * (self.tested.T @ left))
