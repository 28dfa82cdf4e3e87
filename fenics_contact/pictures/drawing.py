"""Drawing of a field on bodies with rigid obstacles, and of the contact at a larger scale."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, singledispatch
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

import numpy as np
import pyvista as pv
from contourpy import contour_generator
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import GivenVector, floats, unit_vector
from fenics_contact._scene.obstacles import MovingObstacle, RigidObstacle, RigidTool
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import (
    AXES,
    GREY,
    IN_PLANE,
    INK,
    PALE,
    Frame,
    Layer,
    Picture,
    Units,
    View,
    add_colour_bar,
    draw_picture,
    frame_around,
    oblique_view,
    render,
    sheet,
    show_image,
    show_view,
)
from fenics_contact.pictures.section import (
    Bodies,
    Spot,
    cells_of,
    draw_cell_edges,
    draw_field,
    draw_outline,
    is_plane,
    moved,
    points_of,
    section_frame,
    section_layers,
    sections_of,
)
from fenics_contact.pictures.unrolled import label_axes
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.revolved import turned_around
from fenics_contact.shapes.combined import placed, simplified
from fenics_contact.shapes.rounded import Box
from fenics_contact.shapes.simple import Cylinder, Plane, Revolved, Sphere, SurfaceShape

if TYPE_CHECKING:
    from mpi4py import MPI


#: A point and a normal: what lies on the side to which it points is cut away.
Clip: TypeAlias = tuple[GivenVector, GivenVector]
#: Samples along each side of a plane picture.
SAMPLES = 400
#: Pieces of a circle.
PIECES = 96
#: Margin of the shown part of a plane around the bodies, relative to their size.
BORDER = 0.06


def obstacles_of(state: OnBodies) -> list[SurfaceShape]:
    """Return the different rigid obstacles of a scene, where they are in a state of it."""
    obstacles: list[RigidObstacle] = []
    for pair in state.geometry.contacts:
        if not pair.between_bodies and pair.obstacle not in obstacles:
            obstacles.append(pair.obstacle)
    return [simplified(_where_it_is(each, state)) for each in obstacles]


@singledispatch
def _where_it_is(obstacle: Any, state: OnBodies) -> SurfaceShape:
    """Return an obstacle where it is in a state. Collective."""
    shape: SurfaceShape = obstacle
    return shape


_where_it_is.register(MovingObstacle, lambda obstacle, state: obstacle.at(state.time))


@_where_it_is.register(RigidTool)
def _(obstacle: RigidTool, state: OnBodies) -> SurfaceShape:
    motion = state.tools()[obstacle.name]
    return tool_at(obstacle.shape, np.array(obstacle.at), motion.rotation, motion.displacement)


def tool_at(
    shape: SurfaceShape, about: np.ndarray, rotation: np.ndarray | float, displacement: np.ndarray
) -> SurfaceShape:
    """Return the shape of a tool that has moved with its point, (dim,), and turned about it, in radians."""
    angle = np.pad(np.atleast_1d(rotation), (3 - np.size(rotation), 0))
    turn = Rotation.from_rotvec(angle).as_matrix()[: len(about), : len(about)]
    return placed(shape, turn, floats(about - turn @ about + displacement))


def turned_shape(shape: SurfaceShape) -> SurfaceShape:
    """Return the shape in space of one over (r, z), turned around the axis of z."""
    match shape:
        case Plane((_, z), (across, along)) if across == 0.0:
            return Plane((0.0, 0.0, z), (0.0, 0.0, along))
        case Sphere((r, z), radius, hollow) if r == 0.0:
            return Sphere((0.0, 0.0, z), radius, hollow)
    return Revolved(shape, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def turned_field(
    bodies: Bodies, values: Mapping[str, np.ndarray], angle: float
) -> tuple[dict[str, pv.UnstructuredGrid], dict[str, np.ndarray]]:
    """Return sections turned around their axis, by an angle in degrees, with their values in every copy."""
    solids = {name: turned_around(body, angle) for name, body in bodies.items()}
    tiled = {}
    for name, own in values.items():
        body, solid = bodies[name], solids[name]
        nodal = len(own) == body.n_points
        copies = solid.n_points // body.n_points if nodal else solid.n_cells // body.n_cells
        tiled[name] = np.tile(own, copies)
    return solids, tiled


def shade_obstacles(axes: Axes, obstacles: list[SurfaceShape], frame: Frame) -> None:
    """Shade the inside of plane obstacles of any shape, where the distance is negative."""
    x, y = (np.linspace(a, b, SAMPLES) for a, b in zip(frame.low, frame.high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    for obstacle in obstacles:
        distance = obstacle.distance(grid.reshape(-1, 2)).reshape(SAMPLES, SAMPLES)
        if distance.min() < 0 < distance.max():
            axes.contourf(x, y, distance, levels=[distance.min(), 0.0], colors=[PALE], zorder=0)
            axes.contour(x, y, distance, levels=[0.0], colors=[GREY], linewidths=1.5, zorder=0.5)


@singledispatch
def outline(shape: Any, points: np.ndarray) -> list[np.ndarray]:
    """Return lines that show an obstacle near bodies, (n, dim) each.

    Of a plane the edge of the part under the bodies, of a sphere three circles, of a cylinder a circle at
    each end of the part near the bodies and four lines between them, of a box the edges of its faces, of
    other shapes in space sections near the bodies.
    """
    return _net(shape, points) if points.shape[1] == 3 else []


outline.register(Plane, lambda shape, points: [_edge(shape, points)])
outline.register(Box, lambda shape, points: _faces(shape) if shape.dim == 3 else [])


@outline.register(Sphere)
def _(shape: Sphere, points: np.ndarray) -> list[np.ndarray]:
    axes = np.eye(len(shape.centre))
    return [
        _circle(np.asarray(shape.centre), (first, second), shape.radius)
        for k, first in enumerate(axes)
        for second in axes[:k]
    ]


@outline.register(Cylinder)
def _(shape: Cylinder, points: np.ndarray) -> list[np.ndarray]:
    axis = np.asarray(shape.axis)
    along = (points - np.asarray(shape.point)) @ axis
    ends = [np.asarray(shape.point) + reach * axis for reach in (along.min(), along.max())]
    across = _across(axis)
    sides = [sign * shape.radius * each for each in across for sign in (1.0, -1.0)]
    circles = [_circle(end, across, shape.radius) for end in ends]
    return circles + [np.stack([end + side for end in ends]) for side in sides]


def _faces(box: Box) -> list[np.ndarray]:
    """Return the closed edges of the flat faces of a box in space, (5, 3) each."""
    half = 0.5 * np.asarray(box.size)
    loop = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    faces = []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for side in (-1.0, 1.0):
            own = np.full((len(loop), 3), side * half[axis])
            own[:, others] = loop * (half[others] - box.radius)
            faces.append(np.asarray(box.centre) + own @ box.directions.T)
    return faces


def _net(shape: SurfaceShape, points: np.ndarray, planes: int = 5, samples: int = 64) -> list[np.ndarray]:
    """Return where planes across each axis cut a shape in space near bodies, (n, 3) each.

    `planes`: number across each axis, evenly over the box around the bodies and a fourth of its size around
    them; `samples`: of the distance along each side of a plane.
    """
    room = 0.25 * float(np.ptp(points, axis=0).max())
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    lines = []
    for axis in range(3):
        across, up = (other for other in range(3) if other != axis)
        sides = [np.linspace(low[other], high[other], samples) for other in (across, up)]
        places = np.empty((planes, samples, samples, 3))
        places[..., across], places[..., up] = np.meshgrid(*sides)
        places[..., axis] = np.linspace(low[axis], high[axis], planes)[:, None, None]
        distance = shape.distance(places.reshape(-1, 3)).reshape(places.shape[:-1])
        for own, at in zip(distance, places[:, 0, 0, axis], strict=True):
            for flat in contour_generator(sides[0], sides[1], own).lines(0.0):
                line = np.full((len(flat), 3), at)
                line[:, [across, up]] = flat
                lines.append(line)
    return lines


def obstacle_layers(
    obstacles: list[SurfaceShape], points: np.ndarray, view: View
) -> tuple[list[Layer], np.ndarray]:
    """Draw the outlines of obstacles in space, and planes as sheets.

    A sheet seen from its free side lies behind all bodies; seen from behind it would hide them. Returns also
    points that the picture should contain.
    """
    layers: list[Layer] = []
    held = [np.zeros((0, 3))]
    for obstacle in obstacles:
        lines = outline(obstacle, points)
        if isinstance(obstacle, Plane):
            held += lines
            if np.asarray(obstacle.normal) @ view.towards > 0.05:
                layers.append(Layer(pv.Quadrilateral(lines[0][:-1]), {"color": PALE, "lighting": False}))
        look = {"color": GREY, "line_width": 3, "lighting": False}
        layers += [Layer(pv.lines_from_points(line), look) for line in lines]
    return layers, np.concatenate(held)


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors perpendicular to a unit vector and to each other."""
    first = np.eye(3)[int(np.argmin(np.round(np.abs(direction), 6)))]
    first = first - (first @ direction) * direction
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)


