"""Copies of nodes: the torn system has one copy of each node for every subdomain around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.linalg import expected_seconds
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import Scene


@displayed
@dataclass(frozen=True)
class Tearing(NodeNumbers):
    """The subdomains of the bodies of a scene, and the rank that owns each.

    Replicated on all ranks. Subdomains, like nodes, are numbered consecutively, body after body. A *copy* is
    a pair (node, subdomain); copies are sorted by node, then by subdomain.

    Attributes:
        dim: Displacement components of a node.
        subdomain_offset: First subdomain of each body and the total, shape (n_bodies + 1,).
        subdomain_rank: Owner of each subdomain, shape (n_subdomains,).
        first_copy: First copy of each node and the total, shape (n_nodes + 1,).
        copy_subdomain: Subdomain of each copy, shape (n_copies,).
        copy_stiffness: Typical stiffness at each copy, the largest being one, shape (n_copies,).
    """

    dim: int
    subdomain_offset: np.ndarray
    subdomain_rank: np.ndarray
    first_copy: np.ndarray
    copy_subdomain: np.ndarray
    copy_stiffness: np.ndarray

    @property
    def multiplicity(self) -> np.ndarray:
        """Number of copies of each node, shape (n_nodes,)."""
        return np.diff(self.first_copy)

    @property
    def copy_node(self) -> np.ndarray:
        """Node of each copy, shape (n_copies,)."""
        return np.repeat(np.arange(self.n_nodes), self.multiplicity)

    def copies_of(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return for each copy of each of some nodes the place of that node among them, and the copy."""
        copies = self.multiplicity[nodes]
        within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
        return np.repeat(np.arange(len(nodes)), copies), np.repeat(self.first_copy[nodes], copies) + within

    @cached_property
    def copy_share(self) -> np.ndarray:
        """Stiffness of each copy relative to all copies of its node, shape (n_copies,)."""
        return self.copy_stiffness / np.repeat(
            np.add.reduceat(self.copy_stiffness, self.first_copy[:-1]), self.multiplicity
        )

    @cached_property
    def on_several_ranks(self) -> np.ndarray:
        """Whether subdomains of different ranks share a node, shape (n_nodes,)."""
        rank, first = self.subdomain_rank[self.copy_subdomain], self.first_copy[:-1]
        return np.asarray(np.minimum.reduceat(rank, first) != np.maximum.reduceat(rank, first))

    @property
    def n_subdomains(self) -> int:
        """Number of subdomains of all bodies."""
        return int(self.subdomain_offset[-1])


def tear(
    scene: Scene, partitions: Mapping[str, np.ndarray], ranks: int, stiffness: Mapping[str, np.ndarray]
) -> Tearing:
    """Cut the bodies along a partition of their cells and distribute the subdomains over ranks.

    Args:
        scene: The scene.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        ranks: Number of ranks; each has about the same work, of every body consecutive subdomains.
        stiffness: Body name -> typical nodal stiffness of every cell, shape (n_cells,), [force / length].
    """
    numbers = NodeNumbers.of(scene)
    names, node_offset = numbers.body_names, numbers.node_offset
    counts = [int(partitions[name].max()) + 1 for name in names]
    subdomain_offset = np.cumsum([0, *counts])
    total = int(subdomain_offset[-1])
    keys, sums = [], []
    for index, name in enumerate(names):
        cells = scene.bodies[name].mesh.cells
        subdomain = partitions[name].astype(np.int64) + subdomain_offset[index]
        # One integer key per node and subdomain: unique keys are the copies, already in their order.
        every = (cells + node_offset[index]) * total + subdomain[:, None]
        unique, where = np.unique(every.ravel(), return_inverse=True)
        weights = np.repeat(stiffness[name], cells.shape[1])
        keys.append(unique)
        sums.append(np.bincount(where.ravel(), weights) / np.bincount(where.ravel()))
    key, stiff = np.concatenate(keys), np.concatenate(sums)
    multiplicity = np.bincount(key // total, minlength=int(node_offset[-1]))
    costs = _costs(key % total, multiplicity[key // total] > 1, total, scene.dim)
    return Tearing(
        names,
        node_offset,
        scene.dim,
        subdomain_offset,
        _deal_out(np.split(costs, subdomain_offset[1:-1]), ranks),
        np.concatenate([[0], np.cumsum(multiplicity)]),
        key % total,
        stiff / stiff.max(),
    )


def _costs(copy_subdomain: np.ndarray, shared: np.ndarray, count: int, dim: int) -> np.ndarray:
    """Return the estimated cost of each subdomain, shape (n_subdomains,), [s].

    Args:
        copy_subdomain: Subdomain of each copy of a node.
        shared: Whether other subdomains share that node.
        count: Number of subdomains.
        dim: Displacement components of a node.
    """
    size = dim * np.bincount(copy_subdomain, minlength=count)
    interface = dim * np.bincount(copy_subdomain[shared], minlength=count)
    return np.array([expected_seconds(int(n), int(b)) for n, b in zip(size, interface, strict=True)])


def _deal_out(costs: list[np.ndarray], ranks: int) -> np.ndarray:
    """Return the rank of every subdomain, given the costs body by body.

    Each body is spread over all ranks as far as possible: where one body changes its shape or has all the
    contacts, no rank waits for another.
    """
    place = np.concatenate([(np.cumsum(cost) - 0.5 * cost) / cost.sum() for cost in costs])
    order = np.argsort(place, kind="stable")
    owner = np.empty(len(place), dtype=np.int64)
    owner[order] = _spread_over_ranks(np.concatenate(costs)[order], ranks)
    return owner


def _spread_over_ranks(cost: np.ndarray, ranks: int) -> np.ndarray:
    """Distribute consecutive items over ranks so that the costs are about equal and no rank is empty."""
    middle = np.cumsum(cost) - 0.5 * cost
    owner = np.minimum((middle * ranks / cost.sum()).astype(int), ranks - 1)
    # Every rank has at least one: no rank is skipped, and enough items remain for the last ones.
    index = np.arange(len(cost))
    without_jumps = np.minimum.accumulate(np.minimum(owner, index) - index) + index
    return np.maximum(without_jumps, ranks - (len(cost) - index))
