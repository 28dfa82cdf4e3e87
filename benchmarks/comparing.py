"""How far two runs differ that should find the same state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Record = Mapping[str, Any]

#: Largest difference of two states that were both solved to 1e-6.
AGREEMENT = 5e-6


def potential_difference(one: Record, other: Record) -> float:
    """Return the difference of the total potentials relative to the first."""
    return abs(other["total_potential"] / one["total_potential"] - 1.0)


def force_difference(one: Record, other: Record) -> float:
    """Return the difference of the forces on all contact nodes relative to the first, in the Euclidean norm.

    Raises:
        ValueError: If the runs have different contact nodes.
    """
    if len(one["forces"]) != len(other["forces"]):
        raise ValueError(
            f"runs to compare must have the same contact nodes, got {len(one['forces'])} and "
            f"{len(other['forces'])}: use the same mesh"
        )
    forces = np.asarray(one["forces"])
    return float(np.linalg.norm(forces - other["forces"]) / np.linalg.norm(forces))


def require_agreement(name: str, one: Record, other: Record) -> tuple[float, float]:
    """Return both differences of two solvers' answers to one discrete problem.

    Raises:
        ValueError: If they are larger than `AGREEMENT`: then seconds must not be compared.
    """
    differences = potential_difference(one, other), force_difference(one, other)
    if max(differences) > AGREEMENT:
        raise ValueError(
            f"both solvers of {name} must find the same state to {AGREEMENT:.0e}, got differences of "
            f"{differences[0]:.1e} (potential) and {differences[1]:.1e} (forces): the problems differ"
        )
    return differences
