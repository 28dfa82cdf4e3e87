"""How long work will still take, where its course so far allows to say so."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

#: Steps that an estimate looks back on, and the least that a residual needs.
WINDOW, LEAST = 12, 6
#: A falling residual has settled when both halves of the window predict its end within this factor.
SETTLED = 1.5

Sample: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Left:
    """Time that work will still take.

    Attributes:
        seconds: How long.
        bound: Whether it is rather the most that it may take.
    """

    seconds: float
    bound: bool = False


class Counted:
    """Work of so many pieces: the rest takes as long a piece as the last ones have taken."""

    def __init__(self) -> None:
        """Begin without knowledge."""
        self._spent: deque[float] = deque(maxlen=WINDOW)

    def add(self, seconds: float) -> None:
        """Note what a piece took."""
        self._spent.append(seconds)

    def seconds(self, pieces: float) -> float | None:
        """Return what so many pieces will take, None as long as none is done."""
        return pieces * sum(self._spent) / len(self._spent) if self._spent else None


class Falling:
    """Work that ends when a residual is small enough: said only where the course is even."""

    def __init__(self) -> None:
        """Begin without knowledge."""
        self._samples: deque[Sample] = deque(maxlen=WINDOW)
        self.first: float | None = None

    def add(self, moment: float, measure: float) -> None:
        """Note a residual and when it was reached, [s]."""
        if 0.0 < measure < math.inf:
            self._samples.append((moment, math.log(measure)))
            self.first = measure if self.first is None else self.first

    def end(self, target: float) -> float | None:
        """Return the moment at which the target will be reached, None while the course has not settled."""
        if len(self._samples) < LEAST or not target > 0.0:
            return None
        samples, half, goal = list(self._samples), len(self._samples) // 2, math.log(target)
        ends = [_crossing(part, goal) for part in (samples, samples[:half], samples[-half:])]
        now = samples[-1][0]
        spans = [end - samples[0][0] for end in ends if end is not None]
        if len(spans) < len(ends) or min(spans) <= 0.0 or max(spans) > SETTLED * min(spans):
            return None
        return max(samples[0][0] + spans[0], now)


def _crossing(samples: list[Sample], goal: float) -> float | None:
    """Return where the line of least squares through the samples meets a height; None if it does not fall."""
    count = len(samples)
    moment, height = (sum(sample[k] for sample in samples) / count for k in (0, 1))
    spread = sum((t - moment) ** 2 for t, _ in samples)
    rise = sum((t - moment) * (y - height) for t, y in samples)
    if not spread > 0.0 or not rise < 0.0:
        return None
    return moment + (goal - height) * spread / rise
