"""One run: solve, measure, compare with the exact discrete solution."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.contact import AnyState, Status, as_linear
from fenics_contact.study.parameters import parameters_from
from fenics_contact.study.protocol import Outcome, Quantity, Value
from fenics_contact.study.scenes import find_study
from fenics_contact.study.solving import gradient_of, reached, slowest, solve_problem
from fenics_contact.study.true_error import true_errors
from fenics_contact.study.worker import peak_memory
from fenics_contact.timing import PhaseTimer


def measured(
    comm: MPI.Comm, scene: str, parameters: Mapping[str, Any], *, verify: bool = False
) -> dict[str, Any]:
    """Run once and return all measurements. Collective.

    Args:
        comm: Communicator.
        scene: As for `find_study`.
        parameters: The settings, as `Parameters.as_dict` returns them.
        verify: Whether to compute errors, too, not only times.
    """
    study, settings = find_study(scene), parameters_from(parameters)
    _dolfinx.release()  # loads dolfinx, which is not part of a run's time
    comm.Barrier()
    began, timer = perf_counter(), PhaseTimer()
    with timer.phase("mesh"):
        problem = study.build(settings, comm)
    states = solve_problem(problem, settings, comm)
    seconds = comm.allreduce(perf_counter() - began, op=MPI.MAX)
    memory = comm.allreduce(peak_memory())
    gradient, after, gradient_products = gradient_of(problem, states[-1])
    record: dict[str, Any] = {
        "seconds": seconds,
        "phases": slowest(comm, {**timer.seconds, **states[-1].seconds}),
        "phases_after": slowest(comm, after),
        "memory": memory or None,
    }
    if not verify:
        return record
    outcome = Outcome(problem, states, settings, gradient)
    return record | {
        "counts": _counts(states) | {"gradient_products": gradient_products},
        "residual": reached(states[-1]),
        "quantities": {quantity.name: _quantity(quantity, outcome) for quantity in study.quantities},
        "parts": error_parts(states[-1]),
        "true_errors": true_errors(states),
    }


def error_parts(state: AnyState) -> dict[str, float | None]:
    """Return the three parts of a state's error, relative to its energy norm. Collective."""
    errors = as_linear(state, "errors").estimate_errors(geometry=False)
    parts = {name: float(getattr(errors, name)) for name in ("algebraic", "friction", "discretisation")}
    # Without an admissible pair the bound is infinite, which JSON cannot represent.
    return {name: value if np.isfinite(value) else None for name, value in parts.items()}


def _counts(states: tuple[AnyState, ...]) -> dict[str, int]:
    """Return sizes of the last state and the work of all."""
    counts = dict(states[-1].counts)
    for name in ("f_products", "solver_steps"):
        counts[name] = sum(state.counts[name] for state in states)
    return counts | {status.name.lower(): states[-1].contact.count(status) for status in Status}


def _quantity(quantity: Quantity, outcome: Outcome) -> dict[str, Any] | None:
    """Return a quantity with its exact value if there is one; None if the run does not have it.

    Of several numbers with an exact value only the norms and the norm of the difference are stored: their
    positions may differ from mesh to mesh.
    """
    value = np.asarray(quantity.value(outcome), dtype=np.float64)
    if value.size == 0 or not np.all(np.isfinite(value)):
        return None
    if quantity.exact is None:
        return {"value": value.tolist()}
    known: Value = quantity.exact(outcome) if callable(quantity.exact) else quantity.exact
    exact = np.asarray(known, dtype=np.float64)
    scale = float(np.linalg.norm(exact))
    difference = value - exact
    error = float(difference) if difference.ndim == 0 else float(np.linalg.norm(difference))
    measure = float(value) if value.ndim == 0 else float(np.linalg.norm(value))
    return {
        "value": measure,
        "exact": float(exact) if exact.ndim == 0 else scale,
        "error": error / scale if scale > 0.0 else None,
    }
