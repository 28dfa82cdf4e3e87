"""Rows of B at tied points: all components where surfaces are bonded, the normal ones where they slide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fenics_contact._pairing.points import ContactPoints, are_sliding
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.contact_rows import Relations
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.row_groups import Joint


@dataclass(frozen=True, eq=False)
class JoinedPoints(Relations, Joint):
    """Rows of a joint that compare displacements at points, whose forces are those on their slaves."""

    def forces(self, multiplier: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Return the forces on the slaves of all points, shape (n_points, dim), [force]."""
        # A row that supports determine is not in B.
        return -self.along_rows(np.where(self.held(fixed), 0.0, multiplier))

    def along_rows(self, values: np.ndarray) -> np.ndarray:
        """Return values of the rows times their directions, summed at each point, shape (n_points, dim)."""
        result = np.zeros((self.points.count, self.components))
        np.add.at(result, self.which, values[:, None] * self.directions)
        return result

    def on_nodes(self, forces: np.ndarray) -> np.ndarray:
        """Return forces of all points on slaves and masters, shape (n_nodes, dim), [force]."""
        return self.points.on_nodes(forces)

    def wrenches(self, modes: np.ndarray, nodes: slice) -> np.ndarray:
        """Return the work of unit forces along the rows, shape (n_modes, n_rows)."""
        arms = self.points.relative(modes, nodes)
        return np.einsum("rd,rdm->mr", self.directions, arms[self.which])

    def carried(self, before: JoinedPoints, multiplier: np.ndarray) -> np.ndarray:
        """Return the multipliers with the forces of the same points, shape (count,)."""
        forces = before.along_rows(multiplier)
        match = same_points(before.points, self.points)[self.which]
        return np.where(match >= 0, np.einsum("rd,rd->r", forces[match], self.directions), 0.0)


class PairedNodes(Protocol):
    """What points are known by from one system to the next."""

    @property
    def pair(self) -> np.ndarray:
        """Numbers of their pairs, shape (n,)."""

    @property
    def slave(self) -> np.ndarray:
        """Their slave nodes, shape (n,)."""


def same_points(before: PairedNodes, after: PairedNodes) -> np.ndarray:
    """Return for each new point the old one of the same pair and slave node, −1 where there is none."""
    if len(before.slave) == 0:
        return np.full(len(after.slave), -1)
    width = int(max(before.slave.max(), after.slave.max(initial=0))) + 1
    old, new = before.pair * width + before.slave, after.pair * width + after.slave
    order = np.argsort(old)
    index = np.minimum(np.searchsorted(old[order], new), len(old) - 1)
    return np.where(old[order[index]] == new, order[index], -1)


def matched(values: np.ndarray, match: np.ndarray) -> np.ndarray:
    """Return values (n, ...) at the numbers of points, zero where these are −1, shape (n_points, ...)."""
    found = np.zeros((len(match), *values.shape[1:]))
    found[match >= 0] = values[match[match >= 0]]
    return found


@dataclass(frozen=True, eq=False)
class BondedPoints(JoinedPoints):
    """Rows u_slave − u_master = −Q q along all components but those that supports prescribe on the slave."""

    closes = True

    def wrenches(self, modes: np.ndarray, nodes: slice) -> np.ndarray:
        """Return the work of unit forces along all axes at all points, shape (n_modes, n_points · dim)."""
        arms = self.points.relative(modes, nodes)
        return arms.reshape(-1, arms.shape[2]).T


def bonded_rows(points: ContactPoints, decomposition: Decomposition) -> tuple[np.ndarray, np.ndarray]:
    """Return points and directions of rows along all components that supports leave free on the slaves."""
    which, component = np.nonzero(~decomposition.fixed[points.slave])
    return which, decomposition.axes.along(points.slave[which], component, points.normal.shape[1])


class TieRows(JoinedPoints):
    """Rows of the ties of a scene."""

    closes = True

    @classmethod
    def key(cls, scene: Scene) -> Sequence[object]:
        """Return the ties."""
        return scene.ties


@dataclass(frozen=True, eq=False)
class BondedTies(TieRows, BondedPoints):
    """Rows of ties that may not slide."""

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[BondedTies]
    ) -> Sequence[BondedTies]:
        """Return those of the tied points of a scene."""
        points = ties.part(~are_sliding(scene.ties, ties.pair))
        return (cls(points, *bonded_rows(points, decomposition), axes=decomposition.axes),)


@dataclass(frozen=True, eq=False)
class SlidingTies(TieRows):
    """Rows of ties that may slide, along their normals."""

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[SlidingTies]
    ) -> Sequence[SlidingTies]:
        """Return those of the tied points of a scene."""
        points = ties.part(are_sliding(scene.ties, ties.pair))
        return (cls(points, np.arange(points.count), -points.normal, axes=decomposition.axes),)
