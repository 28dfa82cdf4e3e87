"""Forces of linear constraints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.sparse import rounded
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact.feti.constraints import ConstraintRows
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.by_name import ByName, names_of
from fenics_contact.results.forces import NodalForces


@displayed
@dataclass(frozen=True, eq=False)
class ConstraintForce:
    """A linear constraint in a state.

    Attributes:
        force: What each equation exerts where its factor is one, shape (n,), [force]: on a node of a term
            this times c d. Equations that follow from others or from supports have none.
        on_bodies: Body -> sum of the forces on its nodes, shape (dim,), [force].
    """

    force: np.ndarray
    on_bodies: Mapping[str, np.ndarray]


@tabled
@dataclass(frozen=True, eq=False)
class ConstraintForces(ByName[ConstraintForce]):
    """All linear constraints of a scene by their names, in its order; those of the same name are numbered."""

    kind: ClassVar[str] = "constraints"
    entries: Mapping[str, ConstraintForce]

    @classmethod
    def of(
        cls, torn: TornSystem, forces: NodalForces, multiplier: np.ndarray, displacement: np.ndarray
    ) -> ConstraintForces:
        """Return what the linear constraints of a state exert."""
        scene, numbers, found = torn.scene, NodeNumbers.of(torn.scene), {}
        for rows in torn.groups.of(ConstraintRows):
            for number, name in enumerate(names_of(scene.constraints)):
                own, on_nodes = rows.of_one(forces.joints[rows], number)
                totals = {}
                for body in dict.fromkeys(term.body for term in scene.constraints[number].terms):
                    first = numbers.first_of(body)
                    totals[body] = on_nodes[first : first + scene.bodies[body].mesh.n_nodes].sum(axis=0)
                found[name] = ConstraintForce(own, totals)
        return cls(found)

    def record(self) -> list[dict[str, Any]]:
        """Return the forces on bodies."""
        return [
            {
                "name": name,
                "equations": len(each.force),
                "largest": float(np.abs(each.force).max()),
                "bodies": [{"body": body, "force": total} for body, total in each.on_bodies.items()],
            }
            for name, each in self.items()
        ]

    def columns(self, scale: float) -> dict[str, float]:
        """Return the components of forces on bodies."""
        columns: dict[str, float] = {}
        for name, each in self.items():
            for body, total in each.on_bodies.items():
                for axis, x in zip("xyz", rounded(total, scale), strict=False):
                    columns[f"constraint {name} {body} F{axis}"] = float(x)
        return columns

    def facts(self, force: str, length: str) -> dict[str, str]:
        """Return sizes of forces on bodies."""
        return {
            f"constraint {name}": ", ".join(
                f"{np.linalg.norm(total):.6g} {force} on {body}" for body, total in each.on_bodies.items()
            )
            for name, each in self.items()
        }

    def _tables(self) -> list[Table]:
        """Return a table with one line for each body of each constraint."""
        if not self.entries:
            return []
        rows: list[tuple[str, ...]] = [("", "equations", "body", "force")]
        for name, each in self.items():
            for body, total in each.on_bodies.items():
                rows.append((name, str(len(each.force)), body, f"({', '.join(f'{x:.5g}' for x in total)})"))
        return [Table(rows, 3, ("in [force]",))]
