"""The free motions of rigid surfaces: unknowns beside the displacements, without stiffness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import counted, displayed
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._scene.supports import AnySupport, RigidSurface
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.all_rows import RowGroups
from fenics_contact.feti.decomposition import Tearing
from fenics_contact.feti.row_groups import Unknowns


@displayed
@dataclass(frozen=True, eq=False)
class FreeMotions:
    """Unknowns q of rigid surfaces in B u − Q q = c, and the work g·q of the loads at their points.

    Nodes of a rigid surface are prescribed, their values depend on q. The rows of multipliers in equilibrium
    with the points, −Qᵀλ = g, are part of the coarse problem, as if every point were a body of its own whose
    stiffness is zero. Motions are scaled to be orthonormal over the nodes of a surface. `columns`: Q; on
    nodes a row for each component of each node, replicated; of a system the owned rows; `load`: g,
    replicated; `tracked`: number of the first unknowns, whose values are known at each configuration; others
    follow from displacements; `nodes`: of tracked ones Q and `dyads` on the nodes, replicated; else None;
    `dyads`: fields on the owned rows whose work with multipliers gives the stiffness of tracked motions; else
    None; `stiffness`: −∂(g + Qᵀλ)/∂q, replicated; None where it is zero.
    """

    columns: sp.csr_matrix
    load: np.ndarray
    tracked: int = 0
    nodes: sp.csr_matrix | None = None
    dyads: sp.csr_matrix | None = None
    stiffness: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return len(self.load)

    def on_rows(self, groups: RowGroups, fixed: np.ndarray, owned: np.ndarray) -> FreeMotions:
        """Return those on nodes on the owned rows of a system."""
        if self.count == 0:
            return replace(self, columns=Csr((len(owned), 0)))
        return replace(self, columns=without_held(groups.columns(self.columns), groups, fixed)[owned])

    def with_unknowns(self, own: Unknowns, owned: np.ndarray) -> FreeMotions:
        """Return those of the owned rows, with unknowns that groups of rows have of their own behind them."""
        if not len(own.load):
            return self
        columns = sp.hstack([self.columns, own.columns[owned]], format="csr")
        return replace(self, columns=columns, load=np.concatenate([self.load, own.load]))

    def on_contact_rows(self, kept: sp.csr_matrix, groups: RowGroups, owned: np.ndarray) -> FreeMotions:
        """Return those of a system on the rows of other contact points."""
        columns = (kept @ self.columns).tocsr()
        if self.nodes is None:
            return replace(self, columns=columns)
        later = (groups.normal, groups.slips, *groups.further)
        parts = [Csr((groups.n_equality, self.nodes.shape[1]))]
        parts += [each.columns(self.nodes) for each in later]
        rows, count = sp.vstack(parts, format="csr")[owned], self.tracked
        more = sp.hstack([rows[:, :count], Csr((len(owned), self.count - count))])
        dyads = (kept @ self.dyads + rows[:, count:]).tocsr()
        return replace(self, columns=(columns + more).tocsr(), dyads=dyads)


def without_held(
    columns: sp.csr_matrix, groups: RowGroups, fixed: np.ndarray, rounding: float = 1e-6
) -> sp.csr_matrix:
    """Return Q without friction rows that are left to normal ones, shape (n_rows, n).

    Rows across a plane of symmetry, or around the axis of revolution, are held: nothing moves there. At the
    tip of a cone on the axis both sides move along it: slip alone is what the normal row has already.
    """
    moving, least = np.ones(columns.shape[0]), rounding * abs(columns).max()
    for group in groups:
        held = np.flatnonzero(group.held(fixed))
        moved, rows = groups.within(group, columns)[held], groups.rows_of(group)[held]
        if group is groups.slips:
            # The normal rows are those of −n.
            share = sp.diags(groups.slips.along_normals(fixed)[held])
            moved = moved + share @ groups.within(groups.normal, columns)[groups.slips.which[held]]
        touched = int(np.count_nonzero(abs(moved).max(axis=1).toarray() > least)) if len(held) else 0
        if touched:
            raise InvalidInputError(
                f"{touched} rows of contact join held slaves and free rigid masters: prescribe or free these"
            )
        moving[rows] = 0.0
    return (sp.diags(moving) @ columns).tocsr()


def _moving(columns: sp.csr_matrix, shape: tuple[int, ...]) -> np.ndarray:
    """Return which nodes rigid surfaces move, shape (n_nodes,)."""
    return np.asarray(np.asarray(abs(columns).sum(axis=1)).reshape(shape).any(axis=1))


def free_motions(scene: Scene, tearing: Tearing) -> FreeMotions:
    """Return the free motions of all rigid surfaces on the nodes of their bodies."""
    columns, loads, size = [], [], tearing.n_nodes * scene.components
    numbered = ((k, rigid) for k, each in enumerate(scene.supports) for rigid in each.rigid_surfaces)
    for number, surface in numbered:
        if not surface.free.any():
            continue
        mesh = scene.bodies[surface.body].mesh
        own = mesh.nodes_to_hold(surface.surface)
        modes, factors = surface.unit_modes(mesh.points[own])
        modes, load = modes[:, :, surface.free], (factors * surface.load)[surface.free]
        others = [support for place, support in enumerate(scene.supports) if place != number]
        prescribed, axes = scene.prescribed_along(surface.body, others)
        along = np.zeros((*prescribed.shape, modes.shape[2]))
        along[own] = modes
        along = axes.to_local(along)[own]
        _require_room(surface, along, ~np.isnan(prescribed[own]))
        basis, load = _independent(surface, modes.reshape(-1, modes.shape[2]), load)
        node, component = np.indices(modes.shape[:2]).reshape(2, -1)
        row = tearing.global_nodes(surface.body, own)[node] * scene.components + component
        place = np.broadcast_to(np.arange(basis.shape[1]), basis.shape)
        entries = (basis.ravel(), (np.repeat(row, basis.shape[1]), place.ravel()))
        columns.append(Csr(entries, shape=(size, basis.shape[1])))
        loads.append(load)
    if not columns:
        return FreeMotions(Csr((size, 0)), np.zeros(0))
    joined = sp.hstack(columns, format="csr")
    _require_flexible_slaves(scene, tearing, _moving(joined, (tearing.n_nodes, scene.components)))
    return FreeMotions(joined, np.concatenate(loads))


def _independent(
    surface: RigidSurface, modes: np.ndarray, load: np.ndarray, near: float = 1e-9
) -> tuple[np.ndarray, np.ndarray]:
    """Return orthonormal motions of nodes, (n, k), and the load on each, (k,).

    Nodes in a line are not moved by turning about it: that motion is left out. `modes`: motions of nodes by
    free components, dimensionless; `load`: that on each; `near`: singular value, relative to the largest, of
    what moves no node, and share of the load on it that is rounding.
    """
    basis, scale = np.linalg.qr(modes)
    left, size, turned = np.linalg.svd(scale)
    size = np.pad(size, (0, len(turned) - len(size)))  # of a single node
    moves = size > near * size.max()
    if moves.all():
        return basis, np.linalg.solve(scale.T, load)
    along = turned @ load
    if np.abs(along[~moves]).max() > near * np.abs(load).max():
        raise InfeasibleError(
            f"nodes of {surface.surface!r} of {surface.body!r} lie on the axis of its moment: name others"
        )
    return basis @ left[:, moves[: len(left)]], along[moves] / size[moves]


def _require_flexible_slaves(scene: Scene, tearing: Tearing, moving: np.ndarray) -> None:
    """Reject slaves with nodes that rigid surfaces move: prescribed nodes have no multipliers."""
    pairs: list[ContactPair | AnyTie] = [*scene.contacts, *scene.ties]
    for pair in pairs:
        nodes = tearing.global_nodes(pair.slave.body, np.unique(scene.facets(pair.slave)))
        if moving[nodes].any():
            surface = f"of surface {pair.slave.name!r} of body {pair.slave.body!r}"
            lie = counted(int(moving[nodes].sum()), f"node {surface} lies", f"nodes {surface} lie")
            raise InvalidInputError(
                f"slaves must be flexible, but {lie} on a free rigid surface: exchange them"
            )


def _require_room(surface: AnySupport, modes: np.ndarray, held: np.ndarray) -> None:
    """Reject free motions of nodes, (n, dim, k), along components that other supports hold, (n, dim)."""
    against = np.abs(modes[held]).max(axis=0, initial=0.0)
    if np.any(against > ROUNDING):
        raise InvalidInputError(
            f"rigid surface {surface.surface!r} of body {surface.body!r} meets another support at "
            f"{counted(int(held.any(axis=1).sum()), 'node')}: prescribe the same displacement and rotation"
        )
