"""Rows of springs between surfaces: B u − C λ = −C N₀ with the compliance C = 1/k, so that λ is the force.

With N = N₀ + k d·(ū₂ − ū₁) and a row of B that is d times the difference of the means, λ = N. The dual
operator of these rows is F + C: bodies stay as they are, with their kernels, and C → 0 ties the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.following import means_on_masters
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.springs import Spring, mean_weights
from fenics_contact.errors import together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.ties import JoinedPoints


@dataclass(frozen=True, eq=False)
class SpringRows(JoinedPoints):
    """Rows of springs, each of which is a point."""

    balanced_as = "beds"
    #: Springs of a scene that have such rows.
    part: ClassVar[type[Spring]] = Spring

    stiffness: np.ndarray
    tension: np.ndarray

    @classmethod
    def key(cls, scene: Scene) -> Sequence[Spring]:
        """Return the springs."""
        return [each for each in scene.springs if type(each) is cls.part]

    @classmethod
    def of(
        cls, scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[SpringRows]
    ) -> Sequence[SpringRows]:
        """Return those of a scene with springs. Collective."""
        springs = cls.key(scene)
        if not springs:
            return ()
        with together(decomposition.comm):
            ends = spring_points(springs, scene, decomposition.tearing)
            if any(body.mesh.followers for body in scene.bodies.values()):
                ends = means_on_masters(ends, scene)
        parts = [each.rows(scene) for each in springs]
        which = np.repeat(np.arange(len(parts)), [len(stiffness) for _, stiffness in parts])
        directions, stiffness = (np.concatenate(part) for part in zip(*parts, strict=True))
        directions = np.pad(directions, ((0, 0), (0, scene.components - scene.dim)))
        tension = np.array([each.tension for each in springs])[which]
        return (cls(ends, which, directions, stiffness, tension, axes=decomposition.axes),)

    @property
    def compliance(self) -> np.ndarray:
        """C, shape (n_rows,), [length / force]."""
        return 1.0 / self.stiffness

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return −C N₀, shape (n_rows,), [length]."""
        return -self.compliance * self.tension

    def held(self, fixed: np.ndarray) -> np.ndarray:
        """Return which rows are left to supports: none, as forces act also where these determine them."""
        return np.zeros(self.count, dtype=bool)

    def elongation(self, multiplier: np.ndarray) -> np.ndarray:
        """Return d·(ū₂ − ū₁) under multipliers, shape (n_rows,), [length]."""
        return np.asarray(self.compliance * (multiplier - self.tension))


def spring_points(springs: Sequence[Spring], scene: Scene, numbers: NodeNumbers) -> ContactPoints:
    """Return a point for each spring whose slave less its master is ū₂ − ū₁.

    The slave is a node of an end: its rank owns the rows. The rest of the mean counts as master.
    """
    count, dim, n_nodes = len(springs), scene.components, numbers.n_nodes
    entries: list[tuple[np.ndarray, ...]] = []
    slaves = np.zeros(count, dtype=np.int64)
    for number, spring in enumerate(springs):
        for end, sign in zip(spring.surfaces.values(), (1.0, -1.0), strict=False):
            own, weights = mean_weights(scene, end)
            nodes = numbers.global_nodes(end.body, own)
            entries.append((sign * weights, np.full(len(nodes), number), nodes))
            slaves[number] = nodes[0]
    entries.append((np.ones(count), np.arange(count), slaves))
    value, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    master = sp.csr_matrix((value, (row, column)), shape=(count, n_nodes))
    nothing = np.zeros(count)
    normals = np.tile(np.eye(dim)[0], (count, 1))
    given = np.ones(count, dtype=bool)
    return ContactPoints.at_nodes(np.arange(count), slaves, master, normals, nothing, nothing, given=given)
