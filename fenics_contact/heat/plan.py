"""What will be built for a scene of heat: its effects, unknowns, rows and memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._base.display import counted, displayed
from fenics_contact._scene.discretisation import in_words
from fenics_contact._scene.memory import Subdomains, expected_memory
from fenics_contact._scene.pair_geometry import pair_geometry
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.tools import check_partitions
from fenics_contact.mesh.cuts import pieces


@displayed
@dataclass(frozen=True)
class HeatPlan:
    """What the temperatures of a scene need; nothing else is built.

    Attributes:
        effects: The physical effects by name, and how many parts of the scene have each.
        subdomains: Number of subdomains, each with one constant in the coarse problem.
        kinds: Those of different shape, conductivity or interface, see `fenics_contact.Plan`.
        unknowns: Temperatures of all subdomains.
        multipliers: Rows by kind; those of ties and contacts are upper bounds.
        memory: Expected memory of all ranks together without their libraries, [bytes].
        contacts: Between which surfaces heat passes; ties: where each is enforced, and why.
    """

    effects: Mapping[str, int]
    subdomains: int
    kinds: int
    unknowns: int
    multipliers: Mapping[str, int]
    memory: float
    contacts: tuple[str, ...]
    ties: tuple[str, ...]

    def __str__(self) -> str:
        """Return one line for each decision."""
        return "\n".join(f"{name:15s} {value}" for name, value in self._facts().items())

    def _facts(self) -> dict[str, str]:
        alike = f" of {counted(self.kinds, 'kind')}" if self.kinds < self.subdomains else ""
        return {
            "heat": "; ".join(f"{name} ({count})" for name, count in self.effects.items()),
            "temperatures": f"{self.unknowns} in {counted(self.subdomains, 'subdomain')}{alike}",
            "rows of heat": ", ".join(f"{n} {kind}" for kind, n in self.multipliers.items() if n) or "none",
            "memory of heat": f"{self.memory / 1e6:.0f} MB",
            **{f"joint {number}": joint for number, joint in enumerate(self.contacts)},
            **{f"heat tie {number}": tie for number, tie in enumerate(self.ties)},
        }


def make_plan(
    field: Scene,
    geometry: Scene,
    effects: Mapping[str, int],
    places: Sequence[str],
    partitions: Mapping[str, np.ndarray],
    ranks: int,
) -> HeatPlan:
    """Decide what a scene needs: its field, its surfaces, and in words what acts and where its contacts are.

    `ranks`: among which the subdomains are dealt out.
    """
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
    joints = tuple(f"{place}; {pair_geometry(geometry, pair)}" for place, pair in pairs)
    ties = tuple(f"{tie.place}; {in_words(tie)}" for tie in geometry.ties)
    sizes = len(parts.size), parts.kinds(ranks), unknowns
    return HeatPlan(effects, *sizes, rows, expected_memory(field, parts, ranks), joints, ties)
