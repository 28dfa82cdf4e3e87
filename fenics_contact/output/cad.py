"""Designed surfaces and bodies as STEP files for CAD programs, through gmsh's OpenCASCADE.

Designed surfaces become B-splines, the other sides of a body flat faces, whose rims and corners are put
exactly into their planes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidDesignError, InvalidInputError, collectively, together
from fenics_contact.gallery.links import DesignSurface
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.output.files import replacing
from fenics_contact.output.surfaces import moved_body, moved_surfaces
from fenics_contact.readers.gmsh_session import gmsh_model, silenced
from fenics_contact.shapes.parametric import DEGREE, tensor_grid

if TYPE_CHECKING:
    from fenics_contact.design.design import MovedSurface
    from fenics_contact.design.problem import ShapeProblem
    from fenics_contact.design.several import JointProblem


class CadError(InvalidDesignError):
    """A design has no surface, or no body, that a CAD file can hold; the message has the reason."""


def _without_solid(found: str) -> CadError:
    return CadError(f"{found}: write the surfaces alone with solid=False")


@dataclass(frozen=True, eq=False)
class SplineFit:
    """A B-spline of degree five with the same clamped knots along all parameters, from 0 to 1.

    `points`: control points, (n, n, 3), of a curve in the plane (n, 2), [length]; `knots`: knots, each as
    often as it counts; `deviation`: largest distance from the surface, at points between those that it
    interpolates.
    """

    points: np.ndarray
    knots: np.ndarray
    deviation: float

    @property
    def sides(self) -> tuple[np.ndarray, ...]:
        """Control points of the sides s = 0, s = 1, t = 0, t = 1, or of the curve itself, (n, 3 | 2)."""
        if self.points.ndim == 2:
            return (self.points,)
        return self.points[0], self.points[-1], self.points[:, 0], self.points[:, -1]


def fitted(surface: MovedSurface, tolerance: float, most: int = 129) -> SplineFit:
    """Interpolate a moved surface by a B-spline, with more points until it is close enough."""
    count, axes = 17, len(surface.ticks)
    allowed = tolerance * float(np.ptp(surface.after(surface.parameters), axis=0).max())
    while True:
        finer = _sampled(surface, 2 * count - 1)
        knots, points = _interpolated(finer[(slice(None, None, 2),) * axes])
        deviation = float(np.linalg.norm(_values(knots, points, 2 * count - 1) - finer, axis=-1).max())
        if deviation <= allowed:
            _require_unfolded(surface, finer)
            return SplineFit(points, knots, deviation)
        if 2 * count - 1 > most:
            raise CadError(
                f"the B-spline of the surface on {surface.design.body!r} must be within {allowed:.3g} of it, "
                f"{count} points along each parameter leave {deviation:.3g}: the surface has kinks; give a "
                "larger tolerance"
            )
        count = 2 * count - 1


def _sampled(surface: MovedSurface, count: int) -> np.ndarray:
    """Return points of the moved surface at equal steps, (count, count, 3) or (count, 2)."""
    places = _places(count, len(surface.ticks))
    return surface.after(places).reshape(*[count] * len(surface.ticks), -1)


def _places(count: int, axes: int) -> np.ndarray:
    return tensor_grid([np.linspace(0.0, 1.0, count)] * axes)


def _interpolated(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return knots and control points of the spline through values at equal steps."""
    from scipy.interpolate import make_interp_spline  # scene files load this module

    points, knots = values, np.zeros(0)
    for axis in range(values.ndim - 1):
        spline = make_interp_spline(np.linspace(0.0, 1.0, len(values)), np.moveaxis(points, axis, 0), DEGREE)
        points, knots = np.moveaxis(spline.c, 0, axis), spline.t
    return knots, points


def _values(knots: np.ndarray, points: np.ndarray, count: int) -> np.ndarray:
    from scipy.interpolate import BSpline

    for axis in range(points.ndim - 1):
        along = BSpline(knots, np.moveaxis(points, axis, 0), DEGREE)(np.linspace(0.0, 1.0, count))
        points = np.moveaxis(along, 0, axis)
    return points


