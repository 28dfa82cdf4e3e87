"""The result of a computation in one JSON file that other programs can read years later.

It describes the scene as plain data, and holds forces, moments and provenance.
"""

from __future__ import annotations

import datetime
import importlib
import json
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from functools import partial, singledispatch
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.libraries import MPI, PETSc
from fenics_contact._scene.body import Body
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.obstacles import MovingObstacle
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.plan import SolverKind
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti.direct import DirectSolution
from fenics_contact.materials.elastic import Material
from fenics_contact.output.files import Lenient, plain, write_json
from fenics_contact.output.paraview import checked_name
from fenics_contact.qp.solution import SolverStep
from fenics_contact.readers.gmsh_session import interrupt_handler_kept
from fenics_contact.results.area import contact_area
from fenics_contact.results.contact import Status, worn_from
from fenics_contact.results.forces import Resultant
from fenics_contact.results.joints import joint_results
from fenics_contact.results.linear_state import as_linear
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.rigid_motions import UnheldMotion
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact._accuracy.state_errors import StateErrors
    from fenics_contact._adaptive.levels import AccurateResult
    from fenics_contact._optimize.result import Result
    from fenics_contact.design.problem import ShapeProblem
    from fenics_contact.design.several import JointProblem


#: Any value as plain data.
readable = partial(plain, form=Lenient())


def described_scene(scene: Scene, subdomains: Mapping[str, int], time: float = 0.0) -> dict[str, Any]:
    """Return bodies, supports, loads and pairs of a scene as plain data.

    See `fenics_contact.write_result`. Functions are given by their names, numbers by their values.
    """
    return {
        **scene.dimension_record,
        "bodies": {name: _body(body, subdomains[name]) for name, body in scene.deforming.items()},
        "supports": readable(scene.supports),
        "loads": readable(scene.loads),
        "contacts": [_described_pair(pair, time) for pair in scene.contacts],
        "ties": [_described_pair(tie, time) for tie in scene.ties],
        **({"preloads": readable(scene.preloads)} if scene.preloads else {}),
        **({"foundations": readable(scene.foundations)} if scene.foundations else {}),
        **({"springs": readable(scene.springs)} if scene.springs else {}),
        **({"constraints": [_constraint(each) for each in scene.constraints]} if scene.constraints else {}),
    }


def _body(body: Body, subdomains: int) -> dict[str, Any]:
    mesh = body.mesh
    return {
        "cells": mesh.n_cells,
        "cell_type": mesh.cell_type,
        "nodes": mesh.n_nodes,
        "subdomains": subdomains,
        "box": [mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()],
        "material": _materials(body.material),
    }


def _materials(material: Material | Mapping[str, Material]) -> dict[str, Any]:
    if isinstance(material, Mapping):
        return {"regions": {region: _material(part) for region, part in material.items()}}
    return _material(material)


def _material(material: Material) -> dict[str, Any]:
    """Return the fields of a material, or its parameters if it is not a dataclass."""
    known = readable(material)
    return known if is_dataclass(material) else {**known, "parameters": readable(material.parameters)}


def _described_pair(pair: ContactPair | AnyTie, time: float) -> dict[str, Any]:
    names = [part.name for part in fields(pair) if part.name != "choice"]
    entries = {name: readable(getattr(pair, name)) for name in [*names, "reason"]}
    for side in ("slave", "master"):
        surface = getattr(pair, side)
        if isinstance(surface, Surface):
            entries[side] = {"body": surface.body, "surface": surface.name}
        if isinstance(surface, MovingObstacle):
            rotation, translation = surface.frame(time)
            moved = {"rotation": rotation.tolist(), "translation": translation.tolist()}
            entries[side] = {**entries[side], **moved}
    return entries


def forces_record(state: State) -> dict[str, Any]:
    """Return reactions, forces of ties and contacts, and their balance by name. Collective."""
    pairs, balance = state.resultants(), state.balance()
    drawn: dict[str, Any] = {each.kind: each.record() for each in joint_results(state)}
    if state.scene.foundations:
        drawn["foundations"] = [_on_surface(each) for each in state.foundations()]
    if any(pair.has_friction for pair in state.scene.contacts):
        drawn["friction"] = [_on_surface(each) for each in pairs.friction]
    return {
        "reactions": [_on_surface(each) for each in state.reactions()],
        "contacts": [_on_surface(each) for each in pairs.contacts],
        "ties": [_on_surface(each) for each in pairs.ties],
        **drawn,
        "balance": {
            "about": balance.total.about,
            **{name: {"force": part.force, "moment": part.moment} for name, part in balance.parts.items()},
            "imbalance": balance.imbalance,
            "force_scale": balance.force_scale,
            "moment_scale": balance.moment_scale,
        },
    }


