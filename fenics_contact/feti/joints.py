"""The kinds of joints that a scene may have."""

from __future__ import annotations

from fenics_contact.feti.periodic import PeriodicRows
from fenics_contact.feti.preloads import SectionRows
from fenics_contact.feti.row_groups import Joint
from fenics_contact.feti.springs import SpringRows
from fenics_contact.feti.ties import BondedTies, SlidingTies

#: In the order of their rows.
JOINTS: tuple[type[Joint], ...] = (
    BondedTies,
    SectionRows,
    SlidingTies,
    SpringRows,
    PeriodicRows,
)
