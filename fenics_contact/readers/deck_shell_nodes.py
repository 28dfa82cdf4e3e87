"""Which nodes of solid cells belong to the nodes of shells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ShellNodes:
    """Nodes across the thickness, for each node of shells and each direction that the shells have there.

    `node`: its position; `ends`: positions of the nodes at the bottom, in the middle, −1 where there is none,
    and on top, (n, 3); `sources`: twice the node, or, where it was added in the middle of an edge of shells
    of 3 and 4 nodes, the ends of this, (n, 2).
    """

    node: np.ndarray
    ends: np.ndarray
    sources: np.ndarray

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


_NONE = np.zeros(0, dtype=np.int64)
#: Of meshes without shells.
NO_SHELLS = ShellNodes(_NONE, np.zeros((0, 3), dtype=np.int64), np.zeros((0, 2), dtype=np.int64))
