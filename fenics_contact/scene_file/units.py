"""Names of units, for labels; nothing is converted."""

from __future__ import annotations

from pydantic import Field

from fenics_contact.scene_file.values import Part


class UnitNames(Part):
    """Names of the units of all numbers of the file; labels use them, nothing is converted."""

    length: str = Field(default="mm", description="unit of coordinates and displacements")
    force: str = Field(default="N", description="unit of forces")
    stress: str = Field(default="MPa", description="unit of stresses, moduli and pressures: force / length²")
