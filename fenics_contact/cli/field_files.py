"""Files of fields, read and drawn by pyvista."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fenics_contact.contact import STRESS_COMPONENTS
from fenics_contact.errors import InvalidInputError
from fenics_contact.io import StoredFields, stored_fields
from fenics_contact.scene_file import suggestion


def newest_member(path: Path) -> StoredFields:
    """Return the first file of the last time that a .pvd file names; any other file itself.

    Raises:
        InvalidInputError: If a .pvd file names none or cannot be read.
    """
    members = stored_fields(path)
    return next(member for member in members if member.value == members[-1].value)


def _blocks(path: Path) -> dict[str, Any]:
    """Read the meshes of a file by name, stresses by components."""
    blocks = newest_member(path).read()
    for block in blocks.values():
        _split_stress(block.point_data)
        _split_stress(block.cell_data)
    return blocks


def _split_stress(data: Any) -> None:
    """Replace stresses by their components, ``stress_xx`` and so on, principal ones by ``sigma_1`` to 3."""
    for prefix in ("", "nodal_"):
        _split(data, f"{prefix}principal_stress", [f"{prefix}sigma_{k}" for k in (1, 2, 3)])
        _split(data, f"{prefix}stress", [f"{prefix}stress_{ending}" for ending in STRESS_COMPONENTS])


def _split(data: Any, name: str, parts: Sequence[str]) -> None:
    if name in data:
        for part, column in zip(parts, np.asarray(data[name]).T, strict=True):
            data[part] = column
        del data[name]


def fields_in(path: Path) -> dict[str, str]:
    """Return name -> range of every field of a file, for vectors of their magnitude."""
    by_name: dict[str, list[tuple[float, float]]] = {}
    for block in _blocks(path).values():
        for data in (block.point_data, block.cell_data):
            for name in data:
                values = np.asarray(data[name], dtype=float)
                size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
                by_name.setdefault(name, []).append((float(np.nanmin(size)), float(np.nanmax(size))))
    return {
        name: f"{min(low for low, _ in ranges):.5g} to {max(high for _, high in ranges):.5g}"
        for name, ranges in by_name.items()
    }


def draw(path: Path, save: Path | None, look: tuple[str, float], *, window: bool) -> str:
    """Draw a field on the deformed bodies: to a PNG file, or in a window if there is a display.

    Args:
        path: The file.
        save: PNG file, or None.
        look: Name of the field, factor of the displacement.
        window: Whether a window is wanted.

    Returns:
        A message about what was done.

    Raises:
        InvalidInputError: If the file has no such field.
        MissingRequirementError: If this machine cannot render.
    """
    display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if save is None and not (window and display):
        return "no window without a display; --save picture.png draws the fields to a file"
    if save is not None and save.suffix != ".png":
        raise InvalidInputError(f"a picture must be a PNG file, got {save.name!r}: let it end in '.png'")
    from fenics_contact.viz import rendering

    with rendering():
        plotter = _plotter(path, look, off_screen=save is not None)
        if save is None:
            plotter.show()
            return "window closed"
        save.parent.mkdir(parents=True, exist_ok=True)
        plotter.screenshot(str(save))
        plotter.close()
    return f"picture in {save}"


def _plotter(path: Path, look: tuple[str, float], *, off_screen: bool) -> Any:
    import pyvista

    from fenics_contact.viz import STRESS_MAP

    field, scale = look
    blocks = _blocks(path)
    names = sorted({name for block in blocks.values() for name in block.array_names})
    if field not in names:
        raise InvalidInputError(
            f"--field must be one of {names}, got {field!r}: {suggestion(field, names)}choose one of them"
        )
    plotter = pyvista.Plotter(off_screen=off_screen, window_size=(1600, 1000))
    clim, beyond = _range(blocks, field)
    for block in blocks.values():
        moved = block.copy()
        if "displacement" in moved.point_data:
            moved.points = moved.points + scale * np.asarray(moved.point_data["displacement"])
        if field in moved.array_names:
            bar = {"title": f"{_WORDS.get(field, field.replace('_', ' '))}{beyond}\n", **_BAR}
            plotter.add_mesh(
                moved, scalars=field, clim=clim, cmap=STRESS_MAP, ambient=0.3, scalar_bar_args=bar,
                show_edges=True, edge_opacity=0.2,
            )  # fmt: skip
        else:
            plotter.add_mesh(moved, color="lightgrey")
    plotter.background_color = "white"
    flat = all(np.ptp(block.points[:, 2]) == 0 for block in blocks.values())
    plotter.view_xy() if flat else plotter.view_isometric()
    plotter.camera.SetWindowCenter(0.15, 0.0)  # space for the bar on the right
    return plotter


_WORDS = {"von_mises": "von Mises stress of cells", "nodal_von_mises": "von Mises stress at nodes"}
#: The colours end at this quantile, and with negative numbers at its counterpart.
QUANTILE = 0.995
#: Colour bar on the right, clear of the bodies.
_BAR = {
    "vertical": True, "position_x": 0.88, "position_y": 0.2, "height": 0.6, "width": 0.05, "n_labels": 5,
    "fmt": "%.4g", "title_font_size": 28, "label_font_size": 24, "color": "black",
}  # fmt: skip


def _range(blocks: dict[str, Any], field: str) -> tuple[tuple[float, float], str]:
    """Return the range of the colours, and in words what lies beyond.

    It holds all but the few extreme values, which would leave one shade.
    """
    arrays = [
        np.asarray(block[field], dtype=float) for block in blocks.values() if field in block.array_names
    ]
    sizes = [np.linalg.norm(values, axis=1) if values.ndim == 2 else values for values in arrays]
    values = np.concatenate([size.ravel() for size in sizes])
    least, most = float(np.nanmin(values)), float(np.nanmax(values))
    low = float(np.nanquantile(values, 0.0 if least >= 0.0 else 1 - QUANTILE))
    high = float(np.nanquantile(values, QUANTILE))
    beyond = f"\nsmallest {least:.4g}" if least < low else ""
    return (low, high), beyond + (f"\nlargest {most:.4g}" if most > high else "")
