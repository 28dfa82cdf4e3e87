"""Quadrature points on the intersections of slave and master facets, in the slave facets' planes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.pairing.mortar.clipping import clip, simplices
from fenics_contact.pairing.mortar.layers import hidden
from fenics_contact.pairing.mortar.local_coordinates import local_coordinates, rule
from fenics_contact.pairing.mortar.planes import Planes, laid_flat, measure
from fenics_contact.surfaces import FacetedSurface, facet_shape_values

#: Area, relative to the smaller of two facets, below which a piece of their intersection is rounding.
NOTHING = 1e-14


@dataclass(frozen=True)
class Cells:
    """Quadrature points on the pieces of intersections of slave and master facets.

    Attributes:
        facet: Slave facet of each cell, numbered 0, 1, … without gaps, shape (n,).
        pair: Pair of facets of each cell, numbered 0, 1, … without gaps, shape (n,).
        weight: Weights with the cell's measure, shape (n, q), [length²] or [length].
        local: Local coordinates on the slave facet, shape (n, q, dim − 1).
        opposite: Local coordinates on the master facet, shape (n, q, dim − 1).
        slave: Shape functions of the slave facet, shape (n, q, corners).
        master: Shape functions of the master facet, shape (n, q, master corners).
    """

    facet: np.ndarray
    pair: np.ndarray
    weight: np.ndarray
    local: np.ndarray
    opposite: np.ndarray
    slave: np.ndarray
    master: np.ndarray


def cells_of(
    planes: Planes, pair_slave: np.ndarray, pair_master: np.ndarray, master: FacetedSurface
) -> tuple[Cells, np.ndarray, np.ndarray, np.ndarray]:
    """Clip pairs of facets and place quadrature points; also return the meaning of the cells' numbers.

    Args:
        planes: Planes of the slave facets.
        pair_slave: Slave facet of each pair, ascending, shape (n,).
        pair_master: Master facet of each pair, shape (n,).
        master: The master surface.

    Returns:
        The cells, the slave facet of each of their facets, and the slave and master facet of each pair.
    """
    subject, heights = laid_flat(master.points[master.facets[pair_master]], planes, pair_slave)
    window = planes.flat[pair_slave]
    apart = (subject.min(axis=1) >= window.max(axis=1)) | (subject.max(axis=1) <= window.min(axis=1))
    near = ~apart.any(axis=1)
    window, subject, heights = window[near], subject[near], heights[near]
    pair_slave, pair_master = pair_slave[near], pair_master[near]
    # Seen from the slave the orientation of the master's facets is reversed.
    vertices, count = clip(subject[:, ::-1], window)
    middle = heights.mean(axis=1)
    count = np.where(hidden(vertices, count, middle, pair_slave, planes.area), 0, count)
    pieces, pair = simplices(vertices, count)
    size = measure(pieces)
    real = np.abs(size) > NOTHING * np.minimum(np.abs(measure(subject)), measure(window))[pair]
    pieces, pair, size = pieces[real], pair[real], size[real]
    barycentric, share = rule(pieces.shape[1])
    points = barycentric @ pieces
    on_slave, on_master = (local_coordinates(points, flat[pair]) for flat in (window, subject))
    used, pair = np.unique(pair, return_inverse=True)
    facets, facet = np.unique(pair_slave[used], return_inverse=True)
    cells = Cells(
        facet.ravel()[pair.ravel()], pair.ravel(), size[:, None] * share, on_slave, on_master,
        facet_shape_values(on_slave, window.shape[1]), facet_shape_values(on_master, subject.shape[1]),
    )  # fmt: skip
    return cells, facets, pair_slave[used], pair_master[used]
