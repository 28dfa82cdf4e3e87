"""Facets cut into linear ones through the same nodes; triangles where some of them are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.mesh.cell_types import FACET_TYPES
from fenics_contact.mesh.faces import is_triangle, of_one_shape

HALVES = np.array([[0, 1, 2], [0, 2, 3]])
"""Corners of the two triangles into which a quadrilateral is cut."""


@dataclass(frozen=True, eq=False)
class LinearFacets:
    """Linear facets, and the facet that each is a piece of, ascending.

    `number`: which of its pieces it is; of quadrilaterals among triangles each linear one has two in turn,
    see `HALVES`.
    """

    rows: np.ndarray
    owner: np.ndarray
    number: np.ndarray


def linear_facets(facets: np.ndarray, dim: int) -> LinearFacets:
    """Cut facets into linear ones."""
    if not has_both(facets):
        pieces = FACET_TYPES[facets.shape[1], dim].pieces
        rows = facets[:, pieces].reshape(-1, pieces.shape[1])
        return LinearFacets(rows, *np.indices((len(facets), len(pieces))).reshape(2, -1))
    parts = []
    for numbers, some in of_one_shape(facets):
        pieces = FACET_TYPES[some.shape[1], dim].pieces
        triangles = pieces if pieces.shape[1] == 3 else pieces[:, HALVES].reshape(-1, 3)
        owner, number = np.indices((len(some), len(triangles))).reshape(2, -1)
        parts.append((some[:, triangles].reshape(-1, 3), numbers[owner], number))
    rows, owner, number = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(owner, kind="stable")
    return LinearFacets(rows[order], owner[order], number[order])


def has_both(facets: np.ndarray) -> bool:
    """Return whether there are triangles among facets of four corners."""
    return bool(is_triangle(facets).any())
