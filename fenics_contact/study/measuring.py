"""One run: solve, measure, compare with the exact discrete solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._accuracy.certificate import certify
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import solve_steps
from fenics_contact._scene.scene import Scene
from fenics_contact.design.objectives import TotalPotential
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.errors import ConvergenceError
from fenics_contact.mesh.bisection import default_partition
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.fixed_point import FixedPoint
from fenics_contact.qp.solution import DualSolution
from fenics_contact.qp.solve import DualSolver, solve
from fenics_contact.results.contact import Status
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.linear_state import LinearState, as_linear
from fenics_contact.results.state import State
from fenics_contact.study.scenes import find_study
from fenics_contact.study.study import Outcome, Parameters, Problem, Quantity, Value
from fenics_contact.study.worker import peak_memory


def solve_problem(problem: Problem, parameters: Parameters, comm: MPI.Comm) -> tuple[AnyState, ...]:
    """Return the states of all load steps. Collective."""
    partitions = cut(problem.scene, parameters.subdomains, comm.size)
    contact = ContactProblem(problem.scene, comm, partitions=partitions, solver=_solver(parameters))
    return solve_steps(contact, problem.steps) if problem.steps else (contact.solve(),)


def _solver(parameters: Parameters) -> DualSolver | None:
    """Return the solver with its tolerance; None: a balanced one."""
    if parameters.balanced:
        return None
    newton = FaceNewton(tolerance=float(parameters.tolerance))
    return FixedPoint(newton) if parameters.solver == "fixed point" else newton


def cut(scene: Scene, subdomains: int | None, ranks: int) -> dict[str, np.ndarray] | None:
    """Cut the bodies into about so many subdomains, in proportion to their cells; None without a number."""
    if subdomains is None:
        return None
    meshes = {name: body.mesh for name, body in scene.bodies.items()}
    cells = sum(mesh.n_cells for mesh in meshes.values())
    least = -(-ranks // len(meshes))
    parts = {name: max(least, round(subdomains * mesh.n_cells / cells)) for name, mesh in meshes.items()}
    return {
        name: default_partition(mesh, least, nodes=_nodes(mesh, parts[name]), body=name)
        for name, mesh in meshes.items()
    }


def _nodes(mesh: BodyMesh, parts: int) -> float:
    """Return the nodes per subdomain when a body is cut into a number of parts."""
    side = (mesh.n_nodes / parts) ** (1.0 / mesh.dim)
    return max(2.0**mesh.dim, (side + 1.0) ** mesh.dim)


def gradient_of(problem: Problem, state: AnyState) -> tuple[np.ndarray, dict[str, float], int]:
    """Return the derivative of the total potential by the design, seconds by phase, products. Collective."""
    if problem.design is None:
        return np.zeros(0), {}, 0
    system = as_linear(state, "derivatives in studies").dual
    before = system.products
    contact = ContactProblem.following(state, tolerance=max(reached(state), 1e-11))
    differentiated = ShapeProblem(contact, problem.design, TotalPotential())
    point = differentiated.differentiate(state)
    seconds = {name: differentiated.seconds.get(name, 0.0) for name in ("objective", "adjoint", "gradient")}
    return point.gradient, seconds, system.products - before


def reached(state: AnyState) -> float:
    """Return the largest relative residual of a state."""
    return float(max(state.solution.natural_residual, state.solution.gluing_residual))


def slowest(comm: MPI.Comm, timer_seconds: Mapping[str, float]) -> dict[str, float]:
    """Return the seconds of the slowest rank in each phase. Collective."""
    names = comm.bcast(list(timer_seconds))
    spent = np.array([timer_seconds.get(name, 0.0) for name in names])
    comm.Allreduce(MPI.IN_PLACE, spent, op=MPI.MAX)
    return dict(zip(names, spent.tolist(), strict=True))


#: Tolerances of the reference solution: the first that can be reached is used.
EXACT = (1e-11, 1e-10, 1e-9)


@dataclass(frozen=True)
class TrueErrors:
    """Energy norms of displacement errors over that of the displacement.

    The larger one of the torn displacement and of that of the fields is used. `algebraic`: distance from the
    solution for the state's own slip bounds; `total`: from that of the friction law; `uncertainty`: error of
    these reference solutions, by their own certificates.
    """

    algebraic: float
    total: float
    uncertainty: float
    tolerance: float


def true_errors(states: tuple[State, ...]) -> TrueErrors | None:
    """Solve the last step again, as exactly as possible, and compare; None where it fails. Collective."""
    state = states[-1]
    if not isinstance(state, LinearState) or not isinstance(state.solution, DualSolution):
        return None
    for tolerance in EXACT:
        try:
            errors = _compared(state, states[:-1], FaceNewton(tolerance=tolerance))
        except ConvergenceError:
            continue
        if np.isfinite(errors.uncertainty):
            return errors
    return None


def _compared(state: LinearState, earlier: tuple[State, ...], solver: FaceNewton) -> TrueErrors:
    problem = ContactProblem.following(state, solver=solver)
    exact = as_linear(problem.solve(before=earlier[-1] if earlier else None), "true errors")
    norm = exact.energies.norm
    total = _distance(state, exact.dual_solution, exact.torn_displacement) / norm
    if not np.any(state.torn.groups.slips.coefficient > 0.0):
        doubt = certify(exact.dual, exact.dual_solution).bound / norm
        return TrueErrors(total, total, doubt, solver.tolerance)
    own = solve(state.dual.problem, state.dual_solution.slip_bound, solver, state.dual_solution.multiplier)
    displacement = state.dual.displacement(own.multiplier, own.alpha)
    doubt = certify(state.dual, own).bound / norm
    return TrueErrors(_distance(state, own, displacement) / norm, total, doubt, solver.tolerance)


def _distance(state: LinearState, other: DualSolution, displacement: np.ndarray) -> float:
    """Return √(dᵀK d) for a difference d of displacements, K d = −Bᵀδλ plus the sewing part. Collective.

    The larger one, of the torn displacement and of that of the fields.
    """
    system = state.dual
    moved = displacement - state.torn_displacement
    force = system.force(state.dual_solution.multiplier - other.multiplier)
    sewn = system.sewn(state.dual_solution.residual)
    energy, _ = system.inverse.energy(sewn)
    by_force, by_sewing = float(moved @ force), energy - 2.0 * float(system.inverse.extend(sewn) @ force)
    squares = state.torn.numbering.comm.allreduce(np.array([by_force, by_force + by_sewing]))
    return float(np.sqrt(max(0.0, *squares)))


def measured(
    comm: MPI.Comm, scene: str, parameters: Mapping[str, Any], *, verify: bool = False
) -> dict[str, Any]:
    """Run once and return all measurements. Collective."""
    study, settings = find_study(scene), Parameters(**parameters)
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
