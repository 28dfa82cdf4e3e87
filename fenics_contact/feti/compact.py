"""A subdomain as one triangle in single precision, for scenes that hardly fit into memory.

The Cholesky factor L of S + ρ Q Qᵀ serves both products with S and with its inverse; K, its factor on the
inside and products in double precision are made again where they are needed, for one subdomain at a time.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from fenics_contact._base.memory import return_memory
from fenics_contact._scene.memory import Rates
from fenics_contact.feti.condensation import pieces, regular_factor
from fenics_contact.feti.factor import Factor
from fenics_contact.feti.subdomain import Subdomain


class Inside:
    """What condenses one subdomain in double precision: its stiffness by blocks, with factors of K_ii."""

    def __init__(self, subdomain: Subdomain, interface: np.ndarray) -> None:
        """Assemble and factor; the stiffness is not kept where it was not there before."""
        held = subdomain.matrix.held
        stiffness = subdomain.stiffness
        self.dofs = np.setdiff1d(np.arange(subdomain.mesh.size), interface, assume_unique=True)
        rows = stiffness[self.dofs]
        self._K_ib, self.K_bb = rows[:, interface].tocsr(), stiffness[interface][:, interface].tocsr()
        self._factor = Factor.of_stiffness(rows[:, self.dofs].tocsr())
        if not held:
            subdomain.matrix.forget()

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return K_ii⁻¹ times a vector on the inside."""
        solution = np.zeros_like(right)
        if right.any():
            self._factor.solve(right, solution)
        return solution

    def pulled(self, displacement: np.ndarray) -> np.ndarray:
        """Return K_ib times an interface displacement."""
        return np.asarray(self._K_ib @ displacement)

    def passed(self, inner: np.ndarray) -> np.ndarray:
        """Return K_bi times a displacement of the inside."""
        return np.asarray(self._K_ib.T @ inner)

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return −K_ii⁻¹ K_ib w and S w for an interface displacement w."""
        inner = -self.solve(self.pulled(displacement))
        return inner, self.K_bb @ displacement + self.passed(inner)


class Insides:
    """Makes what is inside of subdomains, and keeps that of the last one: the next call is often the same."""

    def __init__(self) -> None:
        """Start empty."""
        self._last: tuple[CompactOperator, Inside] | None = None
        self.made = 0

    def of(self, operator: CompactOperator) -> Inside:
        """Return the inside of an operator's subdomain."""
        if self._last is None or self._last[0] is not operator:
            self._last = None  # before the next one is made
            self._last = operator, operator.make_inside()
            self.made += 1
            if self.made % 32 == 0:
                return_memory()
        return self._last[1]


