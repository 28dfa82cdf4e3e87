"""Axes of nodes that supports hold along other directions than those of the coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import counted
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas

#: Directions are the same if the cosine of the angle between them differs from one by no more than this.
TILT = 1e-9


@dataclass(frozen=True, eq=False)
class LocalAxes:
    """Orthonormal axes of some nodes, along which components are held or free; others have the coordinates'.

    Attributes:
        nodes: The nodes, ascending, shape (k,).
        axes: Their axes as rows, shape (k, dim, dim).
    """

    nodes: np.ndarray
    axes: np.ndarray

    def __bool__(self) -> bool:
        """Return whether some nodes have axes of their own."""
        return len(self.nodes) > 0

    def after(self, first: int) -> LocalAxes:
        """Return the axes of nodes that are numbered from another first one."""
        return LocalAxes(self.nodes + first, self.axes)

    def place(self, nodes: np.ndarray) -> np.ndarray:
        """Return the positions of nodes among those with axes of their own, −1 for others."""
        if not self:
            return np.full(len(nodes), -1)
        index = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        return np.where(self.nodes[index] == nodes, index, -1)

    def along(self, nodes: np.ndarray, component: np.ndarray, dim: int) -> np.ndarray:
        """Return the axes of components of nodes as unit vectors, shape (n, dim)."""
        result, place = np.eye(dim)[component], self.place(nodes)
        turned = place >= 0
        result[turned] = self.axes[place[turned], component[turned]]
        return result

    def to_local(self, values: np.ndarray) -> np.ndarray:
        """Return the components of vectors of all nodes along their axes, both (n_nodes, dim, ...)."""
        result = np.array(values, dtype=np.float64)
        result[self.nodes] = np.einsum("kad,kd...->ka...", self.axes, result[self.nodes])
        return result

    def to_global(self, values: np.ndarray) -> np.ndarray:
        """Return vectors of all nodes from their components along the axes, both (n_nodes, dim, ...)."""
        result = np.array(values, dtype=np.float64)
        result[self.nodes] = np.einsum("kad,ka...->kd...", self.axes, result[self.nodes])
        return result

    def matrix(self, n_nodes: int) -> sp.csr_matrix:
        """Return `to_local` on all components of nodes, shape (n_nodes · dim, n_nodes · dim)."""
        dim = self.axes.shape[1]
        plain = np.setdiff1d(np.arange(n_nodes), self.nodes)
        own = (dim * plain[:, None] + np.arange(dim)).ravel()
        dof = dim * self.nodes[:, None] + np.arange(dim)
        row, column = np.repeat(dof, dim, axis=1).ravel(), np.tile(dof, dim).ravel()
        entries = np.concatenate([self.axes.ravel(), np.ones(len(own))])
        places = np.concatenate([row, own]), np.concatenate([column, own])
        return sp.csr_matrix((entries, places), shape=(dim * n_nodes,) * 2)


#: Of nodes all of which have the axes of the coordinates.
NO_AXES = LocalAxes(np.zeros(0, dtype=np.int64), np.zeros((0, 1, 1)))


def joined_axes(parts: Sequence[LocalAxes]) -> LocalAxes:
    """Return the axes of several groups of nodes, numbered in their order."""
    known = [part for part in parts if part]
    if not known:
        return NO_AXES
    nodes, axes = zip(*((part.nodes, part.axes) for part in known), strict=True)
    return LocalAxes(np.concatenate(nodes), np.concatenate(axes))


def same_axes(one: LocalAxes, other: LocalAxes, alike: float = 1e-9) -> bool:
    """Return whether nodes have the same axes, to `alike`."""
    return np.array_equal(one.nodes, other.nodes) and np.allclose(one.axes, other.axes, rtol=0.0, atol=alike)


def free_part(vectors: np.ndarray, node: np.ndarray, fixed: np.ndarray, axes: LocalAxes) -> np.ndarray:
    """Return the parts of vectors at nodes along which these are free.

    `vectors`: shape (m, dim); `node`: the node of each, shape (m,); `fixed`: whether a component of a node
    is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    result = np.where(fixed[node], 0.0, vectors)
    if axes:
        place = axes.place(node)
        at = np.flatnonzero(place >= 0)
        turned = axes.axes[place[at]]
        local = np.where(fixed[node[at]], 0.0, np.einsum("nad,nd->na", turned, vectors[at]))
        part = np.einsum("nad,na->nd", turned, local)
        size = np.linalg.norm(vectors[at], axis=1)[:, None]
        result[at] = np.where(np.abs(part) > ROUNDING * size, part, 0.0)
    return result


