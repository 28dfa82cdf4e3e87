"""Quadrature points on the intersections of slave and master facets, in the slave facets' planes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from fenics_contact.pairing.mortar.clipping import clip, clip_pulled_back, simplices
from fenics_contact.pairing.mortar.layers import hidden
from fenics_contact.pairing.mortar.local_coordinates import (
    local_coordinates,
    local_coordinates_pulled_back,
    rule,
)
from fenics_contact.pairing.mortar.planes import Planes, laid_flat, measure, measure_pulled_back
from fenics_contact.pairing.mortar.sums import SumsBy
from fenics_contact.surfaces import FacetedSurface, facet_shape_values, shape_functions

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

    def part(self, chosen: np.ndarray) -> Cells:
        """Return some of the cells, by indices or a mask."""
        return Cells(**{each.name: getattr(self, each.name)[chosen] for each in fields(self)})


@dataclass(frozen=True)
class Overlaps:
    """Pairs of facets that overlap, and the simplices into which their intersections are cut.

    Attributes:
        facets: Slave facets of the pairs, shape (n_facets,).
        facet: Which of them each pair has, shape (n_pairs,).
        master: Master facet of each pair, shape (n_pairs,).
        subject: Corners of the master facets in the slave facets' planes, shape (n_pairs, corners, dim − 1).
        window: Corners of the slave facets there, shape (n_pairs, corners, dim − 1).
        pair: Pair of each piece, ascending, shape (n,).
        pieces: Simplices, shape (n, dim, dim − 1).
        corner: Which vertices of the intersection the corners of each piece are, shape (n, dim).
    """

    facets: np.ndarray
    facet: np.ndarray
    master: np.ndarray
    subject: np.ndarray
    window: np.ndarray
    pair: np.ndarray
    pieces: np.ndarray
    corner: np.ndarray

    @property
    def slave(self) -> np.ndarray:
        """Slave facet of each pair, shape (n_pairs,)."""
        return self.facets[self.facet]

    def repeated(self, times: int) -> Overlaps:
        """Return the overlaps several times one after the other, as those of different facets."""

        def shifted(number: np.ndarray, count: int) -> np.ndarray:
            return (count * np.arange(times)[:, None] + number).ravel()

        alike = {
            each.name: np.concatenate([getattr(self, each.name)] * times)
            for each in fields(self)
            if each.name not in {"facet", "pair"}
        }
        facet, pair = shifted(self.facet, len(self.facets)), shifted(self.pair, len(self.master))
        return Overlaps(facet=facet, pair=pair, **alike)


def overlaps_of(
    planes: Planes, pair_slave: np.ndarray, pair_master: np.ndarray, master: FacetedSurface
) -> Overlaps:
    """Clip pairs of facets.

    Args:
        planes: Planes of the slave facets.
        pair_slave: Slave facet of each pair, ascending, shape (n,).
        pair_master: Master facet of each pair, shape (n,).
        master: The master surface.
    """
    subject, heights = laid_flat(master.points[master.facets[pair_master]], planes, pair_slave)
    window = planes.flat[pair_slave]
    apart = (subject.min(axis=1) >= window.max(axis=1)) | (subject.max(axis=1) <= window.min(axis=1))
    near = ~apart.any(axis=1)
    window, subject, heights = window[near], subject[near], heights[near]
    pair_slave, pair_master = pair_slave[near], pair_master[near]
    vertices, count = clip(_seen(subject), window)
    middle = heights.mean(axis=1)
    count = np.where(hidden(vertices, count, middle, pair_slave, planes.area), 0, count)
    pieces, pair, corner = simplices(vertices, count)
    smaller = np.minimum(np.abs(measure(subject)), measure(window))
    real = np.abs(measure(pieces)) > NOTHING * smaller[pair]
    used, pair = np.unique(pair[real], return_inverse=True)
    facets, facet = np.unique(pair_slave[used], return_inverse=True)
    return Overlaps(
        facets, facet.ravel(), pair_master[used], subject[used], window[used],
        pair.ravel(), pieces[real], corner[real],
    )  # fmt: skip


def _seen(subject: np.ndarray) -> np.ndarray:
    """Return master facets with the orientation that they have seen from the slave, the reverse."""
    return subject[:, ::-1]


def cells_of(overlaps: Overlaps) -> Cells:
    """Place quadrature points on the pieces of overlaps."""
    pair, pieces = overlaps.pair, overlaps.pieces
    window, subject = overlaps.window, overlaps.subject
    barycentric, share = rule(pieces.shape[1])
    points = barycentric @ pieces
    on_slave, on_master = (local_coordinates(points, flat[pair]) for flat in (window, subject))
    return Cells(
        overlaps.facet[pair], pair, measure(pieces)[:, None] * share, on_slave, on_master,
        facet_shape_values(on_slave, window.shape[1]), facet_shape_values(on_master, subject.shape[1]),
    )  # fmt: skip


@dataclass(frozen=True)
class CellDerivatives:
    """Derivatives of a scalar by what `Cells` have, each in the shape of its namesake."""

    weight: np.ndarray
    local: np.ndarray
    opposite: np.ndarray
    slave: np.ndarray
    master: np.ndarray

    def grown(self, chosen: np.ndarray, more: CellDerivatives) -> CellDerivatives:
        """Return the same with more added to those of some cells."""
        result = replace(self, **{each.name: getattr(self, each.name).copy() for each in fields(self)})
        for each in fields(self):
            getattr(result, each.name)[chosen] += getattr(more, each.name)
        return result


def cells_pulled_back(overlaps: Overlaps, cells: Cells, by: CellDerivatives) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of cells with respect to the flat corners of both facets of each pair.

    Args:
        overlaps: The overlaps.
        cells: Their cells.
        by: Derivatives by them.

    Returns:
        By ``overlaps.subject`` and by ``overlaps.window``, in their shapes.
    """
    pair, pieces, subject, window = overlaps.pair, overlaps.pieces, overlaps.subject, overlaps.window
    over_pairs = SumsBy(pair, len(subject))
    by_local = by.local + _by_local(cells.local, by.slave)
    by_opposite = by.opposite + _by_local(cells.opposite, by.master)
    by_points, by_corners = local_coordinates_pulled_back(cells.local, window[pair], by_local)
    by_window = over_pairs(by_corners)
    more, by_corners = local_coordinates_pulled_back(cells.opposite, subject[pair], by_opposite)
    by_subject = over_pairs(by_corners)
    barycentric, share = rule(pieces.shape[1])
    by_pieces = barycentric.T @ (by_points + more) + measure_pulled_back(pieces, by.weight @ share)
    width = int(overlaps.corner.max(initial=1)) + 1
    over_vertices = SumsBy((pair[:, None] * width + overlaps.corner).ravel(), len(subject) * width)
    by_vertices = over_vertices(by_pieces.reshape(-1, pieces.shape[2]))
    by_seen, more = clip_pulled_back(
        _seen(subject), window, by_vertices.reshape(len(subject), width, pieces.shape[2])
    )
    return by_subject + _seen(by_seen), by_window + more


def _by_local(local: np.ndarray, by_values: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of shape functions by local coordinates, shape (n, q, dim − 1)."""
    corners = by_values.shape[2]
    _, slopes = shape_functions(local.reshape(-1, local.shape[2]), corners)
    return np.einsum("nk,nka->na", by_values.reshape(-1, corners), slopes).reshape(local.shape)
