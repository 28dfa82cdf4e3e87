"""Spacing of the nodes of a ring along its three directions: finer where links touch.

The nodes along a direction are concentrated by the map

    x -> sinh(κ x) / sinh(κ)

of [-1, 1] with the contact at 0, which is smooth there: cells near the contact are almost equal, and those at
the ends cosh κ times as large. The strength κ of the crowns comes from `LinkShape.grading`; across the wire
and through its thickness it is chosen such that the cell at the contact is as small as along the ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Spacing:
    """Cells and strengths of a ring.

    Attributes:
        quarter: Cells on a quarter turn of a crown.
        leg: Cells on a leg, all of one length.
        along: Strength κ on the crowns, 0 for equal cells.
        across: Strength across the wire.
        through: Strength through its thickness, towards its inner side.
    """

    quarter: int
    leg: int
    along: float = 0.0
    across: float = 0.0
    through: float = 0.0

    @property
    def uniform(self) -> Spacing:
        """The same numbers of cells, but uniform."""
        return Spacing(self.quarter, self.leg)


def drawn_together(places: np.ndarray, spot: float, strength: float) -> np.ndarray:
    """Concentrate points of an interval towards its middle or its start.

    Args:
        places: Ascending points, (n,), from the start of the interval, or symmetric about its middle, to its
            end.
        spot: Point of concentration.
        strength: κ; 0 returns the points unchanged.

    Returns:
        Points, (n,), with the same ends.
    """
    if strength == 0.0:
        return places
    reach = places[-1] - spot
    return np.asarray(spot + reach * np.sinh(strength * (places - spot) / reach) / np.sinh(strength))


def strength_for(smallest: float) -> float:
    """Find κ with κ / sinh κ = ``smallest``, the smallest cell over the mean; 0 if that is not below 1."""
    if smallest >= 1.0:
        return 0.0
    # x / sinh x falls from 1 and is about 2 x exp(-x), which lies below at the end of the interval.
    most = 10.0 - 2.0 * float(np.log(smallest))
    return float(brentq(lambda x: x / np.sinh(x) - smallest, 1e-9, most))
