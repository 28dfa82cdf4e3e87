"""The results of joints by kind."""

from __future__ import annotations

from typing import Any

from fenics_contact.results.by_name import ByName, Solved
from fenics_contact.results.constraints import ConstraintForces
from fenics_contact.results.preloads import Preloads
from fenics_contact.results.springs import SpringForces

#: In the order in which they are listed.
KINDS: tuple[type[ByName[Any]], ...] = (Preloads, SpringForces, ConstraintForces)


def joint_results(state: Solved) -> list[ByName[Any]]:
    """Return the results of all kinds of joints that a scene has. Collective."""
    return [found for found in (kind.of(state) for kind in KINDS) if found]
