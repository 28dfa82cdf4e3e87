"""What will be built for a scene of heat: unknowns, rows and memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._scene.discretisation import in_words
from fenics_contact._scene.memory import Rates, Subdomains, expected_memory
from fenics_contact._scene.pair_geometry import pair_geometry
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.tools import check_partitions
from fenics_contact.mesh.cuts import pieces


@dataclass(frozen=True)
class HeatPlan:
    """What the temperatures of a scene need; nothing else is built.

    Attributes:
        effects: How many parts of the scene have each physical effect.
        subdomains: Number of subdomains, each with one constant in the coarse problem.
        unknowns: Their temperatures.
        multipliers: Rows by kind; those of ties and contacts are upper bounds.
        memory: Expected memory of all ranks together without their libraries, [bytes].
        joints: Between which surfaces heat passes, and where, in words.
    """

    effects: Mapping[str, int]
    subdomains: int
    unknowns: int
    multipliers: Mapping[str, int]
    memory: float
    joints: tuple[str, ...]

    def __str__(self) -> str:
        """Return one line for each decision."""
        rows = {
            "heat": "; ".join(f"{name} ({count})" for name, count in self.effects.items()),
            "temperatures": f"{self.unknowns} in {counted(self.subdomains, 'subdomain')}",
            "rows of heat": ", ".join(f"{n} {kind}" for kind, n in self.multipliers.items() if n) or "none",
            "memory of heat": f"{self.memory / 1e6:.0f} MB",
            **{f"joint {number}": words for number, words in enumerate(self.joints)},
        }
        return "\n".join(f"{name:15s} {words}" for name, words in rows.items())


def make_plan(
    field: Scene, geometry: Scene, effects: Mapping[str, int], places: Sequence[str],
    partitions: Mapping[str, np.ndarray], ranks: int,
) -> HeatPlan:  # fmt: skip
    """Return the plan of a field and its surfaces; `effects`, `places`: what acts, and contacts in words."""
    check_partitions(field.bodies, partitions)
    parts = Subdomains.of(field, {n: pieces(b.mesh, partitions[n]) for n, b in field.bodies.items()})
    unknowns = int(parts.size.sum())

    def slaves(pairs: Sequence[Any]) -> int:
        return sum(len(np.unique(geometry.facets(each.slave))) for each in pairs)

    rows = {
        "gluing": unknowns - sum(body.mesh.n_nodes for body in field.bodies.values()),
        "held": sum(int(np.count_nonzero(field.fixed(name))) for name in field.bodies),
        "tied": slaves(geometry.ties),
        "passing heat": slaves(geometry.contacts),
    }
    pairs = zip(places, geometry.contacts, strict=True)
    joints = [f"{place}; {pair_geometry(geometry, pair)}" for place, pair in pairs]
    joints += [f"{tie.place}; {in_words(tie)}" for tie in geometry.ties]
    memory = memory_of_heat(field, parts, ranks)
    return HeatPlan(effects, len(parts.size), unknowns, rows, memory, tuple(joints))


def memory_of_heat(field: Scene, parts: Subdomains, ranks: int) -> float:
    """Return the memory of all ranks together, [bytes].

    Each subdomain keeps matrices of its own, of conduction and of all that it exchanges: three as measured.
    """
    return expected_memory(field, parts, ranks) + 3.0 * Rates().entry * float(parts.couplings @ parts.size)
