"""What must hold after every solve, computed again from the answer alone.

Everything here runs on one rank, so that owned vectors are whole vectors.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.conic_reference import ConicReference


def slip_bound(state: AnyState) -> np.ndarray:
    """Return Ψ = given bound + μ λ_N of every disc, from the scene's data and the answer's normal forces."""
    torn, layout = state.system.torn, state.system.problem.layout
    normal = state.solution.multiplier[layout.normal[layout.friction_of]]
    return torn.groups.slips.tresca_bound + torn.groups.slips.coefficient * np.maximum(normal, 0.0)


def residuals(state: AnyState) -> dict[str, float]:
    """Recompute equilibrium, cone violation, gluing and natural residual of the multiplier.

    With r = F λ − d − Gᵀα: ‖G λ − e‖ relative to the sum of the forces in it; the largest tension or excess
    of friction over its bound and ‖λ − P_Λ(λ − r/diag F)‖, both relative to ‖λ_N‖; and ‖r‖ on the gluing
    rows, which is a jump of displacements, relative to the largest displacement.
    """
    problem, multiplier = state.system.problem, state.solution.multiplier
    G, layout, bound = problem.coarse.matrix, problem.layout, slip_bound(state)
    r = state.system.apply(multiplier) - problem.rhs - G.T @ state.dual_solution.alpha
    forces = np.abs(G) @ np.abs(multiplier) + np.abs(problem.coarse.load)
    size = np.linalg.norm(multiplier[layout.normal]) or 1.0
    normal, tau = multiplier[layout.normal], multiplier[layout.tangential]
    flexibility = problem.diagonal
    mapped_normal = np.maximum(normal - r[layout.normal] / flexibility[layout.normal], 0.0)
    rho = 1.0 / flexibility[layout.tangential].mean(axis=1, keepdims=True)
    mapped_tau = tau - rho * r[layout.tangential]
    length = np.linalg.norm(mapped_tau, axis=1)
    mapped_tau[length > bound] *= (bound / np.where(length > 0, length, 1.0))[length > bound, None]
    excess = np.linalg.norm(tau, axis=1) - bound
    way = np.abs(state.torn_displacement).max() or 1.0
    return {
        "equilibrium": float(np.abs(G @ multiplier - problem.coarse.load).max() / (forces.max() or 1.0)),
        "cone": max(float(-normal.min(initial=0.0)), float(excess.max(initial=0.0))) / size,
        "natural": float(np.hypot(_norm(normal - mapped_normal), _norm(tau - mapped_tau)) / size),
        "gluing": float(np.abs(r[layout.equality]).max(initial=0.0) / way),
    }


def _norm(values: np.ndarray) -> float:
    return float(np.linalg.norm(values))


def assert_solved(state: AnyState, tolerance: float) -> None:
    """Require every residual to be small."""
    found = residuals(state)
    assert state.solution.residuals.within(tolerance)
    assert found["equilibrium"] <= tolerance
    assert found["cone"] <= tolerance
    assert found["natural"] <= 1.01 * tolerance
    assert found["gluing"] <= 10 * tolerance


def body_displacements(state: AnyState) -> np.ndarray:
    """Return the displacement of all bodies' nodes, (n_nodes, 3)."""
    return np.concatenate([state.gather_displacement(name) for name in state.scene.bodies])


def friction_law(state: AnyState, reference: ConicReference) -> dict[str, float]:
    """Measure every sentence of the contact and friction law, from displacements, geometry and forces alone.

    Rows of the contact geometry come from the reference, displacements from the nodes of the bodies, forces
    from the answer. Lengths are relative to the largest displacement, forces to the largest contact force.
    """
    rows, contact = reference.rows, state.contact
    assert np.array_equal(contact.points.slave, rows.slave)
    u = body_displacements(state).ravel()
    gap, slip = rows.gap - rows.N @ u, (rows.T @ u).reshape(-1, 3)
    normal = np.einsum("nd,nd->n", contact.force, rows.normal)
    friction = contact.force - normal[:, None] * rows.normal  # on the slave, against its slip
    bound = rows.bound + rows.coefficient * np.maximum(normal, 0.0)
    length, size = np.abs(u).max(), np.abs(normal).max()
    # Zero only where a point sticks, or its friction is as large as can be and points against the slip.
    unopposed = bound * np.linalg.norm(slip, axis=1) + (friction * slip).sum(axis=1)
    return {
        "penetration": max(0.0, float(-gap.min())) / length,
        "tension": max(0.0, float(-normal.min())) / size,
        "complementarity": float(np.abs(normal * gap).max()) / (size * length),
        "friction beyond its bound": max(0.0, float((np.linalg.norm(friction, axis=1) - bound).max())) / size,
        "slip not opposed": float(unopposed.max()) / (size * length),
    }


def balance(state: AnyState, reference: ConicReference, body: str) -> tuple[np.ndarray, np.ndarray]:
    """Return resultant and moment about the origin of load and contact forces on a body that is only a slave.

    Loads and coordinates come from the reference and the mesh. Both are relative to the sum of all forces.
    """
    start, mesh = reference.offset[body], state.scene.bodies[body].mesh
    nodes = slice(start, start + mesh.n_nodes)
    force = reference.f.reshape(-1, 3)[nodes].copy()
    own = (reference.rows.slave >= nodes.start) & (reference.rows.slave < nodes.stop)
    np.add.at(force, reference.rows.slave[own] - start, state.contact.force[own])
    total = np.abs(force).sum()
    return force.sum(axis=0) / total, np.cross(mesh.points, force).sum(axis=0) / total
