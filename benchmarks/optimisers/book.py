"""The design problem that all methods get, and the book that is kept of what they ask."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.chain_design import chain_shape_problem
from benchmarks.cases.roller_design import RELIEF, roller_shape_problem
from fenics_contact import ShapeProblem, State
from fenics_contact.design import (
    AdaptiveTolerance,
    ContactForces,
    LinearConstraints,
    Objective,
    TotalPotential,
    nearest_feasible,
)
from fenics_contact.errors import ConvergenceError, InvalidDesignError
from fenics_contact.results import ContactResult

#: Tolerance of all states; looser ones would blur differences that the methods look at.
STATES = 1e-8


def _largest(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the largest normal force and one subgradient of it."""
    force = contact.normal_force
    k = int(np.argmax(force))
    return float(force[k]), np.eye(len(force))[k], np.zeros((len(force), 2))


#: What is minimised on the chain, and the same as a function of the state alone.
OBJECTIVES: dict[str, tuple[Objective, Callable[[State], float]]] = {
    "total potential": (TotalPotential(), lambda state: state.energies.total_potential),
    "largest force": (ContactForces(_largest), lambda state: float(state.contact.normal_force.max())),
}


@dataclass(frozen=True)
class Case:
    """One problem: a scene, what is minimised, its friction and where the search starts.

    Attributes:
        size: "roller", or one of `benchmarks.cases.chain_design.SIZES`.
        objective: One of `OBJECTIVES`; of the roller "largest pressure".
        bound: Largest distance of a control point from its place, [mm]; of the roller inwards, in A.
        friction: Coefficient of friction.
        start: 0 for the shape as it is, else the seed of a random feasible one; of the roller 1: a parabola.
    """

    size: str
    objective: str
    bound: float
    friction: float
    start: int

    @property
    def of_roller(self) -> bool:
        """Whether it is the roller."""
        return self.size == "roller"

    @property
    def name(self) -> str:
        """How tables call it."""
        if self.of_roller:
            start = "a parabola" if self.start else "straight"
            return f"{self.objective}, roller, relief up to {self.bound:g} A, {start}"
        start = "the link as it is" if self.start == 0 else f"random shape {self.start}"
        return f"{self.objective}, {self.size} chain, ±{self.bound:g} mm, μ = {self.friction:g}, {start}"


@dataclass(frozen=True)
class Posed:
    """A case as methods get it.

    Attributes:
        problem: J with its subgradient.
        judge: J of a state.
        bounds: Lower and upper, [mm].
        constraints: The row for the volume; none of the roller.
        start: Where the search begins, [mm].
        held: Number of first variables of the design that stay 0 and are none of the methods'.
    """

    problem: ShapeProblem
    judge: Callable[[State], float]
    bounds: tuple[np.ndarray, np.ndarray]
    constraints: LinearConstraints | None
    start: np.ndarray
    held: int = 0


def _posed(comm: MPI.Comm, case: Case, tolerance: float | AdaptiveTolerance) -> Posed:
    if case.of_roller:
        roller = roller_shape_problem(comm, tolerance=tolerance)
        along = np.linspace(0.0, 1.0, roller.size)[1:]  # to move the whole roller changes nothing
        bounds = (np.full(along.size, -case.bound * RELIEF), np.zeros(along.size))
        start = -4.0 * RELIEF * along**2 * case.start
        return Posed(roller, lambda s: float(s.contact.pressure.max()), bounds, None, start, held=1)
    objective, judge = OBJECTIVES[case.objective]
    problem = chain_shape_problem(
        comm, case.size, objective=objective, friction=case.friction, tolerance=tolerance
    )
    bounds = (np.full(problem.size, -case.bound), np.full(problem.size, case.bound))
    _, by_volume = problem.volume(np.zeros(problem.size))
    constraints = LinearConstraints(-by_volume[None, :], [0.0])
    if case.start == 0:
        return Posed(problem, judge, bounds, constraints, np.zeros(problem.size))
    random = np.random.default_rng(case.start).uniform(-0.8, 0.8, problem.size) * case.bound
    return Posed(problem, judge, bounds, constraints, nearest_feasible(random, bounds, constraints))


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
        posed = _posed(comm, case, tolerance)
        self.problem, self._judge = posed.problem, posed.judge
        self.bounds, self.constraints, self.start = posed.bounds, posed.constraints, posed.start
        self.budget, self.rows, self.designs, self.notes = budget, [], [], []
        self._held, self._width = posed.held, float(np.max(posed.bounds[1] - posed.bounds[0]))
        self._began = perf_counter()

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
        found, gradient, error = self.problem.within(self._whole(alpha), value, subgradient)
        self._write(alpha, found)
        return found, gradient[self._held :], error

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return J and a subgradient."""
        value, gradient = self._told(alpha, self.problem)
        self._write(alpha, value)
        return value, gradient[self._held :]

    def value(self, alpha: np.ndarray) -> float:
        """Return J alone, without an adjoint."""
        state = self._told(alpha, self.problem.state_of)
        value = self._judge(state)
        self._write(alpha, value)
        return value

    def _told(self, alpha: np.ndarray, solve: Callable[[np.ndarray], Any]) -> Any:
        """Return what a function finds of a design, and write it down where the design does not exist."""
        self._ask()
        try:
            return solve(self._whole(alpha))
        except (InvalidDesignError, ConvergenceError) as error:
            self._write(alpha, np.nan)
            self.notes.append(str(error))
            raise InvalidDesignError(str(error)) from error

    def _whole(self, alpha: np.ndarray) -> np.ndarray:
        return np.append(np.zeros(self._held), alpha)

    def _ask(self) -> None:
        if len(self.rows) >= self.budget:
            raise Spent

    def _write(self, alpha: np.ndarray, value: float) -> None:
        lower, upper = self.bounds
        outside = float(np.maximum(lower - alpha, alpha - upper).max())
        if self.constraints is not None:
            (row,) = np.asarray(self.constraints.matrix)
            outside = max(outside, float(row @ alpha) / float(np.linalg.norm(row)))
        violation = max(outside, 0.0) / self._width
        self.rows.append((float(value), violation, self.problem.products, perf_counter() - self._began))
        self.designs.append(np.array(alpha))
