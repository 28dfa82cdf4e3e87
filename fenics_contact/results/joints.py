"""The results of joints by kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fenics_contact.results.by_name import ByName
from fenics_contact.results.constraints import ConstraintForces
from fenics_contact.results.preloads import Preloads
from fenics_contact.results.springs import SpringForces

if TYPE_CHECKING:
    from fenics_contact.results.state import State

#: In the order in which they are listed.
KINDS: tuple[type[ByName[Any]], ...] = (Preloads, SpringForces, ConstraintForces)


def joint_results(state: State) -> list[ByName[Any]]:
    """Return the results of all kinds of joints that a scene has. Collective."""
    return [found for found in map(state._of_joints, KINDS) if found]
