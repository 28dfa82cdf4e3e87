"""Derivatives of all integrals of dual functions over pairs of facets by the corners of both facets, at once.

The integral of the dual function of corner c with a function f over a facet is D_c b_cᵀ G⁻¹ ∫ b f, where b
are 1 and the modes of `DualBasis`, G = ∫ b bᵀ, b_c their values at the corner and D_c = ∫ N_c. So all that
has to be differentiated point by point are moments: G, which all functions over a facet share, and ∫ b f of
each pair. They depend on the flat corners of the pair, by way of the vertices of the intersection. The rest
is algebra with small matrices of facets. Reverse mode would run once for each corner and function instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._pairing.mortar.cells import Cells, Overlaps, vertex_slopes
from fenics_contact._pairing.mortar.coupling import DualBasis, inverted_pulled_back
from fenics_contact._pairing.mortar.planes import (
    Planes,
    SumsBy,
    local_coordinates_pulled_back,
    measure_pulled_back,
    planes_pulled_back,
    rule,
)
from fenics_contact._pairing.mortar.traces import Traces, trace_slopes
from fenics_contact._surfaces.facets import FacetedSurface, shape_functions


@dataclass(frozen=True)
class PointSlopes:
    """Derivatives at the quadrature points of cells by t flat coordinates of the corners of their pairs.

    The flat coordinates are those of the slave facet's corners, then those of the master facet's; where
    bodies are revolved the radii of the slave facet's corners follow.

    Attributes:
        weight: Of the weights, shape (n, q, t).
        local: Of the local coordinates on the slave facet, shape (n, q, dim − 1, t).
        opposite: Of those on the master facet, shape (n, q, dim − 1, t).
    """

    weight: np.ndarray
    local: np.ndarray
    opposite: np.ndarray

    @classmethod
    def of(cls, overlaps: Overlaps, cells: Cells, radii: np.ndarray | None) -> PointSlopes:
        """Differentiate cells, not revolved.

        `radii`: those of the corners of each pair's slave facet, shape (n_pairs, corners), None in space and
        where bodies are not revolved.
        """
        pieces, pair, window, subject = overlaps.pieces, overlaps.pair, overlaps.window, overlaps.subject
        barycentric, share = rule(pieces.shape[1], overlaps.degree)
        moved = vertex_slopes(overlaps)[pair[:, None], overlaps.corner]
        (n, ends, width, count), points = moved.shape, len(share)
        at_points = (barycentric @ moved.reshape(n, ends, width * count)).reshape(n, points, width, count)
        area = np.einsum("nca,ncat->nt", measure_pulled_back(pieces, np.ones(n)), moved)
        weight = share[:, None] * area[:, None]
        sides = (window, cells.local, cells.slave, 0), (subject, cells.opposite, cells.master, window[0].size)
        local, opposite = (_local_slopes(at_points, flat[pair], *rest) for flat, *rest in sides)
        if radii is None:
            return cls(weight, local, opposite)
        around = 2 * np.pi * radii[pair]
        by_local = shape_functions(cells.local.reshape(-1, 1), 2)[1]
        radius = np.einsum("nqk,nk->nq", cells.slave, around)
        along = np.einsum("nqk,nk->nq", by_local.reshape(n, points, 2), around)
        change = weight * radius[..., None] + (cells.weight * along)[..., None] * local[:, :, 0]
        by_radii = 2 * np.pi * cells.weight[..., None] * cells.slave
        none = np.zeros((n, points, 1, by_radii.shape[2]))
        return cls(
            np.concatenate([change, by_radii], axis=2),
            *(np.concatenate([each, none], axis=3) for each in (local, opposite)),
        )


def _local_slopes(
    at_points: np.ndarray, flat: np.ndarray, local: np.ndarray, values: np.ndarray, first: int
) -> np.ndarray:
    """Return the derivatives of local coordinates: J δξ = δx − Σ N_k δx_k.

    `at_points`: those of the points, shape (n, q, dim − 1, t); `first`: number of the facet's first
    coordinate.
    """
    width, away = flat.shape[2], at_points.copy()
    for k in range(flat.shape[1]):
        for a in range(width):
            away[:, :, a, first + width * k + a] -= values[:, :, k]
    rows = []
    for a in range(width):
        one = np.zeros_like(local)
        one[:, :, a] = 1.0
        rows.append(local_coordinates_pulled_back(local, flat, one)[0])
    return np.asarray(np.stack(rows, axis=2) @ away)


@dataclass(frozen=True)
class MomentSlopes:
    """Derivatives of the moments of pairs, with modes that are centred where they are.

    Attributes:
        area: Of ∫ 1, shape (n_pairs, t).
        first: Of the modes' integrals, shape (n_pairs, m, t).
        second: Of those of their products, shape (n_pairs, m, m, t).
        functions: Of those of 1 and the modes times functions, shape (n_pairs, 1 + m, f, t).
    """

    area: np.ndarray
    first: np.ndarray
    second: np.ndarray
    functions: np.ndarray

    @classmethod
    def of_pairs(
        cls,
        overlaps: Overlaps,
        planes: Planes,
        cells: Cells,
        basis: DualBasis,
        traces: Traces,
        surfaces: tuple[FacetedSurface, FacetedSurface],
        pairs: tuple[np.ndarray, np.ndarray],
    ) -> MomentSlopes:
        """Return derivatives by the corners of both facets in space, t = dim · all corners.

        `planes`: of the facets of which overlaps are; `cells`: not revolved; `pairs`: slave facet and master
        facet of each pair, shape (n_pairs,) each.
        """
        (slave, master), (here, there), pair = surfaces, pairs, overlaps.pair
        by_places = (
            trace_slopes(master, there[pair], cells.opposite),
            trace_slopes(slave, here[pair], cells.local)[:, :, : traces.slave.shape[1]],
        )
        corners, opposite = slave.points[slave.facets[here]], master.points[master.facets[there]]
        points = PointSlopes.of(overlaps, cells, corners[:, :, 0] if slave.measure.varies else None)
        own, varies = planes.part(overlaps.slave), slave.measure.varies
        onto = corner_slopes(own, corners, opposite, varies=varies)
        return cls.of(basis, points, traces, by_places).by_coordinates(onto)

    @classmethod
    def of(
        cls,
        basis: DualBasis,
        points: PointSlopes,
        traces: Traces,
        by_places: tuple[np.ndarray, np.ndarray],
    ) -> MomentSlopes:
        """Integrate.

        `by_places`: derivatives of the functions of the master and of the slave by their local coordinates,
        shapes (n, q, f, dim − 1).
        """
        cells = basis.cells
        modes = np.concatenate([np.ones_like(basis.modes[:, :, :1]), basis.modes], axis=2)
        n, q, m = modes.shape
        count = points.weight.shape[2]
        # δ(w b) at the points, then by the functions' own changes w b δf.
        turning = np.zeros((n, q, m, count))
        turning[:, :, 1 : 1 + points.local.shape[2]] = points.local
        if m == 4:  # the product of both coordinates
            turning[:, :, 3] = modes[:, :, 2, None] * points.local[:, :, 0]
            turning[:, :, 3] += modes[:, :, 1, None] * points.local[:, :, 1]
        weight = cells.weight[..., None, None]
        change = modes[..., None] * points.weight[:, :, None] + weight * turning
        flat = change.reshape(n, q, m * count).transpose(0, 2, 1)
        products = (flat @ modes).reshape(n, m, count, m).transpose(0, 1, 3, 2)
        still = np.einsum("nq,nqa,nqbt->nabt", cells.weight, modes, turning, optimize=True)
        second = basis.over_pair(products + still)
        moved = (flat @ traces.functions).reshape(n, m, count, -1).transpose(0, 1, 3, 2)
        weighted, split = cells.weight[..., None] * modes, by_places[0].shape[2]
        for slopes, by, some in (
            (points.opposite, by_places[0], slice(0, split)),
            (points.local, by_places[1], slice(split, None)),
        ):
            for a in range(by.shape[3] if by.shape[2] else 0):
                taken = weighted[..., None] * slopes[:, :, None, a]
                more = taken.reshape(n, q, m * count).transpose(0, 2, 1) @ by[..., a]
                moved[:, :, some] += more.reshape(n, m, count, -1).transpose(0, 1, 3, 2)
        return cls(second[:, 0, 0], second[:, 0, 1:], second[:, 1:, 1:], basis.over_pair(moved))

    def by_coordinates(self, onto: np.ndarray) -> MomentSlopes:
        """Return derivatives by other coordinates; `onto`: those by these, shape (n_pairs, t, t')."""

        def taken(values: np.ndarray) -> np.ndarray:
            shape = values.shape
            return np.asarray(
                (values.reshape(shape[0], -1, shape[-1]) @ onto).reshape(*shape[:-1], onto.shape[2])
            )

        return MomentSlopes(taken(self.area), taken(self.first), taken(self.second), taken(self.functions))


def corner_slopes(planes: Planes, corners: np.ndarray, opposite: np.ndarray, *, varies: bool) -> np.ndarray:
    """Return the derivatives of flat coordinates of pairs, see `PointSlopes`, by the corners in space.

    `planes`: of the slave facet of each pair; `corners`: its corners, shape (n_pairs, corners, dim);
    `opposite`: those of the master facet, shape (n_pairs, master corners, dim).

    The result has shape (n_pairs, t, dim · all corners).
    """
    count, dim = len(corners), corners.shape[2]
    sizes = corners.shape[1], opposite.shape[1]
    each, width = np.arange(count), (dim - 1)
    rows = []
    for number in range(width * sum(sizes)):
        seed = np.zeros((sum(sizes), width))
        seed.ravel()[number] = 1.0
        own, other = (
            np.broadcast_to(part, (count, *part.shape)) for part in (seed[: sizes[0]], seed[sizes[0] :])
        )
        sides = planes_pulled_back(
            planes, corners, own, np.zeros_like(planes.normal), (opposite, each, other)
        )
        rows.append(np.concatenate(sides, axis=1).reshape(count, -1))
    if varies:
        radii = np.zeros((sizes[0], dim * sum(sizes)))
        radii[np.arange(sizes[0]), dim * np.arange(sizes[0])] = 1.0
        rows += [np.broadcast_to(row, (count, len(row))) for row in radii]
    return np.stack(rows, axis=1)


@dataclass(frozen=True)
class NumbersOver:
    """Numbers, as of functions or nodes, over each facet, of which pairs have some.

    Attributes:
        number: Those over each facet, −1 beyond their count, shape (n_facets, most).
        place: Where those of each pair are among them, counted through all facets, shape (n_pairs, k).
    """

    number: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, facet: np.ndarray, numbers: np.ndarray) -> NumbersOver:
        """Return the numbers that facets have together.

        `facet`: of each pair, shape (n_pairs,); `numbers`: shape (n_pairs, k).
        """
        count = int(numbers.max()) + 1
        found, place = np.unique(facet[:, None] * count + numbers, return_inverse=True)
        which, number = np.divmod(found, count)
        column = np.arange(len(which)) - np.searchsorted(which, which)
        over = np.full((int(facet.max()) + 1, int(column.max()) + 1), -1)
        over[which, column] = number
        return cls(over, (which * over.shape[1] + column)[place.reshape(numbers.shape)])

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return the sums of values of pairs, shape (n_pairs, k, ...), shape (n_facets, most, ...)."""
        rest = values.shape[2:]
        summed = SumsBy(self.place.ravel(), self.number.size)(values.reshape(self.place.size, *rest))
        return summed.reshape(*self.number.shape, *rest)


@dataclass(frozen=True)
class SharedSlopes:
    """Derivatives of integrals over whole facets by moments, the functions' own moments aside.

    Attributes:
        area: By the area, shape (n_facets, corners, f).
        first: By the integrals of the modes, shape (n_facets, corners, f, m).
        second: By those of their products, shape (n_facets, corners, f, m, m).
        functions: By the moments of a function itself, shape (n_facets, corners, 1 + m).
    """

    area: np.ndarray
    first: np.ndarray
    second: np.ndarray
    functions: np.ndarray

    @classmethod
    def of(cls, basis: DualBasis, moments: np.ndarray) -> SharedSlopes:
        """Differentiate D_c (∫ f / A + b_cᵀ (C⁺ / A) ∫ m f), with modes m that stay centred.

        `moments`: those of functions over whole facets, shape (n_facets, 1 + m, f).
        """
        area, at_corners = basis.area, basis.at_corners
        mean, others = moments[:, 0] / area[:, None], moments[:, 1:].transpose(0, 2, 1)
        by_moments = at_corners @ basis.inverse
        values, D = mean[:, None] + by_moments @ moments[:, 1:], basis.coverage[:, :, None]
        # Of D_c: the shape functions of the facet are combinations of 1 and the modes.
        whole = np.concatenate([np.ones_like(at_corners[:, :, :1]), at_corners], axis=2)
        shares = np.linalg.inv(whole).transpose(0, 2, 1)
        by_area = values * shares[:, :, :1] - D * mean[:, None] / area[:, None, None]
        # Of C⁺ / A.
        by_inverse = (D * at_corners)[:, :, None, :, None] * others[:, None, :, None]
        by_second = np.einsum("ecfij,eijkl->ecfkl", by_inverse, _inverse_slopes(basis), optimize=True)
        by_area -= np.einsum("ecfij,eij->ecf", by_inverse, basis.inverse) / area[:, None, None]
        by_area -= np.einsum("ecfij,eij->ecf", by_second, basis.covariance)
        by_corner = D[..., None] * (others @ basis.inverse)[:, None]
        centring = _by_centres(basis, moments, by_corner, D * by_moments, by_second)
        by_first = values[..., None] * shares[:, :, None, 1:] + centring / area[:, None, None, None]
        by_functions = np.concatenate([np.ones_like(D) / area[:, None, None], by_moments], axis=2)
        return cls(by_area, by_first, by_second, D * by_functions)

    def of_facets(self, slopes: MomentSlopes, over: NumbersOver, at: NumbersOver) -> np.ndarray:
        """Return the derivatives of integrals over whole facets, (n_facets, corners, f, dim · nodes).

        `slopes`: by the corners of both facets of each pair; `over`: functions of pairs and facets; `at`:
        nodes at these corners.
        """
        (pairs, nodes), most = at.place.shape, at.number.shape[1]
        dim = slopes.area.shape[1] // nodes
        facets, corners, count, m = self.first.shape
        moments = [slopes.area[:, None], slopes.first, slopes.second.reshape(pairs, m * m, -1)]
        by_node = np.concatenate(moments, axis=1).reshape(pairs, -1, nodes, dim).transpose(0, 2, 3, 1)
        of_facet = at.sums(by_node).reshape(facets, most * dim, -1).transpose(0, 2, 1)
        shares = np.concatenate(
            [self.area[..., None], self.first, self.second.reshape(facets, corners, count, m * m)], axis=3
        )
        dense = shares.reshape(facets, corners * count, -1) @ of_facet
        facet, functions = over.place[:, 0] // count, over.place.shape[1]
        own = self.functions[facet] @ slopes.functions.reshape(pairs, 1 + m, -1)
        own = own.reshape(pairs, corners, functions, nodes, dim).transpose(0, 2, 3, 1, 4)
        place = over.place[:, :, None] * most + (at.place % most)[:, None]
        summed = SumsBy(place.ravel(), facets * count * most)(own.reshape(-1, corners * dim))
        summed = summed.reshape(facets, count, most, corners, dim).transpose(0, 3, 1, 2, 4)
        return np.asarray(
            dense.reshape(facets, corners, count, most * dim)
            + summed.reshape(facets, corners, count, most * dim)
        )


def _by_centres(
    basis: DualBasis,
    moments: np.ndarray,
    by_corner: np.ndarray,
    by_moment: np.ndarray,
    by_second: np.ndarray,
) -> np.ndarray:
    """Return the derivatives by the means from which modes are deviations, (n_facets, corners, f, m).

    `by_corner`: by the modes at the corner, shape (n_facets, corners, f, m); `by_moment`: by the moments of
    functions, shape (n_facets, corners, m); `by_second`: by those of products, (n_facets, corners, f, m, m).
    """
    at_corners, plain = basis.at_corners, basis.cells.local.shape[2]
    result = -by_corner - by_moment[:, :, None] * moments[:, None, 0, :, None]
    if at_corners.shape[2] == plain:
        return np.asarray(result)
    second = basis.covariance * basis.area[:, None, None]
    both = by_second[..., plain, :] + by_second[..., plain]
    for a in range(plain):  # the last mode is the product of both others
        other = plain - 1 - a
        more = by_corner[..., plain] * at_corners[:, :, None, other]
        more = more + by_moment[:, :, plain, None] * moments[:, None, 1 + other]
        result[..., a] -= more + np.einsum("ecfb,eb->ecf", both, second[:, other])
    return np.asarray(result)


def _inverse_slopes(basis: DualBasis) -> np.ndarray:
    """Return the derivatives of C⁺ / A by second moments at a fixed area, shape (n_facets, m, m, m, m)."""
    count, m, _ = basis.covariance.shape
    result = np.empty((count, m, m, m, m))
    for i in range(m):
        for j in range(m):
            one = np.zeros((count, m, m))
            one[:, i, j] = 1.0
            result[:, i, j] = inverted_pulled_back(basis.covariance, one)
    return np.asarray(result / basis.area[:, None, None, None, None] ** 2)
