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
    answer, where = fun(x.copy()), f"at evaluation {number}"
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise InvalidInputError(f"fun must return (value, subgradient), got {type(answer).__name__} {where}")
    value, subgradient = np.array(answer[0], dtype=float), np.array(answer[1], dtype=float)
    if value.size != 1 or subgradient.shape != x.shape:
        raise InvalidInputError(
            f"fun must return a number and a subgradient of shape {x.shape}, got shapes {value.shape} and "
            f"{subgradient.shape} {where}"
        )
    for name, numbers in (("value", value.ravel()), ("subgradient", subgradient)):
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise InvalidInputError(
                f"fun must return a finite {name}, got {numbers[bad[0]]} in entry {bad[0]} {where}: raise "
                "InvalidDesignError for a design that cannot be evaluated"
            )
    return Evaluation(x.copy(), float(value.item()), subgradient)
