"""A coarse space of motions that are resisted, but little: those of subdomains on elastic foundations.

The matrix K of such a subdomain is regular, and the equilibrium G λ = e lacks its rigid motions R, whose
stiffness S = RᵀK R may be small: without a coarse space for them FETI is not scalable. With K⁺ of the
subdomain floating, F = F̃ + Gᵀ S⁻¹ G, and bonds with forces σ hold it in

    min ½ λᵀF̃ λ + ½ σᵀS⁻¹σ − dᵀλ   subject to   G λ + σ = e,

on which Dirichlet preconditioner and projector work as on any floating subdomains. Without σ, which G λ
gives, their product is a preconditioner of F itself. In multipliers σ / t with t² = ω f S, where f is a
typical flexibility of rows, and with T = diag(t),

    a = (G Gᵀ + T²)⁻¹ G r,   y = M (r − Gᵀa),   b = (G Gᵀ + T²)⁻¹ (G y − S a),   z = y − Gᵀ b.

Motions without stiffness are among those of G, with S = 0: they keep their equilibrium, G z = 0.

References:
    C. Farhat, P.-S. Chen, J. Mandel, A scalable Lagrange multiplier based domain decomposition method for
    time-dependent problems, Int. J. Numer. Meth. Eng. 38 (1995) 3831-3853.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact.feti.kernel_basis import TornModes
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.coarse import CoarseSpace, summed_if_small
from fenics_contact.qp.problem import Dependence, FacePreconditioner, RowsOfFace
from fenics_contact.qp.reductions import global_sum

#: Residual after motions, owned, and the soft ones among these, shape (torn_size,).
Moved = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class NoSoftMotions:
    """Without foundations there are none.

    `scaled`: the coarse space of scaled multipliers λ / s; `factor`: s, owned, or one; `size`: of torn
    vectors.
    """

    scaled: CoarseSpace
    factor: np.ndarray | float
    size: int
    count: ClassVar[int] = 0

    def preconditioner(self, inner: InnerPreconditioner) -> FacePreconditioner:
        """Return it as it is."""
        return inner

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


@dataclass(frozen=True, eq=False)
class SoftMotions:
    """The soft motions of all subdomains, with those that float, in the scaled multipliers λ / s.

    `columns`: this rank's owned columns of G s, shape (m, n_owned); `stiffness`: S, zero of motions that
    float, shape (m,); `flexibility`: f; `factor`: s, owned, or one; `modes`: R of the soft ones.
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

    @classmethod
    def of(
        cls,
        torn: TornSystem,
        floating: sp.csr_matrix,
        flexibility: float,
        factor: np.ndarray | float,
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
        return cls(comm, columns, stiffness, flexibility, factor, moved)

    @property
    def count(self) -> int:
        """Number of motions that are soft."""
        return int(np.count_nonzero(self.stiffness))

    def coarse(self, restriction: sp.csr_matrix) -> CoarseSpace:
        """Return G Z with the inverse of G Z ZᵀGᵀ + T². Collective; `restriction`: Z, of scaled rows."""
        columns = (self.columns @ restriction).tocsr()
        bonds = sp.diags((self.comm.rank == 0) * self.more_flexible * self.flexibility * self.stiffness)
        share = (columns @ columns.T + bonds).tocsr()  # each rank has its own
        gram = summed_if_small(self.comm, share)
        return CoarseSpace(self.comm, columns, np.zeros(len(self.stiffness)), gram=gram)

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

    def preconditioner(self, inner: InnerPreconditioner) -> FacePreconditioner:
        """Return a preconditioner of floating subdomains as one of these, itself without soft motions."""
        return TwoLevel(inner, self) if self.count else inner


class InnerPreconditioner(FacePreconditioner, Protocol):
    """A preconditioner whose faces know which of their rows depend on each other."""

    def on_face(self, restriction: sp.csr_matrix) -> RowsOfFace:
        """Return the preconditioner of the face with basis Z, shape (n_owned, n_face). Collective."""


@dataclass(frozen=True, eq=False)
class TwoLevel:
    """The preconditioner of all rows."""

    inner: InnerPreconditioner
    motions: SoftMotions

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return z, owned. Collective."""
        return self._everywhere(residual)

    @cached_property
    def _everywhere(self) -> TwoLevelOfFace:
        return self.on_face(sp.identity(self.motions.columns.shape[1], format="csr"))

    def on_face(self, restriction: sp.csr_matrix) -> TwoLevelOfFace:
        """Return the preconditioner of the face with basis Z, shape (n_owned, n_face). Collective."""
        inner, motions = self.inner.on_face(restriction), self.motions
        return TwoLevelOfFace(inner, motions, restriction, motions.coarse(restriction))


@dataclass(frozen=True, eq=False)
class TwoLevelOfFace:
    """The preconditioner of a face."""

    inner: RowsOfFace
    motions: SoftMotions
    restriction: sp.csr_matrix
    coarse: CoarseSpace

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return z, owned. Collective."""
        Z, coarse, s = self.restriction, self.coarse, self.motions.factor
        given = coarse.coefficients(Z.T @ (s * residual))
        solved = Z.T @ (self.inner(residual - Z @ coarse.transpose(given) / s) / s)
        left = coarse.solve(coarse.apply(solved) - self.motions.stiffness * given)
        return np.asarray(s * (Z @ (solved - coarse.transpose(left))))

    def contradiction(self, residual: np.ndarray) -> Dependence | None:
        """Return what no force on the face's rows changes, see `qp.RowsOfFace`. Collective."""
        return self.inner.contradiction(residual)