def free_matrix(fixed: np.ndarray, axes: LocalAxes) -> sp.csr_matrix:
    """Return `free_part` on all components of all nodes, shape (n_nodes · dim, n_nodes · dim)."""
    free = sp.diags((~fixed).ravel().astype(float))
    if not axes:
        return sp.csr_matrix(free)
    turn = axes.matrix(len(fixed))
    result = (turn.T @ free @ turn).tocsr()
    result.eliminate_zeros()
    return sp.csr_matrix(result)


@dataclass(frozen=True, eq=False)
class HeldDirections:
    """Directions along which a support holds nodes of a body; a node may have several.

    Attributes:
        surface: Name of the surface, for errors.
        nodes: Shape (n,).
        directions: Unit vectors, shape (n, dim).
        amounts: Displacements along them, shape (n,), [length].
    """

    surface: str
    nodes: np.ndarray
    directions: np.ndarray
    amounts: np.ndarray

    @property
    def layers(self) -> list[np.ndarray]:
        """Positions, so that no node occurs twice in one of them."""
        order = np.argsort(self.nodes, kind="stable")
        first = np.searchsorted(self.nodes[order], self.nodes[order])
        layer = np.arange(len(order)) - first
        return [order[layer == number] for number in range(int(layer.max(initial=-1)) + 1)]


def held_along(
    prescribed: np.ndarray, supports: Sequence[HeldDirections], body: str
) -> tuple[np.ndarray, LocalAxes]:
    """Hold nodes along directions, in addition to prescribed components.

    Each node gets orthonormal axes, and the held ones of these span the directions that are held there: the
    rows of B that hold them are independent wherever supports touch.

    `prescribed`: components of the nodes of a body, NaN where free, shape (n_nodes, dim), [length].

    Returns the components along the axes, NaN where free, and the axes.
    """
    nodes = np.unique(np.concatenate([each.nodes for each in supports]))
    dim = prescribed.shape[1]
    axes, values = np.tile(np.eye(dim), (len(nodes), 1, 1)), prescribed[nodes]
    for support in supports:
        for layer in support.layers:
            _hold(axes, values, np.searchsorted(nodes, support.nodes[layer]), support, layer, body)
    _straighten(axes, values)
    result = prescribed.copy()
    result[nodes] = values
    turned = np.flatnonzero((axes != np.eye(dim)).any(axis=(1, 2)))
    return result, LocalAxes(nodes[turned], axes[turned])


def _hold(
    axes: np.ndarray,
    values: np.ndarray,
    at: np.ndarray,
    support: HeldDirections,
    layer: np.ndarray,
    body: str,
    same: float = 1e-6,
) -> None:
    """Hold some nodes along one more direction each, in place.

    `same`: directions whose sine is below this count as held: a node that two supports hold along both would
    follow the rounding of their difference.
    """
    own, known = axes[at], values[at]
    amount, along = support.amounts[layer], np.einsum("nad,nd->na", own, support.directions[layer])
    held = ~np.isnan(known)
    missing = amount - np.where(held, along * np.nan_to_num(known), 0.0).sum(axis=1)
    along = np.where(held, 0.0, along)
    size = np.linalg.norm(along, axis=1)
    done = size <= same
    scale = max(np.abs(amount).max(initial=0.0), np.abs(np.nan_to_num(known)).max(initial=0.0))
    clash = np.flatnonzero(done & (np.abs(missing) > np.maximum(ROUNDING, 2.0 * size) * scale))
    if len(clash):
        first = int(clash[0])
        words = ", ".join(f"{part:.4g}" for part in support.directions[layer][first])
        raise InvalidInputError(
            f"supports must agree where they meet: {counted(len(clash), 'node')} of surface "
            f"{support.surface!r} of body {body!r} would move by {amount[first]:g} along ({words}), "
            f"where others prescribe {amount[first] - missing[first]:g}: give both the same there, or end one"
        )
    new = np.flatnonzero(~done)
    along, missing = along[new] / size[new, None], missing[new] / size[new]
    # The largest component decides, ties not by the last bit.
    axis = np.argmax(np.round(np.abs(along), 6), axis=1)
    sign = np.sign(along[np.arange(len(new)), axis])
    _reflect(axes, at[new], axis, along * sign[:, None])
    values[at[new], axis] = missing * sign