def _require_unfolded(surface: MovedSurface, after: np.ndarray) -> None:
    """Refuse a surface whose normals turn over: it was moved farther than its radius of curvature."""
    count, axes = len(after), len(surface.ticks)
    before = surface.before(_places(count, axes)).reshape(after.shape)
    now, then = (_orientations(each) for each in (after, before))
    turned = np.einsum("...d,...d->...", now, then) < 0
    if turned.any():
        at = _places(count, axes)[np.argmax(turned)]
        where = ", ".join(f"{name} = {place:.3g}" for name, place in zip("st", at, strict=False))
        raise CadError(
            f"the surface designed on {surface.design.body!r} folds over itself at {where}: bound its nodes"
        )


def _orientations(grid: np.ndarray) -> np.ndarray:
    """Return normals, in the plane tangents, at points of a grid, of any length."""
    if grid.ndim == 2:
        return np.gradient(grid, axis=0)
    return np.cross(np.gradient(grid, axis=0), np.gradient(grid, axis=1))


Plane: TypeAlias = tuple[np.ndarray, float]
"""Unit normal, and distance from the origin along it, [length]."""


@dataclass(frozen=True)
class Edge:
    """An edge of a flat side.

    `nodes`: its nodes in the order of the loop, the body's side on the left; `surface`: number of the
    designed surface that it borders on, None for a straight line.
    """

    nodes: np.ndarray
    surface: int | None = None
    side: int = 0
    reversed: bool = False

    def bend(self, points: np.ndarray) -> float:
        """Return how far its nodes are from the straight line between its ends, [length]."""
        way = points[self.nodes] - points[self.nodes[0]]
        along = way[-1] / np.linalg.norm(way[-1])
        return float(np.linalg.norm(way - np.outer(way @ along, along), axis=1).max())


@dataclass(frozen=True)
class FlatSide:
    """A flat side: its edges in closed loops, that around it first, and its plane.

    `off`: largest distance of the moved nodes from it, in the plane from its straight edges; `planes`: that
    in which it lies, with the normal out of the body; none of a plane body.
    """

    loops: list[list[Edge]]
    off: float
    planes: tuple[Plane, ...] = ()


def flat_sides(
    mesh: BodyMesh,
    moved: np.ndarray,
    surfaces: Sequence[DesignSurface],
    *,
    angle: float = 1e-5,
    most: int = 100,
) -> list[FlatSide]:
    """Return all sides of a body but its designed surfaces.

    Sides are flat where they are so in the reference shape; the nodes of the mesh near a designed surface
    follow it a little.
    """
    facets, _ = mesh.linear.boundary
    areas = vector_areas(mesh.points, facets)
    across = _across(facets)
    labels = _labels(facets, areas, across, surfaces, angle)
    if mesh.dim == 2:
        loops = _loops(moved, facets, labels, surfaces)
        bends = [edge.bend(moved) for loop in loops for edge in loop if edge.surface is None]
        return [FlatSide(loops, max(bends, default=0.0))]
    sides = np.unique(labels[labels >= len(surfaces)])
    if len(sides) > most:
        raise _without_solid(f"a body in a CAD file needs few flat sides, its mesh has {len(sides)}")
    found = []
    for side in sides:
        mine = labels == side
        normal = areas[mine].sum(axis=0) / np.linalg.norm(areas[mine].sum(axis=0))
        level = float(np.mean(mesh.points[facets[mine]] @ normal))
        behind = labels[across[mine]]
        edges = np.stack([facets[mine], np.roll(facets[mine], -1, axis=1)], axis=2)[behind != side]
        loops = _loops(moved, edges, behind[behind != side], surfaces)
        off = float(np.abs(moved[facets[mine]] @ normal - level).max())
        found.append(FlatSide(loops, off, ((normal, level),)))
    return found


def _across(facets: np.ndarray) -> np.ndarray:
    """Return the facet behind every edge of facets, (n, 4 | 3), or the one after each edge, (n, 1)."""
    if facets.shape[1] == 2:
        order = np.argsort(facets[:, 0])
        return order[np.searchsorted(facets[order, 0], facets[:, 1])][:, None]
    after, base = np.roll(facets, -1, axis=1), int(facets.max()) + 1
    keys = (facets * base + after).ravel()
    order = np.argsort(keys)
    found = order[np.searchsorted(keys[order], (after * base + facets).ravel())]
    return found.reshape(facets.shape) // facets.shape[1]


