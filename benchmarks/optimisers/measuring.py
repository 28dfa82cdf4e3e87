"""Let every method minimise the same problem, and note what it asked and what it found."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
import scipy.optimize
from mpi4py import MPI

from benchmarks.optimisers.book import STATES, Book, Case, Spent
from benchmarks.optimisers.rosenbrock import rosenbrock
from fenics_contact import minimize
from fenics_contact.design import AdaptiveTolerance, BundleTrust, ForScipy, nearest_feasible
from fenics_contact.errors.kinds import InvalidDesignError
from fenics_contact.study.scenes.chain_links import GRADING

#: Violation of the volume or of a bound that a method may leave, in widths of the box.
ALLOWED = 1e-4
#: SciPy's methods and their settings, in scaled variables and values; what is not said is SciPy's default.
SCIPY: dict[str, dict[str, Any]] = {
    "SLSQP": {"options": {"ftol": 1e-6, "maxiter": 1000}},
    "trust-constr": {"options": {"xtol": 1e-5, "gtol": 1e-5, "maxiter": 1000, "initial_tr_radius": 0.3}},
    "COBYLA": {"options": {"rhobeg": 0.1, "tol": 1e-4}},
}
METHODS = ("bundle", "bundle, adaptive states", *SCIPY, "Rosenbrock")
#: Most evaluations of a method with derivative by size of the chain, and of one without, which needs one for
#: each variable to begin; it is left out where an evaluation takes long.
BUDGET = {"coarse": 150, "small": 80, "roller": 60}
WITHOUT_DERIVATIVE = {"coarse": 300, "small": 0, "roller": 120}
QUICK_BUDGET = 12
FULL = (
    Case("coarse", "total potential", 0.25, 0.3, 0),
    Case("coarse", "largest force", 1.0, 0.3, 0),
    Case("coarse", "largest force", 1.0, 0.3, 1),
    Case("coarse", "largest force", 1.0, 0.1, 0),
    Case("small", "largest force", 1.0, 0.3, 0),
    Case("roller", "largest pressure", 8.0, 0.0, 0),
    Case("roller", "largest pressure", 8.0, 0.0, 1),
)
#: A start of twice the largest force of the others: a dozen evaluations do not go far from a good one.
QUICK = (Case("coarse", "largest force", 1.0, 0.3, 56),)


def budget_of(case: Case, method: str, quick: bool) -> int:
    """Return how many evaluations a method may spend."""
    if method == "Rosenbrock" and not case.of_roller:
        return 0
    if quick:
        return QUICK_BUDGET
    return (WITHOUT_DERIVATIVE if method in ("COBYLA", "Rosenbrock") else BUDGET)[case.size]


def run(comm: MPI.Comm, case: Mapping[str, Any], method: str, budget: int) -> dict[str, Any]:
    """Minimise once.

    Args:
        comm: Communicator of one rank.
        case: The problem, the fields of a `Case`.
        method: One of `METHODS`.
        budget: Most evaluations.

    Returns:
        What it found, why it stopped, and a row for every evaluation.
    """
    posed = Case(**case)
    adaptive = method == "bundle, adaptive states"
    book = Book(comm, posed, budget, AdaptiveTolerance() if adaptive else STATES)
    stop = "budget spent"
    with suppress(Spent), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of trust-constr, about steps without curvature
        stop = _solver(method)(book)
    seconds = book.rows[-1][3]
    best = _best(book)
    # What is compared keeps every constraint: the smallest violation would pay.
    design = nearest_feasible(book.designs[best], book.bounds, book.constraints)
    value = Book(comm, posed, 1).value(design)
    return {
        "case": posed.name, "objective": posed.objective, "method": method, "stop": stop, "grading": GRADING,
        "evaluations": len(book.rows), "best_evaluation": best + 1,
        "invalid": int(sum(np.isnan(row[0]) for row in book.rows)),
        "value_claimed": book.rows[best][0], "value": value, "violation": book.rows[best][1],
        "products": book.rows[-1][2], "seconds": seconds,
        "design": design, "variables": book.start.size,
        "unknowns": book.problem.contact.decomposition.torn_unknowns,
        "history": [[None if np.isnan(row[0]) else row[0], *row[1:]] for row in book.rows],
        "notes": sorted(set(book.notes)),
    }  # fmt: skip


def _solver(method: str) -> Callable[[Book], str]:
    if method == "Rosenbrock":
        return _by_rosenbrock
    return _by_bundle if method.startswith("bundle") else _by_scipy(method)


def _by_rosenbrock(book: Book) -> str:
    width = np.max(book.bounds[1] - book.bounds[0])

    def value(scaled: np.ndarray) -> float:
        try:
            return book.value(width * scaled)
        except InvalidDesignError:
            return float("inf")

    return rosenbrock(value, book.start / width, (book.bounds[0] / width, book.bounds[1] / width))


def _by_bundle(book: Book) -> str:
    method = BundleTrust(tolerance=1e-4, raise_on_failure=False)
    result = minimize(book, book.start, method, bounds=book.bounds, constraints=book.constraints)
    return result.reason.name.lower().replace("_", " ")


def _by_scipy(method: str) -> Callable[[Book], str]:
    def solve(book: Book) -> str:
        task = ForScipy(book, book.start, bounds=book.bounds, constraints=book.constraints, value=book.value)
        settings = {name: dict(value) for name, value in SCIPY[method].items()}
        if method == "COBYLA":  # an exception would leave traces in its Fortran code
            settings["options"]["maxiter"] = book.budget
        found = scipy.optimize.minimize(**task.arguments(method), **settings)
        if not found.success and len(book.rows) >= book.budget:
            return "budget spent"
        return "converged" if found.success else str(found.message).rstrip(".").lower()

    return solve


def _best(book: Book) -> int:
    """Return the number of the best evaluation that keeps the constraints."""
    values = [row[0] if row[1] <= ALLOWED else np.nan for row in book.rows]
    return int(np.nanargmin(values))
