"""The fields that a page offers: their names, units, colours and ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.contact import STRESS_COMPONENTS
from fenics_contact.viz import Units

if TYPE_CHECKING:
    import pyvista

    Grids = Mapping[str, pyvista.UnstructuredGrid]

_AXES = ("x", "y", "z")
_PRINCIPAL = ("first (largest)", "second", "third (smallest)")
#: Fields of the library: part of the menu, words, and the unit's name in `Units`. In the order of the menu.
_KNOWN = {
    "nodal_von_mises": ("at nodes", "von Mises stress at nodes", "stress"),
    "displacement": ("at nodes", "displacement", "length"),
    "nodal_stress": ("at nodes", "stress", "stress"),
    "nodal_principal_stress": ("at nodes", "principal stress", "stress"),
    "contact_status": ("contact", "contact status", ""),
    "contact_pressure": ("contact", "contact pressure", "stress"),
    "contact_nominal_pressure": ("contact", "contact pressure by undeformed area", "stress"),
    "contact_force": ("contact", "contact force of a node", "force"),
    "contact_slip": ("contact", "slip in the last load step", "length"),
    "von_mises": ("means over cells", "von Mises stress of cells", "stress"),
    "stress": ("means over cells", "stress of cells", "stress"),
    "principal_stress": ("means over cells", "principal stress of cells", "stress"),
}


def field_entries(steps: Sequence[Grids], units: Units) -> list[dict[str, Any]]:
    """Return the fields of all steps in the order of the menu.

    Each entry has ``part`` of the menu, ``source``, the name in the files, ``component``, a column, or −1 for
    the size of a vector, ``label`` and ``unit``, ``place``, "nodes" or "on_cells", ``contact``, whether it
    lives on slave surfaces, ``colours``, "size" or "signed" or "status", ``range`` of the colours, and
    ``extremes``, the smallest and largest value of each step.
    """
    found: dict[str, tuple[str, int]] = {}
    for grid in (grid for grids in steps for grid in grids.values()):
        for place, data in (("on_cells", grid.cell_data), ("nodes", grid.point_data)):
            found |= {name: (place, _columns(values)) for name, values in data.items()}
    ordered = sorted(found, key=lambda name: list(_KNOWN).index(name) if name in _KNOWN else len(_KNOWN))
    return [
        {
            **entry,
            "place": found[name][0],
            "contact": name.startswith("contact_"),
            **_range(steps, entry),
        }
        for name in ordered
        for entry in _components(name, found[name][1], units)
    ]


def _columns(values: np.ndarray) -> int:
    return int(np.prod(values.shape[1:], dtype=int))


def _components(name: str, columns: int, units: Units) -> list[dict[str, Any]]:
    part, words, quantity = _KNOWN.get(name, ("more", name.replace("_", " "), ""))
    unit = getattr(units, quantity) if quantity else ""
    parts = (
        {-1: "magnitude", **dict(enumerate(_AXES))}
        if columns == 3
        else dict(enumerate(range(1, columns + 1)))
    )
    if columns == 6:
        parts = dict(enumerate(STRESS_COMPONENTS))
    elif name.endswith("principal_stress"):
        parts = dict(enumerate(_PRINCIPAL))
    labels = {0: words} if columns == 1 else {number: f"{words}, {which}" for number, which in parts.items()}
    return [
        {"part": part, "source": name, "component": number, "label": label, "unit": unit}
        for number, label in labels.items()
    ]


def _range(steps: Sequence[Grids], entry: Mapping[str, Any], quantile: float = 0.995) -> dict[str, Any]:
    """Return kind and range of the colours over all steps, and the extremes of each step.

    The colours end at a quantile of the sizes of all values, as peaks would leave the rest in one shade.
    """
    if entry["source"] == "contact_status":
        return {"colours": "status", "range": [0.0, 1.0], "extremes": [None] * len(steps)}
    values = [_values(grids, entry) for grids in steps]
    extremes = [[float(part.min()), float(part.max())] if part.size else None for part in values]
    together = np.concatenate(values)
    signed = bool(together.min(initial=0.0) < 0)
    top = rounded_up(float(np.quantile(np.abs(together), quantile)) if together.size else 0.0)
    if top < 1e-3 * np.abs(together).max(initial=0.0):  # few nodes carry something, as in contact
        top = rounded_up(float(np.abs(together).max()))
    return {
        "colours": "signed" if signed else "size",
        "range": [-top if signed else 0.0, top],
        "extremes": extremes,
    }


def _values(grids: Grids, entry: Mapping[str, Any]) -> np.ndarray:
    """Return the finite values of a field on all bodies; of contact fields those of contact points."""
    parts = [np.zeros(0)]
    for grid in grids.values():
        if entry["source"] not in grid.array_names:
            continue
        data = np.asarray(grid[entry["source"]], dtype=float)
        data = data.reshape(len(data), -1)
        number = entry["component"]
        column = np.linalg.norm(data, axis=1) if number < 0 else data[:, number]
        if entry["source"].startswith("contact_") and "contact_status" in grid.array_names:
            column = column[np.asarray(grid["contact_status"]) >= 0]
        parts.append(column[np.isfinite(column)])
    return np.concatenate(parts)


def rounded_up(value: float) -> float:
    """Round up to half a power of ten; 1 for zero."""
    if not value > 0:
        return 1.0
    step = 10.0 ** np.floor(np.log10(value)) / 2
    return float(step * np.ceil(value / step * (1 - 1e-9)))
