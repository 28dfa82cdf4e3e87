"""Analytical contact solutions: references for states, and initial estimates for designs.

All bodies are linearly elastic, contacts without friction and small compared with the bodies (except for
`pin_in_hole`, which may be as large as the pin). Any consistent system of units can be used.
"""

from __future__ import annotations

from fenics_contact.theory.hertz import (
    LineContact,
    PointContact,
    contact_modulus,
    hertz_line,
    hertz_point,
    relative_curvatures,
)
from fenics_contact.theory.pin_in_hole import PinContact, pin_in_hole
from fenics_contact.theory.roller import roller_relief

__all__ = [
    "LineContact",
    "PinContact",
    "PointContact",
    "contact_modulus",
    "hertz_line",
    "hertz_point",
    "pin_in_hole",
    "relative_curvatures",
    "roller_relief",
]
