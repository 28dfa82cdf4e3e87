"""Pictures of states: stress, error, any field, contact pressure and status; and of subdomains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm, Normalize

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import counted
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import (
    ERROR_MAP,
    GREY,
    INK,
    MAPS,
    PALE,
    PRESSURE_MAP,
    STRESS_MAP,
    Picture,
    Range,
    Units,
    checked_factor,
    checked_range,
    checked_reach,
    draw_picture,
    headline,
    nice_number,
    png_path,
    sheet,
    symbols_of,
    written,
)
from fenics_contact.pictures.curves import contact_trace
from fenics_contact.pictures.drawing import (
    Clip,
    ColouredField,
    draw_field_on_bodies,
    obstacles_of,
    turned_field,
    turned_shape,
)
from fenics_contact.pictures.section import (
    Bodies,
    Spot,
    cells_cut,
    chosen_bodies,
    component,
    contact_places,
    draw_field,
    drawn_bodies,
    field_entries,
    lengths,
    linear,
    moved,
    nodal,
    points_of,
    range_of,
    rounded_up,
    strongest_contact,
)  # fmt: skip
from fenics_contact.pictures.unrolled import (
    ContactPatch,
    checked_pair,
    contact_patches,
    draw_traction,
    label_patch,
    mirrored,
    pressure_bar,
)
from fenics_contact.results.fields import in_space
from fenics_contact.results.linear_state import as_linear
from fenics_contact.results.multi_block import body_grid
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.revolved import check_turned
from fenics_contact.results.state import State
from fenics_contact.shapes.simple import SurfaceShape

if TYPE_CHECKING:
    from mpi4py import MPI


def axes_of(scene: Scene) -> tuple[str, str]:
    """Return the names of the coordinates of plane bodies."""
    first, second, *_ = scene.kinematics.axes
    return first, second


@naming_arguments
def plot_decomposition(
    scene: Scene,
    partitions: Mapping[str, np.ndarray],
    path: str | Path | None = None,
    *,
    explode: float = 0.0,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the subdomains of all bodies in twenty colours by turns.

    Args:
        scene: The bodies.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        explode: Shrinkage of each subdomain towards its centre, from 0 (whole bodies) to below 1.

    Raises:
        InvalidInputError: If a partition does not fit its body or ``explode`` is out of range.
    """
    target = png_path(path)
    if not 0.0 <= explode < 1.0:
        raise InvalidInputError(f"explode must be at least 0 and below 1, got {explode}: try 0.1")
    for name, body in scene.deforming.items():
        shape = np.shape(partitions[name]) if name in partitions else "none"
        if shape != (body.mesh.n_cells,):
            raise InvalidInputError(
                f"partitions[{name!r}] must have shape ({body.mesh.n_cells},), got {shape}: give that of the "
                "cut"
            )
    bodies: dict[str, pv.UnstructuredGrid] = {}
    count = 0
    for name, body in scene.deforming.items():
        mesh, numbers = body.mesh.linear, np.unique(partitions[name], return_inverse=True)[1]
        grid = body_grid(mesh, in_space(mesh.points))
        grid.cell_data["subdomain"] = count + numbers[body.mesh.cells_cut]
        bodies[name] = _shrunk(grid, 1.0 - explode) if explode else grid
        count += int(numbers.max()) + 1
    total = written(sum(body.mesh.n_cells for body in scene.deforming.values()))
    facts = f"{counted(count, 'subdomain')} of {counted(len(bodies), 'body', 'bodies')}, {total} cells"
    colours = colormaps["tab20"]
    values = {name: np.asarray(body["subdomain"]) % colours.N for name, body in bodies.items()}
    norm = Normalize(-0.5, colours.N - 0.5)
    words, named = headline(title, facts), units or Units()
    axes = axes_of(scene)
    field = ColouredField(values, colours, norm, "", words, 1.0, 0.0, named, width, axes)
    return draw_field_on_bodies(bodies, field, target, obstacles=[], comm=comm)


def _shrunk(grid: pv.UnstructuredGrid, factor: float) -> pv.UnstructuredGrid:
    """Return the subdomains of a body, each scaled about its centre."""
    parts = list(grid.split_values(scalars="subdomain"))
    for part in parts:
        centre = part.points.mean(axis=0)
        part.points = centre + factor * (part.points - centre)
    return pv.merge(parts, merge_points=False)


