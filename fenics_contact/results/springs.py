"""Forces and elongations of the springs between surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.sparse import ROUNDING, rounded
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

    @classmethod
    def of(
        cls, torn: TornSystem, forces: NodalForces, multiplier: np.ndarray, displacement: np.ndarray
    ) -> SpringForces:
        """Return what the springs of a state exert. Collective."""
        springs, found = torn.scene.springs, {}
        for rows in torn.groups.of(SpringRows):
            on_second, elongation = forces.joints[rows], rows.elongation(torn.gathered(multiplier, rows))
            named = zip(names_of(springs), springs, strict=True)
            for number, name in enumerate(name for name, each in named if type(each) is rows.part):
                mine = rows.which == number
                found[name] = SpringForce(-on_second[number], elongation[mine], rows.directions[mine])
        return cls(found)

    def record(self) -> list[dict[str, Any]]:
        """Return forces and elongations."""
        kinds = ("force", "directions", "tension", "elongation")
        return [
            {"name": name, **{kind: getattr(each, kind) for kind in kinds}} for name, each in self.items()
        ]

    def columns(self, scale: float) -> dict[str, float]:
        """Return tensions and elongations, with the axes of springs that act along several."""
        columns: dict[str, float] = {}
        for name, each in self.items():
            lines = each.directions.tolist()
            axes = [""] if len(lines) == 1 else [f" {'xyz'[line.index(1.0)]}" for line in lines]
            tensions = rounded(each.tension, scale)
            for axis, tension, longer in zip(axes, tensions, each.elongation, strict=True):
                columns[f"spring {name} tension{axis}"] = float(tension)
                columns[f"spring {name} elongation{axis}"] = float(longer)
        return columns

    def facts(self, force: str, length: str) -> dict[str, str]:
        """Return sizes of forces, and by how much ends move."""
        facts = {}
        for name, each in self.items():
            size, longer = np.linalg.norm(each.force), np.linalg.norm(each.elongation)
            facts[f"spring {name}"] = f"{size:.6g} {force}, ends moved by {longer:.6g} {length}"
        return facts

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
