"""Closest-point projection of slave nodes onto a faceted master surface along its continuous normal field."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact._surfaces.facets import FacetedSurface, heights, outside, shape_functions
from fenics_contact._surfaces.pieces import shape_weights
from fenics_contact.mesh.faces import coordinate_rounding, vector_areas, widened
from fenics_contact.mesh.quality import determinants

#: A facet is tried in the second round if its bounding ball is as near as the nearest centroid times this.
REACH = 1.1
#: Largest number of Newton steps to a closest point; a few suffice where it exists.
NEWTON_STEPS = 25
#: Residual tolerance of Newton's method, relative to the facet and the gap.
RESIDUAL = 1e-10
#: Tolerance beyond the outer edges of the surface. Where a plane of symmetry cuts two round bodies the
#: averaged normals are slightly inclined to that plane, and nodes of one body would just miss the other.
MARGIN = 0.1


@dataclass(frozen=True)
class Projection:
    """Projections of points. Only points that have a projection are listed.

    `local`: local coordinates on it; `gap`: signed distance from the true surface along the normal, positive
    outside; `beside`: distance outside its facet, in local coordinates; 0 for rounding; `lost`: points that
    face a facet but have no projection, ascending.
    """

    point: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    beside: np.ndarray
    lost: np.ndarray

    def part(self, chosen: np.ndarray) -> Projection:
        """Return some of the projections, by indices or a mask."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in _EACH})


_EACH = ("point", "facet", "local", "gap", "normal", "beside")


def node_weights(surface: FacetedSurface, hit: Projection) -> sp.csr_matrix:
    """Return the weights of nodes in the motion of a surface at projections, shape (n, n_nodes)."""
    values, _ = shape_functions(hit.local, surface.corners)
    nodes, values = shape_weights(surface, hit.facet, values)
    row = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    return sp.csr_matrix((values.ravel(), (row, nodes.ravel())), shape=(len(nodes), len(surface.nodes)))