def _labels(
    facets: np.ndarray,
    areas: np.ndarray,
    across: np.ndarray,
    surfaces: Sequence[DesignSurface],
    angle: float,
) -> np.ndarray:
    """Return of each facet the number of its designed surface, or behind these of its flat side, (n,)."""
    owner = np.full(len(facets), -1)
    for number, surface in enumerate(surfaces):
        owner[np.isin(facets, surface.nodes).all(axis=1)] = number
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    here = np.repeat(np.arange(len(facets)), across.shape[1])
    there = across.ravel()
    turns = np.linalg.norm(normals[here] - normals[there], axis=1)
    flat = (owner[here] < 0) & (owner[there] < 0) & (turns < angle)
    links = coo_array((np.ones(flat.sum()), (here[flat], there[flat])), shape=[len(facets)] * 2)
    _, components = connected_components(links, directed=False)
    return np.where(owner < 0, components + len(surfaces), owner)


def _loops(
    points: np.ndarray, edges: np.ndarray, labels: np.ndarray, surfaces: Sequence[DesignSurface]
) -> list[list[Edge]]:
    """Join neighbouring edges of the mesh, (n, 2), with the same label; the widest loop first."""
    after = {int(start): (int(end), int(label)) for (start, end), label in zip(edges, labels, strict=True)}
    before = {end: (start, label) for start, (end, label) in after.items()}
    corners = {int(node) for surface in surfaces for line in _lines(surface) for node in line[[0, -1]]}
    breaks = {node for node in after if node in corners or after[node][1] != before[node][1]}
    left, loops = dict.fromkeys(node for node in after if node in breaks), []
    while left:
        loop, node = [], next(iter(left))
        while node in left:
            del left[node]
            label, nodes = after[node][1], [node, after[node][0]]
            while nodes[-1] not in breaks:
                nodes.append(after[nodes[-1]][0])
            loop.append(_edge(np.array(nodes), label, surfaces))
            node = nodes[-1]
        loops.append(loop)
    spans = [np.ptp(points[[edge.nodes[0] for edge in loop]], axis=0).max() for loop in loops]
    return [loops[number] for number in np.argsort(spans)[::-1]]


def _edge(nodes: np.ndarray, label: int, surfaces: Sequence[DesignSurface]) -> Edge:
    if label >= len(surfaces):
        return Edge(nodes)
    for side, line in enumerate(_lines(surfaces[label])):
        for turned in (False, True):
            if np.array_equal(line[::-1] if turned else line, nodes):
                return Edge(nodes, label, side, turned)
    raise _without_solid("each side of a designed surface must be one edge of a flat side, one is not")


def _lines(surface: DesignSurface) -> tuple[np.ndarray, ...]:
    """Return the nodes along the sides of a designed surface, as in `SplineFit.sides`."""
    grid = surface.nodes.reshape(surface.counts)
    return (grid,) if grid.ndim == 1 else (grid[0], grid[-1], grid[:, 0], grid[:, -1])


def corners_in_planes(points: np.ndarray, sides: Sequence[FlatSide]) -> dict[int, np.ndarray]:
    """Return the position of every corner of flat sides in all of their planes, by node."""
    planes: dict[int, list[Plane]] = {}
    for side in sides:
        for edge in (edge for loop in side.loops for edge in loop):
            known = planes.setdefault(int(edge.nodes[0]), [])
            known += side.planes
    return {node: _onto(points[node], known) for node, known in planes.items()}


def rims_in_planes(fits: Sequence[SplineFit], sides: Sequence[FlatSide], tolerance: float) -> list[SplineFit]:
    """Return surfaces whose rims lie in the planes of the flat sides that they border on."""
    planes: list[dict[int, Plane]] = [{} for _ in fits]
    for side in sides:
        for edge in (edge for loop in side.loops for edge in loop):
            if edge.surface is not None:
                planes[edge.surface].update({edge.side: plane for plane in side.planes})
    return [_put(fit, known, tolerance) for fit, known in zip(fits, planes, strict=True)]


def _put(fit: SplineFit, planes: Mapping[int, Plane], tolerance: float) -> SplineFit:
    if not planes:
        return fit
    points = fit.points.copy()
    rims = (points[0], points[-1], points[:, 0], points[:, -1])
    for side, (normal, level) in planes.items():
        inner = rims[side][1:-1]
        inner -= np.outer(inner @ normal - level, normal)
    for i, j in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        both = [planes[side] for side in (-i, 2 - j) if side in planes]
        points[i, j] = _onto(points[i, j], both)
    off = float(np.linalg.norm(points - fit.points, axis=-1).max())
    allowed = tolerance * float(np.ptp(fit.points.reshape(-1, 3), axis=0).max())
    if off > allowed:
        raise CadError(
            f"the rim of a designed surface must stay within {allowed:.3g} of the flat side at it, it leaves "
            f"it by {off:.3g}: hold it by optimize.fixed_rim, or write the surfaces alone with solid=False"
        )
    return replace(fit, points=points, deviation=fit.deviation + off)


