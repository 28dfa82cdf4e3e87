"""Diagrams of curves, and the contact quantities along a plane contact surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    Picture,
    axis_label,
    draw_picture,
    png_path,
    sheet,
)
from fenics_contact.results.contact import NormalForces
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI


#: Abscissas and ordinates of one curve, (n,) each.
Curve: TypeAlias = tuple[Sequence[float] | np.ndarray, Sequence[float] | np.ndarray]

#: Colours and symbols of the series, distinguishable also without colours.
LOOKS = (
    (BLUE, "o"),
    (ORANGE, "^"),
    (GREEN, "s"),
    ("#cc79a7", "D"),
    ("#56b4e9", "v"),
    ("#e69f00", "P"),
)
#: With more points than this a series is drawn as a line.
MOST_SYMBOLS = 90


@naming_arguments
def plot_curves(
    series: Mapping[str, Curve],
    path: str | Path | None = None,
    *,
    xlabel: str,
    ylabel: str,
    reference: Mapping[str, Curve] | None = None,
    connected: bool = False,
    logarithmic: bool | Literal["y"] = False,
    title: str = "",
    width: int = 1200,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw series of points, each in its colour and symbol, on top of dark reference curves.

    Args:
        series: Name -> abscissas and ordinates, computed or measured. NaN leaves a gap.
        xlabel: Label of the abscissas with unit.
        ylabel: Label of the ordinates with unit.
        reference: Name -> abscissas and ordinates of the reference curves.
        connected: Whether to connect the points of a series in their order.
        logarithmic: Whether both axes are logarithmic, for convergence; "y" for the ordinates alone.

    Raises:
        InvalidInputError: If there is nothing to draw, or a curve has different numbers of abscissas and
            ordinates.

    Example:
        >>> shear = {"computed": ([0.0, 1.0], [0.0, 2.0])}
        >>> plot_curves(shear, "shear.png", xlabel="x (mm)", ylabel="q (MPa)")  # doctest: +SKIP
    """
    target = png_path(path)
    shown = {name: _checked(name, curve) for name, curve in series.items()}
    behind = {name: _checked(name, curve) for name, curve in (reference or {}).items()}
    if not shown and not behind:
        raise InvalidInputError("a diagram needs at least one curve, got none: pass series={'name': (x, y)}")

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(0.6 * width)), title) as figure:
            axes = figure.subplots()
            for (name, (x, y)), style in zip(behind.items(), cycle(("-", "--", ":", "-."))):
                axes.plot(x, y, style, color=INK, lw=1.6, label=name, zorder=2)
            for (name, (x, y)), (colour, symbol) in zip(shown.items(), cycle(LOOKS)):
                few = len(x) <= MOST_SYMBOLS
                line, marker = "-" if connected or not few else "none", symbol if few else "none"
                edge = {"ms": 7, "markeredgecolor": "white", "markeredgewidth": 0.6}
                look = {"linestyle": line, "marker": marker, "color": colour, "lw": 2.2, **edge}
                axes.plot(x, y, label=name, zorder=3, **look)
            axes.set(xlabel=xlabel, ylabel=ylabel)
            if logarithmic:
                axes.set_yscale("log")
                axes.set_xscale("linear" if logarithmic == "y" else "log")
            axes.grid(color=GREY, alpha=0.3)
            axes.set_axisbelow(True)
            longest = max(map(len, (*shown, *behind)))
            columns = min(len(shown) + len(behind), max(1, 110 // (longest + 8)))
            figure.legend(loc="outside lower center", ncols=columns)

    return draw_picture(comm, target, draw)


def _checked(name: str, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    x, y = (np.asarray(values, dtype=np.float64) for values in curve)
    if x.ndim != 1 or x.shape != y.shape or not len(x):
        raise InvalidInputError(
            f"curve {name!r} must have one value for each place, got {y.shape} for {x.shape}: match them"
        )
    return x, y


#: A surface whose edges deviate less than this from their mean is shown over a coordinate, else over its
#: length.
STRAIGHT = np.cos(np.radians(60.0))


@dataclass(frozen=True)
class ContactTrace:
    """Contact quantities along the slave surface of a pair in the plane.

    `axis`: label of the positions: "x", "−y", of bodies of revolution "r" and "z", or "along the surface";
    `pressure`: on all nodes, zero where there is no contact point; `traction`: tangential traction on the
    slave in the direction of increasing positions; with torsion its size; `slip`: slip of the contact points
    on the master in the last load step, in the direction of increasing positions, with torsion its size;
    `worn`: depth that both surfaces have lost on all nodes, zero where the pair does not wear, `wears`;
    `shear`: resultant of the traction, with torsion its torque about the axis; `space`: the dimension that
    the scene records, which gives forces their unit.
    """

    name: str
    axis: str
    places: np.ndarray
    breaks: np.ndarray
    pressure: np.ndarray
    traction: np.ndarray
    bound: np.ndarray
    worn: np.ndarray
    points: np.ndarray
    status: np.ndarray
    slip: np.ndarray
    normal_forces: NormalForces
    shear: float
    rubs: bool
    wears: bool
    space: Mapping[str, Any]
    twists: bool = False

    def broken(self, values: np.ndarray) -> np.ndarray:
        """Insert a gap into nodal values where the surface is interrupted."""
        return np.insert(values, self.breaks + 1, np.nan)

    def window(self, reach: float = 0.0) -> tuple[float, float]:
        """Return the visible range of positions, or the given extent around the middle of the closed part.

        It is the closed part with a margin and the open nodes beside it, where the pressure has come to zero.
        """
        closed = np.flatnonzero(self.pressure > 0)
        closed = closed if len(closed) else np.arange(len(self.places))
        low, high = float(self.places[closed].min()), float(self.places[closed].max())
        if reach:
            return (low + high) / 2 - reach, (low + high) / 2 + reach
        room = 0.12 * max(high - low, float(np.ptp(self.places)) / 20)
        before, after = max(closed[0] - 1, 0), min(closed[-1] + 1, len(self.places) - 1)
        low, high = min(low - room, self.places[before]), max(high + room, self.places[after])
        return max(float(low), float(self.places[0])), min(float(high), float(self.places[-1]))


def contact_trace(state: State, pair: int) -> ContactTrace:
    """Unroll the slave surface of a pair of a plane scene."""
    contact, slave = state.contact, state.scene.contacts[pair].slave
    mesh, edges = state.scene.bodies[slave.body].mesh, state.scene.facets(slave)
    order, starts = walk(edges)
    sign = 1.0  # bodies lie left of their surfaces, so that the tangents of points lead forward
    if _runs_backwards(mesh.points[order], starts):
        sign = -1.0
        lengths = np.diff([*starts, len(order)])
        order, starts = order[::-1], np.concatenate([[0], np.cumsum(lengths[::-1])[:-1]])
    axis, places = _unrolled(mesh.points[order], starts)
    if state.scene.axisymmetric:
        axis = axis.replace("x", "r").replace("y", "z")
    numbers = state.torn.decomposition.tearing.global_nodes(slave.body, order)
    chosen = contact.on_pair(pair)
    sorting = np.argsort(numbers)
    points = sorting[np.searchsorted(numbers, contact.points.slave[chosen], sorter=sorting)]
    friction, slip = -sign * contact.friction_force[:, 0], sign * contact.slip[chosen, 0]
    shear = friction[chosen].sum()
    if state.scene.torsion:
        friction = np.linalg.norm(contact.friction_force, axis=1)
        slip = np.linalg.norm(contact.slip[chosen], axis=1)
        shear = -contact.friction_force[chosen, 1] @ mesh.points[order[points], 0]
    values = np.zeros((4, len(order)))
    by_area = np.stack([contact.normal_force, friction, contact.slip_bound]) / contact.area
    every, given = contact.points.of_surface(pair, np.vstack([by_area, contact.worn_depth]).T)
    values[:, sorting[np.searchsorted(numbers, every, sorter=sorting)]] = given.T
    return ContactTrace(
        f"{slave.body}, {slave.name}", axis, places, starts[1:] - 1,
        values[0], values[1], values[2], values[3], points, contact.status[chosen], slip,
        contact.normal_forces(pair), float(shear),
        state.scene.contacts[pair].has_friction, bool(state.scene.contacts[pair].wears),
        state.scene.dimension_record, state.scene.torsion,
    )  # fmt: skip


def walk(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order the nodes of directed edges along the curve; every node begins and ends at most one of them.

    Returns the nodes in order, piece by piece, and the first index of each piece. For a closed curve the
    first node is not repeated.
    """
    nodes, local = np.unique(edges, return_inverse=True)
    local = local.reshape(edges.shape)
    graph = sp.csr_matrix((np.ones(len(edges)), local.T), shape=(len(nodes), len(nodes)))
    count, piece = connected_components(graph, directed=False)
    first = np.ones(len(nodes), dtype=bool)
    first[local[:, 1]] = False
    order = []
    for number in range(count):
        mine = np.flatnonzero(piece == number)
        heads = mine[first[mine]]
        head = int(heads[0]) if len(heads) else int(mine[0])
        order.append(breadth_first_order(graph, head, return_predecessors=False))
    starts = np.cumsum([0, *(len(part) for part in order[:-1])])
    return nodes[np.concatenate(order)], starts


def _steps(points: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vectors from node to node, and which of them lie within a piece."""
    inside = np.ones(len(points) - 1, dtype=bool)
    inside[starts[1:] - 1] = False
    return np.diff(points, axis=0), inside


def _runs_backwards(points: np.ndarray, starts: np.ndarray) -> bool:
    """Whether a surface runs against its dominant axis: bodies lie left of their surfaces."""
    steps, inside = _steps(points, starts)
    total = steps[inside].sum(axis=0)
    return bool(total[int(np.argmax(np.abs(total)))] < 0)


def _unrolled(points: np.ndarray, starts: np.ndarray) -> tuple[str, np.ndarray]:
    """Return the label of the positions along a surface, and the positions."""
    steps, inside = _steps(points, starts)
    length = np.linalg.norm(steps, axis=1)
    unit = steps / np.where(length, length, 1.0)[:, None]
    mean = steps[inside].sum(axis=0)
    mean = mean / max(float(np.linalg.norm(mean)), np.finfo(float).tiny)
    if np.all(unit[inside] @ mean > STRAIGHT):
        return _over_a_coordinate(points, mean)
    return "along the surface", np.concatenate([[0.0], np.cumsum(np.where(inside, length, 0.0))])


def _over_a_coordinate(points: np.ndarray, mean: np.ndarray) -> tuple[str, np.ndarray]:
    """Show a nearly straight surface over x or y if it is parallel to one, else over its direction."""
    axis = int(np.argmax(np.abs(mean)))
    plain = abs(mean[axis]) > np.cos(np.radians(20.0))
    direction = np.eye(2)[axis] if plain else mean
    name = axis_label(np.append(direction, 0.0)) if plain else "along the surface"
    return name, points @ direction