def _constraint(constraint: LinearConstraint) -> dict[str, Any]:
    value = constraint.value if isinstance(constraint.value, float) else f"{len(constraint.value)} values"
    terms = [term.in_words for term in constraint.terms]
    return {"name": constraint.label, "terms": terms, "value": value}


def listed_forces(forces: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the entries of a record of forces by what they are: "reaction 0", ..., "sum of loads", ...

    Each has ``force``, ``moment`` and ``about``; those of surfaces ``body`` and ``surface``, too.
    """
    words = {"reactions": "reaction", "contacts": "contact", "ties": "tie"}
    single = [(f"{words[kind]} {k}", entry) for kind in words for k, entry in enumerate(forces[kind])]
    single += [(f"section of {each['name']}", each) for each in forces.get("preloads", ())]
    single += [(f"friction {k}", each) for k, each in enumerate(forces.get("friction", ()))]
    single += [(f"foundation {k}", each) for k, each in enumerate(forces.get("foundations", ()))]
    balance = forces["balance"]
    sums = {name: entry for name, entry in balance.items() if isinstance(entry, Mapping)}
    whole = [
        (f"sum {'across' if name == 'gaps' else 'of'} {name}", {**entry, "about": balance["about"]})
        for name, entry in sums.items()
    ]
    return [*single, *whole]


def scales_of(forces: Mapping[str, Any]) -> dict[str, float]:
    """Return a reference force and moment; smaller values are rounding.

    Results of before these were stored have the largest entries instead.
    """
    entries: Sequence[Mapping[str, Any]] = [entry for _, entry in listed_forces(forces)]
    return {
        kind: forces["balance"].get(
            f"{kind}_scale", max(float(np.max(np.abs(each[kind]), initial=0.0)) for each in entries)
        )
        for kind in ("force", "moment")
    }


def motions_record(state: State) -> list[dict[str, Any]]:
    """Return the motions of rigid surfaces. Collective."""
    return [
        {
            "body": each.surface.body,
            "surface": each.surface.name,
            "about": each.about,
            "displacement": each.displacement,
            "rotation": each.rotation,
        }
        for each in state.rigid_motions()
    ]


def _on_surface(each: Resultant) -> dict[str, Any]:
    where = {"body": each.surface.body, "surface": each.surface.name} if each.surface else {}
    return {**where, "force": each.force, "moment": each.moment, "about": each.about}


_MODULES = ("numpy", "scipy", "mpi4py", "petsc4py", "gmsh", "clarabel", "pyvista", "vtk")


def versions() -> dict[str, str]:
    """Return the versions of Python, of the libraries that computed and of this package, by name.

    A library that is not installed or does not report its version is marked as such.
    """
    entries = {"fenics_contact": own_version(), "python": platform.python_version()}
    entries["dolfinx"] = _dolfinx.release()
    entries["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    entries["mpi"] = " ".join(re.split(r"[,\n\x00]", MPI.Get_library_version().strip())[0].split())
    return entries | {name: _installed(name) for name in _MODULES}


def own_version() -> str:
    """Return the version of this package."""
    return _installed("fenics_contact")


def _installed(name: str) -> str:
    """Return the version from the metadata or, without these, from the library itself."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        pass
    try:
        with interrupt_handler_kept():  # Debian's gmsh has no metadata
            module: ModuleType = importlib.import_module(name)
    except ImportError:
        return "not installed"
    return str(getattr(module, "__version__", "unknown"))


#: Value of ``format`` in files of `write_result`.
FORMAT = "fenics_contact result"
#: It rises with every change that a reader must know.
FORMAT_VERSION = 1
UNITS = (
    "those of the input: a scene in N and mm has forces in N, stresses, moduli and pressures in N/mm², "
    "energies and moments in N mm; seconds are wall time of rank 0; residuals and errors are relative; "
    "plane bodies without a thickness have forces, moments and energies a unit of it, bodies of revolution "
    "those of a full revolution"
)


@collectively("write_result", lambda state, *_, **__: state.comm)
@naming_arguments
def write_result(
    state: OnBodies,
    folder: str | Path,
    *,
    name: str = "result",
    more: Mapping[str, Any] | None = None,
    errors: bool = False,
    accuracy: AccurateResult[State] | None = None,
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
that was read from a checkpoint is marked so and has no tolerance |
    | ``counts`` | torn unknowns, multipliers, F-products, steps; `State.counts` |
    | ``seconds`` | by phase |
    | ``costs`` | of rank 0: ``set_up``, ``solve``, ``recovery``, each with the counts of a `PhaseCosts` |
    | ``residuals`` | ``gluing``, ``natural``, ``equilibrium``; recomputed, relative |
    | ``residual_history`` | ``method``, ``outer``, ``products``, ``natural``, ``gluing``, ``coarse``: \
lists, one entry per step of the solver; empty for a state that was read from a checkpoint |
    | ``energies`` | ``strain``, ``load``, ``friction``, ``dual``, ``total_potential``, ``primal``; \
None where materials dissipate or are nonlinear |
    | ``errors`` | ``algebraic``, ``friction``, ``discretisation``, ``geometry``, \
``peak_pressure_by_geometry``, ``by_body``; None if unknown |
    | ``contact`` | one entry per pair: ``points``, ``open``, ``stick``, ``slip``, ``force`` on the slave, \
``normal_force`` (the sum of normal forces), ``normal_resultant`` (the size of their vector sum), \
``peak_pressure``, where bodies deform much ``peak_nominal_pressure``, ``area``, \
``smallest_gap``, ``largest_slip`` in the last load step, of pairs that wear ``worn_volume`` and the \
largest ``worn_depth``; without friction closed points count as ``slip`` |
    | ``unheld`` | rigid motions that nothing resists and nothing loads, in words; `State.unheld` |
    | ``forces`` | ``reactions`` of the supports, ``contacts`` and ``ties`` (on the slave): each with body, \
surface, ``force``, ``moment`` and the point ``about`` which it is; where there are any, ``foundations`` \
and the part of ``friction`` in each of the contacts likewise, and of ``preloads`` ``name``, \
``axial_force``, ``shortening``, ``shear``, ``bending`` and \
``torsion``, of ``springs`` ``name``, ``force`` on the first end, ``directions``, ``tension`` and \
``elongation``, of ``constraints`` ``name``, ``equations``, the ``largest`` of their forces and of each of \
``bodies`` ``body`` and ``force``; ``balance`` of all with the loads, its ``imbalance`` and the scales to \
which it is relative |
    | ``rigid_motions`` | of each rigid surface body, surface, ``displacement`` and ``rotation`` of the \
point ``about`` |
    | ``tools`` | of each rigid tool by name ``displacement``, ``rotation``, and ``force`` and ``moment`` of \
contact on it |
    | ``accuracy`` | where a quantity was computed to one: ``value``, ``error``, ``wanted`` (relative), \
``reached``, ``reason``, and of ``levels`` a list for each attribute of `Level`; None for an unknown error |
    | ``more`` | further results of the caller |

    Entries may be added without a new version; changing or removing one requires a new version.

    Args:
        state: The state.
        folder: Output folder; created.
        name: Name of the file without ".json". A file of that name is replaced when the new one is complete.
        more: Further results: numbers, text, arrays, by name.
        errors: Whether to estimate the state's errors, see `LinearState.estimate_errors` for the cost; else
            those known already are written: a balanced solve has all but that of the geometry.
        accuracy: What `solve_to` returned, whose state it is.

    Returns:
        The file; `read_result` reads it.

    Raises:
        InvalidInputError: If the name contains a folder, or ``more`` what JSON has not; states where.

    Example:
        >>> write_result(state, "output", more={"drop_percent": 12.4})  # doctest: +SKIP
    """
    comm = state.comm
    with together(comm):
        target = checked_name(folder, name, ".json")
    record = result_record(state, more=more, errors=errors)
    if accuracy is not None:
        record["accuracy"] = _accuracy(accuracy)
    return write_json(target, record, comm=comm)


@collectively("result_record", lambda state, *_, **__: state.comm)
def result_record(
    state: OnBodies, *, more: Mapping[str, Any] | None = None, errors: bool = False
) -> dict[str, Any]:
    """Return what `write_result` writes, with its arguments. Collective."""
    return {**_record(state, errors), "more": dict(more or {})}


@singledispatch
def _record(state: Any, errors: bool) -> dict[str, Any]:
    """Return head and parts of the record of a result, by default one that has them itself. Collective."""
    head = [_head(state.kind, state.comm), *(_record(part, errors) for part in state.parts)]
    known = {name: value for each in head for name, value in each.items()}
    return {**known, **readable(state.record()), "kind": state.kind}


@_record.register
def _(state: State, errors: bool) -> dict[str, Any]:
    comm, unheld, read_off = state.comm, state.unheld, _read_off(state)
    with together(comm):
        record = {**_head("state", comm), **_state_record(state, unheld), **read_off}
    found = as_linear(state, "errors").estimate_errors() if errors else state.known_errors
    record["errors"] = None if found is None else _errors(found)
    return record


@collectively("write_optimisation_result", lambda result, problem, *_, **__: problem.comm)
@naming_arguments
def write_optimisation_result(
    result: Result,
    problem: ShapeProblem | JointProblem,
    folder: str | Path,
    *,
    name: str = "result",
    more: Mapping[str, Any] | None = None,
    accuracy: AccurateResult[State] | None = None,
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
    | ``optimisation.history`` | one list for each attribute of `design.Record`, one entry an \
evaluation; None where a trial point was rejected as invalid |

    Args:
        result: The result of `minimize`.
        problem: The minimised problem.
        folder: Output folder; created.
        name: Name of the file without ".json".
        more: Further results by name.
        accuracy: What `minimize_to` returned, whose last result and problem these are: ``accuracy`` is as in
            `write_result`, and the first value is that of the design with which the last mesh began.

    Returns:
        The file; `read_result` reads it.

    Raises:
        InvalidInputError: As `write_result` does, or if the problem has not been evaluated.
    """
    first, comm = problem.first, problem.comm
    with together(comm):
        target = checked_name(folder, name, ".json")
        if first is None:
            raise InvalidInputError(
                "an optimisation's result needs designs that were evaluated, the problem has none"
            )
    best = problem.at(result.x)
    unheld, read_off = best.state.unheld, _read_off(best.state)
    with together(comm):
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
        if accuracy is not None:
            record["accuracy"] = _accuracy(accuracy)
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
        "costs": {name: asdict(getattr(state.costs, name)) for name in ("set_up", "solve", "recovery")},
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
        "contact": [_pair_summary(state, number) for number in range(len(state.scene.contacts))],
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
    return {
        "forces": forces_record(state),
        "rigid_motions": motions_record(state),
        "tools": {name: readable(each) for name, each in state.tools().items()},
    }


def _pair_summary(state: State, number: int) -> dict[str, Any]:
    """Return a summary of the contact of one pair."""
    contact = state.contact
    mine, pressing = contact.on_pair(number), contact.normal_forces(number)
    known = {status.name.lower(): int(np.sum(contact.status[mine] == status)) for status in Status}
    largest = float(contact.nominal_pressure[mine].max(initial=0.0))
    nominal = {"peak_nominal_pressure": largest} if state.scene.deforms_much else {}
    return {
        "points": len(mine),
        **known,
        "force": contact.force[mine].sum(axis=0),
        "normal_force": pressing.sum,
        "normal_resultant": pressing.resultant,
        "peak_pressure": float(contact.pressure[mine].max(initial=0.0)),
        **nominal,
        "area": contact_area(state, number),
        "smallest_gap": float(contact.gap[mine].min()) if len(mine) else None,
        "largest_slip": float(np.linalg.norm(contact.slip[mine], axis=1).max(initial=0.0)),
        **{name.replace(" ", "_"): value for name, value in worn_from(state.scene, contact, number).items()},
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


def _accuracy(result: AccurateResult[State]) -> dict[str, Any]:
    names = list(vars(result.levels[0]))
    levels = {name: [readable(getattr(level, name)) for level in result.levels] for name in names}
    kept = {
        name: readable(getattr(result, name)) for name in ("value", "error", "wanted", "reached", "reason")
    }
    return {**kept, "levels": levels}


def _objective(problem: ShapeProblem | JointProblem, initial: float, final: float) -> dict[str, Any]:
    from fenics_contact.design.several import JointProblem

    kind: object = problem if isinstance(problem, JointProblem) else problem.objective
    objective = problem.objectives if isinstance(problem, JointProblem) else problem.objective
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


@naming_arguments
def read_result(path: str | Path) -> dict[str, Any]:
    """Read a file of `write_result` or `write_optimisation_result`.

    Args:
        path: The file, or a folder that holds a "result.json".

    Returns:
        The entries as described there.

    Raises:
        InvalidInputError: If there is no such file, it cannot be read, is not complete JSON, not a result, or
            of a newer format; states what to do.

    Example:
        >>> read_result("output/result.json")["energies"]["total_potential"]  # doctest: +SKIP
    """
    file = Path(path)
    file = file / "result.json" if file.is_dir() else file
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidInputError(
            f"a result is needed at {str(file)!r}, which cannot be read: {error.strerror or error}"
        ) from error
    except ValueError as error:  # of JSON or of the encoding
        raise InvalidInputError(
            f"a result must be a whole JSON file, {str(file)!r} is not one ({error}): it was cut or edited"
        ) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        kind = data.get("format") if isinstance(data, dict) else None
        raise InvalidInputError(
            f'a result must have "format": {FORMAT!r}, {str(file)!r} has {kind!r}: give one of write_result'
        )
    version = data.get("format_version")
    if not isinstance(version, int) or version < 1:
        raise InvalidInputError(
            f"a result must have a format_version of 1 or more, {str(file)!r} has {version!r}: write it again"
        )
    if version > FORMAT_VERSION:
        raise InvalidInputError(
            f"this version of fenics_contact reads results up to format_version {FORMAT_VERSION}, "
            f"{str(file)!r} has {version}: read it with a newer version"
        )
    return data
