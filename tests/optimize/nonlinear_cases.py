"""Published and analytic problems with nonlinear constraints: least values and multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact.design import NonlinearConstraint
from tests.optimize.functions import Array, Fun, maxl


def quadratic(squares: list[float], slopes: list[float], constant: float) -> Fun:
    """Return Σ s_k x_k² + Σ l_k x_k + constant."""
    s, linear = np.array(squares, dtype=float), np.array(slopes, dtype=float)
    return lambda x: (float(s @ x**2 + linear @ x + constant), 2 * s * x + linear)


def square(x: Array) -> tuple[float, Array]:
    return float(x @ x), 2 * x


def downhill(x: Array) -> tuple[float, Array]:
    return float(-x.sum()), -np.ones(x.size)


def below(*functions: Fun) -> tuple[NonlinearConstraint, ...]:
    return tuple(NonlinearConstraint(fun, upper=0.0) for fun in functions)


def equal(fun: Fun, value: float, name: str = "") -> NonlinearConstraint:
    return NonlinearConstraint(fun, value, value, name)


def wong(x: Array) -> tuple[float, Array]:
    """Wong's problem 1 (Hock and Schittkowski 100)."""
    a, b, c, d, e, f, g = x
    value = (a - 10) ** 2 + 5 * (b - 12) ** 2 + c**4 + 3 * (d - 11) ** 2 + 10 * e**6 + 7 * f**2 + g**4
    value -= 4 * f * g + 10 * f + 8 * g
    slope = [2 * (a - 10), 10 * (b - 12), 4 * c**3, 6 * (d - 11), 60 * e**5, 14 * f - 4 * g - 10]
    return float(value), np.array([*slope, 4 * g**3 - 4 * f - 8])


def wong_first(x: Array) -> tuple[float, Array]:
    value = 2 * x[0] ** 2 + 3 * x[1] ** 4 + x[2] + 4 * x[3] ** 2 + 5 * x[4] - 127
    return float(value), np.array([4 * x[0], 12 * x[1] ** 3, 1, 8 * x[3], 5, 0, 0])


def wong_fourth(x: Array) -> tuple[float, Array]:
    value = 4 * x[0] ** 2 + x[1] ** 2 - 3 * x[0] * x[1] + 2 * x[2] ** 2 + 5 * x[5] - 11 * x[6]
    return float(value), np.array([8 * x[0] - 3 * x[1], 2 * x[1] - 3 * x[0], 4 * x[2], 0, 0, 5, -11])


def product(x: Array) -> tuple[float, Array]:
    """Objective of Hock and Schittkowski 78."""
    return float(np.prod(x)), np.array([np.prod(np.delete(x, k)) for k in range(x.size)])


def pairs(x: Array) -> tuple[float, Array]:
    value = x[1] * x[2] - 5 * x[3] * x[4]
    return float(value), np.array([0, x[2], x[1], -5 * x[4], -5 * x[3]])


def cubes(x: Array) -> tuple[float, Array]:
    return float(x[0] ** 3 + x[1] ** 3), np.array([3 * x[0] ** 2, 3 * x[1] ** 2, 0, 0, 0])


def largest_ratio(x: Array) -> tuple[float, Array]:
    """The largest k/x_k, as a stress is a force over a section: nonsmooth where all are equal."""
    ratios = np.arange(1, x.size + 1) / x
    k = int(np.argmax(ratios))
    return float(ratios[k]), -np.eye(x.size)[k] * ratios[k] / x[k]


@dataclass(frozen=True, eq=False)
class Case:
    """A problem, its least value, its active constraints with their multipliers, most evaluations."""

    name: str
    fun: Fun
    start: list[float]
    constraints: tuple[Any, ...]
    minimum: float
    multipliers: tuple[float, ...]
    most: int
    bounds: tuple[float, float] | None = None


_ROSEN_SUZUKI = below(
    quadratic([1, 1, 1, 1], [1, -1, 1, -1], -8),
    quadratic([1, 2, 1, 2], [-1, 0, 0, -1], -10),
    quadratic([2, 1, 1, 0], [2, -1, 0, -1], -5),
)
_WONG = below(
    wong_first,
    quadratic([0, 0, 10, 0, 0, 0, 0], [7, 3, 0, 1, -1, 0, 0], -282),
    quadratic([0, 1, 0, 0, 0, 6, 0], [23, 0, 0, 0, 0, 0, -8], -196),
    wong_fourth,
)
_HS78 = (equal(square, 10.0), equal(pairs, 0.0), equal(cubes, -1.0))

CASES = (
    Case("Rosen-Suzuki", quadratic([1, 1, 2, 1], [-5, -5, -21, 7], 0), [0, 0, 0, 0], _ROSEN_SUZUKI, -44.0,
         (1.0, 0.0, 2.0), 42),
    Case("Wong", wong, [1, 2, 0, 4, 0, 1, 1], _WONG, 680.6300573, (1.13972, 0.0, 0.0, 0.36862), 60),
    Case("LQ", downhill, [-0.5, -0.5], (NonlinearConstraint(square, 1.0),), -np.sqrt(2), (np.sqrt(0.5),), 12),
    Case("Mifflin", lambda x: (float(-x[0]), np.array([-1.0, 0.0])), [0.8, 0.6],
         (NonlinearConstraint(square, 1.0),), -1.0, (0.5,), 20),
    Case("circle", downhill, [-1, 0], (equal(square, 1.0),), -np.sqrt(2), (np.sqrt(0.5),), 15),
    Case("HS78", product, [-2, 1.5, 2, -1, -1], _HS78, -2.9197004, (0.74445, -0.70358, 0.09681), 21),
    Case("sphere", maxl, list(np.linspace(0.1, 2.0, 8)), (equal(square, 8.0),), 1.0, (-1 / 16,), 46,
         (0.0, 5.0)),
    Case("outside", square, [3.0, 0.5], (NonlinearConstraint(quadratic([1, 4], [0, 0], 0), lower=4.0),), 1.0,
         (-0.25,), 18),
    Case("stress", lambda x: (float(x.sum()), np.ones(6)), [7.0] * 6,
         (NonlinearConstraint(largest_ratio, 2.0),), 10.5, (5.25,), 60, (0.1, 10.0)),
)  # fmt: skip
NONLINEAR = {case.name: case for case in CASES}
