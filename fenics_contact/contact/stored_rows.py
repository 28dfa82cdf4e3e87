"""Arrays of a stored state, and the rows to which they belong."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import TornSystem

Stored = Mapping[str, np.ndarray]


def with_stored_slip(torn: TornSystem, stored: Stored) -> TornSystem:
    """Return a system in which slip is measured from the same origin as for a stored state.

    Raises:
        InvalidInputError: If the arrays are those of another system.
    """
    require_rows(torn, stored)
    return torn.with_slip_from(stored["origin"][torn.numbering.owned], stored["slid"])


def require_rows(torn: TornSystem, stored: Stored) -> None:
    """Reject a stored state with other rows.

    Raises:
        InvalidInputError: If it has.
    """
    if stored["multiplier"].shape != (torn.numbering.total,):
        raise InvalidInputError(
            f"a stored state needs {torn.numbering.total} multipliers, got "
            f"{stored['multiplier'].size}: give the scene and the partition of that state"
        )
