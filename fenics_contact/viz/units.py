"""Names of the units in which a scene is written; the numbers themselves carry none."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Units:
    """What titles and colour bars call the scene's units.

    Attributes:
        length: Unit of coordinates and displacements.
        force: Unit of forces.
        stress: Unit of stresses and pressures, force / length².
    """

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"
