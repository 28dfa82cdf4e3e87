"""The balance of heat as a table (CSV)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.output.files import write_text
from fenics_contact.output.tables import csv_text

if TYPE_CHECKING:
    from fenics_contact.heat.coupled import HeatedState
    from fenics_contact.heat.state import HeatState


@collectively("write_heat_balance", lambda states, *_, **__: states[0].comm)
@naming_arguments
def write_heat_balance(
    states: Sequence[HeatState | HeatedState], path: str | Path, times: Sequence[float] | np.ndarray = ()
) -> Path:
    """Write temperatures and where heat comes from as a table (CSV), a row a state. Collective.

    After a remark a line names the columns: ``time``; of each body ``BODY least`` and ``BODY largest``, its
    temperatures; ``through SURFACES``, heat from slave to master, [power]; the names of
    `HeatBalance.by_part`, positive where heat enters; ``stored``; ``error`` of the balance, relative.

    Args:
        states: At least one, such as those of a `HeatHistory`, alone or with mechanics.
        path: File to write; its folder is created.
        times: Of each; by default 0, 1, ...

    Returns:
        The path.

    Example:
        >>> write_heat_balance([state], "output/balance.csv")  # doctest: +SKIP
    """
    given = list(times) or list(range(len(states)))
    if len(given) != len(states):
        raise InvalidInputError(
            f"write_heat_balance needs a time of each state, {len(states)}, got {len(given)}: those of a "
            "HeatHistory are history.times[1:]"
        )
    rows: list[dict[str, Any]] = []
    for time, state in zip(given, (each.heat for each in states), strict=True):
        row: dict[str, Any] = {"time": float(time)}
        for body, own in state.temperature.items():
            row |= {f"{body} least": own.min(), f"{body} largest": own.max()}
        pairs = zip(state.scene.contacts, state.contacts, strict=True)
        row |= {f"through {contact.place}": each.total for contact, each in pairs}
        rows.append({**row, **state.balance.by_part, "stored": state.balance.stored})
        rows[-1]["error"] = state.balance.error
    names = list(dict.fromkeys(name for row in rows for name in row))
    remark = "one row a state; heat is positive where it enters bodies; units are those of the scene"
    with together(states[0].comm):
        if states[0].comm.rank == 0:
            table = ([row.get(name) for name in names] for row in rows)
            write_text(Path(path), csv_text([remark], names, table))
    return Path(path)
