"""The result of a computation in one JSON file that other programs can read years later."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.contact import State, Status, UnheldMotion, as_linear, contact_area
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti import DirectSolution
from fenics_contact.io.described_scene import described_scene, readable
from fenics_contact.io.forces_record import forces_record, motions_record
from fenics_contact.io.json_file import write_json
from fenics_contact.io.names import checked_name
from fenics_contact.io.provenance import versions
from fenics_contact.io.reading import FORMAT, FORMAT_VERSION
from fenics_contact.qp import SolverStep
from fenics_contact.scene import SolverKind

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.accuracy import StateErrors
    from fenics_contact.optimize import Result
    from fenics_contact.shape import LoadPath, ShapeProblem

UNITS = (
    "those of the input: a scene in N and mm has forces in N, stresses, moduli and pressures in N/mm², "
    "energies and moments in N mm; seconds are wall time of rank 0; residuals and errors are relative; "
    "plane bodies have forces, moments and energies a unit of thickness"
)


@collectively("write_result", lambda state, *_, **__: state.torn.decomposition.comm)
def write_result(
    state: State,
    folder: str | Path,
    *,
    name: str = "result",
    more: Mapping[str, Any] | None = None,
    errors: bool = False,
) -> Path:
    """Write a state, how it was computed and with which software. Collective.

    | entry | what it holds |
    |---|---|
    | ``format``, ``format_version``, ``kind`` | "fenics_contact result", 1, "state" |
    | ``written``, ``ranks``, ``versions``, ``units`` | when (UTC), on how many ranks, with which libraries |
    | ``scene`` | ``dimension``, ``bodies`` (cells, nodes, subdomains, bounding box, material with its \
parameters), ``supports``, ``loads``, ``contacts`` and ``ties`` with all their parameters; obstacles \
that move also with their ``rotation`` and ``translation`` in the state |
    | ``plan`` | ``effects`` with the reason for each, ``cone``, ``memory_bytes`` as expected |
    | ``solver`` | ``kind``, ``methods`` that took steps, ``tolerance``, ``reason`` for the stop; a state \
that was read from a checkpoint says so and has no tolerance |
    | ``counts`` | torn unknowns, multipliers, F-products, steps; `State.counts` |
    | ``seconds`` | by phase |
    | ``residuals`` | ``gluing``, ``natural``, ``equilibrium``; recomputed, relative |
    | ``residual_history`` | ``method``, ``outer``, ``products``, ``natural``, ``gluing``, ``coarse``: \
lists, one entry per step of the solver; empty for a state that was read from a checkpoint |
    | ``energies`` | ``strain``, ``load``, ``friction``, ``dual``, ``total_potential``, ``primal``; \
None where materials dissipate or are nonlinear |
    | ``errors`` | ``algebraic``, ``friction``, ``discretisation``, ``geometry``, \
``peak_pressure_by_geometry``, ``by_body``; None if unknown |
    | ``contact`` | one entry per pair: ``points``, ``open``, ``stick``, ``slip``, ``force`` on the slave, \
``normal_force``, ``peak_pressure``, where bodies deform much ``peak_nominal_pressure``, ``area``, \
``smallest_gap``, ``largest_slip`` in the last load step; without friction closed points count as ``slip`` |
    | ``unheld`` | rigid motions that nothing resists and nothing loads, in words; `State.unheld` |
    | ``forces`` | ``reactions`` of the supports, ``contacts`` and ``ties`` (on the slave): each with body, \
surface, ``force``, ``moment`` and the point ``about`` which it is; ``balance`` of all with the loads, its \
``imbalance`` and the scales to which that is relative |
    | ``rigid_motions`` | of each rigid surface body, surface, ``displacement`` and ``rotation`` of the \