def _edge(plane: Plane, points: np.ndarray) -> np.ndarray:
    """Return the edge of the part of a plane under the bodies, closed in space, (5, 3) or (2, 2)."""
    normal = np.asarray(plane.normal)
    axes = np.array([[-normal[1], normal[0]]]) if plane.dim == 2 else np.stack(_across(normal))
    flat = (points - np.asarray(plane.point)) @ axes.T
    border = BORDER * float(np.ptp(points, axis=0).max())
    low, high = flat.min(axis=0) - border, flat.max(axis=0) + border
    corners = [low, high] if plane.dim == 2 else [low, (high[0], low[1]), high, (low[0], high[1]), low]
    return np.asarray(plane.point) + np.array(corners) @ axes


def _circle(centre: np.ndarray, axes: tuple[np.ndarray, np.ndarray], radius: float) -> np.ndarray:
    turn = np.linspace(0.0, 2 * np.pi, PIECES + 1)
    return np.asarray(centre + radius * (np.outer(np.cos(turn), axes[0]) + np.outer(np.sin(turn), axes[1])))


@dataclass(frozen=True)
class ColouredField:
    """The content of a picture of a field, apart from the bodies.

    `reach`: extent of details to each side of the contact's centre, 0 if chosen; `axes`: names of the
    coordinates of plane bodies, of bodies of revolution r and z.
    """

    values: Mapping[str, np.ndarray]
    colours: Colormap
    norm: Normalize
    label: str
    headline: str
    scale: float
    reach: float
    units: Units
    width: int
    axes: tuple[str, str] = ("x", "y")

    def on(self, bodies: Mapping[str, pv.UnstructuredGrid]) -> dict[str, pv.UnstructuredGrid]:
        """Return the bodies with the field ``shown``, the values in terms of the colours, 0 to 1."""
        coloured = {}
        for name, body in bodies.items():
            shown = np.ma.filled(self.norm(self.values[name], clip=False), 0.0)
            coloured[name] = body.copy(deep=False)
            data = coloured[name].point_data if len(shown) == body.n_points else coloured[name].cell_data
            data["shown"] = shown
        return coloured

    def add_bar(self, figure: Figure, panels: Iterable[Axes]) -> None:
        """Add a colour bar next to axes; its ends are pointed where values lie beyond."""
        every = np.concatenate([np.ravel(values) for values in self.values.values()])
        low, high = float(np.nanmin(every)), float(np.nanmax(every))
        key = ScalarMappable(self.norm, self.colours)
        add_colour_bar(figure, panels, key, self.label, beyond=(low, high))

    @property
    def of_surfaces(self) -> dict[str, Any]:
        """Keywords of pyvista's ``add_mesh`` for the field ``shown``."""
        return {"scalars": "shown", "cmap": self.colours, "clim": (0.0, 1.0), "n_colors": 256}


