"""From the torn system to the dual problem and back: F, d, G, e, and the displacements of a multiplier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from fenics_contact._base.costs import count_flops
from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.memory import return_memory
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._base.sparse import ROUNDING, scaled_columns, sweep
from fenics_contact.errors import InfeasibleError, together
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.contact_block import ContactBlock
from fenics_contact.feti.decomposition import DualNumbering
from fenics_contact.feti.inverse import LocalKind, TornInverse
from fenics_contact.feti.kernel_basis import TornModes, whole_motions
from fenics_contact.feti.reduced_coarse import Elimination
from fenics_contact.feti.sewing import NOT_SEWN, NotSewn, Sewing
from fenics_contact.feti.soft_motions import NoSoftMotions, SoftMotions
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.quality import node_volumes
from fenics_contact.qp.coarse import NO_ELIMINATION, CoarseSpace
from fenics_contact.qp.problem import CompliantRows, DualProblem, Operator, Scaling, Unscaled


class DirichletPreconditioner:
    """M = A⁻¹ (B D⁻¹ S D⁻¹ Bᵀ + C) A⁻¹ with A = B D⁻¹ Bᵀ + C, S the Schur complements on the interfaces.

    D is the typical stiffness at each copy of a node, so that of two neighbours the softer one deforms. C is
    the compliance of rows that give way: a jump is closed by bodies and springs, each as it is soft. Gluing
    and Dirichlet rows are orthogonal in D⁻¹: A is diagonal except for the rows of contacts and ties, where it
    is factored. Before S and after it copies of nodes move together, see `sewing`.

    References:
        Farhat, Roux: An unconventional domain decomposition method for an efficient parallel solution of
        large-scale finite element systems. SIAM J. Sci. Stat. Comput. 13 (1992) 379-396.
        Klawonn, Widlund: FETI and Neumann-Neumann iterative substructuring methods: connections and new
        results. Comm. Pure Appl. Math. 54 (2001) 57-90.
    """

    def __init__(
        self,
        inverse: TornInverse,
        B: sp.csr_matrix,
        compliance: np.ndarray,
        numbering: DualNumbering,
        n_gluing: int,
    ) -> None:
        """Factor the contact block of B D⁻¹ Bᵀ. Collective."""
        self._inverse, self._numbering = inverse, numbering
        self._sewing: NotSewn = NOT_SEWN
        self._soft, self._sprung = np.zeros(0, dtype=np.int64), np.zeros(0)
        self._B = scaled_columns(B, compliance)
        self._Bt = self._B.T  # shares its memory
        diagonal = numbering.to_owned(np.asarray(B.multiply(self._B).sum(axis=1)).ravel())
        self._equality = 1.0 / np.where(numbering.owned < n_gluing, diagonal, 1.0)
        self._contact = ContactBlock.of_rows(B, self._B, numbering, n_gluing)
        self._softened = self._contact

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        return self._apply(residual, self._softened)

    def on_face(self, restriction: sp.csr_matrix) -> PreconditionerOfFace:
        """Return the preconditioner of a face; only its rows enter B D⁻¹ Bᵀ. Collective.

        Rows that are not on the face would stiffen their neighbours, the more the stiffer the slave.
        """
        return PreconditionerOfFace(self, self._softened.on_face(restriction))

    def lifting(self, restriction: sp.csr_matrix) -> Lifting:
        """Return the displacements of the interface that close rows of a face. Collective."""
        return Lifting(self, self._contact.on_face(restriction))

    def soften(self, rows: np.ndarray, compliance: np.ndarray, unit: float) -> None:
        """Let rows give way by C. Collective; `unit`: the stiffness of which D is a part."""
        self._soft, self._sprung = rows, unit**2 * compliance
        added = np.zeros(len(self._equality))
        added[rows] = unit * compliance
        self._softened = self._contact.softened(added)

    def sew(self, sewing: NotSewn) -> None:
        """Move copies of nodes together from now on."""
        self._sewing = sewing

    def _apply(self, residual: np.ndarray, contact: ContactBlock) -> np.ndarray:
        count_flops(self._numbering.comm, self._inverse.flops[1] + 4 * self._B.nnz)
        forces = contact.solve(self._equality * residual)
        displacement = self._sewing.eased(self._Bt @ self._numbering.to_local(forces))
        stiffened = self._sewing.eased_transposed(self._inverse.apply_stiffness(displacement))
        jump = self._numbering.to_owned(self._B @ stiffened)
        jump[self._soft] += self._sprung * forces[self._soft]
        return self._equality * contact.solve(jump)

    def _jump(self, residual: np.ndarray, contact: ContactBlock) -> np.ndarray:
        """Return D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹ r on the interface. Collective."""
        return self._Bt @ self._numbering.to_local(contact.solve(self._equality * residual))

    def _force(self, stiffened: np.ndarray, contact: ContactBlock) -> np.ndarray:
        """Return the transpose of `_jump` times an interface force, owned. Collective."""
        return self._equality * contact.solve(self._numbering.to_owned(self._B @ stiffened))


@dataclass(frozen=True, eq=False)
class PreconditionerOfFace:
    """The preconditioner where only rows of a face enter B D⁻¹ Bᵀ, and where these depend on each other."""

    _preconditioner: DirichletPreconditioner
    _contact: ContactBlock

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        return self._preconditioner._apply(residual, self._contact)

    def contradiction(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int] | None:
        """Return what no force on the face's rows changes, see `qp.RowsOfFace`. Collective."""
        return self._contact.contradiction(residual)


