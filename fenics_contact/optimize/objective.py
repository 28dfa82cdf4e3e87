"""The caller's function, guarded: copies go in, checked numbers come out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact.errors import InvalidInputError

Array = NDArray[np.float64]
Fun = Callable[[Array], tuple[float, ArrayLike]]


@dataclass(frozen=True)
class Evaluation:
    """Value and subgradient at a point.

    Attributes:
        x: Point, shape (n,).
        value: J(x).
        subgradient: One subgradient, shape (n,), in the caller's variables.
    """

    x: Array
    value: float
    subgradient: Array


def evaluate(fun: Fun, x: Array, number: int) -> Evaluation:
    """Call the function with a copy of x and check what it returns.

    Args:
        fun: Returns the value and one subgradient.
        x: Point, shape (n,).
        number: Count of this evaluation, for the message.

    Returns:
        Copies of all three.

    Raises:
        InvalidInputError: If the answer is no pair of a finite number and n finite numbers.
        InvalidDesignError: If the function raises it.
    """
    answer = fun(x.copy())
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise InvalidInputError(
            f"fun must return the pair (value, subgradient), got {type(answer).__name__} at evaluation {number}"
        )
    if np.size(answer[0]) != 1 or np.shape(answer[1]) != x.shape:
        raise InvalidInputError(
            f"fun must return a number and a subgradient of shape {x.shape}, got shapes "
            f"{np.shape(answer[0])} and {np.shape(answer[1])} at evaluation {number}"
        )
    value, subgradient = float(np.asarray(answer[0], dtype=float).item()), np.array(answer[1], dtype=float)
    for name, finite in (("value", np.isfinite(value)), ("subgradient", np.isfinite(subgradient).all())):
        if not finite:
            shown = value if name == "value" else f"a bad entry at {np.flatnonzero(~np.isfinite(subgradient))}"
            raise InvalidInputError(
                f"fun must return a finite {name}, got {shown} at evaluation {number}: raise "
                "InvalidDesignError for a design that cannot be evaluated"
            )
    return Evaluation(x.copy(), value, subgradient)
