"""Bodies as they are drawn: their fields with units and ranges, plane drawings, sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pyvista as pv
import scipy.sparse as sp
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.collapsed import SHAPES
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.pictures.canvas import (
    INK,
    Frame,
    Layer,
    Units,
    View,
    axis_label,
    frame_around,
    looking_along,
)
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.fields import STRESS_COMPONENTS
from fenics_contact.results.multi_block import hanging_of, vtk_nodes
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.state import State

#: Drawn bodies by name.
Bodies = Mapping[str, pv.UnstructuredGrid]
Drawn = TypeVar("Drawn")


def drawn_bodies(state: OnBodies) -> dict[str, pv.UnstructuredGrid]:
    """Return the undeformed bodies, with linear cells and all fields. Collective."""
    blocks = state.to_pyvista(linear=True)
    return {name: blocks[name] for name in blocks.keys()}


def chosen_bodies(bodies: Mapping[str, Drawn], names: Sequence[str]) -> dict[str, Drawn]:
    """Return the bodies of these names."""
    if isinstance(names, str) or not names or not set(names) <= set(bodies):
        raise InvalidInputError(f"bodies must be some of {list(bodies)}, got {names!r}: list their names")
    return {name: bodies[name] for name in names}


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
    body = of_one_type(body)
    if body.n_cells == 0 or len(np.unique(body.celltypes)) != 1:
        raise InvalidInputError(
            f"cells of {name!r} must be of one type, got {len(np.unique(body.celltypes))}"
        )
    dim, cells = 2 if is_plane(body) else 3, cells_of(body)
    kind = cell_type_of(cells, dim)
    if kind.order == 1:
        return cells, 1, dim
    return cells[:, kind.pieces].reshape(-1, kind.pieces.shape[1]), len(kind.pieces), dim


def cells_cut(name: str, body: pv.UnstructuredGrid) -> np.ndarray:
    """Return the cell of a body that each cell of `linear` is a piece of, ascending."""
    return np.repeat(np.arange(body.n_cells), linear_cells(name, body)[1])


#: Shape of the linear cell at the corners of VTK's types of cells.
_SHAPE_OF = {
    5: "triangle", 22: "triangle", 9: "quadrilateral", 23: "quadrilateral", 28: "quadrilateral",
    10: "tetrahedron", 24: "tetrahedron", 12: "hexahedron", 25: "hexahedron", 29: "hexahedron",
    13: "prism", 26: "prism", 32: "prism", 14: "pyramid", 27: "pyramid",
}  # fmt: skip


def of_one_type(body: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """Return a body of several shapes of cells with hexahedra (quadrilaterals) at their corners.

    All fields are kept. Others are returned as they are.
    """
    types = np.asarray(body.celltypes)
    several = len(np.unique(types)) > 1 or np.isin(types, (13, 14, 26, 27, 32)).any()
    if not several or not np.isin(types, list(_SHAPE_OF)).all():
        return body
    dim = 2 if is_plane(body) else 3
    nodes, starts = (
        np.asarray(pv.convert_array(each))
        for each in (body.GetCells().GetConnectivityArray(), body.GetCells().GetOffsetsArray())
    )
    cells = np.empty((len(types), 2**dim), dtype=np.int64)
    for number in np.unique(types):
        mine = np.flatnonzero(types == number)
        shape = SHAPES[_SHAPE_OF[int(number)]]
        onto = vtk_nodes(shape.name, shape.corners)[np.array(shape.onto)]
        cells[mine] = nodes[starts[mine][:, None] + onto]
    kind = pv.CellType.QUAD if dim == 2 else pv.CellType.HEXAHEDRON
    found = pv.UnstructuredGrid({kind: cells}, body.points)
    found.point_data.update(body.point_data)
    found.cell_data.update(body.cell_data)
    return found


def linear(name: str, body: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """Return a body with linear cells and all fields."""
    body = of_one_type(body)
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
    values = np.array(body.cell_data_to_point_data()[name])
    hanging = hanging_of(body)  # continuous across faces between small and large cells
    return hanging.placed(values)


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
    "temperature": ("at nodes", "temperature", "temperature"),
    "nodal_heat_flux": ("at nodes", "heat flux", "flux"),
    "contact_status": ("contact", "contact status", ""),
    "contact_pressure": ("contact", "contact pressure", "stress"),
    "contact_nominal_pressure": ("contact", "contact pressure by undeformed area", "stress"),
    "contact_force": ("contact", "contact force of a node", "force"),
    "contact_worn_depth": ("contact", "worn depth", "length"),
    "contact_slip": ("contact", "slip in the last load step", "length"),
    "contact_heat_flux": ("contact", "heat flux into the master", "flux"),
    "contact_temperature_jump": ("contact", "jump of the temperature", "temperature"),
    "contact_conductance": ("contact", "conductance", "conductance"),
    "von_mises": ("means over cells", "von Mises stress of cells", "stress"),
    "stress": ("means over cells", "stress of cells", "stress"),
    "principal_stress": ("means over cells", "principal stress of cells", "stress"),
    "heat_flux": ("means over cells", "heat flux of cells", "flux"),
}


def field_entries(steps: Sequence[Bodies], units: Units) -> list[dict[str, Any]]:
    """Return the fields of all steps in the order of the menu.

    Each entry has its ``name``, ``part`` of the menu, ``source``, the name in the files, ``component``, a
    column, or −1 for the size of a vector, ``label`` and ``unit``, ``place``, "nodes" or "on_cells",
    ``contact``, whether it lives on slave surfaces, ``colours``, one of `MAPS`, ``range``
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


