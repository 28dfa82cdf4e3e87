"""Names of units, for labels; nothing is converted."""

from __future__ import annotations

from pydantic import Field

from fenics_contact.scene_file.values import Part


class UnitNames(Part):
    """Names of the units in which all numbers of the file are given; labels use them, nothing is converted."""

    length: str = Field("mm", description="unit of coordinates and displacements")
    force: str = Field("N", description="unit of forces")
    stress: str = Field("MPa", description="unit of stresses, moduli and pressures: force / length²")
