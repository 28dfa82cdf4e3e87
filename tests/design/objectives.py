"""Objectives that judge a design by everything that a state holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from fenics_contact.design import ContactForces, Objective, TotalPotential, VolumeIntegral
from fenics_contact.results import ContactResult


def _squares(forces: np.ndarray) -> tuple[float, np.ndarray]:
    return float((forces**2).sum()), 2 * forces


def normal_forces(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    value, by_normal = _squares(contact.normal_force)
    return value, by_normal, np.zeros_like(contact.friction_force)


def friction_forces(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    value, by_friction = _squares(contact.friction_force)
    return value, np.zeros(len(by_friction)), by_friction


def misfit(u: Any, x: Any, stress: Any) -> Any:
    """Displacement along x beside a given field."""
    return (u[0] - 0.01 * ufl.sin(x[1] + x[x.ufl_shape[0] - 1])) ** 2


def squared_stress(u: Any, x: Any, stress: Any) -> Any:
    return ufl.inner(stress, stress) * (1 + 0.01 * x[0])


def objectives(body: str) -> dict[str, Objective]:
    """Functions of everything: energy, stress, displacement, normal and friction forces."""
    return {
        "energy": TotalPotential(),
        "stress": VolumeIntegral("squared stress", squared_stress, body),
        "displacement": VolumeIntegral("misfit", misfit, body),
        "normal forces": ContactForces(normal_forces),
        "friction forces": ContactForces(friction_forces),
    }
