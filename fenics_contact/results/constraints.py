"""Forces of linear constraints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact._base.display import Table, displayed, tabled
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

    def _tables(self) -> list[Table]:
        """Return a table with one line for each body of each constraint."""
        if not self.entries:
            return []
        rows: list[tuple[str, ...]] = [("", "equations", "body", "force")]
        for name, each in self.items():
            for body, total in each.on_bodies.items():
                rows.append((name, str(len(each.force)), body, f"({', '.join(f'{x:.5g}' for x in total)})"))
        return [Table(rows, 3, ("in [force]",))]


def constraint_forces(torn: TornSystem, forces: NodalForces) -> ConstraintForces:
    """Return what the linear constraints exert."""
    scene, numbers, found = torn.scene, NodeNumbers.of(torn.scene), {}
    for rows in torn.groups.of(ConstraintRows):
        for number, name in enumerate(names_of(scene.constraints)):
            own, on_nodes = rows.of_one(forces.joints[rows], number)
            totals = {}
            for body in dict.fromkeys(term.body for term in scene.constraints[number].terms):
                first = numbers.first_of(body)
                totals[body] = on_nodes[first : first + scene.bodies[body].mesh.n_nodes].sum(axis=0)
            found[name] = ConstraintForce(own, totals)
    return ConstraintForces(found)
