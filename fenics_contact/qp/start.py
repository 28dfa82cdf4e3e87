"""Where a dual solve starts, cold or from an earlier solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.residual import Residuals
from fenics_contact.qp.solution import SmalseMemory


@dataclass(frozen=True, eq=False)
class Start:
    """A multiplier with what is known about it.

    Attributes:
        operator: F with its counter, to be used for the whole solve.
        multiplier: λ, owned.
        product: F λ, owned.
        residual: r = F λ − d − Gᵀα, owned.
        residuals: Residuals of λ.
        memory: What SMALSE learned before.
        warm: Whether λ comes from an earlier solution.
    """

    operator: CountedOperator
    multiplier: Vector
    product: Vector
    residual: Vector
    residuals: Residuals
    memory: SmalseMemory | None = None
    warm: bool = False


def count_status(problem: DualProblem, multiplier: Vector, slip_bound: Vector) -> tuple[int, int, int]:
    """Count closed contacts, sticking and slipping discs by the multiplier alone. Collective."""
    layout = problem.layout
    length = np.linalg.norm(multiplier[layout.tangential], axis=1)
    slip = length >= slip_bound * (1.0 - 1e-9)
    counts = global_sum(
        problem.comm,
        np.count_nonzero(multiplier[layout.normal] > 0.0),
        np.count_nonzero(~slip),
        np.count_nonzero(slip & (slip_bound > 0.0)),
    )
    closed, stick, slipping = (round(float(count)) for count in counts)
    return closed, stick, slipping
