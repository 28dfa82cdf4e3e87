"""Names of the units of a scene; the numbers themselves have none."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Units:
    """Names of the scene's units in titles and colour bars.

    Attributes:
        length: Unit of coordinates and displacements.
        force: Unit of forces.
        stress: Unit of stresses and pressures, force / length².
    """

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"
