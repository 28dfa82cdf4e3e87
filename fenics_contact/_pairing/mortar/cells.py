"""Quadrature points on the intersections of slave and master facets, in the slave facets' planes.

References:
    Sutherland, I. E., Hodgman, G. W.: Reentrant polygon clipping. Communications of the ACM 17 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._pairing.mortar.planes import (
    Planes,
    SumsBy,
    laid_flat,
    local_coordinates_pulled_back,
    measure,
    measure_pulled_back,
    rule,
)
from fenics_contact._surfaces.facets import FacetedSurface, facet_shape_values, shape_functions
from fenics_contact._surfaces.pieces import local_coordinates
from fenics_contact.mesh.near_surfaces import FACING


def candidate_pairs(slave: Planes, master: Planes) -> tuple[np.ndarray, np.ndarray]:
    """Pair slave facets with all master facets that they may overlap along their normals.

    From the centre of every slave facet a search along its normal, in both directions, finds the master at
    any distance; of several layers of the master the nearest one. Facets near that point are candidates:
    facets further away along the normal than twice the sum of both radii (the maximum for an inclination of
    60 degrees) belong to another layer.

    Returns slave facet, ascending, and master facet of each pair, each shape (n,).
    """
    feet = _feet(slave, master)
    pairs = [_near(slave, master, feet, members) for members in _size_classes(master.radius)]
    pair_slave, pair_master = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    order = np.lexsort((pair_master, pair_slave))
    return pair_slave[order], pair_master[order]


def _feet(slave: Planes, master: Planes, max_steps: int = 5, tried: int = 4) -> np.ndarray:
    """Return where the normals through the centres of slave facets reach the master, shape (n, dim).

    `max_steps`: number of steps along a normal towards the master; one suffices for planes; `tried`: number
    of nearest master facets, the first of which that faces the slave determines the step.
    """
    tree, feet = cKDTree(master.origin), slave.origin.copy()
    for _ in range(max_steps):
        _, nearest = tree.query(feet, k=np.arange(min(tried, tree.n)) + 1)
        cosine = np.einsum("nd,nkd->nk", slave.normal, master.normal[nearest])
        # The nearest one that faces the slave, or the nearest of all if none does.
        choice = np.argmax(cosine < -FACING, axis=1)[:, None]
        facet = np.take_along_axis(nearest, choice, axis=1)[:, 0]
        cosine = np.take_along_axis(cosine, choice, axis=1)[:, 0]
        away = master.origin[facet] - feet
        facing = cosine < -FACING
        to_plane = np.einsum("nd,nd->n", away, master.normal[facet]) / np.where(facing, cosine, 1.0)
        step = np.where(facing, to_plane, np.einsum("nd,nd->n", away, slave.normal))
        feet += step[:, None] * slave.normal
    return feet


def _size_classes(radius: np.ndarray) -> list[np.ndarray]:
    """Group facets so that no radius is more than twice another, for any grading of the mesh."""
    octave = np.floor(np.log2(radius / radius.min())).astype(np.int64)
    return [np.flatnonzero(octave == which) for which in np.unique(octave)]


def _near(
    slave: Planes, master: Planes, feet: np.ndarray, members: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pair the slave facets with those among ``members`` that lie near their feet and face them."""
    reach = slave.radius + master.radius[members].max()
    lists = cKDTree(master.origin[members]).query_ball_point(feet, reach / FACING)
    pair_slave = np.repeat(np.arange(len(feet)), [len(each) for each in lists])
    pair_master = members[np.concatenate(lists).astype(np.int64)]
    away = master.origin[pair_master] - feet[pair_slave]
    normal = slave.normal[pair_slave]
    along = np.einsum("nd,nd->n", away, normal)
    aside = np.linalg.norm(away - along[:, None] * normal, axis=1)
    both = slave.radius[pair_slave] + master.radius[pair_master]
    facing = np.einsum("nd,nd->n", normal, master.normal[pair_master]) < -FACING
    keep = facing & (aside < both) & (np.abs(along) < both / FACING)
    return pair_slave[keep], pair_master[keep]


