"""Linear pieces of facets: of quadratic ones, and of triangles and quadrilaterals of one surface.

Surfaces meet on pieces, displacements are those of the whole facets. In a piece of a quadratic facet the
reference coordinates of the facet are linear. Of triangles and quadrilaterals together all pieces are
triangles, halves of linear quadrilaterals; there reference coordinates follow from the place, by the inverse
of the bilinear map of the undeformed quadrilateral. So integrals over flat quadrilaterals are those over
their halves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact._surfaces.facets import FacetedSurface, shape_functions
from fenics_contact.mesh.cell_types import FACET_TYPES, CellType, shape_gradients, shape_values
from fenics_contact.mesh.faces import TRIANGLE_COLUMNS, is_triangle
from fenics_contact.mesh.linear_facets import HALVES


def local_coordinates(points: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Invert the (bi)linear map of flat facets.

    A bilinear map x = c + a s + b t + d s t becomes s + d₁ s t = s₀, t + d₂ s t = t₀ in the axes (a, b). The
    product p = s t solves d₁ d₂ p² − (1 + d₂ s₀ + d₁ t₀) p + s₀ t₀ = 0; of its roots the one that tends to s₀
    t₀ for d → 0 belongs to the inside of a convex facet.
    """
    corners = flat.shape[1]
    if corners == 2:
        middle, half = (flat[:, :1] + flat[:, 1:]) / 2, (flat[:, 1:] - flat[:, :1]) / 2
        return (points - middle) / half
    if corners == 3:
        return _affine(points - flat[:, :1], flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
    centre, a, b, d = (np.array(_SIGNS) / 4 @ flat).transpose(1, 0, 2)
    start = _affine(points - centre[:, None], a, b)
    twist = _affine(d[:, None], a, b)
    s, t, d1, d2 = start[:, :, 0], start[:, :, 1], twist[:, :, 0], twist[:, :, 1]
    product, sum_ = s * t, 1 + d2 * s + d1 * t
    root = np.sqrt(np.maximum(sum_**2 - 4 * d1 * d2 * product, 0))
    return start - (2 * product / (sum_ + root))[:, :, None] * twist


#: Corners to the coefficients of 1, s, t and s t, times four.
_SIGNS = [[1.0, 1, 1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1], [1, -1, 1, -1]]


def _affine(away: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the components of vectors (n, q, 2) in the axes a and b, each (n, 2)."""
    det = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    x, y = away[:, :, 0], away[:, :, 1]
    s = (x * b[:, None, 1] - y * b[:, None, 0]) / det
    t = (y * a[:, None, 0] - x * a[:, None, 1]) / det
    return np.stack([s, t], axis=2)


@dataclass(frozen=True, eq=False)
class _Places:
    """Some points on pieces of facets of one shape.

    `columns`: nodes of their facets among the columns of these; `arms`: vectors a with δξ = Σ_k δλ_k a_k for
    the piece's shape functions λ, (m, corners, dim − 1).
    """

    points: np.ndarray | slice
    columns: list[int]
    kind: CellType
    local: np.ndarray
    arms: np.ndarray

    @classmethod
    def of(cls, surface: FacetedSurface, facet: np.ndarray, weights: np.ndarray) -> Iterator[_Places]:
        """Yield the points on facets of each shape; arguments as of `shape_weights`."""
        whole, mixed, dim = surface.whole, surface.mixed, surface.dim
        assert whole is not None
        width = whole.shape[1]
        every = list(range(width))
        if mixed is None:
            kind = FACET_TYPES[width, dim]
            yield cls(slice(None), every, kind, *_linear(kind, facet % len(kind.pieces), weights))
            return
        triangles, number = is_triangle(whole)[mixed.owner[facet]], mixed.number[facet]
        columns = TRIANGLE_COLUMNS[width]
        for mine, own in ((np.flatnonzero(triangles), columns), (np.flatnonzero(~triangles), every)):
            kind = FACET_TYPES[len(own), dim]
            if own is columns:
                found = _linear(kind, number[mine], weights[mine])
            else:
                found = _halved(kind, number[mine], mixed.flat[facet[mine]], weights[mine])
            yield cls(mine, own, kind, *found)


def _linear(kind: CellType, piece: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return reference coordinates and their arms where they are linear in pieces."""
    corners = kind.nodes[kind.pieces[piece]]
    return np.einsum("mk,mkd->md", weights, corners), corners


def _halved(
    kind: CellType, number: np.ndarray, flat: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return reference coordinates and their arms in halves of the linear pieces of quadrilaterals."""
    corners = np.take_along_axis(flat, HALVES[number % 2][:, :, None], axis=1)
    place = np.einsum("mk,mkd->md", weights, corners)
    values, slopes = shape_functions(local_coordinates(place[:, None], flat)[:, 0], 4)
    whole = kind.nodes[kind.pieces[number // 2]]
    by_place = np.linalg.inv(np.einsum("mka,mkd->mad", slopes, flat))
    turned = by_place @ np.einsum("mka,mkd->mad", slopes, whole)
    return np.einsum("mk,mkd->md", values, whole), corners @ turned


def whole_nodes(surface: FacetedSurface, facet: np.ndarray) -> np.ndarray:
    """Return the nodes of the whole facets that pieces belong to, shape (m, nodes of a facet)."""
    assert surface.whole is not None
    if surface.mixed is not None:
        return np.asarray(surface.whole[surface.mixed.owner[facet]])
    return np.asarray(surface.whole[facet // (len(surface.facets) // len(surface.whole))])


def shape_weights(
    surface: FacetedSurface, facet: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of whole facets and their weights at points of linear pieces.

    Returns node numbers and shape functions of the whole facets, (m, nodes of a facet) each; of triangles
    among quadrilaterals those of nodes that are listed again are zero.
    """
    nodes = whole_nodes(surface, facet)
    values = np.zeros(nodes.shape)
    for at in _Places.of(surface, facet, weights):
        _put(values, at, shape_values(at.kind, at.local))
    return nodes, values


def _put(result: np.ndarray, at: _Places, values: np.ndarray) -> None:
    """Put values at the points, and at the columns of their facets."""
    rows = np.arange(len(result))[at.points]
    result[rows[:, None], np.array(at.columns)] = values


def shape_weight_gradients(
    surface: FacetedSurface, facet: np.ndarray, weights: np.ndarray, gradients: np.ndarray
) -> np.ndarray:
    """Return the derivatives of the weights that `shape_weights` returns by the pieces' local coordinates."""
    assert surface.whole is not None
    result = np.zeros((len(facet), surface.whole.shape[1], gradients.shape[2]))
    for at in _Places.of(surface, facet, weights):
        by_local = np.einsum("mka,mkd->mda", gradients[at.points], at.arms)
        _put(result, at, shape_gradients(at.kind, at.local) @ by_local)
    return result


def shape_weights_pulled_back(
    surface: FacetedSurface, facet: np.ndarray, weights: np.ndarray, by: np.ndarray
) -> np.ndarray:
    """Vector-Jacobian product of the functions that `shape_weights` returns with respect to ``weights``."""
    result = np.zeros(weights.shape)
    for at in _Places.of(surface, facet, weights):
        gradients = shape_gradients(at.kind, at.local)
        by_local = np.einsum("mj,mjd->md", by[at.points][:, at.columns], gradients)
        result[at.points] = np.einsum("md,mkd->mk", by_local, at.arms)
    return result
