"""Forces and elongations of the springs between surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.feti.springs import SpringRows
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.by_name import ByName, names_of
from fenics_contact.results.forces import NodalForces


@displayed
@dataclass(frozen=True, eq=False)
class SpringForce:
    """A spring in a state.

    Attributes:
        force: On the first end, shape (dim,), [force]; on the second end it is the opposite.
        elongation: ū₂ − ū₁ of the mean displacements along each direction in which the spring acts, shape
            (n,), [length]: one along its line, positive in extension, or one for each axis with a stiffness.
        directions: These directions, unit vectors, shape (n, dim).
    """

    force: np.ndarray
    elongation: np.ndarray
    directions: np.ndarray

    @property
    def tension(self) -> np.ndarray:
        """Force along each direction, positive in tension, shape (n,), [force]."""
        return np.asarray(self.directions @ self.force)


@tabled
@dataclass(frozen=True, eq=False)
class SpringForces(ByName[SpringForce]):
    """All springs of a scene by their names, in its order; those of the same name are numbered."""

    kind: ClassVar[str] = "springs"
    entries: Mapping[str, SpringForce]

    def _tables(self) -> list[Table]:
        """Return a table with one line for each direction of each spring."""
        if not self.entries:
            return []
        size = max(float(np.abs(each.force).max()) for each in self.values())
        rows: list[tuple[str, ...]] = [("", "along", "tension", "elongation")]
        for name, each in self.items():
            for way, tension, longer in zip(each.directions, each.tension, each.elongation, strict=True):
                along = f"({', '.join(f'{x:.3g}' for x in way)})"
                rows.append(
                    (name, along, f"{tension if abs(tension) > ROUNDING * size else 0:.5g}", f"{longer:.5g}")
                )
        return [Table(rows, 2, ("in [force], [length]",))]


def spring_forces(torn: TornSystem, forces: NodalForces, multiplier: np.ndarray) -> SpringForces:
    """Return what the springs exert. Collective.

    `multiplier`: λ, owned.
    """
    found = {}
    for rows in torn.groups.of(SpringRows):
        elongation = rows.elongation(torn.gathered(multiplier, rows))
        for number, name in enumerate(names_of(torn.scene.springs)):
            mine, on_first = rows.which == number, -forces.joints[rows][number]
            found[name] = SpringForce(on_first, elongation[mine], rows.directions[mine])
    return SpringForces(found)
