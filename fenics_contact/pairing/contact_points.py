"""Contact points: nodes of one surface with their counterparts on another surface or an obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed

#: Weights of nodes below this fraction of all are rounding, which must not keep a supported point free.
HELD = 1e-6


@displayed
@dataclass(frozen=True)
class ContactPoints:
    """Contact points of a scene, replicated on all ranks, in the order pair by pair, node by node.

    Attributes:
        pair: Contact pair of the scene, shape (n,).
        slave: Slave node among all bodies' nodes, shape (n,).
        master: Weights of the nodes of all bodies in the node's counterpart on the master, shape (n,
            n_nodes); a row sums to one, and is empty on a rigid obstacle.
        normal: Unit normal from master to slave, shape (n, dim).
        tangents: Unit tangents, shape (n, dim - 1, dim).
        gap: Gap before anything moves, positive when open: the distance, or what the pair gives in its place,
            shape (n,), [length].
        area: Area of the slave surface that belongs to the node, shape (n,), [length^(dim - 1)].
        facet: Facet of the master surface that a node projects on; −1 on a rigid obstacle and where a point
            represents a mean over facets, shape (n,).
        local: Local coordinates on it, shape (n, dim - 1).
        axes: Coordinate axis nearest to the first tangent, as a unit vector, shape (n, dim).
        symmetric: Components normal to a plane of symmetry that cuts both surfaces there, or the one on an
            obstacle: the mirror images move opposite, so that there is no slip across the plane, shape (n,
            dim).
        distance: Measured distance of the surfaces along the normal, positive when apart, shape (n,),
            [length].
        given: Whether the pair says what the gap is, by a value or by declaring the measured overlap an
            interference, shape (n,).
        taken: Slave nodes plus one of other pairs that have a point in the same place, which is left out, on
            a surface beside: their areas are part of that of the point. Shape (n, n_pairs); None: none are.
    """

    pair: np.ndarray
    slave: np.ndarray
    master: sp.csr_matrix
    normal: np.ndarray
    tangents: np.ndarray
    gap: np.ndarray
    area: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    axes: np.ndarray
    symmetric: np.ndarray
    distance: np.ndarray
    given: np.ndarray
    taken: sp.csr_matrix | None = None

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.slave)

    def part(self, chosen: np.ndarray) -> ContactPoints:
        """Return some of the points, by indices or a mask."""
        names = [each.name for each in fields(self) if getattr(self, each.name) is not None]
        return ContactPoints(**{name: getattr(self, name)[chosen] for name in names})

    def of_surface(self, pair: int, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return slave nodes of a pair whose areas belong to points, ascending, with values of these points.

        Args:
            pair: Number of the pair.
            values: A value for each point, shape (n,).
        """
        mine = np.flatnonzero(self.pair == pair)
        if self.taken is None:
            return self.slave[mine], values[mine]
        other = self.taken[:, [pair]].tocoo()
        nodes = np.concatenate([self.slave[mine], other.data - 1])
        order = np.argsort(nodes)
        return nodes[order], np.concatenate([values[mine], values[other.row]])[order]

    @cached_property
    def jump(self) -> sp.csr_matrix:
        """Weights of the nodes in slave minus master displacement, shape (n, n_nodes)."""
        entries = np.ones(self.count), self.slave, np.arange(self.count + 1)
        return (sp.csr_matrix(entries, shape=self.master.shape) - self.master).tocsr()


def join_points(parts: Sequence[ContactPoints], dim: int, n_nodes: int) -> ContactPoints:
    """Concatenate the points of several pairs; empty if there are no parts."""
    if not parts:
        integer = np.zeros(0, dtype=np.int64)
        return ContactPoints(
            integer, integer, sp.csr_matrix((0, n_nodes)), np.zeros((0, dim)), np.zeros((0, dim - 1, dim)),
            np.zeros(0), np.zeros(0), integer, np.zeros((0, dim - 1)), np.zeros((0, dim)),
            np.zeros((0, dim), dtype=bool), np.zeros(0), np.zeros(0, dtype=bool),
        )  # fmt: skip

    if len(parts) == 1:
        return parts[0]

    def strung(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    taken = None
    if some := [part.taken for part in parts if part.taken is not None]:
        none = [sp.csr_matrix((part.count, some[0].shape[1])) for part in parts]
        each = [zero if part.taken is None else part.taken for part, zero in zip(parts, none, strict=True)]
        taken = sp.vstack(each, format="csr")

    return ContactPoints(
        strung("pair"), strung("slave"), sp.vstack([part.master for part in parts], format="csr"),
        strung("normal"), strung("tangents"), strung("gap"), strung("area"), strung("facet"), strung("local"),
        strung("axes"), strung("symmetric"), strung("distance"), strung("given"), taken,
    )  # fmt: skip


def reference_axes(normals: np.ndarray) -> np.ndarray:
    """Return for each normal the coordinate axis that is least aligned with it, shape (n, dim)."""
    # Rounding first: symmetric geometries have ties, which must not be decided by the last bit.
    return np.eye(normals.shape[1])[np.argmin(np.round(np.abs(normals), 6), axis=1)]


def movable(points: ContactPoints, fixed: np.ndarray) -> np.ndarray:
    """Return the components of the relative displacement that supports leave free, shape (n_points, dim).

    Args:
        points: The points.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    jump = points.jump
    squares = sp.csr_matrix((jump.data**2, jump.indices, jump.indptr), shape=jump.shape)
    free, every = squares @ (~fixed).astype(float), squares @ np.ones(fixed.shape)
    return np.asarray((free > HELD**2 * every) & ~points.symmetric)


def in_free_frames(points: ContactPoints, fixed: np.ndarray) -> ContactPoints:
    """Return points whose second tangent is the only direction of slip where supports leave one.

    Where one component is held, closed points can slip only normal to that axis and the normal.

    Args:
        points: Points in frames that depend only on the normals.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    if points.normal.shape[1] == 2:
        return points
    held = ~movable(points, fixed)
    single = (held.sum(axis=1) == 1) & (np.einsum("nd,nd->n", held, points.normal**2) < 0.5)
    axes = np.where(single[:, None], held.astype(float), points.axes)
    return replace(points, axes=axes, tangents=tangent_frames(points.normal, axes))


def tangent_frames(normals: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    """Return the unit tangents of each unit normal, shape (n, dim - 1, dim).

    In space (t1, t2, n) is right-handed, in the plane (t, n).

    Args:
        normals: Unit normals, shape (n, dim).
        axes: Axes nearest to the first tangents, shape (n, dim); `reference_axes` by default.
    """
    if normals.shape[1] == 2:
        return np.stack([normals[:, 1], -normals[:, 0]], axis=1)[:, None]
    axes = reference_axes(normals) if axes is None else axes
    first = axes - np.einsum("nd,nd->n", axes, normals)[:, None] * normals
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=1)
