"""Rows of linear constraints between displacements of nodes, independent of each other and of unit length.

Of equations A u = b prescribed components are known: with P onto free ones the rows are S T A P u = S T (b −
A (1 − P) u). T replaces the equations that share a node one by one, a_i, by the differences of neighbours: a
node that many others follow would fill the block of these rows in B D⁻¹ Bᵀ. S makes lengths one. Rows that
depend on others have pivots of zero in the Cholesky factor of their Gram matrix, and are left out.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU, splu

from fenics_contact._base.display import counted
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.following import followed_nodes
from fenics_contact._pairing.points import HELD, ContactPoints
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes, free_matrix
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InfeasibleError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.contact_rows import on_copies
from fenics_contact.feti.decomposition import Decomposition, Rows, Tearing
from fenics_contact.feti.row_groups import Joint, columns_of

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class ConstraintRows(Joint):
    """Rows of linear constraints.

    `equations`: A, all equations of all constraints; `kept`: S T, shape (n_rows, n_equations), of the
    independent rows; `lost`: T on equations that supports determine or that depend on others, shape (n_lost,
    n_equations); `dependence`: what of each lost one the rows make, shape (n_lost, n_rows); `free`: S T A P,
    shape (n_rows, n_nodes · components); `axes`: axes of nodes along which supports prescribe
    components.
    """

    constraints: Sequence[LinearConstraint]
    equations: sp.csr_matrix
    first: np.ndarray
    kept: sp.csr_matrix
    lost: sp.csr_matrix
    dependence: sp.csr_matrix
    free: sp.csr_matrix
    components: int
    fixed: np.ndarray
    axes: LocalAxes = NO_AXES

    @classmethod
    def key(cls, scene: Scene) -> Sequence[object]:
        """Return the constraints but for their values."""
        return [each.key for each in scene.constraints]

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[ConstraintRows]
    ) -> Sequence[ConstraintRows]:
        """Return those of a scene with constraints. Collective."""
        if not scene.constraints:
            return ()
        for each in known:
            same = np.array_equal(each.fixed, decomposition.fixed)
            if same and [one.key for one in each.constraints] == cls.key(scene):
                return (each,)
        with together(decomposition.comm):
            found = cls.built(scene, decomposition.tearing, decomposition.fixed, decomposition.axes)
        if decomposition.comm.rank == 0 and found.left_out:
            words = "%d of %d equations of linear constraints follow from others or from supports: left out"
            safe_log(_LOG.info, words, found.left_out, found.first[-1])
        return (found,)

    @classmethod
    def built(cls, scene: Scene, tearing: Tearing, fixed: np.ndarray, axes: LocalAxes) -> ConstraintRows:
        """Return those of a scene; `fixed`: see `Relations.rows`."""
        equations, first = _equations(scene, tearing)
        size = _lengths(equations)
        free = equations @ free_matrix(fixed, axes)
        free = _cleaned(free, size)
        loose = _lengths(free) > HELD * size
        whole = _picked(loose)
        apart = (_differences(free[loose]) @ whole).tocsr()
        moved, reach = (apart @ free).tocsr(), abs(apart) @ _lengths(free)
        apart_size = _lengths(moved)
        there = apart_size > ROUNDING * reach
        scaled = (sp.diags(1.0 / apart_size[there]) @ apart[there]).tocsr()
        moved = _cleaned((scaled @ free).tocsr(), np.ones(scaled.shape[0]))
        independent, dependence = independent_rows(moved)
        lost = sp.vstack([_picked(~loose), apart[~there], scaled[~independent]], format="csr")
        nothing = sp.csr_matrix((lost.shape[0] - dependence.shape[0], dependence.shape[1]))
        return cls(
            scene.constraints, equations, first, scaled[independent], lost,
            sp.vstack([nothing, dependence], format="csr"), moved[independent], scene.components, fixed, axes,
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.kept.shape[0])

    @cached_property
    def whole(self) -> sp.csr_matrix:
        """S T A, also of prescribed components, shape (n_rows, n_nodes · components)."""
        return (self.kept @ self.equations).tocsr()

    @property
    def projection(self) -> sp.csr_matrix:
        """P onto free components, shape (n_nodes · components, n_nodes · components)."""
        return free_matrix(self.fixed, self.axes)

    @property
    def left_out(self) -> int:
        """Number of equations that follow from others or from supports."""
        return int(self.lost.shape[0])

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return the rows of B, which act on free components."""
        entries = self.free.tocoo()
        order = np.lexsort((entries.col, entries.row))
        row, dof, value = entries.row[order], entries.col[order], entries.data[order]
        node, component = np.divmod(dof, self.components)
        anchor = node[np.searchsorted(row, np.arange(self.count))]
        return on_copies(tearing, row, node, component, value, anchor)

    def measured(self, field: np.ndarray) -> np.ndarray:
        """Return what a displacement of all nodes is in the rows, shape (n_rows,)."""
        return np.asarray(self.whole @ field.ravel())

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return the contribution of prescribed displacements to each row, shape (n_rows,), [length]."""
        return self.measured(self.moved(prescribed))

    def moved(self, prescribed: np.ndarray) -> np.ndarray:
        """Return prescribed displacements, zero where free, along the coordinates' axes, (n_dofs,)."""
        return self.axes.to_global(np.nan_to_num(prescribed)).ravel()

    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return by how much fields of nodes, (n_nodes · components, n), close the rows, (n_rows, n)."""
        return columns_of(self, fields, self.components)

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return S T b for the values of constraints, shape (n_rows,), [length]."""
        return np.asarray(self.kept @ self._values(scene.constraints))

    def _values(self, constraints: Sequence[LinearConstraint]) -> np.ndarray:
        values = np.zeros(int(self.first[-1]))
        for number, each in enumerate(constraints):
            own = slice(int(self.first[number]), int(self.first[number + 1]))
            count = own.stop - own.start
            if not isinstance(each.value, float) and len(each.value) != count:
                needed = f"LinearConstraint {each.label!r} has {counted(count, 'equation')}"
                raise InvalidInputError(f"{needed}, got {len(each.value)} values: give as many, or one")
            values[own] = each.value
        return values

    def check(self, scene: Scene, prescribed: np.ndarray, moving: sp.csr_matrix, near: float = 1e-6) -> None:
        """Reject equations that contradict others or supports."""
        if not self.left_out:
            return
        values, given = self._values(scene.constraints), self.equations @ self.moved(prescribed)
        scale = max(np.abs(values).max(), np.abs(given).max())
        left = np.abs(self._left(values - given))
        if (left > near * scale).any():
            worst = int(np.argmax(left))
            raise InfeasibleError(
                f"{self._named(worst)} contradicts others or supports by {left[worst]:.3g}: correct its value"
            )
        if moving.shape[1]:
            motions = np.abs(
                np.asarray(abs(self._left(self.equations @ moving)).max(axis=1).todense())
            ).ravel()
            if (motions > near * abs(moving).max()).any():
                raise InfeasibleError(
                    f"{self._named(int(np.argmax(motions)))} acts on no body that deforms: use Support"
                )

    def _left(self, values: np.ndarray | sp.csr_matrix) -> np.ndarray:
        """Return what of lost equations the rows do not say."""
        return self.lost @ values - self.dependence @ (self.kept @ values)

    def _named(self, lost: int) -> str:
        row = self.lost[[lost]].tocoo()
        equation = int(row.col[np.argmax(np.abs(row.data))])
        number = int(np.searchsorted(self.first, equation, side="right")) - 1
        count = int(self.first[number + 1] - self.first[number])
        within = f"equation {equation - int(self.first[number])} of " if count > 1 else ""
        return f"{within}LinearConstraint {self.constraints[number].label!r}"

    def forces(self, multiplier: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Return the force of each equation on a unit of its factors, shape (n_equations,), [force]."""
        return -np.asarray(self.kept.T @ multiplier)

    def on_nodes(self, forces: np.ndarray) -> np.ndarray:
        """Return what equations exert, shape (n_nodes, components), [force]."""
        return np.asarray(self.equations.T @ forces).reshape(-1, self.components)

    def of_one(self, forces: np.ndarray, constraint: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces of the equations of one constraint, and what these exert on nodes."""
        mine = slice(int(self.first[constraint]), int(self.first[constraint + 1]))
        on_nodes = np.asarray(self.equations[mine].T @ forces[mine]).reshape(-1, self.components)
        return forces[mine], on_nodes

    def wrenches(self, modes: np.ndarray, nodes: slice) -> np.ndarray:
        """Return the work of unit multipliers, shape (n_modes, n_rows)."""
        own = slice(nodes.start * self.components, nodes.stop * self.components)
        return np.asarray(self.whole[:, own] @ modes.reshape(-1, modes.shape[2])).T


def _equations(scene: Scene, tearing: Tearing) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return A of all constraints, and the first equation of each with the total."""
    first, parts, width = [0], [], scene.components
    for constraint in scene.constraints:
        entries = constraint.entries(scene.bodies)
        for each in entries:
            nodes = tearing.global_nodes(each.body, each.nodes)
            dim = each.vectors.shape[1]
            dof = nodes[:, None] * width + np.arange(dim)
            row = np.repeat(first[-1] + each.equation, dim)
            parts.append((each.vectors.ravel(), row, dof.ravel()))
        first.append(first[-1] + 1 + max(int(each.equation.max()) for each in entries))
    value, row, dof = (np.concatenate(part) for part in zip(*parts, strict=True))
    matrix = sp.csr_matrix((value, (row, dof)), shape=(first[-1], tearing.n_nodes * width))
    if any(body.mesh.followers for body in scene.bodies.values()):
        matrix = matrix @ sp.kron(followed_nodes(scene), sp.identity(width))
    return _cleaned(matrix.tocsr(), _lengths(matrix)), np.array(first)


def _lengths(matrix: sp.csr_matrix) -> np.ndarray:
    return np.sqrt(np.asarray(matrix.multiply(matrix).sum(axis=1)).ravel())


def _cleaned(matrix: sp.csr_matrix, size: np.ndarray) -> sp.csr_matrix:
    """Return a matrix without entries that are rounding of rows of a size."""
    matrix = matrix.tocsr(copy=True)
    least = np.repeat(ROUNDING * size, np.diff(matrix.indptr))
    matrix.data[np.abs(matrix.data) <= least] = 0.0
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return sp.csr_matrix(matrix)


def _picked(marks: np.ndarray) -> sp.csr_matrix:
    """Return the rows of the identity that are marked."""
    return sp.identity(len(marks), format="csr")[np.flatnonzero(marks)]


def _differences(matrix: sp.csr_matrix, most: int = 12) -> sp.csr_matrix:
    """Return T, with differences of neighbours in place of rows that share a component of a node.

    `most`: rows that may share one: so many are a small block.
    """
    whole = sp.identity(matrix.shape[0], format="csr")
    # Long rows, as of knots of beams, fill the block without that one, too, and would be lost in differences.
    length = np.repeat(np.diff(matrix.indptr), np.diff(matrix.indptr))
    count = np.bincount(matrix.indices, minlength=matrix.shape[1])
    longest = np.zeros(matrix.shape[1], dtype=length.dtype)
    np.maximum.at(longest, matrix.indices, length)
    busy = np.flatnonzero(count > np.maximum(most, 2 * longest))
    for column in busy:  # those that many rows share are few
        entries = matrix[:, [column]].tocoo()
        # Large factors are last: a row to which many times the next one is added would be lost in it.
        order = np.lexsort((entries.row, np.log2(np.abs(entries.data)) // 8))
        row, value = entries.row[order], entries.data[order]
        if len(row) <= most:
            continue
        change = np.full(len(row) - 1, -1.0) * value[:-1] / value[1:]
        step = sp.csr_matrix((change, (row[:-1], row[1:])), shape=whole.shape) + sp.identity(
            len(whole.indptr) - 1
        )
        lengths = _lengths(matrix)
        matrix, whole = _cleaned((step @ matrix).tocsr(), lengths), (step @ whole).tocsr()
    return whole


def independent_rows(
    matrix: sp.csr_matrix, regular: float = 1e-13, least: float = 1e-9, at_once: int = 256
) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return marks of independent rows of unit length, and what of each other one they make.

    `regular`: added to the diagonal of the Gram matrix; `least`: pivot, the squared distance of a row from
    those before it, below which it depends on them; `at_once`: rows that are solved for together, dense.
    """
    count = matrix.shape[0]
    kept, gram = np.ones(count, dtype=bool), (matrix @ matrix.T).tocsr()
    _, number = connected_components(gram, directed=False)
    shared = np.bincount(number)[number] > 1 if count else kept
    coupled = np.flatnonzero(shared)
    if len(coupled):
        kept[coupled] = _pivots(factored(gram[coupled][:, coupled], regular)) > least
    if kept.all():
        return kept, sp.csr_matrix((0, count))
    factor = factored(gram[kept][:, kept], regular)
    own, right, parts = gram[kept][:, kept], (matrix[kept] @ matrix[~kept].T).tocsc(), []
    for start in range(0, right.shape[1], at_once):
        some = right[:, start : start + at_once].toarray()
        made = factor.solve(some)
        made += factor.solve(some - own @ made)
        made[np.abs(made) <= ROUNDING * np.abs(made).max(initial=0.0)] = 0.0
        parts.append(sp.csr_matrix(made.T))
    return kept, sp.vstack(parts, format="csr")


def factored(gram: sp.csr_matrix, regular: float = 1e-13) -> SuperLU:
    """Factor a positive semidefinite matrix, with its pivots on the diagonal."""
    whole = (gram + regular * sp.identity(gram.shape[0])).tocsc()
    options = {"SymmetricMode": True}
    return splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def _pivots(factor: SuperLU) -> np.ndarray:
    """Return the pivot of each row."""
    return np.asarray(factor.U.diagonal()[factor.perm_c])
