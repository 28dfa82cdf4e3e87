"""Which runs are worth their time: no other is both faster and more accurate."""

from __future__ import annotations

from collections.abc import Sequence


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the numbers of the points that no other point beats in both, by rising cost.

    Args:
        costs: What each point costs, (n,).
        errors: How wrong each point is, (n,).
    """
    front: list[int] = []
    best = float("inf")
    for number in sorted(range(len(costs)), key=lambda k: (costs[k], errors[k])):
        if errors[number] < best:
            front.append(number)
            best = errors[number]
    return front
