"""Heat that arises where surfaces slide on each other, and how both share it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_not_negative
from fenics_contact._scene.fields import not_negative
from fenics_contact.errors import InvalidInputError
from fenics_contact.heat.conductance import Touch
from fenics_contact.heat.parts import Value
from fenics_contact.heat.properties import Conductor, TemperatureTable


@dataclass(frozen=True)
@checked("coefficient", "speed")
class FrictionHeat:
    """Heat where surfaces slide, q = η (μ p v + w) per area: a share to the slave, the rest to the master.

    μ p v is that of a prescribed sliding, as of a brake whose mesh stays, w that of friction forces and slips
    of mechanics in some time, see `solve_heated`. What enters an obstacle is lost to bodies.

    Attributes:
        coefficient: μ ≥ 0 of the prescribed sliding: a number, a function of the slave's points, or a
            `TemperatureTable` by the mean temperature of both surfaces.
        speed: v ≥ 0, a number or a function of the slave's points, [length / time].
        part: η in [0, 1], the part of the work that becomes heat.
        share: Part of the heat that enters the slave, in [0, 1], see `effusivity_share`.

    Example:
        >>> iron, pad = Conductor(0.05, 3.7e-3), Conductor(1e-3, 2.0e-3)  # W/(mm K), J/(mm³ K)
        >>> brake = FrictionHeat(0.4, 9000.0, share=effusivity_share(pad, iron))  # mm/s
    """

    coefficient: Value | TemperatureTable = 0.0
    speed: Value = 0.0
    part: float = 1.0
    share: float = 0.5

    def __post_init__(self) -> None:
        """Reject what would cool, or make more heat than there is work."""
        for name, given in (("coefficient", self.coefficient), ("speed", self.speed)):
            if isinstance(given, int | float):
                check_not_negative(f"FrictionHeat.{name}", given, "give its size as a positive number")
        for name, given in (("part", self.part), ("share", self.share)):
            if not 0.0 <= given <= 1.0:
                raise InvalidInputError(
                    f"FrictionHeat.{name} must lie between 0 and 1, got {given!r}: it is a part of the whole"
                )

    @property
    def by_temperature(self) -> bool:
        """Whether it depends on temperatures."""
        return isinstance(self.coefficient, TemperatureTable) and self.part > 0.0

    def at(self, points: np.ndarray, touch: Touch, work: np.ndarray) -> np.ndarray:
        """Return q at points, shape (n,), [power / length²].

        `points`: of the slave, (n, dim); `work`: w, (n,).
        """
        given, name = self.coefficient, "FrictionHeat.coefficient"
        if isinstance(given, TemperatureTable):
            friction = given.at(0.5 * (touch.slave + touch.master))
        else:
            friction = not_negative(name, given, points)
        speed = not_negative("FrictionHeat.speed", self.speed, points)
        return np.asarray(self.part * (friction * touch.pressure * speed + work))

    def split(self, heat: np.ndarray) -> np.ndarray:
        """Return what of heat, (n,), enters the slave, and what the master, (2, n)."""
        return np.outer((self.share, 1.0 - self.share), heat)


#: No heat, whatever slides.
NO_FRICTION_HEAT = FrictionHeat(part=0.0)


def effusivity_share(slave: Conductor, master: Conductor, temperature: float = 20.0) -> float:
    """Return the slave's share of the heat between large bodies, e_s / (e_s + e_m) with e = √(k ρ c).

    Properties that vary are those at the given temperature. Raises `InvalidInputError` without capacities.
    See H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids, 2nd ed., Oxford 1959.

    Example:
        >>> round(effusivity_share(Conductor(4.0, 1.0), Conductor(1.0, 1.0)), 3)
        0.667
    """
    found = []
    for each in (slave, master):
        if not each.capacities:
            raise InvalidInputError(
                f"shares by effusivities need the heat capacities of both, got none for {each!r}: give "
                "heat_capacity=..., or the share as a number"
            )
        capacity = each.capacities[0].at(np.array(temperature))
        found.append(np.sqrt(each.typical(temperature) * capacity))
    return float(found[0] / (found[0] + found[1]))
