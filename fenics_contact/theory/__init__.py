"""Contacts whose answer is known by formula: yardsticks for states, and first guesses for designs.

All bodies are linearly elastic, contacts without friction and small beside the bodies (but for `pin_in_hole`,
which may be as large as the pin). Any consistent system of units will do.
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

__all__ = [
    "LineContact",
    "PinContact",
    "PointContact",
    "contact_modulus",
    "hertz_line",
    "hertz_point",
    "pin_in_hole",
    "relative_curvatures",
]
