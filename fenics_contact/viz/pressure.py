"""Picture of a contact surface seen face on: pressure, and what its points do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.ticker import FuncFormatter
from matplotlib.tri import Triangulation

from fenics_contact.contact import State, Status
from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import BLUE, GREY, INK, ORANGE, PALE, PRESSURE_MAP
from fenics_contact.viz.sheet import draw_on_one_rank, png_path, sheet
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import View, axis_label, face_on, frame_around
from fenics_contact.viz.words import checked_range, headline, written

#: Straight pieces by which the edge of a facet is cut to colour it.
PIECES = 6
#: Symbols of the points: how they are drawn and what the legend calls them.
_SYMBOLS: dict[Status, dict[str, Any]] = {
    Status.OPEN: {"marker": "o", "facecolors": "none", "edgecolors": GREY, "s": 30},
    Status.STICK: {"marker": "s", "facecolors": BLUE, "edgecolors": "white", "s": 90},
    Status.SLIP: {"marker": "^", "facecolors": ORANGE, "edgecolors": "white", "s": 110},
}


def plot_contact_pressure(
    state: State,
    path: str | Path,
    *,
    pair: int = 0,
    clim: tuple[float, float] | None = None,
    half_width: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Path:
    """Draw a contact pair's slave surface as its master sees it. Collective.

    Left the nodal pressure, right the status of the points with the direction in which those that slip move
    on the master.

    Args:
        state: The state.
        path: PNG file to write.
        pair: Number of the contact pair in the scene.
        clim: Range of the colours, [force / length²]; from zero to the largest pressure unless given. Give two
            pictures the same range to compare them.
        half_width: How far the picture reaches around the contact's middle, [length]; chosen unless given.
        title: What comes before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The path.

    Raises:
        InvalidInputError: If the scene has no such pair, or a range or the name of the file cannot be used.
    """
    target = png_path(path)
    if not 0 <= pair < len(state.scene.contacts):
        raise InvalidInputError(
            f"pair must number one of the scene's {len(state.scene.contacts)} contact pairs from 0, got {pair}: "
            "draw a scene with contact"
        )
    if half_width is not None and not 0 < half_width < np.inf:
        raise InvalidInputError(
            f"half_width must be positive, got {half_width}: leave it out to have it chosen"
        )
    given = None if clim is None else checked_range(clim)
    units = units or Units()
    draw_on_one_rank(
        state.system.torn.decomposition.comm,
        lambda: _draw(_patch(state, pair, half_width), target, given, title, units, width),
    )
    return target


@dataclass(frozen=True)
class _Patch:
    """The slave surface projected to a plane, and its contact points.

    Attributes:
        view: The direction of view.
        name: Body and surface.
        places: All nodes of the surface in the picture, (n, 2).
        facets: Rows of positions in ``places``.
        pressure: On all nodes of the surface, zero where there is no contact point, (n,).
        points: Positions of the contact points in ``places``.
        status: Of the contact points.
        slip: Of the contact points in the picture, (n_points, 2).
        force: Normal force of the pair.
        low: Lower left corner of what is shown.
        high: Upper right corner.
    """

    view: View
    name: str
    places: np.ndarray
    facets: np.ndarray
    pressure: np.ndarray
    points: np.ndarray
    status: np.ndarray
    slip: np.ndarray
    force: float
    low: np.ndarray
    high: np.ndarray


def _patch(state: State, pair: int, half_width: float | None) -> _Patch:
    contact, slave = state.contact, state.scene.contacts[pair].slave
    chosen = contact.on_pair(pair)
    mesh = state.scene.bodies[slave.body].mesh
    force, normals = contact.normal_force[chosen], contact.points.normal[chosen]
    weight = force if np.any(force > 0) else np.ones(len(chosen))
    view = face_on(-weight @ normals)
    facets = state.scene.facets(slave)
    corners = mesh.points[facets]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    nodes, local = np.unique(facets[outward @ view.towards > 0], return_inverse=True)
    tearing = state.system.torn.decomposition.tearing
    points = np.searchsorted(tearing.global_nodes(slave.body, nodes), contact.points.slave[chosen])
    pressure = np.zeros(len(nodes))
    pressure[points] = contact.pressure[chosen]
    slip = np.einsum("na,nad->nd", contact.slip[chosen], contact.points.tangents[chosen])
    places = view.project(mesh.points[nodes])
    low, high = _window(places[points], contact.points.area[chosen], force, half_width)
    if half_width is None:
        edge = frame_around(view, mesh.points[nodes], 0.05)
        low, high = np.maximum(low, edge.low), np.minimum(high, edge.high)
    return _Patch(
        view, f"{slave.body}, {slave.name}", places, local.reshape(-1, facets.shape[1]), pressure, points,
        contact.status[chosen], view.project(slip), float(force.sum()), low, high,
    )  # fmt: skip


def _window(
    places: np.ndarray, area: np.ndarray, force: np.ndarray, half_width: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the square around the closed points, with room for two facets beside them."""
    closed = force > 0 if np.any(force > 0) else np.ones(len(force), dtype=bool)
    low, high = places[closed].min(axis=0), places[closed].max(axis=0)
    half = float(np.max(high - low)) / 2 + 2.5 * float(np.sqrt(area[closed].mean()))
    middle = (low + high) / 2
    half = half if half_width is None else half_width
    return middle - half, middle + half


