"""Designs beside one at which points are weakly active: fewer are there, so that there is a gradient."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_contact.errors import InvalidDesignError
from fenics_contact.shape.memory import DesignPoint

#: Parts of the way to a neighbour at which a design is looked for: near first.
PARTS = (1e-2, 1.0)


def with_fewest_weak_points(
    alpha: np.ndarray, end: np.ndarray, judged: Callable[[np.ndarray], DesignPoint]
) -> DesignPoint:
    """Return the design with fewest weak points of some on the way from one to another. Collective.

    In a direction that nothing singles out, points leave their switches: each as one design after the other
    wants it, so that all of them together are in a state that designs have. A point that is still on its
    switch far away does not depend on the design to first order, and counts the same whatever its branch.

    Args:
        alpha: Design variables, shape (size,), [length].
        end: A design nearby, shape (size,), [length].
        judged: Returns a design with its gradient.

    Raises:
        InvalidDesignError: If none of them has an equilibrium.
    """
    best, refused = None, None
    for part in PARTS:
        try:
            point = judged(alpha + part * (end - alpha))
        except InvalidDesignError as error:
            refused = error
            continue
        if best is None or point.weak.count < best.weak.count:
            best = point
        if best.weak.count == 0:
            break
    if best is None:
        raise InvalidDesignError(f"no design beside one with weak points can be evaluated: {refused}")
    return best
