"""Items by a number that agrees up to rounding where the items do."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from typing import Generic, TypeVar

Item = TypeVar("Item")


class ToleranceIndex(Generic[Item]):
    """Items that are found by a number close to theirs, in the order in which they were added."""

    def __init__(self) -> None:
        """Start empty."""
        self._places: list[tuple[float, int]] = []
        self._items: list[Item] = []

    def add(self, value: float, item: Item) -> None:
        """Add an item with its number."""
        insort(self._places, (value, len(self._items)))
        self._items.append(item)

    def near(self, value: float, room: float) -> list[Item]:
        """Return the items whose numbers differ by at most ``room``."""
        first = bisect_left(self._places, (value - room, -1))
        last = bisect_right(self._places, (value + room, len(self._items)))
        return [self._items[index] for index in sorted(index for _, index in self._places[first:last])]
