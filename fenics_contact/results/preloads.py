"""What the sections of preloads transmit, and how far they are drawn together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._base.display import Table, displayed, tabled
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.feti.preloads import SectionRows
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.by_name import ByName, names_of
from fenics_contact.results.forces import NodalForces, Resultant, resultant


@displayed
@dataclass(frozen=True, eq=False)
class SectionForces:
    """What a section transmits, and its shortening.

    Attributes:
        shortening: q, positive where the bolt has got shorter, [length].
        normal: Unit normal n of the section, shape (dim,).
        resultant: Force and moment on the part behind the section, where n points to, about the centroid of
            the section's nodes.
    """

    shortening: float
    normal: np.ndarray
    resultant: Resultant

    @property
    def force(self) -> float:
        """Force along the normal, positive in tension, [force] (in the plane: per unit of thickness)."""
        return -float(self.resultant.force @ self.normal)

    @property
    def shear(self) -> float:
        """Size of the force across the normal, [force]."""
        return float(np.linalg.norm(self.resultant.force + self.force * self.normal))

    @property
    def bending(self) -> float:
        """Size of the moment but for that about the normal, in the plane all of it, [force·length]."""
        moment = np.atleast_1d(self.resultant.moment)
        if len(moment) == 3:
            moment = moment - (moment @ self.normal) * self.normal
        return float(np.linalg.norm(moment))

    @property
    def torsion(self) -> float:
        """Moment about the normal on the part behind, in the plane zero, [force·length]."""
        moment = np.atleast_1d(self.resultant.moment)
        return float(moment @ self.normal) if len(moment) == 3 else 0.0


@tabled
@dataclass(frozen=True, eq=False)
class Preloads(ByName[SectionForces]):
    """What the sections of all preloads transmit, by the names of these, in the scene's order.

    Preloads of the same name, as several through one body, are numbered: "plate 1", "plate 2".
    """

    kind: ClassVar[str] = "preloads"
    entries: Mapping[str, SectionForces]

    @classmethod
    def of(
        cls, torn: TornSystem, forces: NodalForces, multiplier: np.ndarray, displacement: np.ndarray
    ) -> Preloads:
        """Return what the sections of a state transmit. Collective."""
        scene, lengths, found = torn.scene, shortenings(torn, displacement), {}
        for rows in torn.groups.of(SectionRows):
            named = zip(names_of(scene.preloads), scene.preloads, lengths, strict=True)
            for number, (name, preload, length) in enumerate(named):
                mine = rows.points.pair == number
                places, acting = forces.places[rows.points.slave[mine]], forces.joints[rows][mine]
                total = resultant(acting, places, places.mean(axis=0), scene.kinematics)
                normal = preload.normal(scene.bodies[preload.body].mesh)
                found[name] = SectionForces(float(length), normal, total)
        return cls(found)

    def record(self) -> list[dict[str, Any]]:
        """Return forces, moments and shortenings of sections."""
        return [
            {
                "name": name,
                "axial_force": each.force,
                "shortening": each.shortening,
                "shear": each.shear,
                "bending": each.bending,
                "torsion": each.torsion,
                "normal": each.normal,
                "force": each.resultant.force,
                "moment": each.resultant.moment,
                "about": each.resultant.about,
            }
            for name, each in self.items()
        ]

    def columns(self, scale: float) -> dict[str, float]:
        """Return nothing: rows of load steps have the forces."""
        return {}

    def facts(self, force: str, length: str) -> dict[str, str]:
        """Return forces and shortenings."""
        words = "{0.force:.6g} {1}, shorter by {0.shortening:.6g} {2}"
        return {f"preload {name}": words.format(each, force, length) for name, each in self.items()}

    def _tables(self) -> list[Table]:
        """Return a table with one line for each preload."""
        if not self.entries:
            return []
        head = ("", "force", "shortening", "shear", "bending", "torsion")
        size = max(abs(each.force) for each in self.values())
        rows: list[tuple[str, ...]] = [head]
        for name, each in self.items():
            numbers = each.force, each.shortening, each.shear, each.bending, each.torsion
            shown = [0.0 if k != 1 and abs(x) <= ROUNDING * size else x for k, x in enumerate(numbers)]
            rows.append((name, *(f"{x:.5g}" for x in shown)))
        return [Table(rows, 1, ("in [force], [length], [force·length]",))]


def shortenings(torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
    """Return the shortening of each preload of a torn displacement, (n_preloads,), replicated. Collective."""
    for rows in torn.groups.of(SectionRows):
        return rows.lengths(torn.gathered(torn.jump(displacement), rows))
    return np.zeros(0)
