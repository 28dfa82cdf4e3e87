"""Displacements of the two sides of contact or tied points, of several fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.feti import TornSystem, nodal_mean_at
from fenics_contact.pairing import ContactPoints
from fenics_contact.scene import Surface


@dataclass(frozen=True, eq=False)
class PairedFields:
    """State and adjoint as derivatives by the geometry combine them: multipliers of one, motion of the other.

    Attributes:
        multipliers: λ and ζ − ∂J/∂(B u − c), owned.
        displacements: w and u, torn displacements of this rank, shape (torn_size,) each.
    """

    multipliers: tuple[np.ndarray, np.ndarray]
    displacements: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class PointMotions:
    """Displacements of state and adjoint at points, replicated.

    Attributes:
        nodes: Nodes of slaves and masters, ascending, shape (n_nodes,).
        values: Displacement of these nodes, of the adjoint and of the state, shape (2, n_nodes, dim): each
            multiplier is paired with the other field.
        relative: Slave minus master displacement, shape (2, n, dim), in the same order.
    """

    nodes: np.ndarray
    values: np.ndarray
    relative: np.ndarray

    def at(self, nodes: np.ndarray) -> np.ndarray:
        """Return the displacements of some of the nodes, shape (2, ..., dim)."""
        return np.asarray(self.values[:, np.searchsorted(self.nodes, nodes)])


def point_motions(
    torn: TornSystem, points: ContactPoints, masters: Sequence[object], fields: PairedFields
) -> PointMotions:
    """Return the motions of points. Collective.

    Args:
        masters: The masters of the pairs that the points number; all nodes of surfaces are included, as some
            have no weight at any point but a derivative of it.
    """
    tearing, scene = torn.decomposition.tearing, torn.scene
    surfaces = [master for master in masters if isinstance(master, Surface)]
    opposite = [tearing.global_nodes(each.body, np.unique(scene.facets(each))) for each in surfaces]
    nodes = np.unique(np.concatenate([points.jump.indices, *opposite]))
    values = np.stack([nodal_mean_at(torn.decomposition, field, nodes) for field in fields.displacements])
    jump = points.jump[:, nodes]
    return PointMotions(nodes, values, np.stack([jump @ value for value in values]))
