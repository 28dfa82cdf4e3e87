"""New nodes of surfaces are put on the true shapes, those between two shapes or beside a plane on both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import FACET_TYPES, cell_type_of
from fenics_contact.mesh.faces import boundary_faces, match_faces, vector_areas
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes
from fenics_contact.mesh.smoothed_along import smoothed_along
from fenics_contact.shapes.combined import Joined
from fenics_contact.shapes.simple import ROUNDING, STEPS, Plane, SurfaceShape, closest_points, evaluate_shape


def on_shapes(
    straight: np.ndarray,
    cells: np.ndarray,
    surfaces: Mapping[str, np.ndarray],
    shapes: Mapping[str, SurfaceShape],
    new: np.ndarray,
    hanging: HangingNodes = NO_HANGING,
) -> np.ndarray:
    """Return coordinates with new nodes of surfaces on their shapes, all other new ones drawn along.

    `straight`: coordinates with all nodes on facets; `new`: marks of the nodes that move.
    """
    moved, placed, along = put_on_shapes(straight, cells, surfaces, shapes, new, hanging)
    if np.array_equal(moved, straight):
        return moved
    pieces = cell_type_of(cells, straight.shape[1]).pieces
    linear = cells[:, pieces].reshape(-1, pieces.shape[1])
    found = straight + smoothed_along(moved - straight, new & ~placed, straight, linear, along, hanging)
    return hanging.placed(found)


def put_on_shapes(
    points: np.ndarray,
    cells: np.ndarray,
    surfaces: Mapping[str, np.ndarray],
    shapes: Mapping[str, SurfaceShape],
    movable: np.ndarray,
    hanging: HangingNodes = NO_HANGING,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coordinates with movable nodes of surfaces on their shapes.

    A node of several shapes is put on all of them, one beside a plane part of the boundary stays in that.
    Joined shapes are given by their parts, see `with_parts`. Returns also which nodes lie on shapes, and
    projections onto the directions in which other nodes of the boundary may move.
    """
    dim, placed = points.shape[1], np.zeros(len(points), dtype=bool)
    if not any(movable[surfaces[name]].any() for name in shapes):
        return points, placed, np.tile(np.eye(dim), (len(points), 1, 1))
    boundary, _ = boundary_faces(cells, dim, hanging)
    shaped = np.concatenate([surfaces[name] for name in shapes])
    boundary = boundary[match_faces(boundary, shaped) < 0]
    along = _directions(points, _linear_pieces(boundary, dim))
    parts = list(_facets_of(surfaces, shapes, movable))
    nodes = np.unique(np.concatenate([each.ravel() for _, each in parts]))
    nodes, found = nodes[movable[nodes]], points.copy()
    member = np.column_stack([np.isin(nodes, each) for _, each in parts])
    groups, group = np.unique(member, axis=0, return_inverse=True)
    for number, which in enumerate(groups):
        mine = nodes[group.ravel() == number]
        found[mine] = _onto([parts[k][0] for k in np.flatnonzero(which)], points[mine], along[mine])
    placed[nodes] = True
    return found, placed, along


def _linear_pieces(facets: np.ndarray, dim: int) -> np.ndarray:
    pieces = FACET_TYPES[facets.shape[1], dim].pieces
    return facets[:, pieces].reshape(-1, pieces.shape[1])


def _facets_of(
    surfaces: Mapping[str, np.ndarray], shapes: Mapping[str, SurfaceShape], movable: np.ndarray
) -> Iterator[tuple[SurfaceShape, np.ndarray]]:
    """Yield each shape once, with the facets of its surfaces that have a movable node."""
    by_shape: dict[int, tuple[SurfaceShape, list[np.ndarray]]] = {}
    for name, shape in shapes.items():
        facets = surfaces[name][movable[surfaces[name]].any(axis=1)]
        if len(facets):
            by_shape.setdefault(id(shape), (shape, []))[1].append(facets)
    for shape, several in by_shape.values():
        yield shape, np.concatenate(several)


def with_parts(
    mesh: BodyMesh,
) -> tuple[dict[str, np.ndarray], dict[str, SurfaceShape]]:
    """Return the surfaces of a mesh and their shapes, a joined shape replaced by surfaces of its parts.

    Names of these have a null character, which others have not.
    """
    surfaces, shapes = dict(mesh.surfaces), {}
    for name, shape in mesh.shapes.items():
        if not isinstance(shape, Joined):
            shapes[name] = shape
            continue
        part = _part_of(shape, mesh, mesh.surfaces[name])
        for number in np.unique(part):
            surfaces[f"{name}\0{number}"] = mesh.surfaces[name][part == number]
            shapes[f"{name}\0{number}"] = shape.shapes[number]
    return surfaces, shapes


