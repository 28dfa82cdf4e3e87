"""Adjoint directional derivatives beside difference quotients along a line of designs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, ShapeProblem, Status
from fenics_contact.design import DesignPoint, Objective
from fenics_contact.results.deformed_state import AnyState

Problem = TypeVar("Problem")


class Remembering(ShapeProblem):
    """Solves each design once, however many objectives judge it."""

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._known: dict[bytes, AnyState] = {}
        self._judged: dict[tuple[bytes, Objective], DesignPoint] = {}

    def state_of(self, alpha: np.ndarray, after: AnyState | None = None) -> AnyState:
        if after is not None:
            return super().state_of(alpha, after)
        key = np.asarray(alpha, dtype=float).tobytes()
        if key not in self._known:
            self._known[key] = super().state_of(alpha)
        return self._known[key]

    def value_by(self, objective: Objective, alpha: np.ndarray) -> float:
        self.objective = objective
        return self.value_of(alpha)

    def evaluate_by(self, objective: Objective, alpha: np.ndarray) -> DesignPoint:
        self.objective = objective
        key = (alpha.tobytes(), objective)
        if key not in self._judged:
            self._judged[key] = self.evaluate(alpha)
        return self._judged[key]


@dataclass(frozen=True)
class Way(Generic[Problem]):
    """Designs α + s v of one problem.

    Attributes:
        problem: Solves them.
        alpha: α, the design in the middle.
        direction: v.
        step: s of the difference quotients.
        taylor: Multiples of it at which Taylor remainders are taken.
    """

    problem: Problem
    alpha: np.ndarray
    direction: np.ndarray
    step: float = 1e-3
    taylor: tuple[float, ...] = (4.0, 8.0)

    def at(self, multiple: float) -> np.ndarray:
        return self.alpha + multiple * self.step * self.direction

    def quotient_of(self, value: Callable[[float], float]) -> float:
        """The central difference quotient of values at multiples of the step."""
        return (value(1.0) - value(-1.0)) / (2.0 * self.step)

    def rate_of(self, value: Callable[[float], float], slope: float) -> float:
        """Order at which J(α + s v) − J(α) − s J'(α; v) vanishes with s."""
        start = value(0.0)
        near, far = (abs(value(m) - start - m * self.step * slope) for m in self.taylor)
        return float(np.log(far / near) / np.log(self.taylor[1] / self.taylor[0]))


class Line(Way[Remembering]):
    """Designs of one problem, judged by several objectives."""

    def state(self, multiple: float = 0.0) -> AnyState:
        return self.problem.state_of(self.at(multiple))

    def value(self, objective: Objective, multiple: float = 0.0) -> float:
        return self.problem.value_by(objective, self.at(multiple))

    def point(self, objective: Objective) -> DesignPoint:
        return self.problem.evaluate_by(objective, self.alpha)

    def slope(self, objective: Objective) -> float:
        """The adjoint's directional derivative."""
        return float(self.point(objective).gradient @ self.direction)

    def quotient(self, objective: Objective) -> float:
        """The central difference quotient."""
        return self.quotient_of(partial(self.value, objective))

    def miss(self, objective: Objective) -> float:
        """Relative difference of the two."""
        quotient = self.quotient(objective)
        return abs(self.slope(objective) - quotient) / abs(quotient)

    def taylor_rate(self, objective: Objective) -> float:
        """Order at which J(α + s v) − J(α) − s J'(α; v) vanishes with s."""
        return self.rate_of(partial(self.value, objective), self.slope(objective))

    def steepness(self, objective: Objective) -> float:
        """Slope along v relative to the steepest: zero if the derivative says nothing."""
        gradient = self.point(objective).gradient
        return abs(self.slope(objective)) / float(np.linalg.norm(gradient) * np.linalg.norm(self.direction))

    def relative_slope(self, objective: Objective) -> float:
        """By how much of itself the objective changes along a unit of length of v."""
        return abs(self.slope(objective) / self.value(objective)) / float(np.linalg.norm(self.direction))

    def multiples(self) -> tuple[float, ...]:
        return (-1.0, 0.0, 1.0, *self.taylor)

    def is_smooth(self) -> bool:
        """Whether status, slave nodes and master facets are the same at all designs of the line."""
        first = self.state().contact
        others = [self.state(m).contact for m in self.multiples()]
        return all(
            np.array_equal(first.status, other.status)
            and np.array_equal(first.points.slave, other.points.slave)
            and np.array_equal(first.points.facet, other.points.facet)
            for other in others
        )

    def counts(self) -> dict[str, int]:
        """How many points have each status."""
        return {status.name: self.state().contact.count(status) for status in Status}


def check_statuses(here: Line) -> None:
    """Points stick, slip and are open, the same ones all along the line."""
    assert all(count > 0 for count in here.counts().values()), here.counts()
    assert here.is_smooth()


def check_adjoint(here: Line, objective: Objective, steepness: float = 0.02) -> None:
    """The adjoint agrees with central differences along a direction in which the objective changes."""
    assert here.steepness(objective) > steepness
    assert here.miss(objective) < 1e-5


def check_default_settings(here: Line, objective: Objective) -> None:
    """A problem with default settings and cut has the same derivative, to its tolerance."""
    contact = ContactProblem(here.problem.scene, MPI.COMM_SELF)
    default = ShapeProblem(contact, here.problem.designs, objective)
    slope = float(default(here.alpha)[1] @ here.direction)
    assert slope == pytest.approx(here.quotient(objective), rel=1e-3)


Patch = pytest.MonkeyPatch


def miss_without(term: Callable[[Patch], None], here: Line, objective: Objective) -> float:
    """Relative error of an adjoint that leaves a term out."""
    quotient = here.quotient(objective)
    with pytest.MonkeyPatch.context() as patch:
        term(patch)
        here.problem.objective = objective
        slope = here.problem.evaluate(here.alpha).gradient @ here.direction
    return float(abs(slope - quotient) / abs(quotient))