class CompactOperator:
    """(K⁺)_bb = (L Lᵀ)⁻¹ and S = P L Lᵀ P by one packed triangle in single precision, P = I − Q Qᵀ.

    A third of the memory of S and its inverse as triangles in single and double precision, without factors of
    the inside. A product with S and two substitutions read it twice each, as many bytes as the inverse in
    double precision. `apply_flexibility_exactly` and all that is done once are in double precision, by
    refinement:

        u ← u + (L Lᵀ)⁻¹ (f − (S + ρ Q Qᵀ) u),

    with S by the sparse stiffness and the factor of its inside, which are made again for it. `pays_from`:
    number of subdomains from which one product of matrices is faster; `contracts`: whether refinement
    converges; not where S is too ill-conditioned for single precision.
    """

    pays_from = Rates.whole  # what the plan counts with

    def __init__(
        self,
        subdomain: Subdomain,
        interface: np.ndarray,
        schur: np.ndarray,
        insides: Insides,
        least_contraction: float = 0.1,
    ) -> None:
        """Factor a Schur complement, shape (n_b, n_b), which is overwritten.

        `least_contraction`: what a refinement may leave of a residual.
        """
        self._subdomain, self._interface, self._insides = subdomain, interface, insides
        self._size, typical = len(interface), subdomain.typical_stiffness
        factor, modes, self._rho, _ = regular_factor(schur, subdomain.kernel[interface], typical)
        self._modes = modes.astype(np.float32)
        self._unit = float(np.square(factor.diagonal()).max())
        factor /= np.sqrt(self._unit)
        self._lower, _ = lapack.strttp(factor.astype(np.float32, order="F"), uplo="L")
        self.contracts = self._contraction(factor) < least_contraction

    def _contraction(self, factor: np.ndarray) -> float:
        """Return what one refinement leaves of a residual, by the factor in double precision."""
        force = np.random.default_rng(0).standard_normal(self._size)
        moved = self._unit * self._substituted(force)
        back = blas.dtrmv(factor, blas.dtrmv(factor, moved, lower=1, trans=1), lower=1)
        return float(np.linalg.norm(force - back) / np.linalg.norm(force))

    @property
    def nbytes(self) -> int:
        """Bytes that are held."""
        return self._lower.nbytes + self._modes.nbytes + self._interface.nbytes

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `apply_flexibility` and of `apply_stiffness`."""
        return 2 * self._size**2, 2 * self._size**2

    @property
    def interface_stiffness(self) -> sp.csr_matrix:
        """K_bb, shape (n_b, n_b), assembled again."""
        return self._insides.of(self).K_bb

    def make_inside(self) -> Inside:
        """Assemble and factor what is inside."""
        return Inside(self._subdomain, self._interface)

    def apply_flexibility(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb, in single precision, times an interface force into ``displacement``."""
        displacement[:] = self._substituted(force)

    def _substituted(self, force: np.ndarray) -> np.ndarray:
        """Return (L Lᵀ)⁻¹ f."""
        if self._lower.ndim == 2:
            return np.asarray(self.apply_flexibility_to_all(force[None])[0])
        scaled, scale, usual = _scaled(force[None])
        if not usual[0]:
            return np.full(self._size, scale[0, 0])
        half = blas.stpsv(self._size, self._lower, scaled[0], lower=1, overwrite_x=1)
        moved = blas.stpsv(self._size, self._lower, half, lower=1, trans=1, overwrite_x=1)
        return np.asarray(moved * (scale[0] / self._unit))

    def apply_flexibility_exactly(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force in double precision, by refinement."""
        displacement[:] = self._refined(self._insides.of(self), force)

    def _refined(self, inside: Inside, force: np.ndarray, enough: float = 1e-14) -> np.ndarray:
        modes, _ = np.linalg.qr(self._subdomain.kernel[self._interface])
        moved, rest, size = np.zeros(self._size), force, float(np.linalg.norm(force))
        left = size
        while left > enough * size:
            moved = moved + self._substituted(rest)
            rest = force - inside.extend(moved)[1] - self._rho * (modes @ (modes.T @ moved))
            before, left = left, float(np.linalg.norm(rest))
            if not left < 0.5 * before:
                break
        return moved

    def share(self) -> None:
        """Store a whole matrix from now on."""
        if self._lower.ndim == 1:
            self._lower = lapack.stpttr(self._size, self._lower, uplo="L")[0]

    def apply_flexibility_to_all(self, forces: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times interface forces of several subdomains alike, the rows, shape (k, n_b)."""
        scaled, scale, usual = _scaled(forces)
        half = blas.strsm(1.0, self._lower, scaled.T, lower=1)
        moved = blas.strsm(1.0, self._lower, half, lower=1, trans_a=1, overwrite_b=1).T * (scale / self._unit)
        return np.where(usual[:, None], moved, scale)

    def apply_stiffness(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, in single precision, times an interface displacement into ``force``."""
        if self._lower.ndim == 2:
            force[:] = self.apply_stiffness_to_all(displacement[None])[0]
            return
        scaled, scale, usual = _scaled(displacement[None])
        if not usual[0]:
            force[:] = scale[0]
            return
        bent = scaled[0] - self._modes @ (self._modes.T @ scaled[0])
        half = blas.stpmv(self._size, self._lower, bent, lower=1, trans=1, overwrite_x=1)
        moved = blas.stpmv(self._size, self._lower, half, lower=1, overwrite_x=1)
        force[:] = (moved - self._modes @ (self._modes.T @ moved)) * (self._unit * scale[0])

    def apply_stiffness_to_all(self, displacements: np.ndarray) -> np.ndarray:
        """Return S, in single precision, times interface displacements, the rows, shape (k, n_b)."""
        scaled, scale, usual = _scaled(displacements)
        bent = (scaled - (scaled @ self._modes) @ self._modes.T).T
        half = blas.strmm(1.0, self._lower, bent, lower=1, trans_a=1)
        moved = blas.strmm(1.0, self._lower, half, lower=1, overwrite_b=1).T
        forces = (moved - (moved @ self._modes) @ self._modes.T) * (self._unit * scale)
        return np.where(usual[:, None], forces, scale)

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and S times the latter."""
        inside = self._insides.of(self)
        whole = np.empty(self._subdomain.mesh.size)
        whole[self._interface] = displacement
        whole[inside.dofs], force = inside.extend(displacement)
        return whole, force

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,), in double precision."""
        inside = self._insides.of(self)
        relaxed = inside.solve(right[inside.dofs])
        trace = self._refined(inside, right[self._interface] - inside.passed(relaxed))
        solution = np.empty_like(right)
        solution[self._interface] = trace
        solution[inside.dofs] = relaxed - inside.solve(inside.pulled(trace))
        return solution

    def row_flexibility(self, rows: sp.csr_matrix, at_once: int = 64) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, in single precision.

        As ‖L⁻¹ b‖².
        """
        lower = self._lower if self._lower.ndim == 2 else lapack.stpttr(self._size, self._lower, uplo="L")[0]
        flexibility = np.empty(rows.shape[0])
        for part in pieces(np.ones(rows.shape[0], dtype=np.int64), at_once):
            right = np.asfortranarray(rows[part].toarray().T.astype(np.float32))
            half = blas.strsm(1.0, lower, right, lower=1, overwrite_b=1).astype(np.float64)
            flexibility[part] = np.einsum("nk,nk->k", half, half) / self._unit
        return flexibility


def _scaled(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows in single precision over their largest entries, these, (k, 1), and which are usual.

    The range of single precision suffices neither for all units nor for diverging iterates.
    """
    size = np.abs(vectors).max(axis=1, initial=0.0)
    usual = (size > 0.0) & np.isfinite(size)
    scale = np.where(usual, size, 1.0)[:, None]
    scaled = np.where(usual[:, None], vectors / scale, 0.0).astype(np.float32)
    return scaled, np.where(usual[:, None], scale, size[:, None]), usual