def _onto(point: np.ndarray, planes: Sequence[Plane]) -> np.ndarray:
    """Return the nearest point in all planes."""
    if not planes:
        return point
    normals = np.array([normal for normal, _ in planes])
    missing = np.array([level for _, level in planes]) - normals @ point
    return np.asarray(point + np.linalg.lstsq(normals, missing, rcond=1e-6)[0], dtype=np.float64)


@displayed
@dataclass(frozen=True)
class StepFile:
    """A STEP file that was written.

    Attributes:
        deviation: Largest distance of its B-splines from the designed surfaces, [length].
        points: Number of control points of each B-spline along a parameter.
        volume: Volume of the body in it, in the plane its area; None for surfaces alone, [length³].
        sides: Largest distance of the mesh's other boundary nodes from the flat sides of the body, [length].
    """

    path: Path
    deviation: float
    points: tuple[int, ...]
    volume: float | None
    sides: float


@collectively("write_step", lambda problem, *_, **__: problem.comm)
@naming_arguments
def write_step(
    problem: ShapeProblem | JointProblem,
    alpha: np.ndarray,
    path: str | Path,
    *,
    body: str | None = None,
    solid: bool = True,
    tolerance: float = 1e-6,
    scale: float = 1.0,
) -> StepFile:
    """Write a designed body, or its designed surfaces alone, as a STEP file. Collective.

    The designed surfaces are B-splines of degree five through points of `design.MovedSurface`. The body is
    closed by the flat sides of the reference shape; where these are not flat, as next to the crown of a chain
    link, only the surfaces can be written. A plane body is a plane face, its other edges are straight lines
    from node to node.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        path: File to write, .step or .stp; its folder is created.
        body: Name of the body; needed if designs move several.
        solid: Whether to write the body, or the designed surfaces alone.
        tolerance: Largest deviation of the B-splines, relative to the extent of their surface.
        scale: Millimetres in the scene's unit of length: coordinates in the file are in millimetres.

    Returns:
        The file, how far its surfaces deviate, and the volume of its body; `read_cad` reads it.

    Raises:
        InvalidInputError: If the body is not designed, alpha does not fit, or the file has another suffix.
        CadError: If a surface folds or cannot be fitted, or the body has other sides than flat ones.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Example:
        >>> write_step(problem, result.x, "output/pad.step").deviation  # doctest: +SKIP
        3.1e-07
    """
    target = Path(path)
    with together(problem.comm):
        if target.suffix.lower() not in (".step", ".stp") or not 0.0 < scale < np.inf:
            raise InvalidInputError(
                f"write_step needs a file .step or .stp and a scale above zero, got {target.name!r}, {scale}"
            )
    name, mesh = moved_body(problem, alpha, body)
    surfaces = [one for one in moved_surfaces(problem, alpha) if one.design.body == name]
    written: StepFile | None = None
    with together(problem.comm):
        if problem.comm.rank == 0:
            fits = [fitted(surface, tolerance) for surface in surfaces]
            lattices = [one.design.lattice for one in surfaces]
            sides = flat_sides(problem.scene.bodies[name].mesh, mesh.points, lattices) if solid else []
            fits = rims_in_planes(fits, sides, tolerance)
            with replacing(target) as (temporary,), gmsh_model("fenics_contact STEP") as gmsh:
                drawing = _Drawing(gmsh, fits, corners_in_planes(mesh.points, sides), scale)
                volume: float | None = None
                with _reasons():
                    if solid:
                        volume = drawing.body(sides)
                    else:
                        drawing.surfaces()
                    with silenced(1):
                        gmsh.write(str(temporary))
            counts = tuple(len(fit.points) for fit in fits)
            off = max((side.off for side in sides), default=0.0)
            written = StepFile(target, max(fit.deviation for fit in fits), counts, volume, off)
    return problem.comm.bcast(written)


