"""How the linear pieces of triangles and quadrilaterals of one surface are their parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.mesh.cell_types import FACET_TYPES
from fenics_contact.mesh.faces import is_triangle
from fenics_contact.mesh.linear_facets import LinearFacets


@dataclass(frozen=True, eq=False)
class MixedPieces:
    """How triangles are pieces of triangles and quadrilaterals of one surface.

    `number`: which of its pieces it is, see `LinearFacets`; `flat`: corners of the linear quadrilateral that
    each is half of, in the mean plane of this, relative to its middle; zero for triangles.
    """

    owner: np.ndarray
    number: np.ndarray
    flat: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, whole: np.ndarray, cut: LinearFacets) -> MixedPieces:
        """Return those of facets."""
        halved = ~is_triangle(whole)[cut.owner]
        kind, flat = FACET_TYPES[whole.shape[1], 3], np.zeros((len(cut.owner), 4, 2))
        corners = kind.pieces[cut.number[halved] // 2]
        flat[halved] = _laid_flat(points[np.take_along_axis(whole[cut.owner[halved]], corners, axis=1)])
        return cls(cut.owner, cut.number, flat)


def _laid_flat(corners: np.ndarray) -> np.ndarray:
    """Return quadrilaterals, (n, 4, 3), in their mean planes relative to their middles, (n, 4, 2)."""
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    along = corners[:, 1] - corners[:, 0]
    along -= np.einsum("nd,nd->n", along, normal)[:, None] * normal
    along /= np.linalg.norm(along, axis=1)[:, None]
    away = corners - corners.mean(axis=1, keepdims=True)
    return np.asarray(away @ np.stack([along, np.cross(normal, along)], axis=2))