#: Apparent size of the largest displacement relative to the bodies.
VISIBLE = 0.03
#: The colours end at this quantile of the cells, as the peak under a contact would leave the rest in one
#: shade.
QUANTILE = 0.995


@naming_arguments
def plot_stress(
    state: State,
    path: str | Path | None = None,
    *,
    clim: tuple[float, float] | None = None,
    scale: float | None = None,
    sections: bool = True,
    reach: float | None = None,
    smooth: bool = True,
    revolved: float = 0.0,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw the von Mises stress on the deformed bodies. Collective.

    Below, two sections through the centre of the strongest contact, in true deformation: with magnified
    displacement bodies would overlap in contact. Plane bodies are shown in their plane, with a detail of the
    contact if it is small. Rigid obstacles are shaded in the plane; in space planes are shown as sheets,
    spheres, cylinders and boxes by their outlines, others by sections near the bodies.

    Args:
        state: The state.
        clim: Range of the colours, [force / length²]; from zero to the 99.5 % quantile unless given. Give two
            pictures the same range to compare them.
        scale: Factor of the displacement in the upper picture; chosen and stated unless given, 1 where there
            are rigid obstacles.
        sections: Whether to draw the sections, if a contact carries force.
        reach: How far sections reach up and down from the contact's middle, [length]; chosen unless given.
        smooth: Whether to show nodal means instead of cell values.
        revolved: Angle in degrees by which bodies of revolution are turned around their axis, such as 270, in
            space and without details of the contact; 0 shows the section.

    Raises:
        InvalidInputError: If an option or the name of the file cannot be used, or other bodies are to be
            turned.

    Example:
        >>> plot_stress(state, "output/stress.png", clim=(0, 400), scale=50)  # doctest: +SKIP
        >>> plot_stress(state)  # in a notebook  # doctest: +SKIP
    """
    target, around = png_path(path), checked_reach(reach)
    given = checked_range(clim)
    if revolved:
        check_turned(revolved, state.scene.axisymmetric)
    bodies, obstacles = drawn_bodies(state), obstacles_of(state)
    # With magnified displacement bodies would penetrate rigid obstacles.
    chosen = 1.0 if obstacles else chosen_scale(bodies)
    factor = chosen if scale is None else checked_factor("scale", scale)
    by_cell, named = np.concatenate([body["von_mises"] for body in bodies.values()]), units or Units()
    facts = f"von Mises stress, largest mean over a cell {written(float(by_cell.max()))} {named.stress}"
    values = {
        name: nodal(body, "von_mises") if smooth else body["von_mises"] for name, body in bodies.items()
    }
    norm = Normalize(*(given or (0.0, rounded_up(float(np.quantile(by_cell, QUANTILE))))))
    words = headline(title, f"{facts}; displacement × {factor:g}")
    label = f"von Mises stress ({named.stress})"
    axes = axes_of(state.scene)
    coloured = ColouredField(values, STRESS_MAP, norm, label, words, factor, around, named, width, axes)
    spots = contact_spots(state, bodies) if sections and not revolved else []
    if revolved:
        bodies, coloured, obstacles = _turned(bodies, coloured, obstacles, revolved)
    return draw_field_on_bodies(
        bodies, coloured, target, obstacles=obstacles, spots=spots, comm=state.torn.decomposition.comm
    )


@naming_arguments
def plot_field(
    result: OnBodies | Bodies,
    field: str | Mapping[str, np.ndarray] = "von_mises",
    path: str | Path | None = None,
    *,
    bodies: Sequence[str] | None = None,
    scale: float = 1.0,
    clim: tuple[float, float] | None = None,
    clip: Clip | None = None,
    revolved: float = 0.0,
    label: str = "",
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw any field of bodies: one of a state or of a file of results, or values of your own.

    Of a state it is collective, and its rigid obstacles are drawn, too.

    Args:
        result: A state; or name -> body with its fields, as from `State.to_pyvista` or a file.
        field: Name of a field as in the file, with the name of a component for stresses, as in "stress_xx"
            and "principal_stress_1", and for vectors, as in "displacement_x". Or values of your own, name of
            a body -> one for each node, (n_nodes,), or cell, (n_cells,), or for the Gauss points of each
            cell, (n_cells, n_gauss), which are drawn as their means; other bodies are left out.
        bodies: Names of the bodies to draw; all that have the field unless given.
        scale: Factor of the displacement; 0 for the undeformed bodies.
        clim: Range of the colours; chosen unless given.
        clip: A point and a normal, of bodies in space: what lies on the side to which the normal points,
            before deformation, is cut away.
        revolved: Angle in degrees by which bodies of revolution of a state are turned around their axis, such
            as 270; 0 shows the section. Components stay those of the section.
        label: Words for a field of your own, with its unit.

    Raises:
        InvalidInputError: If there is no such field or body, values do not fit, the cut leaves nothing, other
            bodies are to be turned, or an option or the name of the file cannot be used.

    Example:
        >>> plot_field(state, "displacement_z", "lift.png", bodies=["lid"])  # doctest: +SKIP
        >>> used = {"pin": state.gather_von_mises("pin") / 235.0}  # doctest: +SKIP
        >>> plot_field(state, used, clip=((0, 0, 0), (0, 1, 0)), label="share of yield")  # doctest: +SKIP
    """
    target, state = png_path(path), result if isinstance(result, OnBodies) else None
    named = units or Units(**(state.unit_names if state else {}))
    checked_factor("scale", scale)
    given = checked_range(clim)
    if revolved:
        check_turned(revolved, state is not None and state.geometry.axisymmetric)
    every: Bodies = drawn_bodies(result) if isinstance(result, OnBodies) else result
    known = [name for name in every if isinstance(field, str) or name in field]
    chosen = chosen_bodies(every, known if bodies is None else bodies)
    drawn = {name: linear(name, body) for name, body in chosen.items()}
    if isinstance(field, str):
        values, entry = _named_field(drawn, field, named)
    else:
        meshes = state.geometry.bodies if state else {}
        cells = {k: meshes[k].mesh.cells_cut if state else cells_cut(k, body) for k, body in chosen.items()}
        values, entry = _own_field(drawn, cells, field, label)
    if revolved and ", " in entry["label"]:  # x, y, z in space are others than r, z and the way around
        entry = {**entry, "label": f"{entry['label']} of the section"}
    is_status = entry["colours"] == "status"
    ends = (-1.0, 2.0) if is_status else entry["extremes"][0] or (0.0, 0.0)
    words = f"{entry['label']} ({entry['unit']})" if entry["unit"] else entry["label"]
    facts = f"{entry['label']}, {written(ends[0])} to {written(ends[1])} {entry['unit']}".rstrip()
    colours = MAPS[entry["colours"]]
    norm = Normalize(*(given or (ends if is_status else entry["range"])))
    if any("displacement" in body.point_data for body in drawn.values()):
        facts = f"{facts}; displacement × {scale:g}"
    head = headline(title, facts)
    axes = axes_of(state.geometry) if state else ("x", "y")
    coloured = ColouredField(values, colours, norm, words, head, float(scale), 0.0, named, width, axes)
    obstacles = obstacles_of(state) if state else []
    if revolved:
        drawn, coloured, obstacles = _turned(drawn, coloured, obstacles, revolved)
    return draw_field_on_bodies(
        drawn,
        coloured,
        target,
        obstacles=obstacles,
        clip=clip,
        comm=state.comm if state else None,
    )


def _turned(
    bodies: Bodies, field: ColouredField, obstacles: list[SurfaceShape], angle: float
) -> tuple[dict[str, pv.UnstructuredGrid], ColouredField, list[SurfaceShape]]:
    """Return what is to be drawn turned around the axis, by an angle in degrees."""
    solids, values = turned_field(bodies, field.values, angle)
    return solids, replace(field, values=values), [turned_shape(shape) for shape in obstacles]


def _named_field(bodies: Bodies, field: str, units: Units) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return the values of a field by body, and what is known of it."""
    entries = {entry["name"]: entry for entry in field_entries([bodies], units)}
    if field not in entries:
        raise InvalidInputError(f"field must be one of {', '.join(entries)}, got {field!r}: choose one")
    return {name: component(body, entries[field]) for name, body in bodies.items()}, entries[field]


def _own_field(
    bodies: Bodies, cells: Mapping[str, np.ndarray], field: Mapping[str, np.ndarray], label: str
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return given values by body, for each node or drawn cell, and their range.

    `cells`: the cell of the mesh that each drawn cell is a piece of, ascending.
    """
    values, extremes = {}, list[float]()
    for name, body in bodies.items():
        own = np.asarray(field[name], dtype=float) if name in field else np.zeros(0)
        nodal, count = own.shape == (body.n_points,), int(cells[name].max(initial=-1)) + 1
        if not nodal and (own.ndim not in (1, 2) or len(own) != count):
            raise InvalidInputError(
                f"values on {name!r} must be one for each of {body.n_points} nodes or {count} cells, or a "
                f"row of Gauss points for each cell, got shape {own.shape}: use the mesh of the body"
            )
        if not np.isfinite(own).any():
            raise InvalidInputError(f"values on {name!r} must be finite somewhere: leave this body out")
        extremes += [float(np.nanmin(own)), float(np.nanmax(own))]
        means = own.mean(axis=1) if own.ndim == 2 else own
        values[name] = means if nodal else means[cells[name]]
    drawn = np.concatenate(list(values.values()))
    return values, {"label": label or "given values", "unit": "", **range_of([drawn], [extremes])}


def contact_spots(state: State, bodies: Bodies) -> list[Spot]:
    """Return the strongest contact of a state, none if no contact carries force."""
    if not np.any(state.contact.normal_force > 0):
        return []
    return [strongest_contact(state.contact, contact_places(state, moved(bodies, 1.0)))]


def chosen_scale(bodies: Bodies) -> float:
    """Return the round factor, at least 1, that makes the displacement visible."""
    largest = max((float(lengths(body).max()) for body in bodies.values()), default=0.0)
    extent = float(np.ptp(points_of(bodies), axis=0).max())
    return max(1.0, nice_number(VISIBLE * extent / largest)) if largest > 0 else 1.0


#: Smallest lower end of the colours relative to their upper end: smaller errors do not matter.
SPAN = 1e-4


@naming_arguments
def plot_error(
    state: State,
    path: str | Path | None = None,
    by_cell: Mapping[str, np.ndarray] | None = None,
    *,
    clim: tuple[float, float] | None = None,
    sections: bool = True,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw each cell's part of the discretisation error, on a logarithmic scale. Collective.

    The squares of the cells' parts, relative to the energy norm √(uᵀK u) of the displacement, add up to the
    square of the relative error in the title. An efficient mesh shows a uniform colour; dark cells should be
    refined. Bodies are shown in true deformation, with sections through the strongest contact as in
    `plot_stress`.

    Args:
        state: The state.
        by_cell: Body name -> part of each cell relative to that norm, shape (n_cells,); estimated unless
            given, see `LinearState.estimate_errors`.
        clim: Range of the colours, positive; up to the largest part and down to a ten thousandth of it, or
            the smallest, unless given. Give two pictures the same range to compare them.
        sections: Whether to draw the sections, if a contact carries force.
        reach: How far sections reach up and down from the contact's middle, [length]; chosen unless given.

    Raises:
        InvalidInputError: If the number of parts is not that of the cells, materials are nonlinear and none
            are given, or an option or the name of the file cannot be used.
    """
    target, around = png_path(path), checked_reach(reach)
    given = checked_range(clim)
    if given and given[0] <= 0:
        raise InvalidInputError(f"clim of a logarithmic scale must be positive, got {clim}: try (1e-5, 1e-2)")
    if by_cell is None:
        errors = as_linear(state, "errors").estimate_errors(geometry=False)
        by_cell = {name: errors.by_cell(name) for name in state.scene.deforming}
    parts = {name: _checked(name, body.mesh.n_cells, by_cell) for name, body in state.scene.deforming.items()}
    every = np.concatenate(list(parts.values()))
    total, top = float(np.linalg.norm(every)), float(every.max()) or 1.0
    ends = given or (min(max(float(every.min()), SPAN * top), top / 10), top)
    facts = f"estimated discretisation error {written(100 * total, 3)} % in energy norm, by cell"
    bodies, named = drawn_bodies(state), units or Units()
    shown = {name: part[state.scene.bodies[name].mesh.cells_cut] for name, part in parts.items()}
    words, label = headline(title, facts), "part of a cell, relative"
    colours, axes = (ERROR_MAP, LogNorm(*ends)), axes_of(state.scene)
    coloured = ColouredField(shown, *colours, label, words, 1.0, around, named, width, axes)
    spots = contact_spots(state, bodies) if sections else []
    comm = state.torn.decomposition.comm
    return draw_field_on_bodies(
        bodies, coloured, target, obstacles=obstacles_of(state), spots=spots, comm=comm
    )


def _checked(name: str, cells: int, by_cell: Mapping[str, np.ndarray]) -> np.ndarray:
    part = np.asarray(by_cell[name], dtype=np.float64) if name in by_cell else np.zeros(0)
    if part.shape != (cells,) or not np.all(np.isfinite(part) & (part >= 0)):
        smallest = f", the smallest {part.min()}" if part.size else ""
        raise InvalidInputError(
            f"by_cell[{name!r}] must hold {cells} numbers of at least 0, one a cell, got "
            f"{f'shape {part.shape}{smallest}' if name in by_cell else 'none'}: give that of an estimate"
        )
    return part


#: Length of the longest arrow, relative to the map.
ARROW = 0.07
#: Largest number of maps in a row.
COLUMNS = 3


@naming_arguments
def plot_contact_status(
    states: State | Mapping[str, State],
    path: str | Path | None = None,
    *,
    pair: int | str = 0,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw where a contact pair is open, sticks and slips, in one map for each state. Collective.

    Arrows show the slip on the master in the last load step. The surface is seen from the master's side, or
    from inside the slave if the axes then run to the right.

    Args:
        states: A state of a scene in space, or name -> state, for instance after each load step.
        pair: Number of the contact pair in the scenes, or its name: its slave, or both surfaces.
        reach: How far a map reaches around the contact's middle, [length]; chosen unless given.

    Raises:
        InvalidInputError: If there is no state, one has no such pair, or one is plane.
    """
    target, around = png_path(path), checked_reach(reach)
    if not isinstance(states, Mapping):
        states = {"": states}
    if not states:
        raise InvalidInputError("maps of the status need a state, got none: pass one, or {'name': state}")
    if isinstance(pair, str):
        pair = checked_pair(next(iter(states.values())), pair)
    for name, state in states.items():
        if state.scene.dim == 2 or not 0 <= pair < len(state.scene.contacts):
            raise InvalidInputError(
                f"plot_contact_status needs states in space with contact pair {pair}, got {name!r}: in the "
                "plane use plot_contact_pressure"
            )
    comm = next(iter(states.values())).torn.decomposition.comm

    def draw(paper: BinaryIO) -> None:
        patches = dict(zip(states, contact_patches(list(states.values()), pair, around), strict=True))
        _draw_status(patches, paper, title or next(iter(patches.values())).name, units or Units(), width)

    return draw_picture(comm, target, draw)


def _draw_status(
    patches: Mapping[str, ContactPatch], paper: BinaryIO, title: str, units: Units, width: int
) -> None:
    columns = min(COLUMNS, len(patches))
    rows = -(-len(patches) // columns)
    proportion = next(iter(patches.values())).frame.proportion
    height = round((0.09 + rows * (0.09 + 0.9 / (proportion * columns))) * width)
    with sheet(paper, (width, height), title) as figure:
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        tips = []
        for axes, (name, patch) in zip(panels, patches.items(), strict=False):
            tips.append(draw_status(axes, patch, counted=False))
            axes.set_title(_words(patch, units) if not name else f"{name}\n{_words(patch, units)}")
            label_patch(axes, patch, units, mirrored)
        every, (low, high) = np.concatenate(tips), panels[0].get_ylim()
        panels[0].set_ylim(every.min(initial=low), every.max(initial=high))  # arrows do not reach into titles
        for axes in panels[len(patches) :]:
            axes.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def _words(patch: ContactPatch, units: Units) -> str:
    longest, slips = patch.largest_slip, patch.slips
    share = f"{np.count_nonzero(slips)} of {len(slips)} slip"
    words = f"{share}, by up to {written(longest, 2)} {units.length}" if longest > 0 else "none slips"
    return words + patch.behind


def draw_status(axes: Axes, patch: ContactPatch, *, counted: bool = True) -> np.ndarray:
    """Draw projected facets, symbols on contact points, arrows for slip; return how high their tips are."""
    axes.add_collection(PolyCollection(patch.places[patch.facets], facecolors=PALE, edgecolors="white"))
    places = patch.places[patch.points]
    for status, (name, look) in symbols_of(patch.rubs).items():
        chosen = patch.status == status
        label = f"{name} ({np.count_nonzero(chosen)})" if counted else name
        axes.scatter(*places[chosen].T, label=label, zorder=3, linewidths=1.0, **look)
    longest = patch.largest_slip
    if longest > 0:
        # On wide strips arrows and their heads follow the height.
        slender = min(1.0, 3.0 / patch.frame.proportion)
        reach = ARROW * slender * float(np.max(patch.frame.size)) / longest
        arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "color": INK, "zorder": 4}
        arrows["width"] = 0.004 * slender
        # Short arrows stay arrows, as dots would hide the symbols.
        arrows |= {"minlength": 0.0}
        shown = patch.slips & patch.frame.holds(places)
        drawn = axes.quiver(*places[shown].T, *(reach * patch.slip[shown]).T, clip_on=False, **arrows)
        drawn.set_in_layout(False)  # its extent is not known before it is drawn
        return np.asarray((places[shown] + reach * patch.slip[shown])[:, 1])
    return np.zeros(0)


#: Surfaces wider than this relative to their height are drawn one above the other.
WIDE = 2.5


@naming_arguments
def plot_contact_pressure(
    state: State,
    path: str | Path | None = None,
    *,
    pair: int | str = 0,
    clim: tuple[float, float] | None = None,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw a contact pair's slave surface seen from its master. Collective.

    Left, or above, the nodal pressure, then the status of the points with the direction of slip on the
    master. A surface around an axis that carries force on sides facing away, such as a bore, is unrolled; of
    others the title says how many closed points are not seen. For a plane scene the pressure along the slave
    surface, below it the tangential traction on the slave between its bounds, with the status of the points;
    where the pair wears last the depth that it has lost. In space that is the field ``contact_worn_depth``.

    Args:
        state: The state.
        pair: Number of the contact pair in the scene, or its name: its slave, or both surfaces.
        clim: Range of the pressure, [force / length²]; from zero to the largest pressure unless given. Give
            two pictures the same range to compare them.
        reach: How far the picture reaches around the contact's middle, [length]; chosen unless given.

    Raises:
        InvalidInputError: If the scene has no such pair, or a range or the name of the file cannot be used.
    """
    target, number = png_path(path), checked_pair(state, pair)
    around = checked_reach(reach)
    given = checked_range(clim)
    named = units or Units()

    def draw(paper: BinaryIO) -> None:
        if state.scene.dim == 2:
            draw_traction(contact_trace(state, number), paper, (given, around), title, named, width)
        else:
            _draw_pressure(contact_patches([state], number, around)[0], paper, given, title, named, width)

    return draw_picture(state.torn.decomposition.comm, target, draw)


def _draw_pressure(
    patch: ContactPatch,
    paper: BinaryIO,
    clim: Range,
    title: str,
    units: Units,
    width: int,
) -> None:
    peak = float(patch.pressure.max())
    shown = clim or (0.0, peak or 1.0)
    forces = patch.normal_forces.in_words(units.force, written)
    facts = f"largest pressure {written(peak)} {units.stress}, {forces}"
    wide = patch.frame.proportion > WIDE
    tall = 0.24 + 1.76 / patch.frame.proportion if wide else 0.19 + 0.38 / patch.frame.proportion
    with sheet(paper, (width, round(tall * width)), headline(title, facts)) as figure:
        left, right = figure.subplots(*((2, 1) if wide else (1, 2)), sharex=True, sharey=True)
        draw_pressure(left, patch, shown)
        pressure_bar(left, shown, "max" if peak > shown[1] else "neither", units)
        draw_status(right, patch)
        longest = f"{written(patch.largest_slip, 2)} {units.length}"
        slip = f"largest slip {longest}" if patch.largest_slip > 0 else "no slip"
        right.set_title(f"status, {slip if patch.rubs else 'no friction'}{patch.behind}")
        for axes in (left, right):
            label_patch(axes, patch, units)
        (left.set_xlabel if wide else right.set_ylabel)("")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def draw_pressure(axes: Axes, patch: ContactPatch, clim: tuple[float, float]) -> None:
    """Draw the pressure on projected facets."""
    look = {"cmap": PRESSURE_MAP, "vmin": clim[0], "vmax": clim[1]}
    draw_field(axes, patch.places, patch.facets, patch.pressure, look)
    outlines = {"facecolors": "none", "edgecolors": GREY, "linewidths": 0.5}
    axes.add_collection(PolyCollection(patch.places[patch.facets], **outlines))
    axes.set_title(f"pressure on {patch.name}")
