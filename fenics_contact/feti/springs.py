"""Rows of springs between surfaces: B u − C λ = −C N₀ with the compliance C = 1/k, so that λ is the force.

With N = N₀ + k d·(ū₂ − ū₁) and a row of B that is d times the difference of the means, λ = N. The dual
operator of these rows is F + C: bodies stay as they are, with their kernels, and C → 0 ties the means.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.points import ContactPoints, NodeNumbers, tangent_frames
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.springs import mean_weights

if TYPE_CHECKING:
    from fenics_contact.feti.contact_rows import Relations


@dataclass(frozen=True, eq=False)
class SpringRows:
    """The last rows of ties, replicated.

    Attributes:
        spring: Spring of each row, shape (n,).
        directions: d, unit vectors, shape (n, components).
        compliance: C, shape (n,), [length / force].
        tension: N₀, shape (n,), [force].
    """

    spring: np.ndarray
    directions: np.ndarray
    compliance: np.ndarray
    tension: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> SpringRows:
        """Return those of a scene with springs."""
        parts = [each.rows(scene) for each in scene.springs]
        counts = [len(stiffness) for _, stiffness in parts]
        directions, stiffness = (np.concatenate(part) for part in zip(*parts, strict=True))
        directions = np.pad(directions, ((0, 0), (0, scene.components - scene.dim)))
        tension = np.repeat([each.tension for each in scene.springs], counts)
        return cls(np.repeat(np.arange(len(counts)), counts), directions, 1.0 / stiffness, tension)

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.spring)

    @property
    def right(self) -> np.ndarray:
        """Right sides c, shape (n,), [length]."""
        return -self.compliance * self.tension


def spring_points(scene: Scene, numbers: NodeNumbers) -> ContactPoints:
    """Return a point for each spring whose slave less its master is ū₂ − ū₁, numbered after all sections.

    The slave is a node of an end: its rank owns the rows. The rest of the mean counts as master.
    """
    count, dim, n_nodes = len(scene.springs), scene.components, numbers.n_nodes
    entries: list[tuple[np.ndarray, ...]] = []
    slaves = np.zeros(count, dtype=np.int64)
    for number, spring in enumerate(scene.springs):
        for end, sign in ((spring.first, 1.0), (spring.second, -1.0)):
            if isinstance(end, Surface):
                own, weights = mean_weights(scene, end)
                nodes = numbers.global_nodes(end.body, own)
                entries.append((sign * weights, np.full(len(nodes), number), nodes))
                slaves[number] = nodes[0]
    entries.append((np.ones(count), np.arange(count), slaves))
    value, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    master = sp.csr_matrix((value, (row, column)), shape=(count, n_nodes))
    first, nothing = len(scene.ties) + len(scene.preloads), np.zeros(count)
    normals = np.tile(np.eye(dim)[0], (count, 1))
    return ContactPoints(
        first + np.arange(count), slaves, master, normals, tangent_frames(normals), nothing, nothing,
        np.full(count, -1), np.zeros((count, dim - 1)), np.tile(np.eye(dim)[1], (count, 1)),
        np.zeros((count, dim), dtype=bool), nothing, np.ones(count, dtype=bool),
    )  # fmt: skip


def with_springs(tied: Relations, springs: SpringRows) -> Relations:
    """Return the rows of ties and sections, and behind them those of springs, whose points are the last."""
    first = tied.points.count - int(springs.spring[-1]) - 1
    kept = tied.which < first
    return replace(
        tied,
        which=np.concatenate([tied.which[kept], first + springs.spring]),
        directions=np.concatenate([tied.directions[kept], springs.directions]),
        sprung=springs.count,
    )