#: Half size of the detail of a plane picture, relative to half the length of the closed contact.
REACH = 2.5
#: A detail in the plane that shows more than this fraction of the bodies is omitted.
LARGEST_DETAIL = 0.4
#: Fraction of the width for pictures; the rest is for the colour bar.
WIDE = 0.84

_LOOK = {
    "show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1,
    # Enough ambient light that colours of shaded faces match the bar.
    "ambient": 0.75, "diffuse": 0.28, "smooth_shading": True, "split_sharp_edges": True, "feature_angle": 50,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of the picture, and the function that draws it on matplotlib's axes."""

    frame: Frame
    draw: Callable[[Axes], None]


def draw_field_on_bodies(
    bodies: Bodies,
    field: ColouredField,
    path: Path | None,
    *,
    obstacles: list[SurfaceShape],
    spots: Sequence[Spot] = (),
    clip: Clip | None = None,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw a field on all bodies, with details of a contact in true deformation. Collective on ``comm``.

    `spots`: contacts of which a detail is drawn, in space two sections.
    """
    coloured = field.on(bodies)
    plane = all(map(is_plane, bodies.values()))
    if clip is not None:
        if plane:
            raise InvalidInputError("clip is for bodies in space, these are plane: leave it out")
        coloured = _clipped(coloured, clip)
    parts_of = _in_plane if plane else _in_space
    return draw_picture(
        comm, path, lambda paper: _draw(parts_of(coloured, obstacles, spots, field), paper, field)
    )


def _clipped(bodies: Bodies, clip: Clip) -> dict[str, pv.UnstructuredGrid]:
    """Return what a plane leaves of bodies, its normal pointing to what is cut away."""
    if len(clip) != 2 or np.ndim(clip[0]) != 1:
        raise InvalidInputError(
            f"clip must be (point, normal), got {clip!r}: at y = 2 ((0, 2, 0), (0, -1, 0))"
        )
    point, towards = clip
    normal = unit_vector("the normal of clip", towards, 3)
    if len(point) != 3 or not np.isfinite(point).all():
        raise InvalidInputError(f"the point of clip must be three finite numbers, got {point!r}")
    parts = {name: body.clip(normal=normal, origin=point) for name, body in bodies.items()}
    kept = {name: part for name, part in parts.items() if part.n_cells}
    if not kept:
        raise InvalidInputError(
            f"clip leaves nothing of the bodies, got {point!r} and {towards!r}: reverse the normal"
        )
    return kept


def _draw(parts: Sequence[_Part], paper: BinaryIO, field: ColouredField) -> None:
    """Place details below the main part, or beside it where that is not wide."""
    main, *details = parts
    beside = len(details) == 1 and main.frame.proportion < 2.2
    rows = [[*parts]] if beside or not details else [[main], details]
    wide = [part.frame.proportion for part in rows[-1]]
    high = [min(WIDE / sum(part.frame.proportion for part in row), 0.5) for row in rows]
    height = round(float(np.clip(sum(high) + 0.09 * len(rows), 0.3, 1.3)) * field.width)
    names = [[str(parts.index(part)) for part in row] for row in rows]
    names[0] *= len(wide) // len(names[0])
    with sheet(paper, (field.width, height), field.headline) as figure:
        panels = figure.subplot_mosaic(names, width_ratios=wide, height_ratios=high)
        for number, part in enumerate(parts):
            part.draw(panels[str(number)])
        if field.label:
            field.add_bar(figure, panels.values())


def _in_plane(
    bodies: Bodies, obstacles: list[SurfaceShape], spots: Sequence[Spot], field: ColouredField
) -> list[_Part]:
    """All bodies, and the contact if it is small."""
    everything = moved(bodies, field.scale)
    frame = frame_around(IN_PLANE, points_of(everything), 0.04)
    parts = [_Part(frame, partial(_draw_plane, everything, obstacles, frame, field, ""))]
    for spot in spots:
        half = field.reach or REACH * spot.radius
        detail = Frame(spot.centre - half, spot.centre + half)
        if 2 * half < LARGEST_DETAIL * float(np.max(frame.size)) / 1.08:
            words, true = "where they touch; displacement × 1", moved(bodies, 1.0)
            parts.append(_Part(detail, partial(_draw_plane, true, obstacles, detail, field, words)))
    return parts


def _draw_plane(
    bodies: Bodies, obstacles: list[SurfaceShape], frame: Frame, field: ColouredField, title: str, axes: Axes
) -> None:
    shade_obstacles(axes, obstacles, frame)
    look = {"cmap": field.colours, "vmin": 0.0, "vmax": 1.0}
    for body in bodies.values():
        points, cells = np.asarray(body.points)[:, :2], cells_of(body)
        draw_field(axes, points, cells, np.asarray(body["shown"]), look)
        draw_cell_edges(axes, points, cells, frame)
        draw_outline(axes, points, cells)
    unit = field.units.length
    across, up = field.axes
    axes.set(title=title, xlabel=f"{across} ({unit})", ylabel=f"{up} ({unit})")
    frame.fit(axes)


def _in_space(
    bodies: Bodies, obstacles: list[SurfaceShape], spots: Sequence[Spot], field: ColouredField
) -> list[_Part]:
    """All bodies, and two sections through the contact on axes of their own."""
    everything = moved(bodies, field.scale)
    points = points_of(everything)
    view = oblique_view(points)
    layers, corners = obstacle_layers(obstacles, points, view)
    for body in everything.values():
        layers.append(Layer(body.extract_surface(algorithm=None), {**field.of_surfaces, **_LOOK}))
    frame = frame_around(view, np.concatenate([points, corners]))
    # room for the directions of the axes
    frame = Frame(frame.low - [AXES / 2 * float(np.sqrt(np.prod(frame.size))), 0.0], frame.high)
    image = render(layers, view, frame, round(field.width * WIDE), axes=True)
    details = (_sections(moved(bodies, 1.0), spot, view, field) for spot in spots)
    return [_Part(frame, partial(show_view, image=image, frame=frame)), *chain.from_iterable(details)]


def _sections(bodies: Bodies, spot: Spot, main: View, field: ColouredField) -> Iterator[_Part]:
    """Render two sections through a contact, to be shown on axes with coordinates."""
    for section in sections_of(spot, main):
        frame = section_frame(section.view, spot, points_of(bodies), field.reach)
        layers = section_layers(bodies, section, field.of_surfaces)
        image = render(layers, section.view, frame, field.width // 2)
        title = f"{section.title(frame, field.units.length)}\ndisplacement × 1"
        yield _Part(frame, partial(_draw_section, image, frame, title, section.view, field.units))


def _draw_section(image: np.ndarray, frame: Frame, title: str, view: View, units: Units, axes: Axes) -> None:
    show_image(axes, image, frame, title)
    label_axes(axes, view, units)
