"""Newton's method on one mesh as a whole: reference solutions of bodies with nonlinear materials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from fenics_contact._fem.mechanics import MaterialStep, Response
from tests.models.deformed import Patch


@dataclass(frozen=True)
class Equilibrium:
    """Displacement by dof, what the body answers to it, and the residual of each Newton step."""

    displacement: np.ndarray
    response: Response
    residuals: list[float]


def dofs_at(patch: Patch, nodes: np.ndarray, component: int) -> np.ndarray:
    """Dofs of one component at nodes of the body."""
    return patch.mesh.dim * np.flatnonzero(np.isin(patch.mesh.nodes, nodes)) + component


def equilibrium(
    patch: Patch,
    prescribed: dict[int, float],
    load: np.ndarray | float = 0.0,
    start: Equilibrium | None = None,
    tolerance: float = 1e-10,
) -> Equilibrium:
    """Find the displacement after a step from ``start``.

    Args:
        patch: The body.
        prescribed: Dof to displacement.
        load: External force by dof.
        start: The last step, None for the unloaded body.
        tolerance: Of the residual, relative to the internal forces.
    """
    free = np.setdiff1d(np.arange(patch.mesh.size), list(prescribed))
    u = np.zeros(patch.mesh.size) if start is None else start.displacement.copy()
    history = None if start is None else start.response.history
    change = np.zeros_like(u)
    for dof, value in prescribed.items():
        change[dof] = value - u[dof]
    residuals: list[float] = []
    for _ in range(25):
        found = patch.mechanics.at(u, MaterialStep(history))
        rest = load - found.force - found.stiffness @ change
        size = max(np.abs(found.force).max(), np.abs(load).max(), np.abs(rest).max())
        residuals.append(float(np.abs(rest[free]).max(initial=0.0) / size))
        if residuals[-1] < tolerance and not change.any():
            return Equilibrium(u, found, residuals)
        inner = found.stiffness[free][:, free].tocsc()
        change[free] = spla.spsolve(inner, rest[free])
        u, change = u + change, np.zeros_like(u)
    raise AssertionError(f"no equilibrium: {residuals}")