@contextmanager
def _reasons() -> Iterator[None]:
    """Report the reason that gmsh gives."""
    try:
        yield
    except CadError:
        raise
    except Exception as reason:  # gmsh raises no other class
        words = f"OpenCASCADE must be able to build the sides of a body, it reported: {reason}"
        raise _without_solid(words) from reason


class _Drawing:
    """Surfaces and sides in gmsh's current model, in millimetres."""

    def __init__(
        self, gmsh: ModuleType, fits: Sequence[SplineFit], corners: Mapping[int, np.ndarray], scale: float
    ) -> None:
        self._gmsh, self._occ = gmsh, gmsh.model.occ
        self._fits, self._corners, self._scale = fits, corners, scale

    def surfaces(self) -> None:
        """Draw the designed surfaces alone."""
        self._keep([self._spline(fit) for fit in self._fits])

    def body(self, sides: Sequence[FlatSide]) -> float:
        """Draw the body that surfaces and flat sides enclose; return its volume in the scene's units."""
        body = 2, self._face(sides[0])
        if self._fits[0].points.ndim == 3:
            faces = [body, *((2, self._face(side)) for side in sides[1:])]
            faces += [self._spline(fit) for fit in self._fits]
            # Sides share edges of the same control points.
            shell = self._occ.addSurfaceLoop([tag for _, tag in faces], sewing=True)
            body = 3, self._occ.addVolume([shell])
        self._occ.synchronize()
        edges = self._gmsh.model.getBoundary(self._gmsh.model.getBoundary([body]), combined=True)
        if edges:
            raise CadError(
                f"the sides of a body must enclose it, {len(sides)} flat ones and {len(self._fits)} designed "
                f"surfaces leave {len(edges)} open edges: write the surfaces alone with solid=False"
            )
        self._keep([body])
        return float(abs(self._occ.getMass(*body)) / self._scale ** body[0])

    def _keep(self, wanted: list[tuple[int, int]]) -> None:
        """Remove everything but some entities and what they consist of."""
        self._occ.synchronize()
        model = self._gmsh.model
        parts = {(dim, abs(tag)) for dim, tag in wanted}
        level = list(parts)
        while level and level[0][0] > 0:
            level = [(dim, abs(tag)) for dim, tag in model.getBoundary(level, combined=False)]
            parts |= set(level)
        for dim in (2, 1, 0):
            self._occ.remove([entity for entity in model.getEntities(dim) if entity not in parts])
        self._occ.synchronize()

    def _spline(self, fit: SplineFit) -> tuple[int, int]:
        """Draw a designed surface or curve."""
        if fit.points.ndim == 2:
            return 1, self._curve(fit.points, fit.knots)
        tags = [self._point(point) for point in np.swapaxes(fit.points, 0, 1).reshape(-1, 3)]
        knots, times = _counted(fit.knots)
        return 2, self._occ.addBSplineSurface(
            tags, len(fit.points), degreeU=DEGREE, degreeV=DEGREE, knotsU=knots, knotsV=knots,
            multiplicitiesU=times, multiplicitiesV=times,
        )  # fmt: skip

    def _face(self, side: FlatSide) -> int:
        """Draw a flat side."""
        wires = [
            self._occ.addWire([self._edge(edge) for edge in loop], checkClosed=True) for loop in side.loops
        ]
        return int(self._occ.addPlaneSurface(wires))

    def _edge(self, edge: Edge) -> int:
        if edge.surface is None:
            ends = (self._corners[int(node)] for node in edge.nodes[[0, -1]])
            return int(self._occ.addLine(*[self._point(end) for end in ends]))
        fit = self._fits[edge.surface]
        points = fit.sides[edge.side]
        return self._curve(points[::-1] if edge.reversed else points, fit.knots)

    def _curve(self, points: np.ndarray, knots: np.ndarray) -> int:
        distinct, times = _counted(knots)
        tags = [self._point(point) for point in points]
        return int(self._occ.addBSpline(tags, degree=DEGREE, knots=distinct, multiplicities=times))

    def _point(self, point: np.ndarray) -> int:
        x, y, *z = self._scale * point
        return int(self._occ.addPoint(x, y, *(z or [0.0])))


def _counted(knots: np.ndarray) -> tuple[Any, Any]:
    """Return the distinct knots, and how often each counts."""
    distinct, times = np.unique(knots, return_counts=True)
    return distinct.tolist(), times.tolist()