def interpolated_normal(weights: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate unit normals and scale back to unit length."""
    mean = np.einsum("nk,nkd->nd", weights, normals)
    length = np.linalg.norm(mean, axis=1)
    return mean / length[:, None], length


def newton_matrix(
    points: np.ndarray,
    normals: np.ndarray,
    derivatives: np.ndarray,
    gap: np.ndarray,
    normal: np.ndarray,
    length: np.ndarray,
) -> np.ndarray:
    """Return ∂(x(ξ) + g n(ξ))/∂(ξ, g), shape (n, dim, dim); see `project` for the symbols."""
    tangents = np.einsum("nka,nkd->nda", derivatives, points)
    turned = np.einsum("nka,nkd->nda", derivatives, normals)
    turned = (turned - normal[:, :, None] * np.einsum("nd,nda->na", normal, turned)[:, None]) / length[
        :, None, None
    ]
    return np.concatenate([tangents + gap[:, None, None] * turned, normal[:, :, None]], axis=2)


def project(points: np.ndarray, normals: np.ndarray, master: FacetedSurface) -> Projection:
    """Project points onto a surface: find ξ, g with x(ξ) + (h(ξ) + g) n(ξ) = point.

    x(ξ) is the (bi)linear facet, in the plane a straight edge, and n(ξ) the interpolated, normalised nodal
    normal; h is the height of the true surface over the facet. Because n is continuous, so are gap, normal
    and weights while a point slides from facet to facet. Of several projections that with the smallest ``|h +
    g|`` is used; surfaces that face the same way do not touch. Points without any that lie beside the surface
    by no more than a twentieth of a facet's width are projected on the facet's continuation.
    """
    sides, rounding = _Sides.of(master), coordinate_rounding(master.points)
    near = _in_nearest(points, normals, master, sides, rounding)
    projection = best_projections(near.part(near.beside == 0.0), rounding)
    waiting = np.setdiff1d(np.arange(len(points)), projection.point)
    if len(waiting):
        reached = []
        corners = master.points[master.facets]
        radius = np.linalg.norm(corners - sides.middle[:, None], axis=2).max(axis=1)
        for point, facet in facets_in_reach(sides.tree, radius, points, waiting):
            over = sides.may_be_over(points, normals, point, facet)
            reached.append(_solve(points, normals, master, point[over], facet[over], rounding))
        projection = join([projection, best_projections(join(reached), rounding)])
    gap = projection.gap - heights(master, projection.facet, projection.local).value
    return replace(projection, gap=gap, lost=np.setdiff1d(projection.lost, projection.point))


def _in_nearest(
    points: np.ndarray, normals: np.ndarray, master: FacetedSurface, sides: _Sides, rounding: float
) -> Projection:
    """Project points on the facets whose centroids are nearest, but for those that cannot be the closest.

    First each on the facet that it is nearest to, then on three more, then on the others: facets that are
    farther away than its projection are left out.
    """
    point, facet = nearest_facets(sides.tree, points)
    least = _least_distances(points, sides, facet)
    order = np.argsort(least, axis=1, kind="stable")
    facet, least = (np.take_along_axis(each, order, axis=1) for each in (facet, least))
    reach, found = np.full(len(points), np.inf), list[Projection]()
    for some in np.split(np.arange(facet.shape[1]), (1, 4)):
        near = least[:, some] <= reach[:, None]
        found.append(_solve(points, normals, master, point[:, some][near], facet[:, some][near], rounding))
        inside = found[-1].part(found[-1].beside == 0.0)
        np.minimum.at(reach, inside.point, np.abs(inside.gap) + 2.0 * rounding)
    return join(found)


def _least_distances(points: np.ndarray, sides: _Sides, facet: np.ndarray, slack: float = 1e-6) -> np.ndarray:
    """Return bounds below the distances of points from some facets each, shape (n, facets), [length].

    Facets lie inside planes through their edges, and between one above and one below them. `slack`:
    relative, for rounding and projections barely outside a facet.
    """
    out, ends, middle = sides.out, (1.0 + slack) * sides.ends, sides.middle
    # Facets last: what follows are sums of few long arrays.
    last = (np.asfortranarray(each).T.take(facet, axis=-1) for each in (out, ends, middle))
    directions, farthest, start = last
    away = np.einsum("dknf,dnf->knf", directions, points.T[:, :, None] - start) - farthest
    beside, over = (np.maximum(each.max(axis=0), 0.0) for each in (away[:-2], away[-2:]))
    return np.asarray((1.0 - slack) * np.hypot(beside, over))


@dataclass(frozen=True, eq=False)
class _Sides:
    """Planes between which facets lie: through their edges, above and below them.

    `out`: unit normals of these, edges first, shape (n_facets, n_planes, dim); `ends`: their distances from
    `middle`, the means of the corners, shape (n_facets, n_planes), [length]; `normals`: those of the corners,
    shape (n_facets, n_corners, dim).
    """

    out: np.ndarray
    ends: np.ndarray
    middle: np.ndarray
    normals: np.ndarray

    @classmethod
    def of(cls, master: FacetedSurface) -> _Sides:
        """Return those of a surface."""
        corners = master.points[master.facets]
        middle, above = corners.mean(axis=1), _unit(vector_areas(master.points, master.facets))[:, None]
        along = np.roll(corners, -1, axis=1) - corners
        edges = _unit(along if master.dim == 2 else np.cross(along, above))
        out = np.concatenate([edges, above, -above], axis=1)
        ends = np.einsum("fkd,fcd->fkc", out, corners - middle[:, None]).max(axis=2)
        return cls(out, ends, middle, master.normals[master.facets])

    def may_be_over(
        self,
        points: np.ndarray,
        normals: np.ndarray,
        point: np.ndarray,
        facet: np.ndarray,
        slack: float = 0.3,
    ) -> np.ndarray:
        """Return the pairs that can have a projection that faces its point, ascending.

        Where x = x(ξ) + g n(ξ), x is no farther beyond an edge than x(ξ), but for the tilt of n along g.
        `slack`: share for projections beside the facet, where corners have other weights than between them.
        """
        away = points[point] - self.middle[facet]
        reach = np.sqrt(np.einsum("nd,nd->n", away, away)) + self._width[facet]
        left = np.arange(len(point))
        for k in range(self.out.shape[1] - 2):
            of = facet[left]
            beyond = np.einsum("nd,nd->n", self.out[of, k], away[left])
            left = left[beyond <= (1.0 + slack) * self.ends[of, k] + self._tilt[of, k] * reach[left]]
        towards = np.einsum("ncd,nd->nc", self.normals[facet[left]], normals[point[left]])
        return left[towards.min(axis=1) - slack * np.ptp(towards, axis=1) < 0.0]

    @cached_property
    def tree(self) -> cKDTree:
        """The facets by their middles."""
        return cKDTree(self.middle)

    @cached_property
    def _width(self) -> np.ndarray:
        return np.asarray(self.ends.max(axis=1))

    @cached_property
    def _tilt(self) -> np.ndarray:
        """By how much interpolated normals lean over the edges, with a margin, (n_facets, n_edges)."""
        across = np.einsum("fcd,fd->fc", self.normals, _unit(self.normals.mean(axis=1))).min(axis=1)
        tilt = np.abs(np.einsum("fcd,fkd->fck", self.normals, self.out[:, :-2])).max(axis=1)
        return np.asarray(1.3 * tilt / np.maximum(across, 1e-3)[:, None])


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length one along others; zero where these are."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def nearest_facets(tree: cKDTree, points: np.ndarray, nearest: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Pair points with the facets whose centroids are nearest: numbers of both, shape (n, facets)."""
    ranks = np.arange(min(nearest, tree.n)) + 1
    _, facets = tree.query(points, k=ranks)
    return np.repeat(np.arange(len(points))[:, None], len(ranks), axis=1), facets


def facets_in_reach(
    tree: cKDTree, radius: np.ndarray, points: np.ndarray, waiting: np.ndarray, most: int = 1_000_000
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the remaining points with all facets that can be closest, for any grading of the mesh.

    `most`: pairs at a time, or those of one point.
    """
    if not len(waiting):
        yield waiting, waiting
        return
    nearest, _ = tree.query(points[waiting])
    farthest = REACH * nearest + radius.max()
    for some in np.split(np.arange(len(waiting)), np.arange(0, len(waiting), 1 + most // tree.n)[1:]):
        lists = tree.query_ball_point(points[waiting[some]], farthest[some])
        pair = np.repeat(some, [len(facets) for facets in lists])
        facet = np.concatenate([*lists, []]).astype(np.int64)
        distance = np.linalg.norm(points[waiting[pair]] - tree.data[facet], axis=1)
        near = distance <= REACH * nearest[pair] + radius[facet]
        yield waiting[pair[near]], facet[near]


def _solve(
    points: np.ndarray,
    normals: np.ndarray,
    master: FacetedSurface,
    point: np.ndarray,
    facet: np.ndarray,
    rounding: float,
    patience: int = 8,
    edge_tolerance: float = 1e-9,
) -> Projection:
    """Solve for each (point, facet) pair by Newton's method; keep those in a facet or barely beside it.

    `patience`: number of steps after which a point still a facet's width away belongs to another facet;
    `edge_tolerance`: tolerance of a projection outside a facet, in local coordinates, for rounding on shared
    edges. Far from the origin the rounding of coordinates is added.
    """
    nodes = master.facets[facet]
    # Relative to the facet's own corner it is as exact far from the origin as near it.
    start = master.points[nodes[:, 0]]
    corners, target = master.points[nodes] - start[:, None], points[point] - start
    corner_normals = master.normals[nodes]
    size = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    local = np.full((len(point), master.dim - 1), 1 / 3 if master.corners == 3 else 0.0)
    # Pairs come last in memory: what follows are sums of few long arrays.
    corners, corner_normals, target, local = map(np.asfortranarray, (corners, corner_normals, target, local))
    gap = np.zeros(len(point))
    at = np.arange(len(point))  # the pairs still iterating
    for count in range(NEWTON_STEPS):
        pairs = (each.T.take(at, axis=-1).T for each in (corners, corner_normals, target, local, gap, size))
        step = _newton_step(*pairs)
        # A point far beyond the facet belongs to another one; limiting it keeps its iterates finite.
        local[at] = np.clip(local[at] + step[:, :-1], -3, 3)
        gap[at] += step[:, -1]
        moving = np.abs(step[:, :-1]).max(axis=1) > 1e-8  # quadratic convergence: next comes rounding
        if count >= patience:
            moving &= outside(local[at], master.corners) < 1.0
        at = at[moving]
        if len(at) == 0:
            break
    values, derivatives = shape_functions(local, master.corners)
    normal, length = interpolated_normal(values, corner_normals)
    residual = np.einsum("nk,nkd->nd", values, corners) + gap[:, None] * normal - target
    matrix = newton_matrix(corners, corner_normals, derivatives, gap, normal, length)
    solved = np.linalg.norm(residual, axis=1) < RESIDUAL * (size + np.abs(gap))
    beside = outside(local, master.corners)
    beside = np.where(beside <= edge_tolerance + _local_rounding(matrix, rounding), 0.0, beside)
    facing = np.einsum("nd,nd->n", normal, normals[point]) < 0
    near = facing & (beside <= MARGIN * (0.5 if master.corners == 3 else 1.0))
    lost = np.unique(point[near & ~solved])
    return Projection(point, facet, local, gap, normal, beside, lost).part(near & solved)


def _local_rounding(matrix: np.ndarray, rounding: float) -> np.ndarray:
    """Return a bound of the rounding of local coordinates, shape (n,)."""
    # Entries of the inverse are bounded by the product of all but one column norms over the determinant.
    tangents = np.linalg.norm(matrix[:, :, :-1], axis=1)
    cofactor = tangents.max(axis=1) if matrix.shape[1] == 3 else np.ones(len(matrix))
    return np.asarray(rounding * cofactor / np.maximum(np.abs(determinants(matrix)), 1e-300))


def _newton_step(
    corners: np.ndarray,
    normals: np.ndarray,
    target: np.ndarray,
    local: np.ndarray,
    gap: np.ndarray,
    size: np.ndarray,
) -> np.ndarray:
    """Return the changes of (ξ, g), shape (n, dim); zero where the facet and its normals are degenerate."""
    values, derivatives = map(np.asfortranarray, shape_functions(local, corners.shape[1]))
    normal, length = interpolated_normal(values, normals)
    residual = np.einsum("nk,nkd->nd", values, corners) + gap[:, None] * normal - target
    matrix = newton_matrix(corners, normals, derivatives, gap, normal, length)
    regular = np.abs(determinants(matrix)) > 1e-12 * size ** (matrix.shape[1] - 1)
    matrix[~regular] = np.eye(matrix.shape[1])
    return np.where(regular[:, None], -np.linalg.solve(matrix, residual[:, :, None])[:, :, 0], 0.0)


def best_projections(projections: Projection, rounding: float) -> Projection:
    """Keep the projection least beside its facet for each point; then by smallest abs(gap), then facet."""
    distance = np.abs(projections.gap)
    order = np.lexsort((distance, projections.beside, projections.point))
    _, first, group = np.unique(projections.point[order], return_index=True, return_inverse=True)
    nearest = order[first][group.ravel()]  # of the same point, for each in order
    alike = distance[order] - distance[nearest] <= rounding + coordinate_rounding(distance)
    order = order[alike & (projections.beside[order] == projections.beside[nearest])]
    order = order[np.lexsort((projections.facet[order], projections.point[order]))]
    _, first = np.unique(projections.point[order], return_index=True)
    return projections.part(order[first])


def join(parts: Sequence[Projection]) -> Projection:
    """Return the projections of several groups of points, ascending by point."""
    order = np.argsort(np.concatenate([part.point for part in parts]))
    joined = {name: np.concatenate([getattr(part, name) for part in parts])[order] for name in _EACH}
    return Projection(**joined, lost=np.unique(np.concatenate([part.lost for part in parts])))


def surfaces_match(
    slave: FacetedSurface, master: FacetedSurface, *, near: float = 1e-3, first: int = 50
) -> bool:
    """Return whether the facets of two surfaces are the same where the surfaces meet.

    Their nodes lie over each other along the slave's normals, also across a gap, and no slave node without
    such a partner meets the master. Then contact by nodes passes the patch test. `near`: how far nodes may be
    apart, relative to the shortest edge of their facets; `first`: number of nodes that are projected first,
    those nearest to the master: one that meets it decides.
    """
    mine, theirs = _matched_facets(slave, master)
    if mine.shape[1] != theirs.shape[1]:
        return False
    away, partner = cKDTree(master.points).query(slave.points)
    apart = master.points[partner] - slave.points
    apart -= np.einsum("nd,nd->n", apart, slave.normals)[:, None] * slave.normals
    reach = near * _shortest_edges(master)[partner] + coordinate_rounding(master.points)
    over = np.linalg.norm(apart, axis=1) <= reach
    if not _same_facets(mine[over[mine].all(axis=1)], partner, theirs):
        return False
    others = np.flatnonzero(~over)
    others = others[np.argsort(away[others], kind="stable")]
    parts = others[:first], others[first:]
    return not any(len(part) and _meet(slave, part, master) for part in parts)


def _matched_facets(*surfaces: FacetedSurface) -> list[np.ndarray]:
    """Return the facets of surfaces, whole ones where those of some are of several shapes."""
    if not any(surface.cut.is_mixed for surface in surfaces):
        return [surface.facets for surface in surfaces]
    facets = [surface.whole for surface in surfaces]
    width = max(each.shape[1] for each in facets)
    return [widened(each, width) if (each.shape[1], width) in ((3, 4), (6, 9)) else each for each in facets]


def _same_facets(facets: np.ndarray, partner: np.ndarray, master: np.ndarray) -> bool:
    """Return whether facets of a slave, at least one, are facets of the master between partners."""
    mine, known = (np.unique(_each_once(rows), axis=0) for rows in (partner[facets], master))
    return len(mine) > 0 and len(np.unique(np.concatenate([known, mine]), axis=0)) == len(known)


def _each_once(rows: np.ndarray) -> np.ndarray:
    """Return nodes in order, -1 in place of those that triangles among quadrilaterals list again."""
    nodes = np.sort(rows, axis=1)
    nodes[:, 1:][nodes[:, 1:] == nodes[:, :-1]] = -1
    return np.sort(nodes, axis=1)


def _meet(slave: FacetedSurface, nodes: np.ndarray, master: FacetedSurface) -> bool:
    return len(project(slave.points[nodes], slave.normals[nodes], master).point) > 0


def _shortest_edges(surface: FacetedSurface) -> np.ndarray:
    """Return the length of the shortest edge at each node, shape (n,), [length]."""
    corners = surface.points[surface.facets]
    shortest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    result = np.full(len(surface.points), np.inf)
    np.minimum.at(result, surface.facets, shortest[:, None])
    return result
