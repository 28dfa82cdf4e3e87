"""Derivative of an objective by the areas over which forces make pressures."""

from __future__ import annotations

import numpy as np

from fenics_contact.contact import DeformedState, State
from fenics_contact.feti import nodal_mean_transposed
from fenics_contact.shape.contact_derivative import add_areas


def by_true_areas(state: State, by_area: np.ndarray) -> dict[str, np.ndarray]:
    """Return partial derivatives of an objective, by their names in `Partials`. Collective.

    Areas of the undeformed slave change with the shape alone. Those of a deformed one change with the places
    x = X + u of its nodes, by mortar also with the master's: with the displacement and the shape alike.

    Args:
        by_area: Derivative by `ContactResult.area`, replicated, shape (n_points,).
    """
    moved = state.equilibrium.evaluation.contact if isinstance(state, DeformedState) else None
    points = None if moved is None else moved.points
    if moved is None or points is None:
        return {"by_area": by_area}
    torn = state.torn
    by_now, by_before, by_met = points.areas(torn.scene).pulled_back(by_area)
    by_places = points.met_areas_pulled_back(by_met)
    for index in range(len(torn.scene.contacts)):
        add_areas(by_places, torn, index, by_now, points.coordinates)
    free = np.where(np.isnan(moved.prescribed), by_places, 0.0)
    every, first = np.arange(len(free)), torn.decomposition.comm.rank == 0
    return {
        "by_displacement": nodal_mean_transposed(torn.decomposition, every, free),
        "by_shape": by_places if first else np.zeros_like(by_places),
        "by_area": by_before,
    }
