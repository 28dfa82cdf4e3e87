"""Wear of bodies that deform much: what points have lost, wherever contact finds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from fenics_contact._large_deformations.moving_contact import MovedContact, NoEarlierWear
from fenics_contact._large_deformations.newton import NonlinearEquilibrium
from fenics_contact._pairing.points import ContactPoints
from fenics_contact.feti.point_wear import PointWear, WornClosures


@dataclass(frozen=True, eq=False)
class AtNodes:
    """Values by pair and slave node; `key`: both, shape (2, n); `values`: shape (n, k)."""

    key: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, points: ContactPoints, values: np.ndarray) -> AtNodes:
        """Return the values at contact points."""
        return cls(np.stack([points.pair, points.slave]), values)

    @classmethod
    def none(cls) -> AtNodes:
        """Return no values."""
        return cls(np.zeros((2, 0), dtype=np.int64), np.zeros((0, 1)))

    def on(self, points: ContactPoints) -> np.ndarray:
        """Return the values at other points, zero where there is none, shape (n_points, k)."""
        width = 1 + int(max(self.key[1].max(initial=0), points.slave.max(initial=0)))
        known, now = self.key[0] * width + self.key[1], points.pair * width + points.slave
        _, there, here = np.intersect1d(known, now, return_indices=True)
        found = np.zeros((points.count, self.values.shape[1]))
        found[here] = self.values[there]
        return found


@dataclass(frozen=True, eq=False)
class EarlierWear(NoEarlierWear):
    """What contact has taken away before a load step, and the slip over which it takes more in it.

    Newton's method takes the slip as it is; where it has ended that is found anew.

    `lost`: depth before the step, [length]; `slip`: of the step, [length].
    """

    lost: AtNodes
    slip: AtNodes

    @classmethod
    def of(cls, before: Sequence[Any]) -> EarlierWear:
        """Return that of the contact at the end of the load step before, if there is one."""
        lost = slip = AtNodes.none()
        for contact in before:
            lost, slip = (AtNodes.of(contact.points, x) for x in (contact.worn_depth[:, None], contact.slip))
        return cls(lost, slip)

    def on(self, contact: MovedContact) -> MovedContact:
        """Return contact that has lost this, and loses more over the slip."""
        torn, points = contact.torn, contact.torn.points
        before = self.lost.on(points)[:, 0]
        wear = PointWear.of(torn.scene, points, before, torn.decomposition.comm)
        return replace(contact, torn=wear.on(torn, wear.distance(self.slip.on(points))))

    def after(self, found: NonlinearEquilibrium, tolerance: float) -> EarlierWear:
        """Return this if forces would change by less than a part of all if the slip was that found."""
        contact = cast(MovedContact, found.evaluation.contact)
        force, friction = contact.at_points(found.evaluation.at.multiplier)
        torn = contact.torn
        slip = AtNodes.of(torn.points, contact.slip(contact.start) - contact.elastic_slip(friction))
        wear, closures = cast(PointWear, torn.wear), cast(WornClosures, torn.groups.normal.closures)
        missing = wear.distance(slip.values) - closures.distance
        step, _ = contact.at_points(found.evaluation.at.natural_step())
        deeper = step * wear.depth_over(missing, np.maximum(force, 0.0) / torn.points.area)
        change = float(np.linalg.norm(deeper / (1.0 + step * closures.growth(force))))
        small = change <= tolerance * found.evaluation.residuals.force_scale
        return self if small else replace(self, slip=slip)