def _draw(
    patch: _Patch, target: Path, clim: tuple[float, float] | None, title: str, units: Units, width: int
) -> None:
    peak = float(patch.pressure.max())
    shown = clim or (0.0, peak or 1.0)
    facts = (
        f"largest pressure {written(peak)} {units.stress}, normal force {written(patch.force)} {units.force}"
    )
    proportion = float((patch.high - patch.low)[1] / (patch.high - patch.low)[0])
    height = round((0.17 + 0.39 * proportion) * width)
    with sheet(target, (width, height), headline(title, facts), "constrained") as figure:
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        _draw_pressure(left, patch, shown)
        label = f"contact pressure ({units.stress})"
        extend = "max" if peak > shown[1] else "neither"
        figure.colorbar(ScalarMappable(Normalize(*shown), PRESSURE_MAP), ax=left, label=label, extend=extend)
        _draw_status(right, patch, units)
        for axes in (left, right):
            _label(axes, patch, units)
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def _draw_pressure(axes: Any, patch: _Patch, clim: tuple[float, float]) -> None:
    mesh, values = _refined(patch)
    axes.tripcolor(mesh, values, shading="gouraud", cmap=PRESSURE_MAP, vmin=clim[0], vmax=clim[1])
    outlines = {"facecolors": "none", "edgecolors": GREY, "linewidths": 0.5}
    axes.add_collection(PolyCollection(patch.places[patch.facets], **outlines))
    axes.set_title(f"pressure on {patch.name}")


def _refined(patch: _Patch) -> tuple[Triangulation, np.ndarray]:
    """Cut every facet into triangles so small that colours are bilinear on quadrilaterals and favour no diagonal."""
    facets = patch.facets
    if facets.shape[1] == 3:
        return Triangulation(*patch.places.T, facets), patch.pressure
    s, t = np.meshgrid(np.linspace(0, 1, PIECES + 1), np.linspace(0, 1, PIECES + 1), indexing="ij")
    shape = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1).reshape(-1, 4)
    places = np.einsum("kc,fcd->fkd", shape, patch.places[facets]).reshape(-1, 2)
    number = np.arange(len(shape)).reshape(s.shape)
    low, high = (
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:]],
        [number[:-1, :-1], number[1:, 1:], number[:-1, 1:]],
    )
    small = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in (low, high)])
    triangles = (small + len(shape) * np.arange(len(facets))[:, None, None]).reshape(-1, 3)
    return Triangulation(*places.T, triangles), (patch.pressure[facets] @ shape.T).ravel()


def _draw_status(axes: Any, patch: _Patch, units: Units) -> None:
    axes.add_collection(PolyCollection(patch.places[patch.facets], facecolors=PALE, edgecolors="white"))
    places = patch.places[patch.points]
    for status, look in _SYMBOLS.items():
        chosen = patch.status == status
        label = f"{status.name.lower()} ({np.count_nonzero(chosen)})"
        axes.scatter(*places[chosen].T, label=label, zorder=3, linewidths=1.0, **look)
    slips = patch.status == Status.SLIP
    length = np.linalg.norm(patch.slip[slips], axis=1)
    longest = float(length.max(initial=0.0))
    if longest > 0:
        _draw_arrows(axes, patch, places[slips], patch.slip[slips] / longest)
    axes.set_title(
        f"status, largest slip {written(longest, 2)} {units.length}" if longest > 0 else "status, no slip"
    )


def _draw_arrows(axes: Any, patch: _Patch, places: np.ndarray, slip: np.ndarray) -> None:
    reach = 0.1 * float(np.max(patch.high - patch.low))
    axes.quiver(
        *places.T, *(reach * slip).T, angles="xy", scale_units="xy", scale=1, color=INK, width=0.004, zorder=4
    )


def _label(axes: Any, patch: _Patch, units: Units) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(patch.low[0], patch.high[0])
    axes.set_ylim(patch.low[1], patch.high[1])
    for axis, direction, word in ((axes.xaxis, patch.view.right, "right"), (axes.yaxis, patch.view.up, "up")):
        name = axis_label(direction)
        axis.set_label_text(f"{name.strip('−') or word} ({units.length})")
        if name.startswith("−"):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{0 - value:g}".replace("-", "−")))
