"""True shapes of a body's surfaces from the geometry of gmsh's current model, whichever kernel built it."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import ModuleType

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import corners_of, vector_areas
from fenics_contact.readers.bodies import listed
from fenics_contact.readers.gmsh_session import initialised_gmsh, physical_groups
from fenics_contact.shapes.combined import CLOSE, Joined, recognised
from fenics_contact.shapes.parametric import SplinePatch, tensor_grid
from fenics_contact.shapes.simple import SurfaceShape

#: Smallest number of points along each parameter; intervals are halved until the spline is close to the face.
FEWEST = 33
#: Largest number of points along each parameter.
MOST = 129


def shape_of_entity(
    gmsh: ModuleType, entity: tuple[int, int], middles: np.ndarray, outwards: np.ndarray
) -> SurfaceShape | None:
    """Return the shape of a face, in the plane of a curve, of gmsh's current model.

    It is a plane, sphere, cylinder, cone or torus if it is one, else a spline through its points; None if the
    model has only a mesh and no geometry. `middles`: points on or close to it.
    """
    if gmsh.model.getType(*entity).startswith("Discrete"):
        return None
    points, normals = _normals(gmsh, entity)
    for shape in (recognised(points, sign * normals) for sign in (1.0, -1.0)):
        if shape is not None and _leads_out(shape, middles, outwards):
            return shape
    grid = _grid(gmsh, entity)
    shape = SplinePatch(grid, _periodic(grid))
    return shape if _leads_out(shape, middles, outwards) else replace(shape, flipped=True)


def shape_seen(gmsh: ModuleType, entity: tuple[int, int]) -> SurfaceShape | None:
    """Return the plane, sphere, cylinder, cone or torus that a face is, facing either side; else None."""
    return recognised(*_normals(gmsh, entity))


def _leads_out(shape: SurfaceShape, middles: np.ndarray, outwards: np.ndarray) -> bool:
    return bool(np.einsum("nd,nd->", shape.normals(middles), outwards) > 0)


def _normals(gmsh: ModuleType, entity: tuple[int, int], pole: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Return points of an entity and the normals there, to either side, where these exist.

    `pole`: tangents whose cross product is below this fraction of the largest define no normal.
    """
    parameters = _parameters(gmsh, entity, FEWEST)
    points = _values(gmsh, entity, parameters)
    slopes = np.reshape(gmsh.model.getDerivative(*entity, parameters.ravel()), (len(points), -1, 3))
    first = slopes[:, 0]
    across = np.column_stack([first[:, 1], -first[:, 0]]) if entity[0] == 1 else np.cross(first, slopes[:, 1])
    length = np.linalg.norm(across, axis=1)
    sound = length > pole * length.max()
    return points[sound], across[sound] / length[sound, None]


def _grid(gmsh: ModuleType, entity: tuple[int, int]) -> np.ndarray:
    """Return a grid of points, (n, n, 3) or (n, 2), such that a spline through every second is accurate."""
    count = FEWEST
    while True:
        count = 2 * count - 1
        fine = _values(gmsh, entity, _parameters(gmsh, entity, count))
        grid = fine.reshape(*[count] * entity[0], entity[0] + 1)
        coarse = SplinePatch(grid[(slice(None, None, 2),) * entity[0]], _periodic(grid))
        off = np.abs(coarse.at(_counts(count, entity[0]) / 2) - fine).max()
        if off <= CLOSE * np.ptp(fine, axis=0).max() or count >= MOST:
            return grid


def _counts(count: int, directions: int) -> np.ndarray:
    return tensor_grid([np.arange(float(count))] * directions)