def _reflect(
    axes: np.ndarray, at: np.ndarray, axis: np.ndarray, along: np.ndarray, straight: float = 1e-9
) -> None:
    """Put an axis of some nodes along a unit vector, given along their axes, by a reflection, in place.

    `straight`: axes stay where the sine of the angle between both is below this.
    """
    mirror = np.eye(along.shape[1])[axis] - along
    square = np.einsum("na,na->n", mirror, mirror)
    turned = square > straight**2
    mirror, place = mirror[turned], at[turned]
    through = np.einsum("nd,ndc->nc", mirror, axes[place])
    axes[place] -= 2.0 / square[turned, None, None] * mirror[:, :, None] * through[:, None, :]


def _straighten(axes: np.ndarray, values: np.ndarray, straight: float = 1e-9) -> None:
    """Give nodes the axes of the coordinates where each of these is held or free as a whole, in place.

    `straight`: how far entries of projections may be off.
    """
    held, own = ~np.isnan(values), np.eye(axes.shape[1])
    projector = np.einsum("nad,na,nae->nde", axes, held.astype(float), axes)
    share = np.einsum("ndd->nd", projector)
    whole = np.abs(projector - np.round(share)[:, :, None] * own).max(axis=(1, 2)) <= straight
    whole &= (axes != own).any(axis=(1, 2))
    moved = np.einsum("nad,na->nd", axes[whole], np.nan_to_num(values[whole]))
    values[whole] = np.where(share[whole] > 0.5, moved, np.nan)
    axes[whole] = own


def flat_normals(mesh: BodyMesh, surface: str, flat: float = 1e-6) -> tuple[np.ndarray, ...]:
    """Return the outward normal of a flat surface, shape (dim,), none of a curved one and of a node set.

    `flat`: distance of nodes from a plane, relative to the size of the surface, up to which it is flat:
    coordinates of files have few digits.
    """
    if surface in mesh.node_sets:
        return ()
    facets = mesh.surfaces[surface]
    areas = vector_areas(mesh.points, facets)
    total = areas.sum(axis=0)
    size = np.linalg.norm(areas, axis=1).sum()
    if np.linalg.norm(total) <= 0.5 * size:
        return ()
    normal = total / np.linalg.norm(total)
    points = mesh.points[np.unique(facets)]
    away = (points - points[0]) @ normal
    if np.ptp(away) > flat * np.linalg.norm(np.ptp(points, axis=0)) or (areas @ normal <= 0.0).any():
        return ()
    return (np.asarray(normal),)


def widest_angle(mesh: BodyMesh, surface: str) -> float:
    """Return the largest angle between the normals of facets and their mean, in degrees."""
    areas = vector_areas(mesh.points, mesh.surfaces[surface])
    mean = areas.sum(axis=0)
    size = np.linalg.norm(areas, axis=1) * np.linalg.norm(mean)
    cosine = np.where(size > 0.0, areas @ mean, -1.0) / np.where(size > 0.0, size, 1.0)
    return float(np.degrees(np.arccos(np.clip(cosine.min(), -1.0, 1.0))))
