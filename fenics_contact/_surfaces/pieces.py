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

from fenics_contact._surfaces.facets import FacetedSurface, Uncut, shape_functions
from fenics_contact.mesh.cell_types import FACET_TYPES, CellType, shape_gradients, shape_values
from fenics_contact.mesh.faces import TRIANGLE_COLUMNS, is_triangle
from fenics_contact.mesh.linear_facets import HALVES, LinearFacets


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


@dataclass(frozen=True, eq=False)
class Pieces(Uncut):
    """How linear facets are pieces of facets of one shape.

    Attributes:
        whole: The facets, as rows of positions in the nodes of the surface, shape (n_facets, nodes).
        dim: Dimension of the space around them.
    """

    whole: np.ndarray
    dim: int

    is_cut = True

    @property
    def order(self) -> int:  # type: ignore[override]
        """Degree of displacements."""
        return 1 if self.whole.shape[1] == 4 else 2

    @property
    def degree(self) -> int:  # type: ignore[override]
        """Degree of quadrature, higher on quadratic quadrilaterals and halves of any."""
        return 8 if self.whole.shape[1] in (4, 9) else 5

    def whole_of(self, facets: np.ndarray) -> np.ndarray:
        """Return the facets."""
        return self.whole

    def _owner(self, facet: np.ndarray) -> np.ndarray:
        """Return the facets that pieces belong to."""
        return np.asarray(facet // len(FACET_TYPES[self.whole.shape[1], self.dim].pieces))

    def _places(self, facet: np.ndarray, weights: np.ndarray) -> Iterator[_Places]:
        """Yield the points on facets of each shape; arguments as of `functions`, one point a piece."""
        width = self.whole.shape[1]
        kind = FACET_TYPES[width, self.dim]
        yield _Places(
            slice(None), list(range(width)), kind, *_linear(kind, facet % len(kind.pieces), weights)
        )

    def nodes(self, facets: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return the nodes of the whole facets; triangles among quadrilaterals list some again."""
        return np.asarray(self.whole[self._owner(facet)])

    def functions(self, facet: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the shape functions of the whole facets; those of nodes that are listed again are zero."""
        shape, width = values.shape[:-1], self.whole.shape[1]
        values, facet = values.reshape(-1, values.shape[-1]), _each(facet, shape)
        result = np.zeros((len(values), width))
        for at in self._places(facet, values):
            _put(result, at, shape_values(at.kind, at.local))
        return result.reshape(*shape, width)

    def gradients(self, facet: np.ndarray, values: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """Return the derivatives of `functions` by the pieces' local coordinates."""
        result = np.zeros((len(facet), self.whole.shape[1], gradients.shape[2]))
        for at in self._places(facet, values):
            by_local = np.einsum("mka,mkd->mda", gradients[at.points], at.arms)
            _put(result, at, shape_gradients(at.kind, at.local) @ by_local)
        return result

    def pulled_back(self, facet: np.ndarray, values: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `functions` with respect to the linear ones."""
        shape, facet = values.shape, _each(facet, values.shape[:-1])
        values, by = values.reshape(-1, shape[-1]), by.reshape(-1, by.shape[-1])
        result = np.zeros(values.shape)
        for at in self._places(facet, values):
            gradients = shape_gradients(at.kind, at.local)
            by_local = np.einsum("mj,mjd->md", by[at.points][:, at.columns], gradients)
            result[at.points] = np.einsum("md,mkd->mk", by_local, at.arms)
        return result.reshape(shape)

    mean_nodes, mean_functions, means_pulled_back = nodes, functions, pulled_back


@dataclass(frozen=True, eq=False)
class MixedPieces(Pieces):
    """How triangles are pieces of triangles and quadrilaterals of one surface.

    `owner`, `number`: whose piece each is, and which, see `LinearFacets`; `flat`: corners of the linear
    quadrilateral that it is half of, in the mean plane of this, relative to its middle; zero for triangles.
    """

    owner: np.ndarray
    number: np.ndarray
    flat: np.ndarray

    is_mixed = True

    @classmethod
    def of(cls, points: np.ndarray, whole: np.ndarray, cut: LinearFacets) -> MixedPieces:
        """Return those of facets."""
        halved = ~is_triangle(whole)[cut.owner]
        kind, flat = FACET_TYPES[whole.shape[1], 3], np.zeros((len(cut.owner), 4, 2))
        corners = kind.pieces[cut.number[halved] // 2]
        flat[halved] = _laid_flat(points[np.take_along_axis(whole[cut.owner[halved]], corners, axis=1)])
        return cls(whole, 3, cut.owner, cut.number, flat)

    def _owner(self, facet: np.ndarray) -> np.ndarray:
        return np.asarray(self.owner[facet])

    def _places(self, facet: np.ndarray, weights: np.ndarray) -> Iterator[_Places]:
        width, triangles = self.whole.shape[1], is_triangle(self.whole)[self.owner[facet]]
        columns, number = TRIANGLE_COLUMNS[width], self.number[facet]
        mine = np.flatnonzero(triangles)
        kind = FACET_TYPES[len(columns), self.dim]
        yield _Places(mine, columns, kind, *_linear(kind, number[mine], weights[mine]))
        mine = np.flatnonzero(~triangles)
        kind, flat = FACET_TYPES[width, self.dim], self.flat[facet[mine]]
        yield _Places(mine, list(range(width)), kind, *_halved(kind, number[mine], flat, weights[mine]))


def _each(facet: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the facet of each of the points of groups of a shape, (n, ...)."""
    return facet if len(shape) == 1 else np.repeat(facet, shape[1])


def _put(result: np.ndarray, at: _Places, values: np.ndarray) -> None:
    """Put values at the points, and at the columns of their facets."""
    rows = np.arange(len(result))[at.points]
    result[rows[:, None], np.array(at.columns)] = values


def _laid_flat(corners: np.ndarray) -> np.ndarray:
    """Return quadrilaterals, (n, 4, 3), in their mean planes relative to their middles, (n, 4, 2)."""
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    along = corners[:, 1] - corners[:, 0]
    along -= np.einsum("nd,nd->n", along, normal)[:, None] * normal
    along /= np.linalg.norm(along, axis=1)[:, None]
    away = corners - corners.mean(axis=1, keepdims=True)
    return np.asarray(away @ np.stack([along, np.cross(normal, along)], axis=2))


def shape_weights(
    surface: FacetedSurface, facet: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes that move points of facets and their weights, shape (n, nodes) each."""
    return surface.cut.nodes(surface.facets, facet), surface.cut.functions(facet, weights)