@dataclass(frozen=True, eq=False)
class Lifting:
    """The two factors of the preconditioner on a face, M = Lᵀ S L with L = D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹, unsewn.

    B L r = r on the rows of the face, up to the regularisation of the contact block.
    """

    _preconditioner: DirichletPreconditioner
    _contact: ContactBlock

    def jump(self, residual: np.ndarray) -> np.ndarray:
        """Return L r, the interface displacement that moves rows by r, shape (n_interface,). Collective."""
        return self._preconditioner._jump(residual, self._contact)

    def multiplier(self, force: np.ndarray) -> np.ndarray:
        """Return Lᵀ times an interface force, owned. Collective."""
        return self._preconditioner._force(force, self._contact)


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
        kinds: Number of kinds of subdomains, those of each rank counted on their own.
        whole_faces: Whether all equality rows are on every face.
    """

    whole_faces = True

    inverse: TornInverse
    problem: DualProblem
    kernel: TornModes
    unheld: sp.csr_matrix
    points: sp.csr_matrix
    preconditioner: DirichletPreconditioner
    soft_motions: SoftMotions | NoSoftMotions
    _unheld_points: np.ndarray
    _bent: np.ndarray
    _B_interface: sp.csr_matrix
    _Bt_interface: sp.csc_matrix

    def __init__(
        self,
        torn: TornSystem,
        timer: PhaseTimer | None = None,
        *,
        kind: LocalKind = LocalKind.AUTOMATIC,
        previous: DualSystem | None = None,
        shared: bool = True,
    ) -> None:
        """Factor the subdomains and assemble d, G, e. Collective.

        Args:
            torn: The torn system.
            timer: Collects the wall time.
            kind: How the subdomains are stored; by default memory and then the cost model choose.
            previous: System of another geometry; the factors of unchanged subdomains are reused.
            shared: Whether subdomains of a rank that are alike share factors.
        """
        timer = timer or PhaseTimer()
        comm = torn.numbering.comm
        if kind is LocalKind.AUTOMATIC and torn.decomposition.compact:
            kind = LocalKind.COMPACT
        sweep(comm)
        self.torn, self.products, self._shared = torn, 0, shared
        self._B, self._Bt = torn.B, torn.B.T  # shares its memory
        with timer.phase("factor"):
            known = None if previous is None else previous.inverse
            with together(comm):
                # Not kept for later systems: MUMPS holds several times what remains, for a third of its time.
                self.inverse = self._inverse(torn, Condensations(), kind, known)
            self.kinds = int(comm.allreduce(len(self.inverse.kinds)))
        if previous is not None and self._is_that_of(previous):
            self._take_over(previous, timer)
        else:
            self._set_up(timer)
        return_memory()
        bent = self.inverse(torn.load)
        self._bent = bent[self.inverse.interface]
        rhs = self.jump(bent) - torn.right
        compliant = CompliantRows(torn.compliance.soft, torn.compliance.constant)
        self.problem = replace(
            self.problem, rhs=rhs, compliance=torn.compliance.contact, compliant=compliant, given=torn.right
        )

    def _inverse(
        self, torn: TornSystem, condensations: Condensations, kind: LocalKind, known: TornInverse | None
    ) -> TornInverse:
        """Factor the subdomains."""
        return TornInverse(
            torn.subdomains, torn.B, condensations, kind=kind, previous=known, shared=self._shared
        )

    def _is_that_of(self, previous: DualSystem) -> bool:
        """Return whether F and G are those of an earlier system. Collective."""
        mine, other = self.torn.free.columns, previous.torn.free.columns
        differs = self.torn.B is not previous.torn.B or self.inverse.changed
        differs = differs or mine.shape != other.shape or bool(abs(mine - other).sum() > 0.0)
        return not self.torn.numbering.comm.allreduce(int(differs))

    def _take_over(self, previous: DualSystem, timer: PhaseTimer) -> None:
        """Use the operators of an earlier system with the present load. Collective."""
        self._B_interface, self._Bt_interface = previous._B_interface, previous._Bt_interface
        self.preconditioner, self.soft_motions = previous.preconditioner, previous.soft_motions
        self.kernel, self.unheld = previous.kernel, previous.unheld
        self.points, self._unheld_points = previous.points, previous._unheld_points
        self._require_unloaded()
        with timer.phase("coarse space"):
            coarse = previous.problem.coarse.with_load(self._resultants(self.torn.numbering.comm))
            scaling = previous.problem.scaling.with_load(coarse.load)
        operator, exact = self._operators
        self.problem = replace(
            previous.problem,
            operator=operator,
            exact=exact,
            coarse=coarse,
            scaling=scaling,
            reach=self.reach,
        )

    def _set_up(self, timer: PhaseTimer) -> None:
        """Build coarse space and preconditioner. Collective."""
        torn, comm = self.torn, self.torn.numbering.comm
        # B has no other nonzero columns: products with F then need no vectors of the torn size.
        place = np.zeros(torn.B.shape[1], dtype=torn.B.indices.dtype)
        place[self.inverse.interface] = np.arange(len(self.inverse.interface))
        entries = torn.B.data, place[torn.B.indices], torn.B.indptr  # values share their memory
        self._B_interface = Csr(entries, shape=(torn.B.shape[0], len(self.inverse.interface)))
        self._Bt_interface = self._B_interface.T
        with timer.phase("coarse space"):
            self.kernel = self._kernel(comm)
            eliminate = Elimination(torn.layout.equality) if self.whole_faces else NO_ELIMINATION
            columns, load = self._coarse_columns(), self._resultants(comm)
            coarse = self._without_unheld(CoarseSpace(comm, columns, load, eliminate=eliminate))
        with timer.phase("preconditioner"):
            preconditioner = DirichletPreconditioner(
                self.inverse, self._B_interface, self._compliance(), torn.numbering, torn.n_gluing
            )
            preconditioner.sew(self._sewing())
            if torn.groups.compliance.any():
                preconditioner.soften(torn.compliance.soft, torn.compliance.constant, self._stiffest)
            diagonal, supported = self._diagonal()
            self.preconditioner, scaling = preconditioner, self._scaling(coarse)
            self.soft_motions = self._soft_motions(coarse, scaling)
        nothing = np.zeros(len(torn.numbering.owned))
        operator, exact = self._operators
        self.problem = DualProblem(
            comm,
            operator,
            nothing,
            coarse,
            self.torn.layout,
            diagonal,
            preconditioner,
            scaling,
            self.reach,
            supported,
            exact=exact,
            second_level=self.soft_motions,
        )

    def apply(self, multiplier: np.ndarray) -> np.ndarray:
        """Return F λ = B K⁺ Bᵀ λ for an owned vector, with C λ on rows of joints that give way. Collective.

        In double precision, however K⁺ is stored.
        """
        return self._applied(self.inverse.apply_flexibility_exactly, multiplier)

    def apply_rounded(self, multiplier: np.ndarray) -> np.ndarray:
        """Return F λ in the precision in which K⁺ is stored. Collective."""
        return self._applied(self.inverse.apply_flexibility, multiplier)

    @property
    def _operators(self) -> tuple[Operator, Operator | None]:
        """What Krylov methods apply, and what confirms their answer where that is in single precision."""
        return (self.apply_rounded, self.apply) if self.inverse.is_rounded else (self.apply, None)

    def _applied(
        self, apply_flexibility: Callable[[np.ndarray], np.ndarray], multiplier: np.ndarray
    ) -> np.ndarray:
        self.products += 1
        numbering = self.torn.numbering
        count_flops(numbering.comm, self.inverse.flops[0] + 4 * self._B_interface.nnz)
        force = self._Bt_interface @ numbering.to_local(multiplier)
        product = numbering.to_owned(self._B_interface @ apply_flexibility(force))
        return self.torn.compliance.added(product, multiplier)

    def reach(self, multiplier: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Return abs(B) abs(u), the size of the displacements at each row, owned, [length]. Collective."""
        moved = (
            self._bent_by(self.inverse.apply_flexibility, multiplier)
            + (self.kernel @ alpha)[self.inverse.interface]
        )
        return self.torn.numbering.to_owned(abs(self._B_interface) @ np.abs(moved))

    def bent(self, multiplier: np.ndarray) -> np.ndarray:
        """Return K⁺(f − Bᵀλ) on the interface, (n_interface,), [length]; one product. Collective."""
        return self._bent_by(self.inverse.apply_flexibility_exactly, multiplier)

    def _bent_by(
        self, apply_flexibility: Callable[[np.ndarray], np.ndarray], multiplier: np.ndarray
    ) -> np.ndarray:
        count_flops(self.torn.numbering.comm, self.inverse.flops[0] + 2 * self._B_interface.nnz)
        return self._bent - apply_flexibility(self._Bt_interface @ self.torn.numbering.to_local(multiplier))

    def force(self, multiplier: np.ndarray) -> np.ndarray:
        """Return Bᵀλ on this rank's torn dofs, [force]. Collective."""
        return self._Bt @ self.torn.numbering.to_local(multiplier)

    def jump(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u, owned, [length]. Collective."""
        return self.torn.jump(displacement)

    def interface_jump(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u for a displacement of the interface, (n_interface,), owned, [length]. Collective."""
        return self.torn.numbering.to_owned(self._B_interface @ displacement)

    def displacement(self, multiplier: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Return u = K⁺(f − Bᵀλ) + R α on this rank's torn dofs, [length]. Collective.

        u contains no unresisted motion: its least-squares fit over the volume is removed, with the share
        of each node, so that what remains does not depend on where a mesh is fine.
        """
        displacement = self.inverse(self.torn.load - self.force(multiplier)) + self.kernel @ alpha
        return self._at_rest(displacement)

    def _at_rest(self, displacement: np.ndarray) -> np.ndarray:
        """Remove the unresisted motions from a torn displacement. Collective."""
        if self.unheld.shape[1] == 0:
            return displacement
        weighted, gram = self._fit
        sums = self.torn.numbering.comm.allreduce(weighted @ displacement)
        return displacement - self.unheld @ np.linalg.solve(gram, sums)

    def at_rest_transposed(self, gradient: np.ndarray) -> np.ndarray:
        """Return the derivative of a function of displacements with no unresisted motions. Collective.

        `gradient`: that of the same function where these are not removed, this rank's part, (torn_size,).
        """
        if self.unheld.shape[1] == 0:
            return gradient
        weighted, gram = self._fit
        sums = self.torn.numbering.comm.allreduce(self.unheld.T @ gradient)
        return gradient - weighted.T @ np.linalg.solve(gram, sums)

    @cached_property
    def _fit(self) -> tuple[sp.csr_matrix, np.ndarray]:
        """Rᵀ W of this rank and Rᵀ W R of all, W the volume of each node's share. Collective on first use.

        R are the unresisted motions; (k, torn_size) and (k, k).
        """
        tearing, (copy, block) = self.torn.decomposition.tearing, self.torn.decomposition.held
        meshes = (self.torn.scene.bodies[name].mesh for name in tearing.body_names)
        volumes = [node_volumes(mesh.points, mesh.cells) for mesh in meshes]
        share = np.concatenate(volumes) / tearing.multiplicity
        weight = np.empty(self.unheld.shape[0] // tearing.components)
        weight[block] = share[tearing.copy_node[copy]]
        weighted = (self.unheld.T @ sp.diags(np.repeat(weight, tearing.components))).tocsr()
        return weighted, self.torn.numbering.comm.allreduce((weighted @ self.unheld).toarray())

    def sewn(self, residual: np.ndarray) -> np.ndarray:
        """Return the interface displacement that makes copies agree and satisfies supports. Collective.

        The copies of a node move to their mean, weighted by the stiffness at each, prescribed ones to the
        prescribed value.

        Args:
            residual: r = c − B u of the displacement, owned, [length].

        Returns:
            Shape (n_interface,), [length].
        """
        nothing = Csr((len(residual), 0))
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

    def _kernel(self, comm: MPI.Comm) -> TornModes:
        counts = np.zeros(self.torn.decomposition.tearing.n_subdomains, dtype=np.int64)
        for subdomain in self.torn.subdomains:
            counts[subdomain.mesh.number] = subdomain.kernel.shape[1]
        offset = np.concatenate([[0], np.cumsum(comm.allreduce(counts))])
        mine = offset[[subdomain.mesh.number for subdomain in self.torn.subdomains]]
        own, count = TornModes.of(self.torn.subdomains, mine, int(offset[-1])), self.torn.free.count
        whole, self.points = whole_motions(self.torn, offset), Csr((count, own.shape[1]))
        if count:  # the motions of points move nothing but the right sides of rows
            self.points = sp.hstack([self.points, sp.identity(count)], format="csr")
            whole = sp.hstack([whole, Csr((whole.shape[0], count))], format="csr")
        return own.combined(whole)

    def _without_unheld(self, coarse: CoarseSpace) -> CoarseSpace:
        """Remove the motions in the kernel of B from R, and their rows from G. Collective.

        They must not be unknowns: rounding would load them, differently on every face, and nothing resists.
        """
        unfelt, k = coarse.gram.null_space, coarse.gram.null_space.shape[1]
        # Without one mode of each, the others still span every motion that B sees.
        order = scipy.linalg.qr(unfelt.T, mode="r", pivoting=True)[-1] if k else np.arange(coarse.m)
        # Each in terms of its own mode: then motions of bodies that are not connected share no entries.
        unfelt = unfelt @ np.linalg.inv(unfelt[order[:k]])
        unfelt[np.abs(unfelt) <= ROUNDING * np.abs(unfelt).max(initial=0.0)] = 0.0
        self.unheld = self.kernel.combined(Csr(unfelt)).tocsr()
        self._unheld_points = self.points @ unfelt
        if k == 0:
            return coarse
        self._require_unloaded()
        remaining = np.sort(order[k:])
        self.kernel = replace(self.kernel, coefficients=self.kernel.coefficients[:, remaining])
        self.points = self.points[:, remaining]
        held, load = coarse.matrix[remaining], coarse.load[remaining]
        return CoarseSpace(coarse.comm, held, load, eliminate=coarse.eliminate)

    def _require_unloaded(self, unbalanced: float = 1e-8) -> None:
        """Reject loads on motions in the kernel of B. Collective.

        `unbalanced`: work of the loads on an unresisted motion, relative to their sum, above which it is not
        rounding.
        """
        if self.unheld.shape[1] == 0:
            return
        work = np.append(self.unheld.T @ self.torn.load, np.abs(self.torn.load).sum())
        work = self.torn.numbering.comm.allreduce(work)
        driven, loads = work[:-1] + self._unheld_points.T @ self.torn.free.load, self._size(work[-1])
        if np.abs(driven).max() > unbalanced * loads:
            raise InfeasibleError(
                f"every loaded body must be held, a motion has load {max(driven, key=abs):.3e}: support it"
            )

    def _resultants(self, comm: MPI.Comm) -> np.ndarray:
        """Return e = Rᵀ f, replicated; rounding of balanced loads is set to zero."""
        resultants = np.asarray(comm.allreduce(self.kernel.resultants(self.torn.load)))
        resultants += self.points.T @ self.torn.free.load
        size = self._size(comm.allreduce(np.abs(self.torn.load).sum()))
        resultants[np.abs(resultants) <= ROUNDING * size] = 0.0
        return resultants

    def _size(self, on_nodes: float) -> float:
        """Return the sum of the sizes of nodal forces and of loads at points."""
        return on_nodes + float(np.abs(self.torn.free.load).sum())

    def _coarse_columns(self) -> sp.csr_matrix:
        """Return this rank's owned columns of G = Rᵀ Bᵀ, shape (n_modes, n_owned)."""
        columns = self.torn.numbering.sum_rows(self.kernel.moved_by(self._B)).T.tocsr()
        if self.torn.free.count:
            columns = (columns - self.points.T @ self.torn.free.columns.T).tocsr()
        columns.data[np.abs(columns.data) <= ROUNDING * np.abs(columns.data).max(initial=0.0)] = 0.0
        columns.eliminate_zeros()
        return columns.copy()  # otherwise with room for the zeros

    def _compliance(self) -> np.ndarray:
        """Return 1 / the typical stiffness at each interface dof."""
        decomposition = self.torn.decomposition
        here, block = decomposition.held
        of_block = np.empty(len(here))
        of_block[block] = 1.0 / decomposition.tearing.copy_stiffness[here]
        return of_block[self.inverse.interface // self.torn.components]

    def _sewing(self) -> NotSewn:
        """Return how the preconditioner moves copies of nodes together. Collective."""
        if self.inverse.is_rounded:  # where memory is short, no further matrices are stored
            return NOT_SEWN
        coupling = self.inverse.strongest_coupling(self.torn.components)
        coupling = self.torn.numbering.comm.allreduce(coupling, op=MPI.MAX)
        if coupling < Sewing.coupled:
            return NOT_SEWN
        return Sewing.of(self.torn, self._B_interface, self.inverse.interface_stiffness(), coupling)

    def _scaling(self, coarse: CoarseSpace) -> Scaling | Unscaled:
        """Return factors √(b·b / b·D⁻¹b) of the rows b of B, one where stiffness is uniform. Collective."""
        B, numbering = self._B_interface, self.torn.numbering
        squares = B.multiply(B)
        plain, weighted = (
            numbering.to_owned(np.asarray(squares @ weight)).clip(np.finfo(float).tiny)
            for weight in (np.ones(B.shape[1]), self._compliance())
        )
        factor, layout = np.sqrt(plain / weighted), self.torn.layout
        factor[layout.tangential] = factor[layout.tangential_frictional, None]
        # Factors that hardly differ are not worth scaling with.
        low = numbering.comm.allreduce(factor.min(initial=np.inf), op=MPI.MIN)
        high = numbering.comm.allreduce(factor.max(initial=0.0), op=MPI.MAX)
        return Unscaled() if high - low <= 1e-6 * high else Scaling.build(factor / high, coarse)

    def _soft_motions(self, coarse: CoarseSpace, scaling: Scaling | Unscaled) -> SoftMotions | NoSoftMotions:
        """Return the motions that foundations resist, and weights of springs, in scaled rows. Collective."""
        numbering, factor, given = self.torn.numbering, scaling.factor, self.torn.compliance
        held = sum(len(part.resistance) for part in self.torn.subdomains)
        if not numbering.comm.allreduce(held + len(given.soft)):
            # Neither squares of B nor a copy of G are needed.
            return NoSoftMotions(scaling.of_coarse(coarse), factor, self.torn.B.shape[1])
        glued = (factor**2 * self.flexibility)[numbering.owned < self.torn.n_gluing]
        total, count = numbering.comm.allreduce(np.array([glued.sum(), len(glued)]))
        typical = float(total / max(count, 1.0))
        weight = np.ones(len(numbering.owned))
        flexibility = np.maximum(self.flexibility[given.soft], np.finfo(float).tiny)
        weight[given.soft] = np.minimum(flexibility / given.constant, 1.0)
        return SoftMotions.of(self.torn, coarse.matrix, typical, factor, weight)

    @cached_property
    def _stiffest(self) -> float:
        """The typical stiffness of the stiffest subdomain, of which D is a part. Collective on first use."""
        own = max((part.typical_stiffness for part in self.torn.subdomains), default=0.0)
        return float(self.torn.numbering.comm.allreduce(own, op=MPI.MAX))

    @cached_property
    def flexibility(self) -> np.ndarray:
        """How far bodies give way to a force in each row b of B, b D⁻¹ bᵀ, owned, [length / force].

        Collective on first use.
        """
        B, numbering = self._B_interface, self.torn.numbering
        return np.asarray(numbering.to_owned(np.asarray(B.multiply(B) @ self._compliance())) / self._stiffest)

    def _diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the diagonal of F on contact rows, one elsewhere, and marks of filled rows. Collective."""
        numbering = self.torn.numbering
        local = np.zeros(self._B.shape[0])
        contact = np.flatnonzero(numbering.local_rows >= self.torn.n_equality)
        local[contact] = self.inverse.row_flexibility(self._B_interface[contact])
        diagonal = numbering.to_owned(local)
        diagonal[numbering.owned < self.torn.n_equality] = 1.0
        return self._filled(diagonal)

    def _filled(self, diagonal: np.ndarray, share: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
        """Give rows that supports alone determine the diagonal of their disc, or a small one. Collective.

        Small, as such a row has no flexibility: any slip that supports prescribe must count as slip. Returns
        the diagonal, and marks of the rows that got a small one, both owned. `share`: substitute flexibility
        of rows that have none, relative to the mean of all contact rows.
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
        diagonal[supported] = share * total / count
        return diagonal, supported
