"""Solve the dual system of a scene with its friction, and evaluate the result on its contact surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.held_friction import even_friction
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.face_newton import SlidingError
from fenics_contact.qp.fixed_point import FixedPoint
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import DualSolution, contact_step
from fenics_contact.qp.solve import DualSolver, solve
from fenics_contact.results.contact import ContactResult, RowValues, Status
from fenics_contact.results.rigid_motions import motion_in_words, rigid_motions


def solve_dual(
    system: DualSystem, solver: DualSolver, start: DualSolution | np.ndarray | None = None
) -> DualSolution:
    """Solve the dual problem of a system with the friction laws of its scene. Collective.

    `start`: earlier solution, or multiplier to start from, owned, or None.
    """
    law = system.torn.law
    if not isinstance(law, TrescaLaw) and isinstance(solver, Smalse):
        solver = FixedPoint(solver)
    try:
        found = solve(system.problem, None, solver, start, law=law)
    except SlidingError as error:
        (motion,) = rigid_motions(system.torn, (system.kernel @ error.motion)[:, None])
        rounded = {name: np.round(own, 3) + 0.0 for name, own in motion.bodies.items()}
        words = ", ".join(f"{name!r} by {motion_in_words(own)}" for name, own in rounded.items() if own.any())
        raise error.named(f"the load makes slide {words}") from error.__cause__
    return replace(found, multiplier=even_friction(system.torn, found.multiplier))


def row_values(system: DualSystem, solution: DualSolution) -> RowValues:
    """Return what the laws of rows depend on at a solution."""
    problem = system.problem
    return RowValues(
        solution.multiplier, solution.residual, solution.slip_bound,
        contact_step(problem.layout, problem.diagonal), problem.rhs, problem.between_supports,
        solution.residuals,
    )  # fmt: skip


def sticking(torn: TornSystem, values: RowValues) -> np.ndarray:
    """Return marks of the friction rows of points that do not slip, open ones included, owned."""
    rows, discs = torn.layout.tangential, torn.owned_discs
    step = values.step[rows[:, 0]]
    elastic = torn.groups.slips.elastic_slip[discs]
    trial = values.multiplier[rows] - step[:, None] * values.residual[rows]
    sticks = np.zeros(torn.layout.size, dtype=bool)
    sticks[rows[np.linalg.norm(trial, axis=1) < values.slip_bound * (1.0 + step * elastic)]] = True
    return sticks


def worn_by(contact: ContactResult, torn: TornSystem) -> ContactResult:
    """Return a result without wear with that of its pressures and slips, by which gaps are wider."""
    worn = torn.wear.depth(contact.normal_force / torn.points.area, contact.slip)
    return replace(contact, worn=worn, worn_before=torn.wear.before, gap=contact.gap + worn)


def contact_result(torn: TornSystem, values: RowValues, displacement: np.ndarray) -> ContactResult:
    """Gather forces, gaps and status of all contact points on every rank, see `worn_by`. Collective."""
    rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
    gathered = [torn.numbering.gather(x, rows) for x in (values.multiplier, values.residual, values.step)]
    count, frictional = torn.points.count, torn.frictional
    normal, gap, normal_step = (x[:count] for x in gathered)
    tau, minus_slip, tangential_step = (x[count:].reshape(-1, torn.components - 1) for x in gathered)
    trial_normal = normal - normal_step * gap
    trial_tangential = tau - tangential_step * minus_slip
    slips = torn.groups.slips
    bound = slips.slip_bound(normal[frictional])
    status = np.where(trial_normal > 0, Status.SLIP, Status.OPEN).astype(int)
    slip = -minus_slip - slips.elastic_slip[:, None] * tau
    bound_of_trial = bound * (1.0 + tangential_step[:, 0] * slips.elastic_slip)
    sticks = (np.linalg.norm(trial_tangential, axis=1) < bound_of_trial) & (trial_normal[frictional] > 0)
    status[frictional[sticks]] = Status.STICK

    def spread(values: np.ndarray, others: float | np.ndarray = 0.0) -> np.ndarray:
        full = np.empty((count, *values.shape[1:]))
        full[frictional], full[slips.frictionless] = values, others
        return full

    gap = gap + torn.reach
    origin = torn.numbering.gather(torn.right + torn.supported, torn.tangential_rows.ravel())
    return ContactResult(
        torn.points,
        np.where(trial_normal > 0, np.maximum(normal, 0.0), 0.0),
        spread(tau),
        spread(bound),
        gap,
        spread(slip, torn.sliding(displacement) - torn.slid),
        spread(origin.reshape(-1, torn.components - 1), torn.slid),
        status,
        torn.points.area,
        torn.points.area,
        torn.scene.kinematics.balanced,
        torn.fluid.wet,
    )
