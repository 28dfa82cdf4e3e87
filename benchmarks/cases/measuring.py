"""What every case tells of a state."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact import State, Status


def state_record(state: State) -> dict[str, Any]:
    """Return what can be counted and compared of a state, the same on every rank."""
    return {
        "counts": {
            **state.counts,
            **{status.name.lower(): state.contact.count(status) for status in Status},
        },
        "total_potential": state.energies.total_potential,
        "natural_residual": state.solution.natural_residual,
        "gluing_residual": state.solution.gluing_residual,
        "normal_force": state.contact.normal_force.sum(),
        "contact_force": state.contact.force.sum(axis=0),
    }


def nodal_forces(state: State) -> np.ndarray:
    """Return the force on every contact node in the order of the nodes, whatever the partition, (n, 3)."""
    return np.asarray(state.contact.force[np.argsort(state.contact.points.slave)])