point ``about`` |
    | ``more`` | further results of the caller |

    Entries may be added without a new version; changing or removing one requires a new version.

    Args:
        state: The state.
        folder: Output folder; created.
        name: Name of the file without ".json". A file of that name is replaced when the new one is complete.
        more: Further results: numbers, text, arrays, by name.
        errors: Whether to estimate the state's errors, see `LinearState.estimate_errors` for the cost; else
            those known already are written: a balanced solve has all but that of the geometry.

    Returns:
        The file; `read_result` reads it.

    Raises:
        InvalidInputError: If the name contains a folder, or ``more`` something that JSON lacks; states where.

    Example:
        >>> write_result(state, "output", more={"drop_percent": 12.4})  # doctest: +SKIP
    """
    comm = state.torn.decomposition.comm
    with together(comm):
        target = checked_name(folder, name, ".json")
    return write_json(target, result_record(state, more=more, errors=errors), comm=comm)


@collectively("result_record", lambda state, *_, **__: state.torn.decomposition.comm)
def result_record(
    state: State, *, more: Mapping[str, Any] | None = None, errors: bool = False
) -> dict[str, Any]:
    """Return what `write_result` writes, with its arguments. Collective."""
    comm, unheld, read_off = state.torn.decomposition.comm, state.unheld, _read_off(state)
    with together(comm):
        record = {**_head("state", comm), **_state_record(state, unheld), **read_off}
    found = as_linear(state, "errors").estimate_errors() if errors else state.known_errors
    record["errors"] = None if found is None else _errors(found)
    return {**record, "more": dict(more or {})}


@collectively("write_optimisation_result", lambda result, problem, *_, **__: problem.comm)
def write_optimisation_result(
    result: Result,
    problem: ShapeProblem | LoadPath,
    folder: str | Path,
    *,
    name: str = "result",
    more: Mapping[str, Any] | None = None,
) -> Path:
    """Write the result of an optimisation. Collective.

    The file has the entries of `write_result` for the state of the best design, with ``kind``
    "optimisation", ``seconds`` and ``counts`` of the whole run, and

    | entry | what it holds |
    |---|---|
    | ``optimisation.objective`` | ``type``, ``definition`` with all arguments, ``initial``, ``final``, \
``drop_percent`` |
    | ``optimisation.design`` | ``variables``, ``bodies``, ``values`` at the best point |
    | ``optimisation.stop`` | ``converged``, ``reason``, ``iterations``, ``evaluations``, ``f_products`` |
    | ``optimisation.constraints`` | of each nonlinear one ``name``, ``value``, ``lower``, ``upper``, \
``violation``, ``multiplier``; None for no limit |
    | ``optimisation.history`` | one list for each attribute of `fenics_contact.optimize.Record`, one entry \
