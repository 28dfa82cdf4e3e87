"""Areas that belong to contact points where bodies lie now: pressures are forces over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.pairing.node_numbers import NodeNumbers
from fenics_contact.pairing.sliding.means import MovingMeans
from fenics_contact.scene import Scene, surface_of


@displayed
@dataclass(frozen=True)
class PointAreas:
    """Areas of the deformed and of the undeformed slave that belong to contact points.

    By nodes these are whole areas of the nodes. By mortar they are the parts that face the master, on which
    the pressure of a point acts, but no less than halves: what holds a node hardly over the rim of the
    master has no area there, and its force does not vanish with it.

    Attributes:
        now: a, area of the node on the slave as it lies now, shape (n,), [length²] or in the plane [length].
        before: A, area of the node on the undeformed slave, shape (n,).
        share: What of the node's area counts, shape (n,).
        facing: Whether it is the part that faces the master, shape (n,).
        much: Whether the slave's material is made for large deformations, shape (n,).
    """

    now: np.ndarray
    before: np.ndarray
    share: np.ndarray
    facing: np.ndarray
    much: np.ndarray

    @classmethod
    def of(
        cls,
        scene: Scene,
        points: ContactPoints,
        coordinates: np.ndarray,
        means: Sequence[MovingMeans | None],
    ) -> PointAreas:
        """Measure the areas of points.

        Args:
            scene: The scene in its reference configuration.
            points: Its points where the bodies lie now, with the areas of before.
            coordinates: Of all nodes now, shape (n_nodes, dim), [length].
            means: The coupling of each pair of mortar contact; None for other pairs.
        """
        count, before = points.count, points.area
        areas = cls(np.zeros(count), before, np.ones(count), *np.zeros((2, count), dtype=bool))
        for index, (pair, met) in enumerate(zip(scene.contacts, means, strict=True)):
            surface, body = surface_of(scene, pair.slave, "faceted"), pair.slave.body
            nodes = NodeNumbers.of(scene).global_nodes(body, surface.nodes)
            slave, point = points.of_surface(index, np.arange(count))
            areas.now[point] += surface.areas_at(coordinates[nodes])[np.searchsorted(nodes, slave)]
            mine = points.pair == index
            areas.much[mine] = scene.bodies[body].deforms_much
            if met is not None:
                part = met.coupling.area / areas.now[mine]
                areas.share[mine], areas.facing[mine] = np.maximum(part, 0.5), part > 0.5
        return areas

    @property
    def true(self) -> np.ndarray:
        """Areas to which the stress of the slave's material refers, shape (n,), [length²] or [length].

        Those of the deformed slave; where its material knows small strains alone, of the undeformed one.
        """
        return np.where(self.much, self.now, self.before) * self.share

    @property
    def nominal(self) -> np.ndarray:
        """Areas of the undeformed slave, shape (n,), [length²] or [length]."""
        return self.before * self.share

    def pulled_back(self, by_true: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the derivatives by a, A and the parts of a that face the master, shape (n,) each.

        The last is zero by nodes, and where another part counts.

        Args:
            by_true: Derivative by `true`, shape (n,).
        """
        ratio = np.where(self.facing, np.where(self.much, 1.0, self.before / self.now), 0.0)
        by_part = by_true * self.share
        return by_part * (self.much - ratio), by_part * ~self.much, by_true * ratio
