"""Nodes that follow others: hanging ones, of small cells on the faces of larger neighbours, and centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError


class DependentNodes:
    """Nodes whose displacement is a combination of that of others, u_h = Σ w_j u_j.

    `masters`: the nodes that each follows, none of which depends on others.
    """

    nodes: np.ndarray
    masters: np.ndarray

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return len(self.nodes) > 0

    @property
    def weights(self) -> np.ndarray:
        """Weights of the masters, which add up to one, shape (n, k)."""
        return np.full(self.masters.shape, 1.0 / self.masters.shape[1])

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return values at all nodes, those of dependent ones by their masters', (n_nodes, ...)."""
        result = np.array(points, dtype=np.float64)
        result[self.nodes] = np.einsum("nk,nk...->n...", self.weights, result[self.masters])
        return result

    def means(self, n_nodes: int) -> sp.csr_matrix:
        """Return W with u_h = W u, shape (n, n_nodes)."""
        row = np.repeat(np.arange(len(self.nodes)), self.masters.shape[1])
        entries = self.weights.ravel(), (row, self.masters.ravel())
        return sp.csr_matrix(entries, shape=(len(self.nodes), n_nodes))

    def followed(self, n_nodes: int) -> sp.csr_matrix:
        """Return T with T u = u but at dependent nodes, where it is W u, shape (n_nodes, n_nodes)."""
        stays = np.ones(n_nodes)
        stays[self.nodes] = 0.0
        chosen = np.ones(len(self.nodes)), (self.nodes, np.arange(len(self.nodes)))
        spread = sp.csr_matrix(chosen, shape=(n_nodes, len(self.nodes)))
        return (sp.diags(stays) + spread @ self.means(n_nodes)).tocsr()


@displayed
@dataclass(frozen=True, eq=False)
class HangingNodes(DependentNodes):
    """Nodes whose displacement is the mean of that of others, u_h = 1/k Σ u_j, so that bodies do not gape.

    They lie at the mean of their masters, also where a surface is curved: on the larger facet, not on a shape
    that it approximates.

    Attributes:
        nodes: Their numbers, ascending, shape (n,).
        masters: The corners of the larger face that each lies on, none of which hangs, shape (n, 2) in the
            plane, (n, 4) in space; in the middle of an edge its two ends, each twice.
        levels: How often each cell was halved, shape (n_cells,); cells that share a point differ by one at
            most. Empty where there are no hanging nodes.
    """

    nodes: np.ndarray
    masters: np.ndarray
    levels: np.ndarray

    def filled_in(self, values: np.ndarray, facets: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Return nodal values, those of hanging nodes of facets that are not known by their masters'."""
        nodes, result = np.unique(facets), values.copy()
        fill = self.filled(nodes, np.isin(nodes, known))
        result[nodes] = (fill @ values[nodes].reshape(len(nodes), -1)).reshape(values[nodes].shape)
        return result

    def filled(self, nodes: np.ndarray, known: np.ndarray) -> sp.csr_matrix:
        """Return the matrix that fills in values at hanging nodes among some nodes, numbered ascending.

        `known`: marks of those with values, and of others that stay as they are, as do those whose masters
        are not among the nodes.
        """
        mine = np.isin(self.nodes, nodes[~known]) & np.isin(self.masters, nodes).all(axis=1)
        place = np.searchsorted(nodes, self.nodes[mine])
        masters = np.searchsorted(nodes, self.masters[mine])
        row = np.concatenate([np.delete(np.arange(len(nodes)), place), np.repeat(place, masters.shape[1])])
        column = np.concatenate([np.delete(np.arange(len(nodes)), place), masters.ravel()])
        weight = np.ones(len(row))
        weight[len(nodes) - len(place) :] = 1.0 / masters.shape[1]
        return sp.csr_matrix((weight, (row, column)), shape=2 * (len(nodes),))


@displayed
@dataclass(frozen=True, eq=False)
class Centres(DependentNodes):
    """Centres of faces and cells that follow the other nodes of these by the serendipity shape functions.

    Cells of 9 and 27 nodes are those of 8 and 20 nodes then: on quadrilaterals u_c = ½ Σ midpoints − ¼ Σ
    corners, in hexahedra u_c = ¼ Σ midpoints − ¼ Σ corners.

    Attributes:
        nodes: Their numbers, ascending, shape (n,).
        masters: Corners and midpoints that each follows, shape (n, 8 | 20); those of faces are repeated, with
            weights of zero.
        given: Their weights, shape (n, 8 | 20).
    """

    nodes: np.ndarray
    masters: np.ndarray
    given: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """Weights of the masters, which add up to one, shape (n, k)."""
        return self.given

    def without(self, nodes: np.ndarray) -> Centres:
        """Return those that are not among some nodes."""
        stays = ~np.isin(self.nodes, nodes)
        return Centres(self.nodes[stays], self.masters[stays], self.given[stays])


_NONE = np.zeros(0, dtype=np.int64)
#: Of meshes whose cells have one size beside each other.
NO_HANGING = HangingNodes(_NONE, np.zeros((0, 4), dtype=np.int64), _NONE)
#: Of meshes all of whose nodes are unknowns.
NO_CENTRES = Centres(_NONE, np.zeros((0, 20), dtype=np.int64), np.zeros((0, 20)))


def nodes_to_hold(hanging: DependentNodes, surface: str, facets: np.ndarray) -> np.ndarray:
    """Return the nodes by which a support holds a surface, ascending: hanging ones follow their masters."""
    nodes = np.unique(facets)
    mine = np.isin(hanging.nodes, nodes)
    masters = hanging.masters[mine]
    outside = ~np.isin(masters, nodes).all(axis=1)
    if outside.any():
        raise InvalidInputError(
            f"surfaces with supports must contain the masters of their hanging nodes, {surface!r} lacks some "
            f"of {np.count_nonzero(outside)} nodes: take all facets on the faces of larger cells"
        )
    return np.setdiff1d(nodes, hanging.nodes)


def require_none(dependent: DependentNodes, what: str, remedy: str) -> None:
    """Reject the hanging nodes or following centres of a mesh for what cannot deal with them."""
    if isinstance(dependent, Centres) and dependent:
        raise InvalidInputError(
            f"{what} needs complete cells, {len(dependent.nodes)} centres follow: take mesh.completed"
        )
    if dependent:
        raise InvalidInputError(
            f"{what} needs a mesh without hanging nodes, got {len(dependent.nodes)}: {remedy}"
        )