def clip(subject: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clip polygons to convex windows (Sutherland–Hodgman), all pairs at once; intervals to intervals.

    `subject`: polygons, shape (n, k, 2), or intervals, shape (n, 2, 1); `window`: convex polygons,
    counterclockwise, shape (n, m, 2), or intervals, shape (n, 2, 1). Vertices may be repeated.

    Returns vertices in the order of the subject, shape (n, k', 2) or (n, 2, 1), unused ones equal to the
    first, and their numbers, shape (n,), zero for empty intersections.
    """
    if window.shape[2] == 1:
        low = np.maximum(subject.min(axis=1), window.min(axis=1))
        high = np.minimum(subject.max(axis=1), window.max(axis=1))
        count = np.where(high > low, 2, 0)[:, 0]
        return np.stack([low, np.maximum(low, high)], axis=1), count
    vertices, count = subject, np.full(len(subject), subject.shape[1])
    for corner in range(window.shape[1]):
        start, end = window[:, corner], window[:, (corner + 1) % window.shape[1]]
        vertices, count, _ = _half(vertices, count, start, end)
    return vertices, count


@dataclass(frozen=True)
class _Cut:
    """How polygons were cut along one line each.

    Attributes:
        vertices: Vertices before, shape (n, k, 2).
        start: A point of the line, shape (n, 2).
        along: From there to another one, shape (n, 2).
        left: Positions of the vertices, positive on the left, shape (n, k).
        crossing: Whether the line cuts the side from a vertex to the next, shape (n, k).
        kept: Polygon, place among vertices and cuts by turns, and place in the result of what is kept.
        count: Numbers of vertices of the result, shape (n,).
    """

    vertices: np.ndarray
    start: np.ndarray
    along: np.ndarray
    left: np.ndarray
    crossing: np.ndarray
    kept: tuple[np.ndarray, np.ndarray, np.ndarray]
    count: np.ndarray


def _half(
    vertices: np.ndarray, count: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, _Cut]:
    """Keep the part to the left of the lines from ``start`` to ``end``."""
    along = (end - start)[:, None]
    away = vertices - start[:, None]
    left = along[:, :, 0] * away[:, :, 1] - along[:, :, 1] * away[:, :, 0]
    # Unused entries repeat the first vertex, so the one after the last is the first.
    following, left_then = np.roll(vertices, -1, axis=1), np.roll(left, -1, axis=1)
    used = np.arange(vertices.shape[1]) < count[:, None]
    inside = left >= 0
    crossing = used & (inside != (left_then >= 0))
    fraction = np.divide(left, left - left_then, out=np.zeros_like(left), where=crossing)
    cut = vertices + fraction[:, :, None] * (following - vertices)
    places = 2 * vertices.shape[1]
    keep = np.stack([used & inside, crossing], axis=2).reshape(len(vertices), places)
    offered = np.stack([vertices, cut], axis=2).reshape(len(vertices), places, 2)
    left_over = keep.sum(axis=1)
    clipped: np.ndarray = np.zeros((len(vertices), int(left_over.max(initial=0)), 2))
    row, column = np.nonzero(keep)
    place = (np.cumsum(keep, axis=1) - 1)[row, column]
    clipped[row, place] = offered[row, column]
    unused = np.arange(clipped.shape[1]) >= left_over[:, None]
    clipped = np.where(unused[:, :, None], clipped[:, :1], clipped)
    cut_by = _Cut(vertices, start, along[:, 0], left, crossing, (row, column, place), left_over)
    return clipped, left_over, cut_by


def clip_pulled_back(
    subject: np.ndarray, window: np.ndarray, by_vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of `clip` with respect to polygons and windows.

    `by_vertices`: derivative by the vertices, zero for unused ones and those left out, shape (n, any number,
    dim − 1).

    The result is in the shapes of ``subject`` and ``window``.
    """
    if window.shape[2] == 1:
        return _interval_pulled_back(subject, window, by_vertices)
    vertices, count, cuts = subject, np.full(len(subject), subject.shape[1]), []
    for corner in range(window.shape[1]):
        start, end = window[:, corner], window[:, (corner + 1) % window.shape[1]]
        vertices, count, cut = _half(vertices, count, start, end)
        cuts.append(cut)
    by_window, by = np.zeros_like(window), np.zeros_like(vertices)
    width = min(by.shape[1], by_vertices.shape[1])
    by[:, :width] = by_vertices[:, :width]
    for corner in reversed(range(window.shape[1])):
        by, by_start, by_end = _half_pulled_back(cuts[corner], by)
        by_window[:, corner] += by_start
        by_window[:, (corner + 1) % window.shape[1]] += by_end
    return by, by_window


def _half_pulled_back(cut: _Cut, by_clipped: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives by the vertices before a cut, and by both points of the line."""
    count, width = cut.left.shape
    by_clipped = by_clipped.copy()
    unused = np.arange(by_clipped.shape[1]) >= cut.count[:, None]
    by_clipped[:, :1] += np.where(unused[:, :, None], by_clipped, 0.0).sum(axis=1, keepdims=True)
    row, column, place = cut.kept
    by_offered = np.zeros((count, 2 * width, 2))
    by_offered[row, column] = by_clipped[row, place]
    by_vertices = by_offered[:, 0::2].copy()
    row, here = np.nonzero(cut.crossing)
    then, by_point = (here + 1) % width, by_offered[row, 2 * here + 1]
    left, left_then = cut.left[row, here], cut.left[row, then]
    # The cut is x + s (x' − x) with s = l / (l − l').
    share, slope = left / (left - left_then), 1.0 / (left - left_then) ** 2
    vertex, following = cut.vertices[row, here], cut.vertices[row, then]
    by_share = slope * np.einsum("nd,nd->n", by_point, following - vertex)
    by_left, by_then = (-left_then * by_share)[:, None], (left * by_share)[:, None]
    across = np.stack([-cut.along[row, 1], cut.along[row, 0]], axis=1)
    by_vertices[row, here] += (1 - share)[:, None] * by_point + by_left * across
    by_vertices[row, then] += share[:, None] * by_point + by_then * across
    lever = by_left * (vertex - cut.start[row]) + by_then * (following - cut.start[row])
    by_end = np.stack([lever[:, 1], -lever[:, 0]], axis=1)
    over_polygons = SumsBy(row, count)
    by_start = over_polygons(-(by_left + by_then) * across - by_end)
    return by_vertices, by_start, over_polygons(by_end)


def clip_slopes(subject: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Return the derivatives of the vertices that `clip` returns by the coordinates of window and subject.

    The result has shape (n, vertices, dim − 1, t), the coordinates of the window's corners first.
    """
    (count, corners, width), own = subject.shape, window.shape[1] * window.shape[2]
    if width == 1:
        return _interval_slopes(subject, window)
    slopes = np.zeros((count, corners, width, own + corners * width))
    each = np.arange(corners * width)
    slopes.reshape(count, corners * width, -1)[:, each, own + each] = 1.0
    vertices, left_over = subject, np.full(count, corners)
    for corner in range(window.shape[1]):
        ends = corner, (corner + 1) % window.shape[1]
        vertices, left_over, cut = _half(vertices, left_over, window[:, ends[0]], window[:, ends[1]])
        slopes = _half_slopes(cut, slopes, ends)
    return slopes


def _half_slopes(cut: _Cut, slopes: np.ndarray, ends: tuple[int, int]) -> np.ndarray:
    """Return the derivatives of the vertices after a cut along a side of the window; see `clip_slopes`.

    `slopes`: those of the vertices before; `ends`: numbers of the window's corners at the side's ends.
    """
    row, column, place = cut.kept
    here, is_cut = column // 2, (column % 2).astype(bool)
    offered = slopes[row, here]
    row_cut, here = row[is_cut], here[is_cut]
    then = (here + 1) % cut.left.shape[1]
    left, left_then = cut.left[row_cut, here], cut.left[row_cut, then]
    across = np.stack([-cut.along[row_cut, 1], cut.along[row_cut, 0]], axis=1)

    def of_left(number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices with the derivatives of their positions beside the line."""
        vertex, moved = cut.vertices[row_cut, number], slopes[row_cut, number]
        change = np.einsum("na,nat->nt", across, moved)
        away = vertex - cut.start[row_cut]
        by_end = np.stack([away[:, 1], -away[:, 0]], axis=1)
        for end, by in zip(ends, (-across - by_end, by_end), strict=True):
            change[:, 2 * end : 2 * end + 2] += by
        return vertex, change

    (vertex, change), (following, change_then) = of_left(here), of_left(then)
    # The cut is x + s (x' − x) with s = l / (l − l').
    share, slope = left / (left - left_then), 1.0 / (left - left_then) ** 2
    change = slope[:, None] * (left[:, None] * change_then - left_then[:, None] * change)
    first, second = slopes[row_cut, here], slopes[row_cut, then]
    moved = first + share[:, None, None] * (second - first)
    offered[is_cut] = moved + (following - vertex)[:, :, None] * change[:, None]
    clipped: np.ndarray = np.zeros((len(slopes), int(cut.count.max(initial=0)), *slopes.shape[2:]))
    clipped[row, place] = offered
    unused = np.arange(clipped.shape[1]) >= cut.count[:, None]
    return np.where(unused[:, :, None, None], clipped[:, :1], clipped)


def _interval_slopes(subject: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Return which ends of window and subject the ends of intersections are, shape (n, 2, 1, 4)."""
    slopes = np.zeros((len(subject), 2, 1, 4))
    for place in range(2):
        one = np.zeros((len(subject), 2, 1))
        one[:, place] = 1.0
        by_subject, by_window = _interval_pulled_back(subject, window, one)
        slopes[:, place, 0] = np.concatenate([by_window, by_subject], axis=1)[:, :, 0]
    return slopes


def _interval_pulled_back(
    subject: np.ndarray, window: np.ndarray, by_ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give the derivatives by the ends of intersections to the ends that they are."""
    ends, each = np.concatenate([subject, window], axis=1)[:, :, 0], np.arange(len(subject))
    low, high = (
        np.stack([find(ends[:, :2], axis=1), 2 + find(ends[:, 2:], axis=1)])
        for find in (np.argmin, np.argmax)
    )
    by = np.zeros(ends.shape)
    by[each, np.where(ends[each, low[0]] >= ends[each, low[1]], *low)] += by_ends[:, 0, 0]
    by[each, np.where(ends[each, high[0]] <= ends[each, high[1]], *high)] += by_ends[:, 1, 0]
    return by[:, :2, None], by[:, 2:, None]


def simplices(vertices: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut convex polygons into triangles between their first vertex and the opposite sides.

    `vertices`: polygons, shape (n, k, 2), or intervals, shape (n, 2, 1), as `clip` returns them; `count`:
    numbers of vertices, shape (n,).

    Returns triangles, shape (m, 3, 2), or intervals, shape (m, 2, 1), which of the given polygons or
    intervals each belongs to, ascending, shape (m,), and which of its vertices are the corners, shape (m,
    dim).
    """
    if vertices.shape[2] == 1:
        chosen = np.flatnonzero(count)
        return vertices[chosen], chosen, np.tile([0, 1], (len(chosen), 1))
    width = max(vertices.shape[1] - 2, 0)
    polygon, second = np.nonzero(np.arange(width) + 2 < count[:, None])
    corner = np.stack([np.zeros_like(second), second + 1, second + 2], axis=1)
    return vertices[polygon[:, None], corner], polygon, corner


#: Fraction of a slave facet's area that must be covered twice for layers to be searched.
TWICE = 1e-6


def hidden(
    vertices: np.ndarray, count: np.ndarray, height: np.ndarray, facet: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return which pieces of the master lie behind nearer ones, seen from the same slave facet.

    A partly hidden piece counts as hidden.

    `vertices`: pieces in the planes of the slave facets, as `clip` returns them, shape (n, k, dim − 1);
    `count`: their numbers of vertices, shape (n,); `height`: mean heights above the plane, shape (n,),
    [length]; `facet`: slave facet of each piece, shape (n,); `area`: area (length) of the slave facets, shape
    (n_facets,).

    Returns whether a piece is hidden, shape (n,).
    """
    behind = np.zeros(len(vertices), dtype=bool)
    if vertices.shape[1] < 2:
        return behind
    size = _area(vertices, count)
    covered = np.bincount(facet, weights=size, minlength=len(area))
    crowded = np.flatnonzero((covered > (1 + TWICE) * area)[facet] & (size > 0))
    if len(crowded) == 0:
        return behind
    far, near = _neighbours(vertices[crowded], height[crowded], facet[crowded])
    shared = _area(*clip(vertices[crowded[far]], vertices[crowded[near]]))
    smaller = np.minimum(size[crowded[far]], size[crowded[near]])
    behind[crowded[far[shared > TWICE * smaller]]] = True
    return behind


def _neighbours(vertices: np.ndarray, height: np.ndarray, facet: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair pieces of the same slave facet that may overlap, the further one first."""
    centre = vertices.mean(axis=1)
    reach = 2 * np.linalg.norm(vertices - centre[:, None], axis=2).max()
    # Facets are separated in an additional coordinate, too far apart to overlap.
    places = np.column_stack([centre, 2 * reach * facet])
    pairs = cKDTree(places).query_pairs(reach, output_type="ndarray")
    further = np.abs(height[pairs[:, 0]]) > np.abs(height[pairs[:, 1]])
    return np.where(further, pairs[:, 0], pairs[:, 1]), np.where(further, pairs[:, 1], pairs[:, 0])


def _area(vertices: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the areas (lengths) of pieces, zero for empty ones, shape (n,)."""
    if vertices.shape[1] < 2:
        return np.zeros(len(vertices))
    return np.where(count > 0, np.abs(measure(vertices)), 0.0)


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
        degree: Degree of the quadrature rule on each piece.
    """

    facets: np.ndarray
    facet: np.ndarray
    master: np.ndarray
    subject: np.ndarray
    window: np.ndarray
    pair: np.ndarray
    pieces: np.ndarray
    corner: np.ndarray
    degree: int = 5

    @property
    def slave(self) -> np.ndarray:
        """Slave facet of each pair, shape (n_pairs,)."""
        return self.facets[self.facet]


def overlaps_of(
    planes: Planes,
    pair_slave: np.ndarray,
    pair_master: np.ndarray,
    master: FacetedSurface,
    degree: int = 5,
) -> Overlaps:
    """Clip pairs of facets.

    `pair_slave`: slave facet of each pair, ascending, shape (n,); `pair_master`: master facet of each pair,
    shape (n,); `degree`: of the quadrature rule on their intersections.
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
    real = np.abs(measure(pieces)) > LAST_PLACES * smaller[pair]
    used, pair = np.unique(pair[real], return_inverse=True)
    facets, facet = np.unique(pair_slave[used], return_inverse=True)
    return Overlaps(
        facets, facet.ravel(), pair_master[used], subject[used], window[used],
        pair.ravel(), pieces[real], corner[real], degree,
    )  # fmt: skip


def _seen(subject: np.ndarray) -> np.ndarray:
    """Return master facets with the orientation that they have seen from the slave, the reverse."""
    return subject[:, ::-1]


def cells_of(overlaps: Overlaps) -> Cells:
    """Place quadrature points on the pieces of overlaps."""
    pair, pieces = overlaps.pair, overlaps.pieces
    window, subject = overlaps.window, overlaps.subject
    barycentric, share = rule(pieces.shape[1], overlaps.degree)
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

    def with_traces(self, more: tuple[np.ndarray, np.ndarray]) -> CellDerivatives:
        """Return the same with more added to those by the slave's and the master's shape functions."""
        return replace(self, slave=self.slave + more[0], master=self.master + more[1])

    def grown(self, chosen: np.ndarray, more: CellDerivatives) -> CellDerivatives:
        """Return the same with more added to those of some cells."""
        result = replace(self, **{each.name: getattr(self, each.name).copy() for each in fields(self)})
        for each in fields(self):
            getattr(result, each.name)[chosen] += getattr(more, each.name)
        return result


def cells_pulled_back(overlaps: Overlaps, cells: Cells, by: CellDerivatives) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of cells with respect to the flat corners of both facets of each pair.

    Derivatives by ``overlaps.subject`` and by ``overlaps.window``, in their shapes.
    """
    pair, pieces, subject, window = overlaps.pair, overlaps.pieces, overlaps.subject, overlaps.window
    over_pairs = SumsBy(pair, len(subject))
    by_local = by.local + _by_local(cells.local, by.slave)
    by_opposite = by.opposite + _by_local(cells.opposite, by.master)
    by_points, by_corners = local_coordinates_pulled_back(cells.local, window[pair], by_local)
    by_window = over_pairs(by_corners)
    more, by_corners = local_coordinates_pulled_back(cells.opposite, subject[pair], by_opposite)
    by_subject = over_pairs(by_corners)
    barycentric, share = rule(pieces.shape[1], overlaps.degree)
    by_pieces = barycentric.T @ (by_points + more) + measure_pulled_back(pieces, by.weight @ share)
    width = int(overlaps.corner.max(initial=1)) + 1
    over_vertices = SumsBy((pair[:, None] * width + overlaps.corner).ravel(), len(subject) * width)
    by_vertices = over_vertices(by_pieces.reshape(-1, pieces.shape[2]))
    by_seen, more = clip_pulled_back(
        _seen(subject), window, by_vertices.reshape(len(subject), width, pieces.shape[2])
    )
    return by_subject + _seen(by_seen), by_window + more


def vertex_slopes(overlaps: Overlaps) -> np.ndarray:
    """Return the derivatives of the vertices of the intersections by the flat corners of both facets.

    Those of the slave facet come first, then those of the master facet, shape (n_pairs, vertices, dim − 1,
    t).
    """
    subject, window = overlaps.subject, overlaps.window
    slopes = clip_slopes(_seen(subject), window)
    own, (count, vertices, width, total) = window[0].size, slopes.shape
    seen = slopes[..., own:].reshape(count, vertices, width, -1, width)[..., ::-1, :]
    return np.concatenate([slopes[..., :own], seen.reshape(count, vertices, width, total - own)], axis=3)


def _by_local(local: np.ndarray, by_values: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of shape functions by local coordinates, shape (n, q, dim − 1)."""
    corners = by_values.shape[2]
    _, slopes = shape_functions(local.reshape(-1, local.shape[2]), corners)
    return np.einsum("nk,nka->na", by_values.reshape(-1, corners), slopes).reshape(local.shape)
