"""Designs near one with weakly active points: fewer points are weak there, so that a gradient exists."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from fenics_contact.errors import InvalidDesignError
from fenics_contact.shape.memory import DesignPoint, JointPoint

#: Fractions of the way to a neighbour at which designs are evaluated, nearest first.
PARTS = (1e-2, 1.0)


Point = TypeVar("Point", DesignPoint, JointPoint)


def with_fewest_weak_points(
    alpha: np.ndarray, end: np.ndarray, evaluate: Callable[[np.ndarray], Point]
) -> Point:
    """Return the design with the fewest weak points of a few on the way from one to another. Collective.

    In a generic direction, points leave their switches, and their branches together are those of an actual
    design. A point that is still on its switch far away does not depend on the design to first order: either
    branch gives the same derivative.

    Args:
        alpha: Design variables, shape (size,), [length].
        end: A design nearby, shape (size,), [length].
    """
    best: Point | None = None
    refused: InvalidDesignError | None = None
    for part in PARTS:
        try:
            point = evaluate(alpha + part * (end - alpha))
        except InvalidDesignError as error:
            refused = error
            continue
        if best is None or point.weak.count < best.weak.count:
            best = point
        if best.weak.count == 0:
            break
    if best is None:
        raise InvalidDesignError(f"no design near one with weak points can be evaluated: {refused}")
    return best
