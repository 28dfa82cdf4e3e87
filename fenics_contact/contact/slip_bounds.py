"""The next slip bounds of the Coulomb fixed point: undamped as long as that converges, else damped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.qp import Vector, global_sum

#: Slip bounds have returned to earlier ones if the distance to these, relative to the last ones, is below
#: this.
RETURN_RATIO = 0.3
#: A cycle is a return in this many consecutive steps.
RETURNS = 3
#: Residuals have stopped falling if this many steps (1/θ times as many when damped) have not reduced the best
#: one by this factor.
PATIENCE, PROGRESS = 10, 0.9
#: Number of earlier slip bounds that are compared: the longest period that is recognised, plus one.
MEMORY = 6


@dataclass(frozen=True)
class Damping:
    """Ψ ← (1 − θ) Ψ + θ μ λ_N with θ = 1 until the iteration cycles or stagnates.

    Near the solution the undamped iteration multiplies an error by an eigenvalue that friction makes
    negative: below −1 it alternates without converging, and damping by θ moves the eigenvalue ω to 1 − θ
    (1 − ω).

    Attributes:
        fractions: The values of θ, each used when the one before it failed.
    """

    fractions: tuple[float, ...] = (1.0, 0.6, 0.3, 0.15)


class SlipBoundSequence:
    """Chooses slip bounds from the record of earlier ones.

    Attributes:
        fraction: θ of the next step.
        exhausted: Whether the smallest θ failed too.
    """

    def __init__(self, comm: MPI.Comm, damping: Damping) -> None:
        """Begin with the first θ and an empty record."""
        self._comm, self._fractions = comm, damping.fractions
        self._stage = 0
        self._bounds: list[Vector] = []
        self._best, self._since_best, self._returns = np.inf, 0, 0

    @property
    def fraction(self) -> float:
        """θ of the next step."""
        return self._fractions[min(self._stage, len(self._fractions) - 1)]

    @property
    def exhausted(self) -> bool:
        """Whether the smallest θ failed too."""
        return self._stage >= len(self._fractions)

    def advance(self, bound: Vector, image: Vector, residual: float) -> tuple[Vector, str]:
        """Return the next slip bound and a note on the decision. Collective.

        Args:
            bound: Ψ of the last Tresca problem, shape (n_friction,), owned.
            image: The slip bound that belongs to its solution, shape (n_friction,), owned.
            residual: Natural residual of that solution with ``image``.
        """
        self._bounds = [*self._bounds[1 - MEMORY :], bound]
        period, change = self._returned(image)
        self._returns = self._returns + 1 if period else 0
        if residual < PROGRESS * self._best:
            self._best, self._since_best = residual, 0
        else:
            self._since_best += 1
        note = f"slip bounds changed by {change:.1e}"
        reason = self._failure(period)
        if reason:
            self._stage += 1
            self._bounds, self._best, self._since_best, self._returns = [], np.inf, 0, 0
            remedy = "no θ is left" if self.exhausted else f"damping with θ = {self.fraction:g}"
            note += f", {reason}: {remedy}"
        return (1.0 - self.fraction) * bound + self.fraction * image, note

    def _failure(self, period: int) -> str:
        """Return why the present θ fails, empty if it does not."""
        if self._returns >= RETURNS and self._since_best >= RETURNS:
            return f"they cycle with period {period}"
        if self._since_best * self.fraction >= PATIENCE:
            return f"the residual has not fallen in {self._since_best} steps"
        return ""

    def _returned(self, image: Vector) -> tuple[int, float]:
        """Return the period with which the bounds repeat, 0 for none, and their last relative change."""
        squares = [(image - earlier) @ (image - earlier) for earlier in reversed(self._bounds)]
        *distances, size = np.sqrt(global_sum(self._comm, *squares, image @ image))
        change = float(distances[0] / size) if size > 0.0 else 0.0
        older = distances[1:]
        if not older or distances[0] == 0.0 or min(older) > RETURN_RATIO * distances[0]:
            return 0, change
        return int(np.argmin(older)) + 2, change
