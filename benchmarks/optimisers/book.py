"""The design problem that all methods get, and the book that is kept of what they ask."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.chain_design import chain_shape_problem
from fenics_contact.contact import ContactResult, State
from fenics_contact.errors import ConvergenceError, InvalidDesignError
from fenics_contact.optimize import LinearConstraints, nearest_feasible
from fenics_contact.shape import AdaptiveTolerance, ContactForces, Objective, TotalPotential

#: Tolerance of all states; looser ones would blur differences that the methods look at.
STATES = 1e-8


def _largest(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the largest normal force and one subgradient of it."""
    force = contact.normal_force
    k = int(np.argmax(force))
    return float(force[k]), np.eye(len(force))[k], np.zeros((len(force), 2))


#: What is minimised, and the same as a function of the state alone.
OBJECTIVES: dict[str, tuple[Objective, Callable[[State], float]]] = {
    "total potential": (TotalPotential(), lambda state: state.energies.total_potential),
    "largest force": (ContactForces(_largest), lambda state: float(state.contact.normal_force.max())),
}


@dataclass(frozen=True)
class Case:
    """One problem: a chain, what is minimised, its friction and where the search starts.

    Attributes:
        size: One of `benchmarks.cases.chain_design.SIZES`.
        objective: One of `OBJECTIVES`.
        bound: Largest distance of a control point from its place, [mm].
        friction: Coefficient of friction.
        start: 0 for the shape as it is, else the seed of a random feasible one.
    """

    size: str
    objective: str
    bound: float
    friction: float
    start: int

    @property
    def name(self) -> str:
        """How tables call it."""
        start = "the link as it is" if self.start == 0 else f"random shape {self.start}"
        return f"{self.objective}, {self.size} chain, ±{self.bound:g} mm, μ = {self.friction:g}, {start}"


class Spent(Exception):
    """The budget of evaluations is used up."""


class Book:
    """J with its subgradient, and J alone, every evaluation written down.

    Attributes:
        rows: A row an evaluation: value (nan where the design does not exist), violation of the constraints
            in units of the box's width, products and seconds up to and with it.
        designs: The designs, in the same order.
        notes: Why designs did not exist.
    """

    def __init__(
        self, comm: MPI.Comm, case: Case, budget: int, tolerance: float | AdaptiveTolerance = STATES
    ) -> None:
        """Prepare the problem; no state is solved."""
        objective, self._judge = OBJECTIVES[case.objective]
        self.problem = chain_shape_problem(
            comm, case.size, objective=objective, friction=case.friction, tolerance=tolerance
        )
        size = self.problem.size
        self.bound = case.bound
        self.bounds = (np.full(size, -case.bound), np.full(size, case.bound))
        _, by_volume = self.problem.volume(np.zeros(size))
        self.constraints = LinearConstraints(-by_volume[None, :], [0.0])
        self.start: np.ndarray = np.zeros(size)
        if case.start:
            random = np.random.default_rng(case.start).uniform(-0.8, 0.8, size) * case.bound
            self.start = nearest_feasible(random, self.bounds, self.constraints)
        self.budget, self.rows, self.designs, self.notes = budget, [], [], []
        self._row = by_volume / np.linalg.norm(by_volume)
        self._state_products, self._began = 0, perf_counter()

    rows: list[tuple[float, float, int, float]]
    designs: list[np.ndarray]
    notes: list[str]

    @property
    def inexact(self) -> bool:
        """Whether the bundle method may ask for less accuracy."""
        return self.problem.inexact

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return J, a subgradient and the error of J, no more accurate than asked."""
        self._ask()
        found = self.problem.within(alpha, value, subgradient)
        self._write(alpha, found[0])
        return found

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return J and a subgradient."""
        value, gradient = self._told(alpha, self.problem)
        self._write(alpha, value)
        return value, gradient

    def value(self, alpha: np.ndarray) -> float:
        """Return J alone, without an adjoint."""
        state = self._told(alpha, self.problem.state_of)
        self._state_products += state.solution.products
        value = self._judge(state)
        self._write(alpha, value)
        return value

    def _told(self, alpha: np.ndarray, solve: Callable[[np.ndarray], Any]) -> Any:
        """Return what a function finds of a design, and write it down where the design does not exist."""
        self._ask()
        try:
            return solve(alpha)
        except (InvalidDesignError, ConvergenceError) as error:
            self._write(alpha, np.nan)
            self.notes.append(str(error))
            raise InvalidDesignError(str(error)) from error

    def _ask(self) -> None:
        if len(self.rows) >= self.budget:
            raise Spent

    def _write(self, alpha: np.ndarray, value: float) -> None:
        outside = float(np.abs(alpha).max()) - self.bound
        violation = max(outside, -float(self._row @ alpha), 0.0) / (2.0 * self.bound)
        products = self.problem.products + self._state_products
        self.rows.append((float(value), violation, products, perf_counter() - self._began))
        self.designs.append(np.array(alpha))