def _parameters(gmsh: ModuleType, entity: tuple[int, int], count: int) -> np.ndarray:
    """Return a grid of parameters, (countᵏ, k)."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(*entity))
    return np.asarray(low + (high - low) * _counts(count, entity[0]) / (count - 1))


def _values(gmsh: ModuleType, entity: tuple[int, int], parameters: np.ndarray) -> np.ndarray:
    points = np.reshape(gmsh.model.getValue(*entity, parameters.ravel()), (-1, 3))
    return np.asarray(points[:, : entity[0] + 1])


def _periodic(grid: np.ndarray) -> tuple[bool, ...]:
    """Return in which directions a grid is smoothly periodic: bent there no more than elsewhere."""
    periodic = []
    for axis in range(grid.ndim - 1):
        steps = np.diff(np.moveaxis(grid, axis, 0), axis=0)
        closed = np.abs(steps.sum(axis=0)).max() <= 1e-6 * np.abs(steps).max()
        bend = np.linalg.norm(np.diff(steps, axis=0), axis=-1).max()
        periodic.append(bool(closed and np.linalg.norm(steps[0] - steps[-1], axis=-1).max() <= 2 * bend))
    return tuple(periodic)


_LOGGER = logging.getLogger(__name__)


def cad_shapes(
    mesh: BodyMesh, surfaces: Mapping[str, str | int | Sequence[str | int]] | None = None
) -> dict[str, SurfaceShape]:
    """Return the true shapes of a body's surfaces from the geometry of gmsh's current model.

    Planes, spheres, cylinders, cones and tori are recognised, also if the model represents them as splines;
    other faces become splines through their points. The shapes no longer need gmsh, and can be sent to other
    ranks. A surface of several faces is `Joined`. Surfaces whose faces have no geometry, as in a mesh that
    was read from a file, and those whose nodes have left it are omitted. `surfaces`: name of a surface to the
    physical groups (by name, or number), or named entities, of which it consists; all with the name of such a
    group unless given.
    """
    gmsh = initialised_gmsh("cad_shapes", "read_cad")
    known, nodes = _named(gmsh, mesh.dim - 1), _nodes(gmsh)
    chosen = {name: name for name in mesh.surfaces if name in known} if surfaces is None else surfaces
    shapes = {}
    for name, labels in chosen.items():
        if name not in mesh.surfaces:
            raise InvalidInputError(
                f"cad_shapes names surface {name!r}, the body has {sorted(mesh.surfaces)}"
            )
        tags = sorted({tag for label in listed(labels) for tag in _tags(known, str(label), name)})
        shape = _shape(gmsh, tags, nodes, mesh, mesh.surfaces[name])
        if shape is None:
            _LOGGER.info("surface %r stays as its facets are: it has no geometry, or has left it", name)
        else:
            shapes[name] = shape
    return shapes


def _named(gmsh: ModuleType, dim: int) -> dict[str, list[int]]:
    """Return the entities of each physical group and of each name, by text."""
    groups = {str(label): tags for label, tags in physical_groups(gmsh, dim).items()}
    for _, tag in gmsh.model.getEntities(dim):
        if name := gmsh.model.getEntityName(dim, tag):
            groups.setdefault(name, []).append(int(tag))
    return groups


def _tags(known: Mapping[str, list[int]], label: str, surface: str) -> list[int]:
    if label not in known:
        there = ", ".join(map(repr, sorted(known))) or "none at all"
        raise InvalidInputError(f"surface {surface!r} needs physical group {label!r}, the model has {there}")
    return known[label]


def _nodes(gmsh: ModuleType) -> np.ndarray:
    """Return the coordinates of the node of each tag, (largest + 1, 3)."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = np.zeros((int(tags.max(initial=0)) + 1, 3))
    points[tags.astype(np.int64)] = coordinates.reshape(-1, 3)
    return points


def _shape(
    gmsh: ModuleType,
    tags: list[int],
    nodes: np.ndarray,
    mesh: BodyMesh,
    facets: np.ndarray,
    far: float = 0.01,
) -> SurfaceShape | None:
    """Return the shape of a surface of the body; None if any of its facets is on no geometry.

    `far`: largest distance of nodes from their face, relative to the shortest edge of the surface.
    """
    corners, outwards = mesh.points[corners_of(facets, mesh.dim)], vector_areas(mesh.points, facets)
    middles = corners.mean(axis=1)
    edge = float(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).min())
    shapes: list[SurfaceShape] = []
    parts: list[np.ndarray] = []
    left = np.ones(len(facets), dtype=bool)
    for entity in ((mesh.dim - 1, tag) for tag in tags):
        mine = left & _on_entity(gmsh, entity, nodes, middles, edge)
        if not mine.any():  # on another body's boundary
            continue
        shape = shape_of_entity(gmsh, entity, middles[mine], outwards[mine])
        if shape is None or np.abs(shape.distance(mesh.points[np.unique(facets[mine])])).max() > far * edge:
            return None
        left &= ~mine
        _add(shapes, parts, shape, corners[mine])
    if left.any() or not shapes:
        return None
    return shapes[0] if len(shapes) == 1 else Joined(tuple(shapes), tuple(parts))


def _on_entity(
    gmsh: ModuleType,
    entity: tuple[int, int],
    nodes: np.ndarray,
    middles: np.ndarray,
    edge: float,
    same: float = 1e-6,
) -> np.ndarray:
    """Return which facets are elements of an entity, by equal middles, (n,).

    `same`: middles of facets coincide if they are closer than this fraction of that edge.
    """
    on = np.zeros(len(middles), dtype=bool)
    types, _, elements = gmsh.model.mesh.getElements(*entity)
    for kind, numbers in zip(types, elements, strict=True):
        _, _, _, each, _, first, *_ = gmsh.model.mesh.getElementProperties(kind)
        theirs = nodes[numbers.astype(np.int64).reshape(-1, each)[:, :first]].mean(axis=1)
        on |= cKDTree(theirs[:, : middles.shape[1]]).query(middles)[0] < same * edge
    return on


def _add(
    shapes: list[SurfaceShape],
    parts: list[np.ndarray],
    shape: SurfaceShape,
    corners: np.ndarray,
    alike: float = 1e-8,
) -> None:
    """Add the shape of a part, or the part to a shape that it continues: halves of a hole, of a torus.

    `alike`: two faces have a common shape if on one of them their shapes differ by less than this fraction of
    its extent.
    """
    middles = corners.mean(axis=1)
    for number, other in enumerate(shapes):
        if isinstance(other, SplinePatch) or isinstance(shape, SplinePatch):
            continue
        size = float(np.ptp(corners.reshape(-1, corners.shape[2]), axis=0).max())
        apart = np.abs(other.distance(middles) - shape.distance(middles)).max()
        along = np.einsum("nd,nd->n", other.normals(middles), shape.normals(middles)).min()
        if apart <= alike * size and along > 0:
            parts[number] = np.concatenate([parts[number], corners])
            return
    shapes.append(shape)
    parts.append(corners)
