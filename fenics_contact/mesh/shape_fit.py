"""Check that the nodes of surfaces lie on the given shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import corners_of
from fenics_contact.surface_shapes import Joined, Plane, SurfaceShape, evaluate_shape

#: Largest distance of nodes from their shape, relative to the shortest edge of a facet around them.
FARTHEST = 0.1
#: Cosine of the angle between a facet's normal and the inward normal of a shape above which it faces inwards.
INWARD = 0.5


def distance_in_edges(points: np.ndarray, facets: np.ndarray, shape: SurfaceShape) -> np.ndarray:
    """Return the distance of a surface's nodes from a shape, relative to the shortest edge around each.

    Args:
        points: Coordinates, (n_nodes, 3 | 2), [length].
        facets: Node numbers of facets, linear or quadratic, (n_facets, nodes of a facet).
        shape: The shape.

    Returns:
        For each node in ascending order of its number, (n,).
    """
    nodes, local = np.unique(facets, return_inverse=True)
    corners = corners_of(facets, points.shape[1])
    edges = np.linalg.norm(points[np.roll(corners, -1, axis=1)] - points[corners], axis=2)
    size = np.full(len(nodes), np.inf)
    np.minimum.at(
        size, local.reshape(facets.shape), np.broadcast_to(edges.min(axis=1)[:, None], facets.shape)
    )
    return np.asarray(np.abs(evaluate_shape(shape, "distance", points[nodes])) / size)


def check_shapes(
    points: np.ndarray, surfaces: Mapping[str, np.ndarray], shapes: Mapping[str, SurfaceShape]
) -> dict[str, np.ndarray]:
    """Reject shapes on which a surface does not lie.

    Args:
        points: Coordinates, (n_nodes, 3 | 2), [length].
        surfaces: Name to facets.
        shapes: Name of a surface to its shape.

    Returns:
        Name of each of these surfaces to the distances of its nodes, see `distance_in_edges`.

    Raises:
        InvalidInputError: If there is no such surface, the shape is of another dimension, or nodes lie off it
            by more than a tenth of an edge, or the shape faces into the body.
    """
    distances = {}
    for name, shape in shapes.items():
        if name not in surfaces:
            raise InvalidInputError(
                f"shapes names surface {name!r}, the mesh has {sorted(surfaces)}: use one of them"
            )
        dim = getattr(shape, "dim", points.shape[1])
        if dim != points.shape[1]:
            raise InvalidInputError(
                f"the shape of surface {name!r} must be of the mesh's dimension {points.shape[1]}, "
                f"{type(shape).__name__} is for {dim}: in the plane give curves, such as a Circle"
            )
        away = distance_in_edges(points, surfaces[name], shape)
        off = away > FARTHEST
        if off.any():
            raise InvalidInputError(
                f"the nodes of surface {name!r} must lie on its shape, {np.count_nonzero(off)} of {len(off)} "
                f"lie off {type(shape).__name__} by more than a tenth of an edge, up to {away.max():.3g} "
                "edges: check its place and size and the unit of length, or give the shape of another surface"
            )
        _check_side(name, points, surfaces[name], shape)
        distances[name] = away
    return distances


def _check_side(name: str, points: np.ndarray, facets: np.ndarray, shape: SurfaceShape) -> None:
    """Reject a shape, or a part of a joined one, whose normals point into the body."""
    corners = points[corners_of(facets, points.shape[1])]
    if points.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        outward = np.column_stack([along[:, 1], -along[:, 0]])
    else:
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
    middles = corners.mean(axis=1)
    area = np.linalg.norm(outward, axis=1)
    along = np.einsum("nd,nd->n", outward, evaluate_shape(shape, "normals", middles))
    parts: Sequence[SurfaceShape] = [shape]
    part = np.zeros(len(middles), dtype=np.int64)
    if isinstance(shape, Joined):
        parts, part = shape.shapes, shape.nearest(middles)
    inward = np.bincount(part, np.where(along < -INWARD * area, area, 0.0), len(parts))
    # By area, as normals of a coarse facet beside a sharp edge may be those of the next part.
    wrong = np.flatnonzero(inward > 0.5 * np.bincount(part, area, len(parts)))
    if len(wrong):
        turned = parts[wrong[0]]
        raise InvalidInputError(
            f"the shape of surface {name!r} must have its normals out of the body, those of "
            f"{type(turned).__name__} point into it: {_turning(turned)}"
        )


def _turning(shape: SurfaceShape) -> str:
    """Return how to let a shape face the other way."""
    for switch in ("hollow", "flipped"):
        if hasattr(shape, switch):
            return f"give it {switch}={not getattr(shape, switch)}"
    if isinstance(shape, Plane):
        return f"give it the normal {tuple(-x for x in shape.normal)}"
    return "turn it round, its distance is negative inside the body"
