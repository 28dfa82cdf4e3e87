"""Rows of B for heat between surfaces: T_slave − T_master − C λ = T_obstacle, with λ the heat that passes.

With the conductance h and the area A of a point C is 1/(h A), and zero where surfaces are tied: bodies stay
as they are, with their constants without energy, and a perfect joint is a row and no penalty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.feti.ties import JoinedPoints

if TYPE_CHECKING:
    from fenics_contact._pairing.points import ContactPoints
    from fenics_contact._scene.scene import Scene
    from fenics_contact.feti.decomposition import Decomposition


@dataclass(frozen=True, eq=False)
class ConductingRows(JoinedPoints):
    """Heat that passes at points, one row each.

    `resistance`: C, shape (n,), [degree / power]; `opposite`: temperature of rigid masters, zero elsewhere,
    and what a linearised law adds, shape (n,).
    """

    resistance: np.ndarray
    opposite: np.ndarray

    @classmethod
    def at(cls, points: ContactPoints, resistance: np.ndarray, opposite: np.ndarray) -> ConductingRows:
        """Return rows at all of the points."""
        every = np.arange(points.count)
        return cls(points, every, np.ones((points.count, 1)), resistance, opposite)

    @classmethod
    def key(cls, scene: Scene) -> Sequence[object]:
        """Return nothing: no scene of mechanics has such rows."""
        return ()

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[ConductingRows]
    ) -> Sequence[ConductingRows]:
        """Return none, as above."""
        return ()

    def act_as(self, other: ConductingRows) -> bool:
        """Return whether B and C have the same entries in these rows as in others."""
        mine, theirs = self.points.jump, other.points.jump
        same = np.array_equal(self.resistance, other.resistance)
        same = same and np.array_equal(self.points.slave, other.points.slave)
        return same and mine.shape == theirs.shape and (mine != theirs).nnz == 0

    @property
    def compliance(self) -> np.ndarray:
        """C, shape (n,), [degree / power]."""
        return self.resistance

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return the temperatures of rigid masters, shape (n,)."""
        return self.opposite

    def held(self, fixed: np.ndarray) -> np.ndarray:
        """Return which rows held temperatures determine: perfect ones between nodes that are held all.

        Others pass heat whatever is held.
        """
        held = np.asarray(abs(self.points.jump) @ (~fixed[:, 0]).astype(float) == 0.0)
        return held & (self.resistance == 0.0)
