"""Heat that arises where surfaces slide on each other, and how both share it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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

    μ p v is that of a prescribed sliding, as of a brake whose disc turns while its mesh stays; w that of the
    friction forces and slips of mechanics in a load step that takes some time, see `solve_heated`. What
    enters an obstacle is lost to bodies.

    Attributes:
        coefficient: μ ≥ 0 of the prescribed sliding: a number, a function of the slave's points, or a
            `TemperatureTable` by the mean temperature of both surfaces.
        speed: v ≥ 0, a number or a function of the slave's points, [length / time].
        part: η in [0, 1], the part of the work that becomes heat.
        share: Part of the heat that enters the slave, in [0, 1], see `effusivity_share`. The conductance of
            the contact passes on what heats one side more than the other.

    Raises:
        InvalidInputError: If something is negative, or parts are more than the whole.

    Example:
        >>> iron, pad = Conductor(0.05, 3.7e-3), Conductor(1e-3, 2.0e-3)  # W/(mm K), J/(mm³ K)
        >>> brake = FrictionHeat(0.4, 9000.0, share=effusivity_share(pad, iron))  # mm/s
        >>> round(brake.share, 3)
        0.094
    """

    coefficient: Value | TemperatureTable = 0.0
    speed: Value = 0.0
    part: float = 1.0
    share: float = 0.5

    def __post_init__(self) -> None:
        """Reject what would cool, or make more heat than there is work."""
        given: Any
        for name in ("coefficient", "speed"):
            given = getattr(self, name)
            if isinstance(given, int | float):
                remedy = "give how fast surfaces slide, and the friction as a positive number"
                check_not_negative(f"FrictionHeat.{name}", given, remedy)
        for name in ("part", "share"):
            given = getattr(self, name)
            if not 0.0 <= given <= 1.0:
                raise InvalidInputError(
                    f"FrictionHeat.{name} must lie between 0 and 1, got {given!r}: it is a part of the whole"
                )

    @property
    def by_temperature(self) -> bool:
        """Whether it depends on temperatures."""
        return isinstance(self.coefficient, TemperatureTable) and self.part > 0.0

    @property
    def slides(self) -> bool:
        """Whether a sliding is prescribed that heats."""
        return self.part > 0.0 and not any(given == 0.0 for given in (self.coefficient, self.speed))

    def at(self, points: np.ndarray, touch: Touch, work: np.ndarray) -> np.ndarray:
        """Return q at points, shape (n,), [power / length²].

        `points`: of the slave, (n, dim); `work`: w, (n,).
        """
        given = self.coefficient
        if isinstance(given, TemperatureTable):
            mean = 0.5 * (touch.slave + touch.master)
            friction = given.at(mean)
        else:
            friction = not_negative("FrictionHeat.coefficient", given, points)
        speed = not_negative("FrictionHeat.speed", self.speed, points)
        return np.asarray(self.part * (friction * touch.pressure * speed + work))


#: No heat, whatever slides.
NO_FRICTION_HEAT = FrictionHeat(part=0.0)


def effusivity_share(slave: Conductor, master: Conductor, temperature: float = 20.0) -> float:
    """Return the slave's share of the heat between large bodies, e_s / (e_s + e_m) with e = √(k ρ c).

    Args:
        slave: With a heat capacity, as the master.
        master: What the slave slides on.
        temperature: At which properties that vary are taken, in degrees.

    Raises:
        InvalidInputError: If one of them has no heat capacity.

    Example:
        >>> effusivity_share(Conductor(4.0, 1.0), Conductor(1.0, 1.0))
        0.6666666666666666

    References:
        H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids, 2nd ed., Oxford 1959, section 2.15.
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
