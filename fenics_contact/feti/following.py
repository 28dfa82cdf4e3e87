"""Dependent nodes of a subdomain, hanging ones or centres, which follow their masters in the subdomain.

With u_h = W u_m, written u = T u, the energy of a subdomain is that of Tᵀ K T and Tᵀ f. A stiffness between
dependent nodes and the means of their masters keeps them as unknowns, whose number and numbering stay:

    K' = Tᵀ K T + s Cᵀ C,    C u = u_h − W u_m.

Its kernel is that of K, as rigid motions satisfy C u = 0. No row of B acts on dependent nodes, and so the
equation K' u = Tᵀ f − Bᵀ λ gives C u = 0 exactly, whatever s is. Gluing the masters of two subdomains glues
what hangs on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.scene import Scene
from fenics_contact.mesh.body_mesh import BodyMesh


@dataclass(frozen=True, eq=False)
class Following:
    """The dependent nodes of a subdomain."""

    means: sp.csr_matrix
    apart: sp.csr_matrix

    @classmethod
    def of(cls, mesh: BodyMesh, nodes: np.ndarray, components: int) -> AnyFollowing:
        """Return those among the nodes of a subdomain, given by block."""
        followers = mesh.followers
        block = np.full(mesh.n_nodes, -1)
        block[nodes] = np.arange(len(nodes))
        here = block[followers.nodes] >= 0
        if not here.any():
            return NoneFollow(components * len(nodes))
        own, masters = block[followers.nodes[here]], block[followers.masters[here]]
        assert (masters >= 0).all()  # siblings are kept together
        count, width = masters.shape
        row, weight = np.repeat(np.arange(count), width), followers.weights[here].ravel()
        one, size = np.ones(count), len(nodes)
        chosen = sp.csr_matrix((one, (np.arange(count), own)), shape=(count, size))
        apart = chosen - sp.csr_matrix((weight, (row, masters.ravel())), shape=(count, size))
        every = sp.identity(components)
        means = sp.identity(size) - chosen.T @ apart
        return cls(sp.kron(means, every, format="csr"), sp.kron(apart, every, format="csr"))

    def same_as(self, other: AnyFollowing) -> bool:
        """Return whether the same nodes of another subdomain, numbered alike, follow the same others."""
        if self.apart.shape != other.apart.shape:
            return False
        return bool((self.apart != other.apart).nnz == 0)

    def stiffness(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """Return Tᵀ K T + s Cᵀ C, with s the mean of the diagonal's entries."""
        typical = float(np.abs(matrix.diagonal()).mean())
        return (self.means.T @ matrix @ self.means + typical * (self.apart.T @ self.apart)).tocsr()

    def force(self, force: np.ndarray) -> np.ndarray:
        """Return Tᵀ f."""
        return np.asarray(self.means.T @ force)


@dataclass(frozen=True)
class NoneFollow:
    """A subdomain all of whose nodes are unknowns."""

    size: int

    @property
    def means(self) -> sp.csr_matrix:
        """T, shape (n, n)."""
        return sp.identity(self.size, format="csr")

    @property
    def apart(self) -> sp.csr_matrix:
        """C, shape (0, n)."""
        return sp.csr_matrix((0, self.size))

    def same_as(self, other: AnyFollowing) -> bool:
        """Return whether no node of another subdomain follows others, either."""
        return not other.apart.shape[0]

    def stiffness(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """Return K itself."""
        return matrix

    def force(self, force: np.ndarray) -> np.ndarray:
        """Return f itself."""
        return force


AnyFollowing: TypeAlias = Following | NoneFollow


def dependent_nodes(scene: Scene, numbers: NodeNumbers) -> np.ndarray:
    """Return the numbers of the dependent nodes of all bodies, shape (n,)."""
    followers = {name: scene.bodies[name].mesh.followers for name in numbers.body_names}
    return np.concatenate([numbers.global_nodes(name, each.nodes) for name, each in followers.items()])
