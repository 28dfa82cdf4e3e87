"""Derivative of an objective by the slip bounds of friction, and by what these depend on."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti import TornSystem
from fenics_contact.scene import Tresca, gradients_of
from fenics_contact.shape.linearised_face import LinearisedFace


def bound_sensitivity(
    torn: TornSystem, by_multiplier: np.ndarray, w: np.ndarray, linearised: LinearisedFace
) -> np.ndarray:
    """Return dJ by each slip bound at fixed geometry, d·(∂J/∂τ − B_T w), replicated. Collective."""
    force = by_multiplier - torn.jump(w)
    mine = np.einsum("na,na->n", linearised.slip_direction, force[torn.layout.tangential])
    result = np.zeros(len(torn.frictional))
    result[torn.owned_discs] = mine
    return np.asarray(torn.decomposition.comm.allreduce(result))


def bounds_by_area(torn: TornSystem, by_bound: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the slip bounds with respect to the areas of the points, (n_points,).

    Tresca's bound is a traction times a nodal area, which moves with the nodes.

    Args:
        by_bound: Derivative by each frictional point's slip bound, shape (n_friction,).
    """
    by_area = np.zeros(torn.points.count)
    area = torn.points.area[torn.frictional]
    by_area[torn.frictional] = by_bound * torn.tresca_bound / np.where(area > 0.0, area, 1.0)
    return by_area


def bounds_by_place(torn: TornSystem, normal_force: np.ndarray, by_bound: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the slip bounds with respect to the slave nodes, (n_points, dim).

    Friction given as a function of position changes with the place of the node: a bound μ(x) λ_N by λ_N ∇μ,
    Tresca's bound by the area times the gradient of the traction. Gradients are central differences.

    Args:
        normal_force: λ_N of the points, shape (n_points,), [force].
        by_bound: Derivative by each frictional point's slip bound, shape (n_friction,).
    """
    points = torn.points
    result, by_all = np.zeros((points.count, torn.dim)), np.zeros(points.count)
    by_all[torn.frictional] = by_bound
    places = torn.scene.points[points.slave]
    for index, pair in enumerate(torn.scene.contacts):
        if pair.friction_varies:
            mine = np.flatnonzero(points.pair == index)
            size = points.area if isinstance(pair.friction, Tresca) else normal_force
            slope = gradients_of(f"friction of {pair.place}", pair.friction_value, places[mine], ())
            result[mine] = (size * by_all)[mine, None] * slope
    return result
