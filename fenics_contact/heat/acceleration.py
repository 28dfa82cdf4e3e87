"""Fixed points by Anderson's acceleration."""

from __future__ import annotations

import numpy as np


class Anderson:
    """The next guess of x = g(x) from those before, by the combination whose changes g(x) − x are least.

    References:
        D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965) 547-560;
        H. F. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49 (2011)
        1715-1735.
    """

    def __init__(self, depth: int = 5) -> None:
        """Combine the last guess with that many before it."""
        self._depth = depth
        self._found: list[np.ndarray] = []
        self._changes: list[np.ndarray] = []

    def next(self, guess: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Return the next guess after g(guess) was found, shape (n,) each."""
        return self._combined(guess, found, 1.0)

    def _combined(self, guess: np.ndarray, found: np.ndarray, share: float) -> np.ndarray:
        """Return the combination with a share of its change."""
        self._found.append(found)
        self._changes.append(found - guess)
        del self._found[: -self._depth - 1], self._changes[: -self._depth - 1]
        if len(self._changes) == 1:
            return guess + share * (found - guess)
        steps = np.diff(self._changes, axis=0).T
        scale = np.linalg.norm(steps, axis=0)
        kept = scale > 1e-14 * np.linalg.norm(self._changes[-1])
        steps, scale = steps[:, kept], scale[kept]
        parts = np.linalg.lstsq(steps / scale, self._changes[-1], rcond=1e-10)[0] / scale
        following = found - np.diff(self._found, axis=0).T[:, kept] @ parts
        return np.asarray(following - (1.0 - share) * (self._changes[-1] - steps @ parts))


class CautiousAnderson(Anderson):
    """The same of laws that bend: where the change has grown, what was known is forgotten and half is taken.

    Guesses stay within those of the last step.

    Attributes:
        change: Largest |g(x) − x| at the last guess.
        rate: The same relative to the one before.
    """

    def __init__(self, depth: int) -> None:
        """Combine the last guess with that many before it."""
        super().__init__(depth)
        self._share, self.change, self.rate = 1.0, 0.0, 0.0

    def next(self, guess: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Return the next guess after g(guess) was found, shape (n,) each."""
        before, self.change = self.change, float(np.abs(found - guess).max())
        self.rate = self.change / before if before else 1.0
        self._share = 0.5 * self._share if self.rate > 1.0 else min(1.0, 1.2 * self._share)
        if self.rate > 1.0:
            self._found.clear()
            self._changes.clear()
        following, both = self._combined(guess, found, self._share), (guess, found)
        return np.clip(following, np.min(both), np.max(both))
