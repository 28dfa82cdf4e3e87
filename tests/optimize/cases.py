"""The published problems: function, starting point, least value, constraints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.design import LinearConstraints, nearest_feasible
from tests.optimize.functions import (
    COLVILLE_A,
    COLVILLE_B,
    Array,
    Fun,
    cb2,
    cb3,
    colville1,
    crescent,
    dem,
    el_attar,
    goffin,
    hs78,
    hs86,
    lq,
    mad1,
    mad4,
    maxl,
    maxq,
    maxquad,
    mifflin1,
    mifflin2,
    mxhilb,
    pentagon,
    ql,
    rosen_suzuki,
    rosenbrock,
    shor,
    wolfe,
)


@dataclass(frozen=True, eq=False)
class Case:
    """One published problem.

    Attributes:
        name: Its name in the report.
        fun: Value and subgradient.
        start: Published starting point, shape (n,).
        minimum: Published least value, local where the function is not convex.
        most_evaluations: Most evaluations to the relative tolerance 1e-6: half as many again as were seen.
        bounds: Box, or None.
        constraints: Linear constraints, or None.
    """

    name: str
    fun: Fun
    start: Array
    minimum: float
    most_evaluations: int
    bounds: tuple[Array, Array] | None = None
    constraints: LinearConstraints | None = None


def _pentagon_rows() -> LinearConstraints:
    angle = 2 * np.pi * np.arange(5) / 5
    rows = np.kron(np.eye(3), np.column_stack([np.cos(angle), np.sin(angle)]))
    return LinearConstraints(rows, np.ones(15))


_PENTAGON = _pentagon_rows()
# The published start puts the third point outside the pentagon.
_PENTAGON_START = nearest_feasible([-1.0, 0, 0, -1, 1, 1], constraints=_PENTAGON)

_SLOPE = np.array([*range(1, 11), *range(-11, -21, -1)], dtype=float)

CONVEX = (
    Case("CB2", cb2, np.array([1.0, -0.1]), 1.9522245, 35),
    Case("CB3", cb3, np.array([2.0, 2.0]), 2.0, 25),
    Case("DEM", dem, np.array([1.0, 1.0]), -3.0, 25),
    Case("QL", ql, np.array([-1.0, 5.0]), 7.2, 40),
    Case("LQ", lq, np.array([-0.5, -0.5]), -np.sqrt(2.0), 20),
    Case("Mifflin1", mifflin1, np.array([0.8, 0.6]), -1.0, 130),
    Case("Rosen-Suzuki", rosen_suzuki, np.zeros(4), -44.0, 45),
    Case("Shor", shor, np.array([0.0, 50, 0, 0, 1]), 22.600162, 80),
    Case("Maxquad", maxquad, np.ones(10), -0.8414083, 130),
    Case("Maxq", maxq, _SLOPE, 0.0, 350),
    Case("Maxl", maxl, _SLOPE, 0.0, 180),
    Case("Goffin", goffin, np.arange(50) - 24.5, 0.0, 370),
    Case("MXHILB", mxhilb, np.ones(50), 0.0, 100),
)

NONCONVEX = (
    Case("Wolfe", wolfe, np.array([3.0, 2.0]), -8.0, 55),
    Case("Mifflin2", mifflin2, np.array([-1.0, -1.0]), -1.0, 35),
    Case("Crescent", crescent, np.array([-1.5, 2.0]), 0.0, 35),
    Case("Rosenbrock", rosenbrock, np.array([-1.2, 1.0]), 0.0, 95),
    Case("Colville1", colville1, np.array([0.0, 0, 0, 0, 1]), -32.348679, 90),
    Case("HS78", hs78, np.array([-2.0, 1.5, 2.0, -1.0, -1.0]), -2.9197004, 300),
    Case("El-Attar", el_attar, np.array([2.0, 2, 7, 0, -2, 1]), 0.5598131, 110),
)

CONSTRAINED = (
    Case(
        "MAD1",
        mad1,
        np.array([1.0, 2.0]),
        -0.38965952,
        20,
        constraints=LinearConstraints(np.array([[-1.0, -1.0]]), np.array([-0.5])),
    ),
    Case(
        "MAD2",
        mad1,
        np.array([-2.0, -1.0]),
        -0.33035714,
        20,
        constraints=LinearConstraints(np.array([[3.0, 1.0]]), np.array([-2.5])),
    ),
    Case(
        "MAD4",
        mad4,
        np.array([-1.0, 0.01]),
        -0.44891079,
        30,
        constraints=LinearConstraints(np.array([[-0.05, 1.0]]), np.array([0.5])),
    ),
    Case(
        "MAD5",
        mad4,
        np.array([-1.0, 3.0]),
        -0.42928061,
        25,
        constraints=LinearConstraints(np.array([[0.9, -1.0]]), np.array([-1.0])),
    ),
    Case("Pentagon", pentagon, _PENTAGON_START, -1.85961870, 25, constraints=_PENTAGON),
    Case(
        "HS86",
        hs86,
        np.array([0.0, 0, 0, 0, 1]),
        -32.348679,
        30,
        bounds=(np.zeros(5), np.full(5, np.inf)),
        constraints=LinearConstraints(-COLVILLE_A, -COLVILLE_B),
    ),
)

BY_NAME = {case.name: case for case in (*CONVEX, *NONCONVEX, *CONSTRAINED)}
