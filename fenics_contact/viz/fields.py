"""The bodies of a state for drawing, and the fields that they have: names, units, colours and ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv

from fenics_contact.contact import STRESS_COMPONENTS, State
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import cell_type_of
from fenics_contact.viz.units import Units

#: Drawn bodies by name.
Bodies = Mapping[str, pv.UnstructuredGrid]


def drawn_bodies(state: State) -> dict[str, pv.UnstructuredGrid]:
    """Return the undeformed bodies, with linear cells and all fields. Collective."""
    blocks = state.to_pyvista(linear=True)
    return {name: blocks[name] for name in blocks.keys()}


def moved(bodies: Bodies, scale: float) -> dict[str, pv.UnstructuredGrid]:
    """Return the bodies moved by ``scale`` times their displacement, if they have one."""
    return {
        name: body.warp_by_vector("displacement", factor=scale) if "displacement" in body.point_data else body
        for name, body in bodies.items()
    }


def points_of(bodies: Bodies) -> np.ndarray:
    """Return the nodes of all bodies, (n, 3), [length]."""
    return np.concatenate([body.points for body in bodies.values()])


def contact_places(state: State, bodies: Bodies) -> np.ndarray:
    """Return the positions of the contact points' slave nodes on drawn bodies, (n, dim), [length]."""
    return np.asarray(points_of(bodies)[state.contact.points.slave, : state.scene.dim])


def cells_of(body: pv.UnstructuredGrid) -> np.ndarray:
    """Return the nodes of a body's cells, which are of one type, (n_cells, nodes of a cell)."""
    return np.asarray(body.cell_connectivity).reshape(body.n_cells, -1)


def is_plane(body: pv.UnstructuredGrid) -> bool:
    """Return whether a body is plane."""
    return int(body.get_cell(0).dimension) == 2


def linear_cells(name: str, body: pv.UnstructuredGrid) -> tuple[np.ndarray, int, int]:
    """Return the nodes of linear cells, how many of them one of the body makes, and their dimension."""
    if body.n_cells == 0 or len(np.unique(body.celltypes)) != 1:
        raise InvalidInputError(
            f"fields are drawn on cells of one type, {name!r} has {len(np.unique(body.celltypes))} types: "
            "give files that write_vtu or ResultSeries wrote"
        )
    dim, cells = 2 if is_plane(body) else 3, cells_of(body)
    kind = cell_type_of(cells, dim)
    if kind.order == 1:
        return cells, 1, dim
    return cells[:, kind.pieces].reshape(-1, kind.pieces.shape[1]), len(kind.pieces), dim


def linear(name: str, body: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """Return a body with linear cells and all fields."""
    cells, pieces, dim = linear_cells(name, body)
    if pieces == 1:
        return body
    kind = {(2, 3): pv.CellType.TRIANGLE, (2, 4): pv.CellType.QUAD, (3, 4): pv.CellType.TETRA}
    cut = pv.UnstructuredGrid({kind.get((dim, cells.shape[1]), pv.CellType.HEXAHEDRON): cells}, body.points)
    cut.point_data.update(body.point_data)
    for key, values in body.cell_data.items():
        cut.cell_data[key] = np.repeat(np.asarray(values), pieces, axis=0)
    return cut


def nodal(body: pv.UnstructuredGrid, name: str) -> np.ndarray:
    """Return a field on cells as the mean over the cells around each node, (n_nodes,)."""
    return np.asarray(body.cell_data_to_point_data()[name])


def lengths(body: pv.UnstructuredGrid) -> np.ndarray:
    """Return the magnitude of each node's displacement, zero if unknown, (n_nodes,), [length]."""
    if "displacement" not in body.point_data:
        return np.zeros(body.n_points)
    return np.linalg.norm(body["displacement"], axis=1)


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


def field_entries(steps: Sequence[Bodies], units: Units) -> list[dict[str, Any]]:
    """Return the fields of all steps in the order of the menu.

    Each entry has its ``name``, ``part`` of the menu, ``source``, the name in the files, ``component``, a
    column, or −1 for the size of a vector, ``label`` and ``unit``, ``place``, "nodes" or "on_cells",
    ``contact``, whether it lives on slave surfaces, ``colours``, "size" or "signed" or "status", ``range``
    of the colours, and ``extremes``, the smallest and largest value of each step.
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
    shared = {"part": part, "source": name, "unit": getattr(units, quantity) if quantity else ""}
    if columns == 1:
        return [{**shared, "component": 0, "name": name, "label": words}]
    parts: dict[int, tuple[Any, Any]] = {k: (k + 1, k + 1) for k in range(columns)}
    if columns == 6:
        parts = {k: (axes, axes) for k, axes in enumerate(STRESS_COMPONENTS)}
    elif name.endswith("principal_stress"):
        parts = {k: (k + 1, which) for k, which in enumerate(_PRINCIPAL)}
    elif columns == 3:
        parts = {-1: ("", "magnitude"), **{k: (axis, axis) for k, axis in enumerate("xyz")}}
    return [
        {**shared, "component": k, "name": f"{name}_{end}".rstrip("_"), "label": f"{words}, {which}"}
        for k, (end, which) in parts.items()
    ]


def _range(steps: Sequence[Bodies], entry: Mapping[str, Any], quantile: float = 0.995) -> dict[str, Any]:
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


def _values(grids: Bodies, entry: Mapping[str, Any]) -> np.ndarray:
    """Return the finite values of a field on all bodies; of contact fields those of contact points."""
    parts = [np.zeros(0)]
    for grid in grids.values():
        if entry["source"] not in grid.array_names:
            continue
        column = component(grid, entry)
        if entry["source"].startswith("contact_") and "contact_status" in grid.array_names:
            column = column[np.asarray(grid["contact_status"]) >= 0]
        parts.append(column[np.isfinite(column)])
    return np.concatenate(parts)


def component(grid: pv.UnstructuredGrid, entry: Mapping[str, Any]) -> np.ndarray:
    """Return the values of a field of `field_entries` on a body, NaN where it has none, (n,)."""
    if entry["source"] not in grid.array_names:
        return np.full(grid.n_points, np.nan)
    data = np.asarray(grid[entry["source"]], dtype=float)
    data, number = data.reshape(len(data), -1), entry["component"]
    return np.linalg.norm(data, axis=1) if number < 0 else data[:, number]


def rounded_up(value: float) -> float:
    """Round up to half a power of ten; 1 for zero."""
    if not value > 0:
        return 1.0
    step = 10.0 ** np.floor(np.log10(value)) / 2
    return float(step * np.ceil(value / step * (1 - 1e-9)))