an evaluation; None where a trial point was rejected as invalid |

    Args:
        result: The result of `minimize`.
        problem: The minimised problem.
        folder: Output folder; created.
        name: Name of the file without ".json".
        more: Further results by name.

    Returns:
        The file; `read_result` reads it.

    Raises:
        InvalidInputError: As `write_result` does, or if the problem has not been evaluated.
    """
    first, comm = problem.first, problem.comm
    best = None if first is None else problem.at(result.x)
    unheld = () if best is None else best.state.unheld
    read_off = {} if best is None else _read_off(best.state)
    with together(comm):
        target = checked_name(folder, name, ".json")
        if first is None or best is None:
            raise InvalidInputError(
                "an optimisation's result needs designs that were evaluated, the problem has none: give the "
                "problem that was handed to minimize"
            )
        record = {**_head("optimisation", comm), **_state_record(best.state, unheld), **read_off}
        record["counts"]["f_products"] = problem.products
        record["seconds"] = dict(problem.seconds)
        record["optimisation"] = {
            "objective": _objective(problem, first.value, best.value),
            "design": {
                "variables": problem.size,
                "bodies": [design.body for design in problem.designs],
                "values": np.asarray(result.x),
            },
            "stop": {
                "converged": result.reason.success,
                "reason": result.reason.value,
                "iterations": result.iterations,
                "evaluations": result.evaluations,
                "f_products": problem.products,
            },
            "constraints": readable(result.constraints),
            "history": _history(result),
        }
    known = best.state.known_errors
    record["errors"] = None if known is None else _errors(known)
    return write_json(target, {**record, "more": dict(more or {})}, comm=comm)


def _head(kind: str, comm: MPI.Comm) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "kind": kind,
        "written": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "ranks": comm.size,
        "versions": versions(),
        "units": UNITS,
    }


def _state_record(state: State, unheld: Sequence[UnheldMotion]) -> dict[str, Any]:
    decomposition, solution = state.torn.decomposition, state.solution
    parts = decomposition.partitions
    plan = state.scene.plan(parts)
    direct = isinstance(solution, DirectSolution)
    methods = list(dict.fromkeys(step.method for step in solution.history))
    return {
        "scene": described_scene(
            state.scene, {name: int(np.max(part)) + 1 for name, part in parts.items()}, state.time
        ),
        "plan": {
            "effects": {effect.name.value: effect.reason for effect in plan.effects},
            "cone": plan.cone.value,
            "memory_bytes": round(plan.memory),
        },
        "solver": {
            "kind": SolverKind.DIRECT.value if direct else "dual",
            "methods": methods,
            "tolerance": readable(state.tolerance),
            "reason": solution.reason,
        },
        "counts": state.counts,
        "seconds": dict(state.seconds),
        "residuals": {
            "gluing": readable(solution.gluing_residual),
            "natural": readable(solution.natural_residual),
            "equilibrium": readable(solution.coarse_residual),
        },
        "residual_history": _residual_history(solution.history),
        "energies": {
            key: readable(getattr(state.energies, key))
            for key in ("strain", "load", "friction", "dual", "total_potential", "primal")
        },
        "contact": [_pair(state, number) for number in range(len(state.scene.contacts))],
        "unheld": [str(motion) for motion in unheld],
    }


def _residual_history(history: Sequence[SolverStep]) -> dict[str, list[Any]]:
    counted = {name: [getattr(step, name) for step in history] for name in ("method", "outer", "products")}
    measured = {
        name: [readable(getattr(step.residuals, name)) for step in history]
        for name in ("natural", "gluing", "coarse")
    }
    return counted | measured


def _read_off(state: State) -> dict[str, Any]:
    """Return forces and motions of rigid surfaces. Collective."""
    return {"forces": forces_record(state), "rigid_motions": motions_record(state)}


def _pair(state: State, number: int) -> dict[str, Any]:
    """Return a summary of the contact of one pair."""
    contact = state.contact
    mine = contact.on_pair(number)
    known = {status.name.lower(): int(np.sum(contact.status[mine] == status)) for status in Status}
    largest = float(contact.nominal_pressure[mine].max(initial=0.0))
    nominal = {"peak_nominal_pressure": largest} if state.scene.deforms_much else {}
    return {
        "points": len(mine),
        **known,
        "force": contact.force[mine].sum(axis=0),
        "normal_force": float(contact.normal_force[mine].sum()),
        "peak_pressure": float(contact.pressure[mine].max(initial=0.0)),
        **nominal,
        "area": contact_area(state, number),
        "smallest_gap": float(contact.gap[mine].min()) if len(mine) else None,
        "largest_slip": float(np.linalg.norm(contact.slip[mine], axis=1).max(initial=0.0)),
    }


def _errors(errors: StateErrors) -> dict[str, Any]:
    return {
        "algebraic": readable(errors.algebraic),
        "friction": readable(errors.friction),
        "discretisation": readable(errors.discretisation),
        "geometry": readable(errors.geometry),
        "peak_pressure_by_geometry": readable(errors.peak_by_geometry),
        "by_body": readable(errors.by_body),
    }


def _objective(problem: ShapeProblem | LoadPath, initial: float, final: float) -> dict[str, Any]:
    from fenics_contact.shape import LoadPath

    kind: object = problem if isinstance(problem, LoadPath) else problem.objective
    objective = problem.objectives if isinstance(problem, LoadPath) else problem.objective
    return {
        "type": type(kind).__name__,
        "definition": re.sub(r" at 0x[0-9a-f]+", "", repr(objective)),
        "initial": initial,
        "final": final,
        "drop_percent": (initial - final) / abs(initial) * 100.0 if initial else None,
    }


def _history(result: Result) -> dict[str, list[Any]]:
    if not result.history:
        return {}
    names = list(vars(result.history[0]))
    return {name: [readable(getattr(record, name)) for record in result.history] for name in names}
