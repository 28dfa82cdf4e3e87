"""From the torn system to the dual problem and back: F, d, G, e, and the displacements of a multiplier."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.errors import InfeasibleError, together
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.dirichlet import DirichletPreconditioner
from fenics_contact.feti.inverse import LocalKind, TornInverse, kernel_matrix
from fenics_contact.feti.kernel_basis import whole_motions
from fenics_contact.feti.torn import TornSystem
from fenics_contact.linalg import ROUNDING, sweep
from fenics_contact.qp import EVEN, CoarseSpace, DualProblem, Scaling
from fenics_contact.timing import PhaseTimer

#: Substitute flexibility of rows that have none, relative to the mean of all contact rows.
STIFF = 1e-6
#: Work of the loads on an unresisted motion, relative to their sum, above which it is not rounding.
UNBALANCED = 1e-8


class DualSystem:
    """The dual of a torn system: operators on multipliers, and the recovery of displacements.

    Attributes:
        torn: The torn system.
        inverse: K⁺ and the interface operators of the subdomains.
        kernel: This rank's R, shape (torn_size, n_modes), without the span of `unheld`.
        unheld: This rank's part of the motions in the kernel of B, as columns, shape (torn_size, k): loads
            must not drive them, and they are zero.
        points: The motions q of rigid surfaces in terms of the modes, shape (n_free, n_modes), replicated.
        problem: The problem for the dual solvers.
        products: F-products so far.
    """

    inverse: TornInverse
    problem: DualProblem
    kernel: sp.csr_matrix
    unheld: sp.csr_matrix
    points: sp.csr_matrix
    _unheld_points: np.ndarray
    _bent: np.ndarray
    _B_interface: sp.csr_matrix
    _Bt_interface: sp.csr_matrix

    def __init__(
        self,
        torn: TornSystem,
        timer: PhaseTimer | None = None,
        *,
        kind: LocalKind = LocalKind.AUTOMATIC,
        previous: DualSystem | None = None,
    ) -> None:
        """Factor the subdomains and assemble d, G, e. Collective.

        Args:
            torn: The torn system.
            timer: Collects the wall time.
            kind: How the subdomains are stored; the cost model chooses by default.
            previous: System of another geometry; the factors of unchanged subdomains are reused.
        """
        timer = timer or PhaseTimer()
        comm = torn.numbering.comm
        sweep(comm)
        self.torn, self.products = torn, 0
        self._B, self._Bt = torn.B, torn.B.T.tocsr()
        with timer.phase("factor"):
            known = None if previous is None else previous.inverse
            condensations = torn.decomposition.condensations
            with together(comm):
                self.inverse = self._inverse(torn, condensations, kind, known)
        if previous is not None and self._is_that_of(previous):
            self._take_over(previous, timer)
        else:
            self._set_up(timer)
        bent = self.inverse(torn.load)
        self._bent = bent[self.inverse.interface]
        self.problem = replace(self.problem, rhs=self.jump(bent) - torn.right)

    def _inverse(
        self, torn: TornSystem, condensations: Condensations, kind: LocalKind, known: TornInverse | None
    ) -> TornInverse:
        """Factor the subdomains."""
        return TornInverse(torn.subdomains, torn.B, condensations, kind=kind, previous=known)

    def _is_that_of(self, previous: DualSystem) -> bool:
        """Return whether F and G are those of an earlier system. Collective."""
        mine, other = self.torn.free.columns, previous.torn.free.columns
        differs = self.torn.B is not previous.torn.B or self.inverse.factored > 0
        differs = differs or mine.shape != other.shape or bool(abs(mine - other).sum() > 0.0)
        return not self.torn.numbering.comm.allreduce(int(differs))

    def _take_over(self, previous: DualSystem, timer: PhaseTimer) -> None:
        """Use the operators of an earlier system with the present load. Collective."""
        self._B_interface, self._Bt_interface = previous._B_interface, previous._Bt_interface
        self.kernel, self.unheld = previous.kernel, previous.unheld
        self.points, self._unheld_points = previous.points, previous._unheld_points
        self._require_unloaded()
        with timer.phase("coarse space"):
            coarse = previous.problem.coarse.with_load(self._resultants(self.torn.numbering.comm))
            scaling = previous.problem.scaling
            scaling = None if scaling is None else scaling.with_load(coarse.load)
        self.problem = replace(
            previous.problem, operator=self.apply, coarse=coarse, scaling=scaling, reach=self.reach
        )

    def _set_up(self, timer: PhaseTimer) -> None:
        """Build coarse space and preconditioner. Collective."""
        torn, comm = self.torn, self.torn.numbering.comm
        # B has no other nonzero columns: products with F then need no vectors of the torn size.
        self._B_interface = torn.B[:, self.inverse.interface].tocsr()
        self._Bt_interface = self._B_interface.T.tocsr()
        with timer.phase("coarse space"):
            self.kernel = self._kernel(comm)
            coarse = self._without_unheld(CoarseSpace(comm, self._coarse_columns(), self._resultants(comm)))
        with timer.phase("preconditioner"):
            preconditioner = DirichletPreconditioner(
                self.inverse, self._B_interface, self._compliance(), torn.numbering, torn.n_gluing
            )
            diagonal, supported = self._diagonal()
            scaling = self._scaling(coarse)
        nothing = np.zeros(len(torn.numbering.owned))
        self.problem = DualProblem(
            comm,
            self.apply,
            nothing,
            coarse,
            self.torn.layout,
            diagonal,
            preconditioner,
            scaling,
            self.reach,
            supported,
        )

    def apply(self, multiplier: np.ndarray) -> np.ndarray:
        """Return F λ = B K⁺ Bᵀ λ for an owned vector. Collective."""
        self.products += 1
        numbering = self.torn.numbering
        force = self._Bt_interface @ numbering.to_local(multiplier)
        return numbering.to_owned(self._B_interface @ self.inverse.flex(force))

    def reach(self, multiplier: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Return abs(B) abs(u), the size of the displacements at each row, owned, [length]. Collective."""
        numbering = self.torn.numbering
        force = self._Bt_interface @ numbering.to_local(multiplier)
        moved = self._bent - self.inverse.flex(force) + self.kernel[self.inverse.interface] @ alpha
        return numbering.to_owned(abs(self._B_interface) @ np.abs(moved))

    def force(self, multiplier: np.ndarray) -> np.ndarray:
        """Return Bᵀλ on this rank's torn dofs, [force]. Collective."""
        return self._Bt @ self.torn.numbering.to_local(multiplier)

    def jump(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u, owned, [length]. Collective."""
        return self.torn.jump(displacement)

    def interface_jump(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u for a displacement of the interface, (n_interface,), owned, [length]. Collective."""
        return self.torn.numbering.to_owned(self._B_interface @ displacement)

    @property
    def preconditioner(self) -> DirichletPreconditioner:
        """The preconditioner of the unscaled problem."""
        return cast(DirichletPreconditioner, self.problem.preconditioner)

    def displacement(self, multiplier: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Return u = K⁺(f − Bᵀλ) + R α on this rank's torn dofs, [length]. Collective.

        u contains no unresisted motion: its least-squares fit over the nodes is removed.
        """
        displacement = self.inverse(self.torn.load - self.force(multiplier)) + self.kernel @ alpha
        return self._at_rest(displacement)

    def _at_rest(self, displacement: np.ndarray) -> np.ndarray:
        """Remove the unresisted motions from a torn displacement. Collective."""
        if self.unheld.shape[1] == 0:
            return displacement
        tearing, here = self.torn.decomposition.tearing, self.torn.decomposition.copy_block
        weight = np.empty(len(displacement) // tearing.dim)
        weight[here[here >= 0]] = 1.0 / tearing.multiplicity[tearing.copy_node[here >= 0]]
        weighted = self.unheld.T @ sp.diags(np.repeat(weight, tearing.dim))
        sums = np.column_stack([(weighted @ self.unheld).toarray(), weighted @ displacement])
        sums = self.torn.numbering.comm.allreduce(sums)
        return displacement - self.unheld @ np.linalg.solve(sums[:, :-1], sums[:, -1])

    def sewn(self, residual: np.ndarray) -> np.ndarray:
        """Return the interface displacement that makes copies agree and satisfies supports. Collective.

        The copies of a node move to their mean, weighted by the stiffness at each, prescribed ones to the
        prescribed value.

        Args:
            residual: r = c − B u of the displacement, owned, [length].

        Returns:
            Shape (n_interface,), [length].
        """
        nothing = sp.csr_matrix((len(residual), 0))
        if self.torn.free.count:  # rigid surfaces move as the nodes on them do on average
            residual = residual + self.torn.free.columns @ self.torn.free_motion(residual)
        return self.preconditioner.lifting(nothing).jump(residual)

    def conforming(self, displacement: np.ndarray) -> np.ndarray:
        """Return a torn displacement made continuous, so that the copies of a node agree. Collective.

        Copies move by `sewn`; the inside of each subdomain follows with the least energy, as under forces on
        its interface alone. Otherwise the averaging would strain one layer of cells.

        Args:
            displacement: This rank's torn displacement, shape (torn_size,), [length].
        """
        sewn = self.sewn(self.torn.right - self.jump(displacement))
        return self._at_rest(displacement + self.inverse.extend(sewn))

    def _kernel(self, comm: MPI.Comm) -> sp.csr_matrix:
        counts = np.zeros(self.torn.decomposition.tearing.n_subdomains, dtype=np.int64)
        for subdomain in self.torn.subdomains:
            counts[subdomain.mesh.number] = subdomain.kernel.shape[1]
        offset = np.concatenate([[0], np.cumsum(comm.allreduce(counts))])
        mine = offset[[subdomain.mesh.number for subdomain in self.torn.subdomains]]
        own = kernel_matrix(self.torn.subdomains, int(offset[-1]), mine)
        motions, count = (own @ whole_motions(self.torn, offset)).tocsr(), self.torn.free.count
        self.points = sp.csr_matrix((count, motions.shape[1]))
        if count:  # the motions of points move nothing but the right sides of rows
            self.points = sp.hstack([self.points, sp.identity(count)], format="csr")
            motions = sp.hstack([motions, sp.csr_matrix((motions.shape[0], count))], format="csr")
        return motions

    def _without_unheld(self, coarse: CoarseSpace) -> CoarseSpace:
        """Remove the motions in the kernel of B from R, and their rows from G. Collective.

        They must not be unknowns: rounding would load them, differently on every face, and nothing resists.

        Raises:
            InfeasibleError: The load drives one of them.
        """
        unfelt, k = coarse.gram.null_space, coarse.gram.null_space.shape[1]
        # Without one mode of each, the others still span every motion that B sees.
        order = scipy.linalg.qr(unfelt.T, mode="r", pivoting=True)[-1] if k else np.arange(coarse.m)
        # Each in terms of its own mode: then motions of bodies that are not connected share no entries.
        unfelt = unfelt @ np.linalg.inv(unfelt[order[:k]])
        unfelt[np.abs(unfelt) <= ROUNDING * np.abs(unfelt).max(initial=0.0)] = 0.0
        self.unheld = (self.kernel @ sp.csr_matrix(unfelt)).tocsr()
        self._unheld_points = self.points @ unfelt
        if k == 0:
            return coarse
        self._require_unloaded()
        remaining = np.sort(order[k:])
        self.kernel, self.points = self.kernel[:, remaining], self.points[:, remaining]
        return CoarseSpace(coarse.comm, coarse.matrix[remaining], coarse.load[remaining])

    def _require_unloaded(self) -> None:
        """Reject loads on motions in the kernel of B. Collective."""
        if self.unheld.shape[1] == 0:
            return
        work = np.append(self.unheld.T @ self.torn.load, np.abs(self.torn.load).sum())
        work = self.torn.numbering.comm.allreduce(work)
        driven, loads = work[:-1] + self._unheld_points.T @ self.torn.free.load, self._size(work[-1])
        if np.abs(driven).max() > UNBALANCED * loads:
            raise InfeasibleError(
                "every loaded body must be held by supports, ties or contact, but the load works "
                f"{max(driven, key=abs):.3e} on a rigid motion that nothing resists: support that body"
            )

    def _resultants(self, comm: MPI.Comm) -> np.ndarray:
        """Return e = Rᵀ f, replicated; rounding of balanced loads is set to zero."""
        resultants = np.asarray(comm.allreduce(self.kernel.T @ self.torn.load))
        resultants += self.points.T @ self.torn.free.load
        size = self._size(comm.allreduce(np.abs(self.torn.load).sum()))
        resultants[np.abs(resultants) <= ROUNDING * size] = 0.0
        return resultants

    def _size(self, on_nodes: float) -> float:
        """Return the sum of the sizes of nodal forces and of loads at points."""
        return on_nodes + float(np.abs(self.torn.free.load).sum())

    def _coarse_columns(self) -> sp.csr_matrix:
        """Return this rank's owned columns of G = Rᵀ Bᵀ, shape (n_modes, n_owned)."""
        columns = self.torn.numbering.sum_rows(self._B @ self.kernel).T.tocsr()
        if self.torn.free.count:
            columns = (columns - self.points.T @ self.torn.free.columns.T).tocsr()
        columns.data[np.abs(columns.data) <= ROUNDING * np.abs(columns.data).max(initial=0.0)] = 0.0
        columns.eliminate_zeros()
        return columns

    def _compliance(self) -> np.ndarray:
        """Return 1 / the typical stiffness at each interface dof."""
        decomposition = self.torn.decomposition
        here, block = decomposition.held
        of_block = np.empty(len(here))
        of_block[block] = 1.0 / decomposition.tearing.copy_stiffness[here]
        return of_block[self.inverse.interface // self.torn.dim]

    def _scaling(self, coarse: CoarseSpace) -> Scaling | None:
        """Return factors √(b·b / b·D⁻¹b) of the rows b of B, None where stiffness is uniform. Collective."""
        B, numbering = self._B_interface, self.torn.numbering
        squares = B.multiply(B)
        plain, weighted = (
            numbering.to_owned(np.asarray(squares @ weight)).clip(np.finfo(float).tiny)
            for weight in (np.ones(B.shape[1]), self._compliance())
        )
        factor, layout = np.sqrt(plain / weighted), self.torn.layout
        factor[layout.tangential] = factor[layout.tangential_frictional, None]
        low = numbering.comm.allreduce(factor.min(initial=np.inf), op=MPI.MIN)
        high = numbering.comm.allreduce(factor.max(initial=0.0), op=MPI.MAX)
        return None if high - low <= EVEN * high else Scaling.build(factor / high, coarse)

    def _diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the diagonal of F on contact rows, one elsewhere, and marks of filled rows. Collective."""
        numbering = self.torn.numbering
        local = np.zeros(self._B.shape[0])
        contact = np.flatnonzero(numbering.local_rows >= self.torn.n_equality)
        local[contact] = self.inverse.row_flexibility(self._B_interface[contact])
        diagonal = numbering.to_owned(local)
        diagonal[numbering.owned < self.torn.n_equality] = 1.0
        return self._filled(diagonal)

    def _filled(self, diagonal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give rows that supports alone determine the diagonal of their disc, or a small one. Collective.

        Small, as such a row has no flexibility: any slip that supports prescribe must count as slip.

        Returns:
            The diagonal, and marks of the rows that got a small one, both owned.
        """
        layout, comm = self.torn.layout, self.torn.numbering.comm
        total, count = comm.allreduce(
            np.array([diagonal[layout.contact].sum(), np.count_nonzero(diagonal[layout.contact])])
        )
        if count == 0:
            total, count = 1.0, 1.0
        discs = diagonal[layout.tangential]
        diagonal[layout.tangential] = np.where(discs > 0, discs, discs.max(axis=1, initial=0.0)[:, None])
        supported = np.zeros(len(diagonal), dtype=bool)
        supported[layout.contact] = ~(diagonal[layout.contact] > 0)
        diagonal[supported] = STIFF * total / count
        return diagonal, supported