def _part_of(shape: Joined, mesh: BodyMesh, facets: np.ndarray, off: float = 1e-3) -> np.ndarray:
    """Return the part of a joined shape on which each facet lies with all its nodes, shape (n_facets,).

    Of several the one whose normal and place are those of its middle: near a ridge the middle of a coarse
    facet may be nearer to the part beyond it. `off`: distance of nodes from their shape, relative to the size
    of the facet.
    """
    points, parts = mesh.points[facets], shape.shapes
    size = np.linalg.norm(np.ptp(points, axis=1), axis=1)[:, None]
    stays = ~np.isin(facets, mesh.hanging.nodes)
    flat, middle, areas = points.reshape(-1, mesh.dim), points.mean(axis=1), vector_areas(mesh.points, facets)
    away, badness = np.empty((2, len(facets), len(parts)))
    for number, each in enumerate(parts):
        far = np.abs(evaluate_shape(each, "distance", flat)).reshape(facets.shape)
        away[:, number] = np.where(stays, far, 0.0).max(axis=1)
        leans = np.einsum("nd,nd->n", evaluate_shape(each, "normals", middle), areas)
        beyond = np.abs(evaluate_shape(each, "distance", middle)) / size[:, 0]
        badness[:, number] = beyond - leans / np.linalg.norm(areas, axis=1)
    on = away <= away.min(axis=1, keepdims=True) + off * size
    return np.asarray(np.where(on, badness, np.inf).argmin(axis=1))


def _onto(
    shapes: Sequence[SurfaceShape],
    points: np.ndarray,
    along: np.ndarray,
    parallel: float = 0.05,
    farthest: float = 10.0,
) -> np.ndarray:
    """Return points of all shapes that are close to given ones, in the directions in which these may move.

    Newton's method with the smallest step, x − (N P)⁺ d(x), with the normals N as rows and the projection P.
    Where they touch at so small an angle that this does not find their intersection, as a fillet does, the
    closest point of a shape that is no plane. `along`: P; `parallel`: sine of the smallest angle between
    shapes that intersect; `farthest`: largest movement relative to the distance from the shapes.
    """

    def away(there: np.ndarray) -> np.ndarray:
        return np.column_stack([evaluate_shape(shape, "distance", there) for shape in shapes])

    found, first = points.copy(), away(points)
    for _ in range(STEPS):
        normals = np.stack([evaluate_shape(shape, "normals", found) for shape in shapes], axis=1) @ along
        left, size, right = np.linalg.svd(normals, full_matrices=False)
        inverse = np.where(size > parallel, 1.0 / np.maximum(size, parallel), 0.0)
        step = np.einsum("nki,ni,nid,nk->nd", left, inverse, right, away(found))
        found -= step
        if np.abs(step).max(initial=0.0) <= ROUNDING * np.abs(found).max(initial=0.0):
            break
    far, rounding = np.abs(first).max(axis=1), ROUNDING * np.abs(points).max(initial=0.0)
    missed = (np.abs(away(found)).max(axis=1) > 1e-3 * far) & (far > rounding)
    missed |= np.linalg.norm(found - points, axis=1) > farthest * far + rounding
    curved = min(shapes, key=lambda shape: isinstance(shape, Plane))
    found[missed] = closest_points(curved, points[missed])
    return found


def _directions(points: np.ndarray, boundary: np.ndarray, gentle: float = 0.9) -> np.ndarray:
    """Return projections onto the directions in which nodes of a boundary may move, (n_nodes, dim, dim).

    Nodes of plane parts stay in these, those of gently curved ones are free. `boundary`: its linear facets
    without shapes; `gentle`: cosine of the angle between normals of facets around a node and their mean from
    which on the boundary is gently curved there; it is so at a node if it is at all corners of the facets
    around.
    """
    count, dim = points.shape
    areas = vector_areas(points, boundary)
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    mean, squares = np.zeros((count, dim)), np.zeros((count, dim, dim))
    np.add.at(mean, boundary, normals[:, None])
    np.add.at(squares, boundary, np.einsum("nd,ne->nde", normals, normals)[:, None])
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-100)[:, None]
    cosine, wider = np.ones(count), np.ones(count)
    np.minimum.at(cosine, boundary, np.einsum("nd,nkd->nk", normals, mean[boundary]))
    np.minimum.at(wider, boundary, cosine[boundary].min(axis=1)[:, None])
    result = np.tile(np.eye(dim), (count, 1, 1))
    there = np.unique(boundary)
    there = there[(wider[there] < gentle) | (wider[there] > 1.0 - 1e-8)]
    values, axes = np.linalg.eigh(squares[there] / np.trace(squares[there], axis1=1, axis2=2)[:, None, None])
    result[there] -= np.einsum("nda,na,nea->nde", axes, (values > 0.1).astype(float), axes)
    return result
