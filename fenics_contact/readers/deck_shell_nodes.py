"""Which nodes of solid cells belong to the nodes of shells and beams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ShellNodes:
    """Nodes across the thickness, for each node of shells and each direction that the shells have there.

    `node`: its position; `ends`: positions of the nodes at the bottom, in the middle, −1 where there is none,
    and on top, (n, 3), of beams those around the section: corner, middle of a side, corner, ..., (n, 8), of
    shells between them filled up by −1; `sources`: twice the node, or, where it was added in the middle of an
    edge of shells of 3 and 4 nodes or of a beam of two, the ends of this, (n, 2).
    """

    node: np.ndarray
    ends: np.ndarray
    sources: np.ndarray

    @property
    def of_beams(self) -> np.ndarray:
        """Which are of beams, (n,)."""
        return np.asarray((self.ends[:, 3:] >= 0).any(axis=1))

    @property
    def weights(self) -> np.ndarray:
        """Shares that the nodes across have of the displacements that CalculiX prints, as `ends`."""
        inner = np.arange(self.ends.shape[1]) % 2 == 1
        share = np.where(inner, np.where(self.of_beams[:, None], 0.0, 4.0), 1.0) * (self.ends >= 0)
        return np.asarray(share / share.sum(axis=1, keepdims=True))

    def joined(self, other: ShellNodes) -> ShellNodes:
        """Return these nodes and others."""
        width = max(self.ends.shape[1], other.ends.shape[1])
        ends = [
            np.pad(each.ends, ((0, 0), (0, width - each.ends.shape[1])), constant_values=-1)
            for each in (self, other)
        ]
        node, sources = np.append(self.node, other.node), np.vstack([self.sources, other.sources])
        return ShellNodes(node, np.vstack(ends), sources)

    @property
    def added(self) -> np.ndarray:
        """Which nodes the deck has not, (n,)."""
        return np.asarray(self.sources[:, 0] != self.sources[:, 1])

    def sides_at(self, node: int) -> np.ndarray:
        """Return the nodes at the bottom and on top whose mean the motion of a node is, none of others.

        At knots those of one shell are enough, as all turn about the node.
        """
        return self.ends[(self.sources == node).all(axis=1)][:1, [0, 2]].ravel()

    def across(self, nodes: np.ndarray) -> np.ndarray:
        """Return nodes with those across the thickness in place of nodes of shells, ascending."""
        mine = self.ends[np.isin(self.sources, nodes).all(axis=1)]
        return np.union1d(np.setdiff1d(nodes, self.node), mine[mine >= 0])

    def between(self, values: np.ndarray) -> np.ndarray:
        """Return values of all nodes, those in the middle of edges as means of the ends."""
        result = values.copy()
        result[self.node[self.added]] = values[self.sources[self.added]].mean(axis=1)
        return result

    def heated(self, values: np.ndarray) -> np.ndarray:
        """Return values of all nodes, those across the thickness from the nodes of the deck."""
        result = self.between(values)
        for column in self.ends.T:
            there = column >= 0
            result[column[there]] = values[self.sources[there]].mean(axis=1)
        return result


def first_come(node: np.ndarray, fits: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the number of the group of each node of an element.

    The first element of a node has the first group, the first that does not fit the next one. `fits`: returns
    which of some nodes of elements go with others.
    """
    group = np.full(len(node), -1)
    count, first = 0, np.zeros(int(node.max()) + 1, dtype=np.int64)
    number = first.copy()
    while (rest := np.flatnonzero(group < 0)).size:
        nodes, place = np.unique(node[rest], return_index=True)
        first[nodes], number[nodes] = rest[place], count + np.arange(len(nodes))
        mine = rest[fits(rest, first[node[rest]])]
        group[mine] = number[node[mine]]
        count += len(nodes)
    return group


_NONE = np.zeros(0, dtype=np.int64)
#: Of meshes without shells.
NO_SHELLS = ShellNodes(_NONE, np.zeros((0, 3), dtype=np.int64), np.zeros((0, 2), dtype=np.int64))
