"""Copies of nodes: the torn system holds each node of the bodies once for every subdomain around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenics_contact.linalg import expected_seconds
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import Scene


@dataclass(frozen=True)
class Tearing(NodeNumbers):
    """How the bodies of a scene are cut into subdomains, and which rank owns which.

    Replicated on all ranks. Subdomains are numbered together as nodes are, body after body. A *copy* is a
    pair (node, subdomain); copies are sorted by node, then by subdomain.

    Attributes:
        dim: Displacement components of a node.
        subdomain_offset: First subdomain of each body and the total, shape (n_bodies + 1,).
        subdomain_rank: Owner of each subdomain, shape (n_subdomains,).
        first_copy: First copy of each node and the total, shape (n_nodes + 1,).
        copy_subdomain: Subdomain of each copy, shape (n_copies,).
        copy_stiffness: Typical stiffness that each copy feels, the largest being one, shape (n_copies,).
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

    @cached_property
    def copy_share(self) -> np.ndarray:
        """Stiffness of each copy relative to all copies of its node, shape (n_copies,)."""
        return self.copy_stiffness / np.repeat(
            np.add.reduceat(self.copy_stiffness, self.first_copy[:-1]), self.multiplicity
        )

    @cached_property
    def on_several_ranks(self) -> np.ndarray:
        """Whether subdomains of different ranks hold a node, shape (n_nodes,)."""
        rank, first = self.subdomain_rank[self.copy_subdomain], self.first_copy[:-1]
        return np.asarray(np.minimum.reduceat(rank, first) != np.maximum.reduceat(rank, first))

    @property
    def n_subdomains(self) -> int:
        """Number of subdomains of all bodies."""
        return int(self.subdomain_offset[-1])

def tear(
    scene: Scene, partitions: Mapping[str, np.ndarray], ranks: int, stiffness: Mapping[str, np.ndarray]
) -> Tearing:
    """Cut the bodies along a partition of their cells and deal the subdomains out to ranks.

    Args:
        scene: The scene.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        ranks: Number of ranks; each gets about equally much work, of every body a run of consecutive
            subdomains.
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
        every = (cells + node_offset[index]) * total + subdomain[:, None]
        found, where = np.unique(every.ravel(), return_inverse=True)
        weights = np.repeat(stiffness[name], cells.shape[1])
        keys.append(found)
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
    """Return what each subdomain is expected to cost, shape (n_subdomains,), [s].

    Args:
        copy_subdomain: Subdomain of each copy of a node.
        shared: Whether other subdomains hold that node too.
        count: Number of subdomains.
        dim: Displacement components of a node.
    """
    size = dim * np.bincount(copy_subdomain, minlength=count)
    interface = dim * np.bincount(copy_subdomain[shared], minlength=count)
    return np.array([expected_seconds(int(n), int(b)) for n, b in zip(size, interface, strict=True)])


def _deal_out(costs: list[np.ndarray], ranks: int) -> np.ndarray:
    """Return the rank of every subdomain, given the costs body by body.

    Each body is shared by all ranks as far as it goes: where one body changes its shape or has all the
    contacts, no rank waits for another.
    """
    place = np.concatenate([(np.cumsum(cost) - 0.5 * cost) / cost.sum() for cost in costs])
    order = np.argsort(place, kind="stable")
    owner = np.empty(len(place), dtype=np.int64)
    owner[order] = _spread_over_ranks(np.concatenate(costs)[order], ranks)
    return owner


def _spread_over_ranks(cost: np.ndarray, ranks: int) -> np.ndarray:
    """Deal consecutive items to ranks so that the costs are about equal and no rank stays empty."""
    middle = np.cumsum(cost) - 0.5 * cost
    owner = np.minimum((middle * ranks / cost.sum()).astype(int), ranks - 1)
    # Every rank gets at least one: no rank is skipped on the way up, and the last ones are kept for the rest.
    index = np.arange(len(cost))
    without_jumps = np.minimum.accumulate(np.minimum(owner, index) - index) + index
    return np.maximum(without_jumps, ranks - (len(cost) - index))
