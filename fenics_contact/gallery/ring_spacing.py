"""How closely the nodes of a ring lie along its three directions: denser where links touch.

A direction's nodes are drawn together by the map

    x -> sinh(κ x) / sinh(κ)

of [-1, 1] with the spot at 0, which is smooth there: cells beside the spot are next to equal, and those at
the ends cosh κ times as large. The strength κ of the crowns comes from `LinkShape.grading`; across the wire
and through its thickness it is the one that makes the cell at the spot as small as it is along the ring.
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
        through: Strength through its thickness, whose spot is its inner side.
    """

    quarter: int
    leg: int
    along: float = 0.0
    across: float = 0.0
    through: float = 0.0

    @property
    def uniform(self) -> Spacing:
        """As many cells, but equal ones."""
        return Spacing(self.quarter, self.leg)


def drawn_together(places: np.ndarray, spot: float, strength: float) -> np.ndarray:
    """Move places on an interval towards the spot in its middle or at its start.

    Args:
        places: Ascending, (n,), from the start of the interval, or evenly about its middle, to its end.
        spot: Where they are drawn to.
        strength: κ; 0 returns the places as they are.

    Returns:
        Places, (n,), with the ends where they were.
    """
    if strength == 0.0:
        return places
    reach = places[-1] - spot
    return np.asarray(spot + reach * np.sinh(strength * (places - spot) / reach) / np.sinh(strength))


def strength_for(smallest: float) -> float:
    """Find κ with κ / sinh κ = ``smallest``, the smallest cell over the mean; 0 where it is no smaller."""
    if smallest >= 1.0:
        return 0.0
    # x / sinh x falls from 1 and is about 2 x exp(-x), which lies below at the end of the interval.
    most = 10.0 - 2.0 * float(np.log(smallest))
    return float(brentq(lambda x: x / np.sinh(x) - smallest, 1e-9, most))
