"""How far two runs differ that should find the same state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
    size = _norm(one["forces"])
    return _norm([_minus(a, b) for a, b in zip(one["forces"], other["forces"], strict=True)]) / size


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


def _minus(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _norm(vectors: Sequence[Sequence[float]]) -> float:
    return math.sqrt(sum(x * x for vector in vectors for x in vector))
