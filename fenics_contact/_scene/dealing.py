"""Which rank gets which subdomain: those alike go together, as a rank has one set of factors for all of them.

Neighbours are kept together only where nothing is alike: what ranks exchange is small.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from fenics_contact._base.sparse import PRODUCTS, expected_cost


@dataclass(frozen=True)
class Dealing:
    """Deals subdomains to ranks: of every body each rank gets its share, of as few kinds as possible.

    Where one body changes its shape or has all the contacts, no rank waits for another.

    Attributes:
        body: Numbers of the bodies, ascending, shape (n_subdomains,).
        kind: Numbers of kinds, the same for those that are alike; which is a guess.
        once: Seconds for the factors of one, which a rank makes once for each kind.
        each: Seconds for its products.
    """

    body: np.ndarray
    kind: np.ndarray
    once: np.ndarray
    each: np.ndarray

    @classmethod
    def of(cls, body: np.ndarray, kind: np.ndarray, size: np.ndarray, interface: np.ndarray) -> Dealing:
        """Return that of subdomains with some unknowns, of which rows touch some, shape (n_subdomains,)."""
        costs = [expected_cost(*each) for each in zip(size.tolist(), interface.tolist(), strict=True)]
        once, each = np.array([(cost.setup, PRODUCTS * cost.product) for cost in costs]).T
        return cls(body, kind, once, each)

    def among(self, ranks: int) -> np.ndarray:
        """Return the rank of every subdomain, shape (n_subdomains,); none of the ranks goes without."""
        if ranks == 1:
            return np.zeros(len(self.body), dtype=np.int64)
        shares = _Shares(self, ranks)
        for number in np.unique(self.body):
            shares.deal(np.flatnonzero(self.body == number))
        return _without_empty(shares.rank, ranks)


@dataclass
class _Shares:
    """What ranks have got so far.

    `uneven`: by how much of its share of a body a rank may have more, rather than part of a kind; `known`:
    ranks that have some of a kind; `load`: seconds of each rank, `room`: what is left for it of its `share`
    of the present body, `left`: seconds of it that are not dealt yet.
    """

    uneven: ClassVar[float] = 0.1

    dealing: Dealing
    ranks: int
    share: float = 0.0
    left: float = 0.0
    known: dict[int, list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.rank = np.full(len(self.dealing.body), -1)
        self.load, self.room = np.zeros(self.ranks), np.zeros(self.ranks)

    def deal(self, body: np.ndarray) -> None:
        """Deal the subdomains of a body."""
        given = self.dealing
        _, first, which, counts = np.unique(
            given.kind[body], return_index=True, return_inverse=True, return_counts=True
        )
        which = which.ravel()
        new = np.array([kind not in self.known for kind in given.kind[body[first]].tolist()])
        alone = (counts == 1) & new
        # How often factors of others are made depends on how they are dealt.
        self.share = float(given.each[body].sum() + given.once[body[first]][alone].sum()) / self.ranks
        self.room[:], self.left = self.share, self.ranks * self.share
        groups = [body[which == k] for k in np.flatnonzero(~alone)]
        groups.sort(key=lambda group: -float(given.each[group].sum()))  # a stable sort
        rest = [self._to_known(group) for group in groups]
        for group in rest:
            self._whole_if_possible(group)
        self._one_after_the_other(body[alone[which]])

    def _to_known(self, group: np.ndarray) -> np.ndarray:
        """Give ranks more of what they have got of earlier bodies; returns what is left."""
        for rank in self.known.get(int(self.dealing.kind[group[0]]), []):
            if len(group):
                group = self._give(rank, group, self._fitting(rank, group))
        return group

    def _whole_if_possible(self, group: np.ndarray) -> None:
        """Give all of a kind to one rank, which may have a bit more than its share then, or to several."""
        given = self.dealing
        while len(group):
            rank = self._emptiest()
            once = float(given.once[group[0]])
            over = float(given.each[group].sum()) - self._open(rank)
            self.load[rank] += once
            self.known.setdefault(int(given.kind[group[0]]), []).append(rank)
            # To divide a kind has the price of its factors once more, in time and in memory.
            whole = over <= max(once, self.uneven * self.share)
            count = len(group) if whole else max(self._fitting(rank, group), 1)
            group = self._give(rank, group, count)

    def _one_after_the_other(self, some: np.ndarray) -> None:
        """Deal subdomains that are like no others, neighbours to one rank."""
        cost = self.dealing.once + self.dealing.each
        while len(some):
            rank = self._emptiest()
            middle = np.cumsum(cost[some]) - 0.5 * cost[some]
            count = max(int(np.searchsorted(middle, self.room[rank])), 1)
            spent = float(self.dealing.once[some[:count]].sum())
            self.room[rank] -= spent
            self.load[rank] += spent
            self.left -= spent
            for kind in self.dealing.kind[some[:count]].tolist():
                self.known[kind] = [rank]  # those alike in bodies that follow go there, too
            some = self._give(rank, some, count)

    def _emptiest(self) -> int:
        """Return the rank with most room, of several the one with least to do so far."""
        most = np.flatnonzero(self.room >= self.room.max() - 1e-9 * np.abs(self.room).max())
        return int(most[np.argmin(self.load[most])])

    def _fitting(self, rank: int, group: np.ndarray) -> int:
        return int(np.clip(self._open(rank) / self.dealing.each[group[0]] + 0.5, 0, len(group)))

    def _open(self, rank: int) -> float:
        """Return what a rank may get: less than its room where others have got more than their share."""
        return (
            float(self.room[rank])
            * self.left
            / max(np.maximum(self.room, 0.0).sum(), self.left, np.finfo(float).tiny)
        )

    def _give(self, rank: int, group: np.ndarray, count: int) -> np.ndarray:
        """Give the first of some subdomains to a rank, and return the others."""
        self.rank[group[:count]] = rank
        cost = float(self.dealing.each[group[:count]].sum())
        self.room[rank] -= cost
        self.load[rank] += cost
        self.left -= cost
        return group[count:]


def _without_empty(rank: np.ndarray, ranks: int) -> np.ndarray:
    """Give every rank at least one subdomain, if there are as many."""
    counts = np.bincount(rank, minlength=ranks)
    for empty in np.flatnonzero(counts == 0)[: max(len(rank) - ranks + (counts == 0).sum(), 0)]:
        richest = int(np.argmax(counts))
        rank[np.flatnonzero(rank == richest)[-1]] = empty
        counts[richest] -= 1
        counts[empty] += 1
    return rank
