"""Wear of bodies that deform much: what points have lost, wherever contact finds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from fenics_contact._large_deformations.contact_feedback import ContactFeedback
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._large_deformations.moving_contact import MovedContact
from fenics_contact._large_deformations.newton import NonlinearEquilibrium
from fenics_contact.feti.point_wear import AtNodes, PointWear, WornClosures


@dataclass(frozen=True, eq=False)
class EarlierWear(ContactFeedback):
    """What contact has taken away before a load step, and the slip over which it takes more in it.

    Newton's method takes the slip as it is; where it has ended that is found anew.

    `lost`: depth before the step, [length]; `slip`: of the step, [length].
    """

    lost: AtNodes
    slip: AtNodes
    unsettled = (
        "wear must agree with the slip",
        "take smaller load steps or fewer cycles, or prescribe how far surfaces slide",
    )

    @classmethod
    def of(cls, before: Sequence[Any]) -> EarlierWear:
        """Return that of the state at the end of the load step before, if there is one.

        Nodes that have left the master keep what they have lost until they come back.
        """
        lost = slip = AtNodes.none()
        for state in before:
            contact, points = state.contact, state.contact.points
            if contact.worn_depth.any():
                lost = cast(PointWear, state.torn.wear).lost
            lost = lost.updated(points, contact.worn_depth[:, None])
            slip = AtNodes.of(points, contact.slip)
        return cls(lost, slip)

    def on(self, contact: MovedContact, load: Loading) -> MovedContact:
        """Return contact that has lost this, and loses more over the slip."""
        torn, points = contact.torn, contact.torn.points
        before = self.lost.on(points)[:, 0]
        wear = replace(PointWear.of(torn.scene, points, before, torn.decomposition.comm), lost=self.lost)
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
