"""Contact with Coulomb friction on a plane z = const as one equation a node, and its derivative."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ContactEquations:
    """C(p, u) = 0 and one element of its generalised derivative, node by node.

    Attributes:
        value: C, shape (n, 3).
        by_force: ∂C/∂p, shape (n, 3, 3).
        by_displacement: ∂C/∂u, shape (n, 3, 3).
        closed: Nodes with contact, shape (n,).
        stick: Closed nodes that do not slide, shape (n,).
    """

    value: np.ndarray
    by_force: np.ndarray
    by_displacement: np.ndarray
    closed: np.ndarray
    stick: np.ndarray


def contact_equations(
    force: np.ndarray,
    displacement: np.ndarray,
    gap: np.ndarray,
    friction_coefficient: float,
    stiffness: np.ndarray,
) -> ContactEquations:
    """Evaluate the augmented complementarity functions

        p_N − max(0, p_N − c (g + u_N)) = 0,
        p_T − P(p_T − c u_T) = 0,  P on the disc of radius μ max(0, p_N − c (g + u_N)).

    They hold exactly where contact and friction do, whatever c > 0.

    Args:
        force: p, what the plane exerts on the nodes, shape (n, 3), normal component last.
        displacement: u, shape (n, 3).
        gap: g, shape (n,).
        friction_coefficient: μ.
        stiffness: c, shape (n,).

    References:
        P. Alart, A. Curnier, A mixed formulation for frictional contact problems prone to Newton like
        solution methods, Comput. Methods Appl. Mech. Engrg. 92 (1991).
    """
    c = stiffness
    normal = force[:, 2] - c * (gap + displacement[:, 2])
    trial = force[:, :2] - c[:, None] * displacement[:, :2]
    closed = normal > 0.0
    radius = friction_coefficient * np.where(closed, normal, 0.0)
    length = np.linalg.norm(trial, axis=1)
    stick = closed & (length < radius)
    slip = closed & ~stick

    value = force.copy()
    value[closed, 2] = (c * (gap + displacement[:, 2]))[closed]
    value[stick, :2] = (c[:, None] * displacement[:, :2])[stick]
    by_force = np.tile(np.eye(3), (len(force), 1, 1))
    by_displacement = np.zeros_like(by_force)
    by_force[closed, 2, 2] = 0.0
    by_displacement[closed, 2, 2] = c[closed]
    by_force[stick, :2, :2] = 0.0
    by_displacement[stick, :2, :2] = c[stick, None, None] * np.eye(2)

    direction = trial[slip] / length[slip, None]
    shrink = radius[slip] / length[slip]
    turning = shrink[:, None, None] * (np.eye(2) - direction[:, :, None] * direction[:, None, :])
    growing = friction_coefficient * direction
    value[slip, :2] -= radius[slip, None] * direction
    by_force[slip, :2, :2] -= turning
    by_force[slip, :2, 2] = -growing
    by_displacement[slip, :2, :2] = c[slip, None, None] * turning
    by_displacement[slip, :2, 2] = c[slip, None] * growing
    return ContactEquations(value, by_force, by_displacement, closed, stick)
