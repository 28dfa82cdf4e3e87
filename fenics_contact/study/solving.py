"""Solve the problem of one run with its settings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.contact import (
    AnyState,
    ContactProblem,
    FixedPoint,
    as_linear,
    solve_steps,
)
from fenics_contact.mesh import BodyMesh
from fenics_contact.partition import default_partition
from fenics_contact.qp import DualSolver, FaceNewton
from fenics_contact.scene import Scene
from fenics_contact.shape import ShapeProblem, TotalPotential
from fenics_contact.study.parameters import Parameters
from fenics_contact.study.protocol import Problem


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
    """Cut the bodies into about the given number of subdomains in total, in proportion to their cells.

    Returns:
        Body name -> subdomain of every cell; None where no number is given.
    """
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
