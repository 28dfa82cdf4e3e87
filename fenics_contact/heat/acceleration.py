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
        """Remember that many guesses."""
        self._depth = depth
        self._found: list[np.ndarray] = []
        self._changes: list[np.ndarray] = []

    def next(self, guess: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Return the next guess after g(guess) was found, shape (n,) each."""
        self._found.append(found)
        self._changes.append(found - guess)
        del self._found[: -self._depth - 1], self._changes[: -self._depth - 1]
        if len(self._changes) == 1:
            return found
        steps = np.diff(self._changes, axis=0).T
        scale = np.linalg.norm(steps, axis=0)
        kept = scale > 1e-14 * np.linalg.norm(self._changes[-1])
        steps, scale = steps[:, kept], scale[kept]
        parts = np.linalg.lstsq(steps / scale, self._changes[-1], rcond=1e-10)[0] / scale
        return np.asarray(found - np.diff(self._found, axis=0).T[:, kept] @ parts)
