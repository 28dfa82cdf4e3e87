"""The table of forces and moments: reactions, contacts, ties, and their balance with the loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.table import Table

from fenics_contact.display import force_units
from fenics_contact.io import listed_forces, scales_of
from fenics_contact.linalg import ROUNDING


def forces_table(forces: Mapping[str, Any], units: Mapping[str, str] | None = None) -> Table:
    """Return forces and moments as they stand in a result file, one row each."""
    balance, names = forces["balance"], units or {}
    force, length = names.get("force", "force"), names.get("length", "length")
    plane = np.ndim(balance["loads"]["moment"]) == 0
    force, moment = force_units(force, length, 2 if plane else 3)
    table = Table(title=f"forces ({force}) and moments ({moment})", title_justify="left", box=None)
    table.pad_edge = False
    table.caption_justify = "left"
    table.caption = (
        f"moments about the centroids of surfaces,\nof sums about {_place(balance['about'])}\n"
        f"imbalance of all forces and moments {balance['imbalance']:.1e}"
    )
    for column in ("", "on"):
        table.add_column(column, overflow="fold")
    for column in ("Fx", "Fy", "M") if plane else ("Fx", "Fy", "Fz", "Mx", "My", "Mz"):
        table.add_column(column, justify="right", no_wrap=True)
    scales = scales_of(forces)
    for what, entry in listed_forces(forces):
        where = f"{entry['body']} {entry['surface']}" if "surface" in entry else ""
        numbers = np.hstack([_rounded(entry[kind], scale) for kind, scale in scales.items()])
        if where or numbers.any():
            table.add_row(what, where, *(f"{number:.5g}" for number in numbers))
    return table


def _rounded(values: Any, scale: float) -> np.ndarray:
    """Return numbers with rounding set to zero."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    return np.where(np.abs(numbers) > ROUNDING * scale, numbers, 0.0)


def _place(point: Any) -> str:
    return f"({', '.join(f'{value:.4g}' for value in point)})"
