"""Picture of a field on plane bodies: all of them, and where they touch at a larger scale."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from fenics_contact.contact import ContactResult
from fenics_contact.scene import Scene
from fenics_contact.viz.fields import Moved
from fenics_contact.viz.obstacles import shade_obstacles
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.plane import draw_cell_edges, draw_field, draw_outline, window
from fenics_contact.viz.sheet import sheet

#: Half size of the detail, in half lengths of the closed part of the contact surface.
REACH = 2.5
#: A detail that shows more than this part of the bodies is left out.
LARGEST_DETAIL = 0.4
#: Room around the bodies, relative to their size.
BORDER = 0.04


@dataclass(frozen=True)
class _Part:
    title: str
    scale: float
    low: np.ndarray
    high: np.ndarray

    @property
    def proportion(self) -> float:
        """Width by height."""
        return float((self.high - self.low)[0] / (self.high - self.low)[1])


def contact_window(
    contact: ContactResult, places: np.ndarray, reach: float | None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the corners of a square around the pair with the largest force; None if no force acts.

    Args:
        contact: What happens on the contact points.
        places: Their places, (n, 2), [length].
        reach: Half size of the square, [length], or None.
    """
    force, points = contact.normal_force, contact.points
    if not np.any(force > 0):
        return None
    pair = int(np.argmax(np.bincount(points.pair, weights=force)))
    closed = (points.pair == pair) & (force > 0)
    weight = np.where(closed, force, 0.0)
    middle = weight @ places / weight.sum()
    half = REACH * float(points.area[closed].sum()) / 2 if reach is None else reach
    return middle - half, middle + half


def draw_in_plane(
    scene: Scene,
    bodies: Mapping[str, Moved],
    detail: tuple[np.ndarray, np.ndarray] | None,
    paper: BinaryIO,
    paints: Paints,
) -> None:
    """Draw a field on the deformed bodies, and beside it the contact in true deformation.

    Args:
        scene: Gives the obstacles.
        bodies: The bodies.
        detail: Corners of what is shown at a larger scale, or None.
        paper: Where the picture goes.
        paints: The field.
    """
    parts = _parts(bodies, detail, paints.scale)
    upright = len(parts) > 1 and parts[0].proportion > 2.2
    # Sizes in parts of the sheet's width, with room for tick labels, titles and the colour bar.
    if upright:
        height = 0.84 / parts[0].proportion + 0.36 + 0.2
    else:
        height = 0.8 / sum(part.proportion for part in parts) + 0.13
    height = float(np.clip(height, 0.3, 1.0))
    size = paints.width, round(height * paints.width)
    with sheet(paper, size, paints.headline, "constrained") as figure:
        ratios = {"height_ratios": [0.84 / parts[0].proportion, 0.36]} if upright else None
        ratios = ratios or {"width_ratios": [part.proportion for part in parts]}
        shape = (len(parts), 1) if upright else (1, len(parts))
        panels = figure.subplots(*shape, squeeze=False, gridspec_kw=ratios).ravel()
        for axes, part in zip(panels, parts, strict=True):
            _draw_part(axes, scene, bodies, part, paints)
        look: dict[str, Any] = {"extend": paints.extend, "aspect": 30, "shrink": 0.95}
        figure.colorbar(paints.key, ax=panels.tolist(), label=paints.label, **look)


def _parts(
    bodies: Mapping[str, Moved], detail: tuple[np.ndarray, np.ndarray] | None, scale: float
) -> list[_Part]:
    points = np.concatenate([body.deformed(scale) for body in bodies.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    border = BORDER * float(np.max(high - low))
    parts = [_Part("", scale, low - border, high + border)]
    if detail is not None and np.max(detail[1] - detail[0]) < LARGEST_DETAIL * np.max(high - low):
        parts.append(_Part("where they touch; displacement × 1", 1.0, *detail))
    return parts


def _draw_part(axes: Any, scene: Scene, bodies: Mapping[str, Moved], part: _Part, paints: Paints) -> None:
    shade_obstacles(axes, scene, part.low, part.high)
    for name, body in bodies.items():
        points, cells = body.deformed(part.scale), body.mesh.cells
        draw_field(axes, points, cells, paints.shown(name), paints.of_cells)
        draw_cell_edges(axes, points, cells, part.low, part.high)
        draw_outline(axes, points, cells)
    axes.set_title(part.title)
    window(axes, part.low, part.high, paints.units.length)
