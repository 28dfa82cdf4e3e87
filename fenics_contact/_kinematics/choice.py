"""The kinematics and the integration of a body, by what it was given."""

from __future__ import annotations

from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.integration import FULL, Integration, Reduced, Stabilised
from fenics_contact._kinematics.revolution import Revolution
from fenics_contact._kinematics.torsion import Torsion


def kinematics_of(dim: int, axisymmetric: bool, torsion: bool) -> Kinematics:
    """Return the kinematics of a body whose mesh has a number of dimensions."""
    if torsion:
        return Torsion()
    return Revolution() if axisymmetric else Kinematics(dim)


def integration_of(name: str, *, thin: bool) -> Integration:
    """Return the integration called "full" or "reduced"; `thin`: where a section may be one cell across."""
    if name == "reduced":
        return Stabilised() if thin else Reduced()
    return FULL