def _range(steps: Sequence[Bodies], entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return kind and range of the colours over all steps, and the extremes of each step."""
    if entry["source"] == "contact_status":
        return {"colours": "status", "range": [0.0, 1.0], "extremes": [None] * len(steps)}
    values = [_values(grids, entry) for grids in steps]
    found = range_of(values, values)
    if entry["source"] == "temperature":  # it has no zero
        ends = [part for part in found["extremes"] if part]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        found |= {"colours": "level", "range": [low, high if high > low else low + 1.0]}
    return found


def range_of(
    values: Sequence[np.ndarray], ends: Sequence[Sequence[float] | np.ndarray], quantile: float = 0.995
) -> dict[str, Any]:
    """Return kind and range of the colours of values of all steps, and the extremes of others.

    The colours end at a quantile of the sizes of all values, as peaks would leave the rest in one shade.
    """
    extremes = [[float(np.min(part)), float(np.max(part))] if len(part) else None for part in ends]
    together = np.concatenate(values)
    together = together[np.isfinite(together)]
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


#: Edges closer than this, relative to the size of the picture, are faded, as they would blacken it.
CLOSEST = 0.009


def draw_field(
    axes: Axes, points: np.ndarray, cells: np.ndarray, values: np.ndarray, look: dict[str, Any]
) -> None:
    """Colour plane cells by nodal or cell values."""
    if len(values) == len(points):
        mesh, shown = refined(points, cells, values)
        axes.tripcolor(mesh, shown, shading="gouraud", rasterized=True, **look)
        return
    faces = PolyCollection(points[cells], array=values, edgecolors="face", linewidths=0.2, cmap=look["cmap"])
    faces.set_clim(look["vmin"], look["vmax"])
    axes.add_collection(faces)


def refined(points: np.ndarray, cells: np.ndarray, values: np.ndarray) -> tuple[Triangulation, np.ndarray]:
    """Cut quadrilaterals into small triangles, so that colours are bilinear and favour no diagonal."""
    if cells.shape[1] == 3:
        return Triangulation(*points.T, cells), values
    ticks = np.linspace(0.0, 1.0, int(np.clip(100 / np.sqrt(len(cells)), 2, 6)) + 1)
    s, t = np.meshgrid(ticks, ticks, indexing="ij")
    shape = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1).reshape(-1, 4)
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    small = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    triangles = (small + s.size * np.arange(len(cells))[:, None, None]).reshape(-1, 3)
    places = np.einsum("kc,fcd->fkd", shape, points[cells]).reshape(-1, 2)
    return Triangulation(*places.T, triangles), (values[cells] @ shape.T).ravel()


def draw_outline(axes: Axes, points: np.ndarray, cells: np.ndarray, *, width: float = 1.2) -> None:
    """Draw the boundary of a plane body."""
    edges = without_seams(points, boundary_faces(cells, 2)[0])
    axes.add_collection(LineCollection(points[edges], colors=INK, linewidths=width, capstyle="round"))


def without_seams(points: np.ndarray, edges: np.ndarray, slight: float = 1e-3) -> np.ndarray:
    """Return the edges of an outline without those between small and large cells, which lie inside.

    On the edge of a large cell lie the ends of those of small ones. `slight`: distance from an edge relative
    to its length up to which a point lies on it.
    """
    edges = edges[(points[edges[:, 0]] != points[edges[:, 1]]).any(axis=1)]  # on an axis some are points
    first, last = points[edges[:, 0]], points[edges[:, 1]]
    length, used = np.linalg.norm(last - first, axis=1), np.unique(edges)
    found = cKDTree(points[used]).query_ball_point((first + last) / 2, (0.5 - slight) * length)
    edge = np.repeat(np.arange(len(edges)), [len(near) for near in found])
    node = used[np.concatenate([np.zeros(0, dtype=np.int64), *map(np.asarray, found)]).astype(np.int64)]
    along = (last - first)[edge] / length[edge, None]
    away = points[node] - first[edge]
    away = away - np.einsum("nd,nd->n", away, along)[:, None] * along
    on = np.linalg.norm(away, axis=1) <= slight * length[edge]
    large = np.unique(edge[on])
    if not len(large):
        return edges
    row = np.concatenate([edge[on], np.repeat(large, 2)])
    column = np.concatenate([node[on], edges[large].ravel()])
    there = sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(len(edges), len(points)))
    ends = np.ones(edges.size), (np.repeat(np.arange(len(edges)), 2), edges.ravel())
    both = (sp.csr_matrix(ends, shape=there.shape) @ there.T).max(axis=1).toarray().ravel()
    return edges[both < 2.0]


def draw_cell_edges(axes: Axes, points: np.ndarray, cells: np.ndarray, frame: Frame) -> None:
    """Draw the edges of cells inside a frame faintly, and fainter the smaller the cells are."""
    corners = points[cells]
    inside = np.all((corners.max(axis=1) > frame.low) & (corners.min(axis=1) < frame.high), axis=1)
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    strength = 0.25 * np.minimum(1.0, (length / (CLOSEST * float(np.max(frame.size)))) ** 2)
    seen = inside & (strength > 0.01)
    colours = np.column_stack([np.tile(to_rgb(INK), (int(np.count_nonzero(seen)), 1)), strength[seen]])
    look = {"facecolors": "none", "edgecolors": colours, "linewidths": 0.4}
    axes.add_collection(PolyCollection(corners[seen], **look))


#: Half height of a section, relative to the size of the contact.
SECTION_REACH = 5.0
#: Ratio of width to height of a section, unless the bodies are smaller.
PROPORTION = 1.4
#: Margin around the bodies, relative to the half height.
SECTION_BORDER = 0.03

#: Dark on a light border, visible on every colour.
_OUTLINE = (("white", 6), (INK, 3))


@dataclass(frozen=True)
class Spot:
    """Location and size of the contact of a pair.

    `centre`: force-weighted middle, (dim,); in space on the planes of symmetry that cut the contact;
    `normal`: mean unit normal, from master to slave, (dim,); in space within these planes; `radius`: radius
    of a disc, or half length of a line, of the size of the closed part of the surface; `inside`: from planes
    of symmetry into the modelled part of the contact, 0 along other axes, (dim,).
    """

    centre: np.ndarray
    normal: np.ndarray
    radius: float
    inside: np.ndarray


@dataclass(frozen=True)
class Section:
    """A plane through bodies, and the side to which it is shifted slightly."""

    view: View
    origin: np.ndarray
    inside: np.ndarray

    def title(self, frame: Frame, unit: str) -> str:
        """Return where it lies, to a thousandth of what is seen: "section at y = 0 mm"."""
        axis = axis_label(self.view.towards).strip("−")
        if not axis:
            return "section"
        place, step = float(self.origin["xyz".index(axis)]), 1e-3 * float(np.max(frame.size))
        # Adding zero makes a positive zero of a negative one.
        place = round(place, -int(np.floor(np.log10(step)))) + 0.0
        return f"section at {axis} = {place:g} {unit}".replace("-", "−")


def strongest_contact(contact: ContactResult, places: np.ndarray) -> Spot:
    """Return the contact of the pair with the largest normal force.

    In space planes of symmetry count: half a contact's middle lies on the plane that halves it.
    """
    force, points = contact.normal_force, contact.points
    pair, dim = int(np.argmax(np.bincount(points.pair, weights=force))), places.shape[1]
    symmetric, normals = points.symmetric[:, :dim], points.normal[:, :dim]  # with torsion there is one more
    weight = np.where(points.pair == pair, force, 0.0)
    middle = weight @ places / weight.sum()
    centre, mirrors = _on_mirrors(middle, places, symmetric & (weight > 0)[:, None])
    normal = np.where(mirrors, 0.0, weight @ normals)
    # Around a pin the normals cancel: there the point of largest force is used, best one on a mirror, and the
    # axis that is nearest to its normal.
    if np.linalg.norm(normal) < 1e-3 * weight.sum():
        held = symmetric.sum(axis=1)
        normal = normals[int(np.argmax(np.where(held == held[weight > 0].max(), weight, 0.0)))]
        normal = np.eye(len(normal))[int(np.argmax(np.round(np.abs(normal), 6)))]
    near = weight > 0
    solid = places.shape[1] == 3
    radius = float(np.sqrt(points.area[near].sum() / np.pi) if solid else points.sizes[near].sum() / 2)
    inside = np.where(mirrors, np.sign(middle - centre), 0.0)
    return Spot(centre, normal / np.linalg.norm(normal), radius, inside)


def _on_mirrors(middle: np.ndarray, places: np.ndarray, marks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move a contact's middle to the nearest planes of symmetry; return it and the axes normal to them."""
    mirrors = marks.any(axis=0) & (len(middle) == 3)
    distance = np.where(marks, np.abs(places - middle), np.inf)
    nearest = places[np.argmin(distance, axis=0), np.arange(len(middle))] if len(places) else middle
    return np.where(mirrors, nearest, middle), np.asarray(mirrors)


def sections_of(spot: Spot, main: View) -> list[Section]:
    """Return two planes that hold the middle and the normal of a contact, perpendicular to each other.

    Both are seen from the side of the main view, and horizontal directions stay horizontal where possible.
    """
    helper = np.eye(3)[int(np.argmin(np.round(np.abs(spot.normal), 6)))]
    first = np.cross(spot.normal, helper)
    first /= np.linalg.norm(first)
    views = []
    for across in (first, np.cross(first, spot.normal)):
        towards = across if across @ main.towards > 0 else -across
        inside = (spot.normal, np.cross(spot.normal, towards))
        horizontal = max(inside, key=lambda direction: abs(float(direction @ main.right)))
        views.append(looking_along(towards, np.sign(horizontal @ main.right) * horizontal))
    return [
        Section(view, spot.centre, spot.inside if abs(spot.inside @ view.towards) > 0.5 else view.towards)
        for view in sorted(views, key=lambda view: -float(view.towards @ main.towards))
    ]


def section_frame(view: View, spot: Spot, points: np.ndarray, reach: float = 0.0) -> Frame:
    """Return the frame around a contact, limited to the visible bodies.

    `reach`: extent up and down; by default five times the radius of the contact.
    """
    bodies = frame_around(view, points, 0.0)
    middle = view.project(spot.centre[None])[0]
    half = (reach or SECTION_REACH * spot.radius) * np.array([PROPORTION, 1.0])
    border = SECTION_BORDER * min(float(half[1]), float(np.max(bodies.size)) / 2)
    return Frame(
        np.maximum(middle - half, bodies.low - border), np.minimum(middle + half, bodies.high + border)
    )


def cut(bodies: Mapping[str, pv.DataSet], section: Section) -> dict[str, pv.PolyData]:
    """Cut bodies, or their surfaces, by a plane.

    It is shifted slightly: where it ran along faces of cells, both neighbours would be cut or none. Where it
    misses all bodies it is shifted to the other side.
    """
    faces = {}
    for side in (section.inside, -section.inside):
        for name, body in bodies.items():
            beside = section.origin + 1e-6 * float(np.ptp(body.points)) * side
            faces[name] = body.slice(normal=section.view.towards, origin=beside)
        if any(face.n_points for face in faces.values()):
            break
    return faces


def section_layers(bodies: Bodies, section: Section, look: Mapping[str, Any]) -> list[Layer]:
    """Cut all bodies and draw the cut in colours."""
    layers = []
    for name, face in cut(bodies, section).items():
        if face.n_points:
            layers.append(Layer(face, {"lighting": False, **look}))
            hangs = bool(hanging_of(bodies[name]))
            whole = face.clean(tolerance=1e-5) if hangs else face
            edge = whole.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            if hangs:
                kept = without_seams(np.asarray(edge.points), edge.lines.reshape(-1, 3)[:, 1:])
                edge = pv.PolyData(edge.points, lines=np.insert(kept, 0, 2, axis=1).ravel())
            layers += [Layer(edge, {"color": c, "line_width": w, "lighting": False}) for c, w in _OUTLINE]
    return layers
