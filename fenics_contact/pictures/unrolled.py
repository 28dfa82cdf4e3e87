"""Contact surfaces seen from their master or unrolled, and pictures of plane contact surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import BinaryIO, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import FuncFormatter, MaxNLocator

from fenics_contact._base.display import DerivedUnits
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._scene.pairs import pair_number
from fenics_contact._surfaces.facets import filled_at_corners
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.pictures.canvas import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    PRESSURE_MAP,
    Frame,
    Range,
    Units,
    View,
    axis_label,
    face_on,
    headline,
    sheet,
    symbols_of,
    written,
)
from fenics_contact.pictures.curves import ContactTrace
from fenics_contact.results.contact import NormalForces, Status
from fenics_contact.results.state import State

#: What is done with a reversed axis, and said of it.
Turned: TypeAlias = Callable[[Axes, Axis, View], str]

#: A surface runs around an axis if Σ A n nᵀ has one eigenvalue below this fraction of the next.
SLENDER = 0.05
#: Its nodes may lie farther or nearer than the mean radius by this fraction of it.
ROUND = 0.1


@dataclass(frozen=True)
class Unrolling:
    """A cylinder that is cut open along a line.

    `frame`: direction of angle 0, direction of a quarter turn, and axis as rows, right-handed; `middle`:
    angle opposite of the cut.
    """

    centre: np.ndarray
    frame: np.ndarray
    radius: float
    middle: float

    def angles(self, points: np.ndarray) -> np.ndarray:
        """Return the angles of points (..., 3), within half a turn of the middle, [rad]."""
        zero, quarter = np.moveaxis((points - self.centre) @ self.frame[:2].T, -1, 0)
        return np.asarray(self.middle + _half_turn(np.arctan2(quarter, zero) - self.middle))

    def unroll(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unroll a surface; facets that the cut runs through stay whole, and their nodes are there twice.

        Returns the node of every place, the places, and facets as rows of places. The first place of a node
        is within half a turn of the middle, if a facet is there.
        """
        angles = self.angles(points)
        around = self.angles(points[facets].mean(axis=1))
        turns = np.round((around[:, None] - angles[facets]) / (2 * np.pi)).astype(int)
        keys, rows = np.unique(
            np.column_stack([turns.ravel() ** 2, turns.ravel(), facets.ravel()]), axis=0, return_inverse=True
        )
        node = keys[:, 2]
        arcs = self.radius * (angles[node] + 2 * np.pi * keys[:, 1])
        return node, np.column_stack([arcs, points[node] @ self.frame[2]]), rows.reshape(facets.shape)

    def turn(self, vectors: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return vectors at points, both (n, 3), as they run on the unrolled surface, (n, 2)."""
        angles = self.angles(points)
        around = np.cos(angles)[:, None] * self.frame[1] - np.sin(angles)[:, None] * self.frame[0]
        return np.column_stack([np.einsum("nd,nd->n", vectors, around), vectors @ self.frame[2]])

    def labels(self, units: Units) -> tuple[str, str]:
        """Return the labels of the horizontal and the vertical axis."""
        axis, zero = axis_label(self.frame[2]), axis_label(self.frame[0])
        if not axis:
            return f"around the axis ({units.length})", f"along the axis ({units.length})"
        return f"around {axis} ({units.length}), 0 towards {zero}", f"{axis} ({units.length})"

    def label(self, axes: Axes, units: Units, turned: Turned) -> None:
        """Name the axes, which no side reverses."""
        across, along = self.labels(units)
        axes.set(xlabel=across, ylabel=along)


@dataclass(frozen=True)
class Projection:
    """A surface seen in a direction, with the members of an `Unrolling`."""

    view: View

    def unroll(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project a surface without the facets that face away."""
        facing = facets[vector_areas(points, facets) @ self.view.towards > 0]
        node, rows = np.unique(facing, return_inverse=True)
        return node, self.view.project(points[node]), rows.reshape(facing.shape)

    def turn(self, vectors: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return vectors, (n, 3), as they are seen, (n, 2)."""
        return self.view.project(vectors)

    def label(self, axes: Axes, units: Units, turned: Turned) -> None:
        """Name the axes, see `label_axes`."""
        label_axes(axes, self.view, units, turned)


def unrolling_of(
    points: np.ndarray, facets: np.ndarray, places: np.ndarray, force: np.ndarray
) -> Unrolling | None:
    """Fit a cylinder to a surface that runs around an axis; None if it does not.

    `places`: where forces act on it: the cut is opposite of their middle.
    """
    areas = vector_areas(points, facets)
    size = np.linalg.norm(areas, axis=1)
    values, vectors = np.linalg.eigh((areas / size[:, None]).T @ areas)
    if values[0] > SLENDER * values[1]:
        return None
    frame, nodes = _unrolled_frame(vectors[:, 0]), points[np.unique(facets)]
    flat = nodes @ frame[:2].T
    origin = flat.mean(axis=0)
    flat -= origin
    # |p|² = 2 c·p + r² − |c|² on a circle of centre c and radius r.
    terms = np.column_stack([2 * flat, np.ones(len(flat))])
    fitted = np.linalg.lstsq(terms, np.sum(flat**2, axis=1), rcond=None)[0]
    middle, radius = fitted[:2], float(np.sqrt(fitted[2] + fitted[:2] @ fitted[:2]))
    if np.abs(np.linalg.norm(flat - middle, axis=1) - radius).max() > ROUND * radius:
        return None
    cylinder = Unrolling((origin + middle) @ frame[:2], frame, radius, 0.0)
    strong = frame[:2] @ (force @ (places - cylinder.centre))
    # Forces alike all around point nowhere.
    alike = np.linalg.norm(strong) < 1e-3 * radius * force.sum()
    return replace(cylinder, middle=0.0 if alike else float(np.arctan2(strong[1], strong[0])))


def _unrolled_frame(axis: np.ndarray) -> np.ndarray:
    """Return a right-handed frame, (3, 3), whose last row is a unit vector, along and not against x, y or z.

    Along an axis angle 0 is at the next one: around z they count from x to y.
    """
    main = int(np.argmax(np.abs(axis)))
    axis = np.sign(axis[main]) * axis
    zero = np.eye(3)[(main + 1) % 3] - axis[(main + 1) % 3] * axis
    zero /= np.linalg.norm(zero)
    return np.array([zero, np.cross(axis, zero), axis])


def _half_turn(angles: np.ndarray) -> np.ndarray:
    """Return angles from −π to below π."""
    return (angles + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True)
class ContactPatch:
    """The slave surface projected to a plane or unrolled, and its contact points.

    `flat`: how the surface is made plane; `places`: all nodes of the surface in the
    picture; `pressure`: on all nodes of the surface, interpolated at the corners of quadratic triangles.
    """

    flat: Projection | Unrolling
    name: str
    places: np.ndarray
    facets: np.ndarray
    pressure: np.ndarray
    points: np.ndarray
    status: np.ndarray
    slip: np.ndarray
    normal_forces: NormalForces
    rubs: bool
    hidden: int
    frame: Frame

    @property
    def slips(self) -> np.ndarray:
        """Which contact points slip against friction."""
        return (self.status == Status.SLIP) & self.rubs

    @property
    def behind(self) -> str:
        """What is not shown, "; 12 of 80 closed points face away", or ""."""
        closed = self.hidden + int(np.count_nonzero(self.status != Status.OPEN))
        return f"; {self.hidden} of {closed} closed points face away" if self.hidden else ""

    @property
    def largest_slip(self) -> float:
        """Their largest slip, [length]."""
        return float(np.linalg.norm(self.slip[self.slips], axis=1).max(initial=0.0))


def checked_pair(state: State, pair: int | str) -> int:
    """Return the number of a contact pair, if the scene has one of that number or name."""
    if isinstance(pair, str):
        return pair_number(state.scene.contacts, pair)
    if not 0 <= pair < len(state.scene.contacts):
        raise InvalidInputError(
            f"pair must be below {len(state.scene.contacts)}, got {pair}: draw a scene with contact"
        )
    return pair


def contact_patches(states: Sequence[State], pair: int, reach: float = 0.0) -> list[ContactPatch]:
    """Show the slave surface of a pair in several states alike.

    It is projected to a plane. If facets that face away carry force it is unrolled, provided that it runs
    around an axis.
    """
    patches = [_patch(state, pair, reach, _projection(state, pair)) for state in states]
    hiding = [state for state, patch in zip(states, patches, strict=True) if patch.hidden]
    if not hiding:
        return patches
    behind = hiding[0]
    contact, slave = behind.contact, behind.scene.contacts[pair].slave
    points, chosen = behind.scene.bodies[slave.body].mesh.points, behind.contact.on_pair(pair)
    places, force = behind.contact_places[chosen], contact.normal_force[chosen]
    unrolling = unrolling_of(points, behind.scene.facets(slave), places, force)
    return patches if unrolling is None else [_patch(state, pair, reach, unrolling) for state in states]


def _projection(state: State, pair: int) -> Projection:
    """Return the projection along the mean normal of the contact, or of the surface without forces."""
    chosen = state.contact.on_pair(pair)
    force = state.contact.normal_force[chosen]
    weight = force if float(force.sum()) > 0 else np.ones(len(chosen))
    return Projection(face_on(-weight @ state.contact.points.normal[chosen]))


def _patch(state: State, pair: int, reach: float, flat: Projection | Unrolling) -> ContactPatch:
    """Make the slave surface plane, with its contact points."""
    contact, slave = state.contact, state.scene.contacts[pair].slave
    mesh, facets = state.scene.bodies[slave.body].mesh, state.scene.facets(slave)
    chosen = contact.on_pair(pair)
    node, places, rows = flat.unroll(mesh.points, facets)
    nodes, first = np.unique(node, return_index=True)
    numbers = state.torn.decomposition.tearing.global_nodes(slave.body, nodes)
    seen = np.isin(contact.points.slave[chosen], numbers)
    hidden = int(np.count_nonzero(~seen & (contact.normal_force[chosen] > 0)))
    chosen = chosen[seen]
    points = first[np.searchsorted(numbers, contact.points.slave[chosen])]
    pressure = np.zeros(mesh.n_nodes)
    every, given = contact.points.of_surface(pair, contact.pressure)
    shown = np.isin(every, numbers)
    pressure[nodes[np.searchsorted(numbers, every[shown])]] = given[shown]
    if mesh.hanging:
        of_points = every - state.torn.decomposition.tearing.first_of(slave.body)
        pressure = mesh.hanging.filled_in(pressure, mesh.surfaces[slave.name], of_points)
    if not state.scene.contacts[pair].by_mortar:
        pressure = filled_at_corners(mesh.surfaces[slave.name], pressure)
    pressure = np.maximum(pressure[node], 0.0)
    slip = contact.slip_in_space[chosen]
    return ContactPatch(
        flat, f"{slave.body}, {slave.name}", places, rows, pressure,
        points, contact.status[chosen], flat.turn(slip, mesh.points[node[points]]),
        contact.normal_forces(pair), state.scene.contacts[pair].has_friction, hidden,
        _frame(places[first], pressure[first], contact.points.area[chosen], reach),
    )  # fmt: skip


def _frame(places: np.ndarray, pressure: np.ndarray, area: np.ndarray, reach: float) -> Frame:
    """Return a square around the nodes under pressure with a margin of two facets.

    Unless its size is given, it is limited to slightly more than the surface.
    """
    closed = pressure > 0 if np.any(pressure > 0) else np.ones(len(places), dtype=bool)
    low, high = places[closed].min(axis=0), places[closed].max(axis=0)
    middle = (low + high) / 2
    if reach:
        return Frame(middle - reach, middle + reach)
    half = float(np.max(high - low)) / 2 + 2.5 * float(np.sqrt(area.mean()))
    border = 0.1 * min(half, float(np.ptp(places, axis=0).min()))
    low, high = places.min(axis=0) - border, places.max(axis=0) + border
    return Frame(np.maximum(middle - half, low), np.minimum(middle + half, high))


def viewing_side(axes: Axes, axis: Axis, view: View) -> str:
    """Return how a reversed axis runs and from where it is seen."""
    seen, back = axis_label(view.towards), "to the left" if axis is axes.xaxis else "down"
    return f", runs {back}" + (f": seen from {seen}" if seen else "")


def mirrored(axes: Axes, axis: Axis, view: View) -> str:
    """Turn a reversed horizontal axis, see `viewing_side` for a vertical one."""
    if axis is not axes.xaxis:
        return viewing_side(axes, axis, view)
    axes.invert_xaxis()
    return ""


def label_axes(axes: Axes, view: View, units: Units, turned: Turned = viewing_side) -> None:
    """Label the axes of a view, a reversed one with decreasing numbers and what `turned` returns for it."""
    for axis, direction, word in ((axes.xaxis, view.right, "right"), (axes.yaxis, view.up, "up")):
        name = axis_label(direction)
        label = f"{name.strip('−') or word} ({units.length})"
        if name.startswith("−"):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{0 - value:g}".replace("-", "−")))
            label += turned(axes, axis, view)
        axis.set_label_text(label)


def label_patch(axes: Axes, patch: ContactPatch, units: Units, turned: Turned = viewing_side) -> None:
    """Show the frame of a contact surface with equal scales, and name its axes; see `label_axes`."""
    patch.frame.fit(axes)
    patch.flat.label(axes, units, turned)


def pressure_bar(axes: Axes, clim: tuple[float, float], extend: str, units: Units) -> None:
    """Add a colour bar to the right of axes, of the same height."""
    key, label = ScalarMappable(Normalize(*clim), PRESSURE_MAP), f"contact pressure ({units.stress})"
    place = axes.inset_axes((1.03, 0.0, 0.04, 1.0))
    axes.figure.colorbar(key, cax=place, label=label, extend=extend)


#: Length of the longest arrow, relative to the width.
ARROW = 0.03
#: Largest number of arrows: more would overlap at that length.
MOST_ARROWS = 40


def draw_traction(
    trace: ContactTrace,
    paper: BinaryIO,
    window: tuple[Range, float],
    title: str,
    units: Units,
    width: int,
) -> None:
    """Draw the pressure above and, where friction acts, the tangential traction on the slave below, and wear.

    ``window`` holds the range of the pressure and the extent of the picture, () and 0 for automatic ones.
    """
    (clim, reach), rubs = window, trace.rubs
    facts = f"largest pressure {written(float(trace.pressure.max()))} {units.stress}, "
    names = DerivedUnits.of(units.force, units.length, trace.space)
    facts += trace.normal_forces.in_words(names.force + names.per, written)
    if rubs:
        shear = trace.shear if abs(trace.shear) > ROUNDING * trace.normal_forces.sum else 0.0
        what, unit = (
            ("torque of friction", names.moment) if trace.twists else ("tangential force", names.force)
        )
        facts += f", {what} {written(shear)} {unit}{names.per}"
    top = float(trace.pressure.max()) or 1.0
    count = 1 + rubs + trace.wears
    height = round((0.4 + 0.22 * (count - 1)) * width)
    with sheet(paper, (width, height), headline(title, facts)) as figure:
        rows = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        _curve(rows[0], trace, trace.pressure, BLUE)
        _symbols(rows[0], trace, trace.pressure)
        rows[0].set_ylabel(f"contact pressure ({units.stress})")
        rows[0].set_title(f"pressure on {trace.name}")
        rows[0].set_ylim(*(clim or (-0.05 * top, 1.08 * top)))
        if rubs:
            _draw_friction(rows[1], trace, units)
        if trace.wears:
            _draw_wear(rows[-1], trace, units)
        rows[-1].set_xlabel(f"{trace.axis} ({units.length})")
        rows[-1].set_xlim(*trace.window(reach))
        for axes in rows:
            axes.grid(color=GREY, alpha=0.25)
            axes.yaxis.set_major_locator(MaxNLocator(6))
        handles, labels = rows[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def _draw_wear(axes: Axes, trace: ContactTrace, units: Units) -> None:
    """Draw the worn depth downwards, as the surfaces have lost it."""
    _curve(axes, trace, trace.worn, INK)
    axes.fill_between(trace.broken(trace.places), trace.broken(trace.worn), color=PALE, linewidth=0)
    axes.invert_yaxis()
    axes.set_ylabel(f"worn depth ({units.length})")
    deepest = written(float(trace.worn.max()))
    axes.set_title(f"depth lost by both surfaces since the start, up to {deepest} {units.length}")


def _draw_friction(axes: Axes, trace: ContactTrace, units: Units) -> None:
    places, bound = trace.broken(trace.places), trace.broken(trace.bound)
    axes.fill_between(places, -bound, bound, color=PALE, linewidth=0)
    for side in (-bound, bound):
        axes.plot(places, side, "--", color=INK, lw=1.2)
    _curve(axes, trace, trace.traction, ORANGE)
    _symbols(axes, trace, trace.traction)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set_ylabel(f"tangential traction ({units.stress})")
    slips = trace.status == Status.SLIP
    longest = float(np.abs(trace.slip[slips]).max(initial=0.0))
    if trace.twists:
        axes.set_ylim(bottom=0.0)
        slid = f"largest slip {written(longest, 2)} {units.length}"
        axes.set_title(f"size of the tangential traction, slip bound dashed; {slid}")
        return
    end = ", no slip"
    if longest > 0:
        _draw_slip(axes, trace, longest)
        end = f"; arrows: slip on the master, largest {written(longest, 2)} {units.length}"
    axes.set_title(f"tangential traction on the slave, slip bound dashed{end}")


def _draw_slip(axes: Axes, trace: ContactTrace, longest: float) -> None:
    """Draw slip by arrows, at a subset of the points if these are many."""
    low, high = trace.window()
    places = trace.places[trace.points]
    seen = np.flatnonzero((trace.status == Status.SLIP) & (places >= low) & (places <= high))
    seen = seen[np.argsort(places[seen])][:: max(-(-len(seen) // MOST_ARROWS), 1)]
    lengths = ARROW * trace.slip[seen] / longest
    look = {"angles": "uv", "scale_units": "width", "scale": 1, "width": 0.0022, "minlength": 0.0}
    heights = trace.traction[trace.points[seen]]
    axes.quiver(places[seen], heights, lengths, 0 * lengths, color=INK, zorder=4, **look)


def _curve(axes: Axes, trace: ContactTrace, values: np.ndarray, colour: str) -> None:
    axes.plot(trace.broken(trace.places), trace.broken(values), color=colour, lw=1.8, zorder=2.5)


def _symbols(axes: Axes, trace: ContactTrace, values: np.ndarray) -> None:
    low, high = trace.window()
    seen = int(np.count_nonzero((trace.places > low) & (trace.places < high)))
    size = float(np.clip(60 / max(seen, 1), 0.12, 0.6))
    for status, (name, look) in symbols_of(trace.rubs).items():
        chosen = trace.points[trace.status == status]
        axes.scatter(
            trace.places[chosen],
            values[chosen],
            label=f"{name} ({len(chosen)})",
            zorder=3,
            linewidths=0.6,
            **{**look, "s": size * look["s"]},
        )
