"""Measure values, subgradients and optima with states of different tolerances."""

from __future__ import annotations

from collections import Counter
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.chain_design import BOUND, chain_shape_problem
from fenics_contact import ShapeProblem, minimize
from fenics_contact.design import AdaptiveTolerance, BundleTrust, DesignPoint, LinearConstraints, Result
from fenics_contact.study.scenes.chain_links import GRADING

#: What everything is compared with.
REFERENCE = 1e-11
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
FIXED = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
ADAPTIVE = {"adaptive": AdaptiveTolerance(), "adaptive from 1e-2": AdaptiveTolerance(loosest=1e-2)}
STOPPING = (1e-4, 1e-6)
#: What is left of that where an evaluation takes long.
FEW_FIXED, FEW_ADAPTIVE, FEW_STOPPING = (1e-3, 1e-6, 1e-8), ("adaptive",), (1e-4,)


def designs(best: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Return the start, a design on the way, the optimum, and random ones."""
    rng = np.random.default_rng(1)
    named = {"start": np.zeros_like(best), "half way": 0.5 * best, "optimum": best}
    return named | {f"random {k}": 0.4 * BOUND * rng.standard_normal(best.size) for k in range(count)}


def compared(point: DesignPoint, exact: DesignPoint) -> dict[str, Any]:
    """Return the errors of a value with its correction and of the subgradient, all relative."""
    size, miss = abs(exact.value), exact.value - (point.value - point.correction)
    gradient = float(np.linalg.norm(point.gradient - exact.gradient) / np.linalg.norm(exact.gradient))
    return {
        "tolerance": point.tolerance,
        "value_error": abs(miss) / size,
        "corrected_error": abs(miss - point.correction) / size,
        "estimate": abs(point.correction) / size,
        "subgradient_error": gradient,
        "wrong_status": int(np.count_nonzero(point.state.contact.status != exact.state.contact.status)),
        "contact_points": point.state.contact.points.count,
        "closed_points": int(np.count_nonzero(exact.state.contact.status)),
        "products": point.state.solution.products + point.adjoint_iterations,
    }


def errors(comm: MPI.Comm, size: str, best: np.ndarray, count: int) -> list[dict[str, Any]]:
    """Return the errors at some designs, each solved from a cold start."""
    found = []
    for name, alpha in designs(best, count).items():
        exact = chain_shape_problem(comm, size, tolerance=REFERENCE).evaluate(alpha)
        for tolerance in TOLERANCES:
            adaptive = AdaptiveTolerance(loosest=tolerance, tightest=tolerance)
            problem = chain_shape_problem(comm, size, tolerance=adaptive)
            found.append({"design": name, **compared(problem.evaluate(alpha), exact)})
    return found


def minimised(problem: ShapeProblem, tolerance: float) -> Result:
    """Minimise within the box, without losing volume."""
    start = np.zeros(problem.size)
    _, by_volume = problem.volume(start)
    return minimize(
        problem,
        start,
        BundleTrust(tolerance=tolerance, raise_on_failure=False),
        bounds=(start - BOUND, start + BOUND),
        constraints=LinearConstraints(-by_volume[None, :], [0.0]),
    )


def optimum(comm: MPI.Comm, size: str, name: str, stopping: float) -> dict[str, Any]:
    """Minimise once and evaluate the design that was found accurately."""
    tolerance = ADAPTIVE[name] if name in ADAPTIVE else float(name)
    problem = chain_shape_problem(comm, size, tolerance=tolerance)
    began = perf_counter()
    result = minimised(problem, stopping)
    seconds = perf_counter() - began
    exact = chain_shape_problem(comm, size, tolerance=REFERENCE).evaluate(result.x)
    return {
        "states": name,
        "stopping": stopping,
        "design": result.x,
        "value_claimed": result.value,
        "value": exact.value,
        "reason": result.reason.name,
        "kinds": dict(Counter(record.kind.value for record in result.history)),
        "products": problem.products,
        "seconds": seconds,
        "seconds_solving": problem.seconds["solve"] + problem.seconds["adjoint"],
    }


def study(comm: MPI.Comm, size: str, random_designs: int, *, few: bool) -> dict[str, Any]:
    """Return all measurements of one size, or few of them.

    Args:
        comm: Communicator of one rank.
        size: One of `benchmarks.cases.chain_design.SIZES`.
        random_designs: Random designs beside the start, the optimum and one between them.
        few: Whether only few tolerances are tried.
    """
    fixed, adaptive = (FEW_FIXED, FEW_ADAPTIVE) if few else (FIXED, tuple(ADAPTIVE))
    names = [*(f"{tolerance:.0e}" for tolerance in fixed), *adaptive]
    stopping = FEW_STOPPING if few else STOPPING
    optima = [optimum(comm, size, name, limit) for limit in stopping for name in names]
    best = min(optima, key=lambda run: run["value"])["design"]
    found = errors(comm, size, best, random_designs)
    return {"size": size, "grading": GRADING, "optima": optima, "errors": found}
