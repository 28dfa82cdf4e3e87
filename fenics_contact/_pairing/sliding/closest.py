"""Closest points on the smooth surfaces of moved bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact._base.csr import Csr
from fenics_contact._pairing.sliding.patches import PatchValues, SmoothPatches, n_values
from fenics_contact._surfaces.facets import FacetedSurface, corner_products, outside
from fenics_contact._surfaces.projection import (
    Projection,
    best_projections,
    facets_in_reach,
    join,
    nearest_facets,
)
from fenics_contact.mesh.faces import coordinate_rounding


@dataclass(frozen=True)
class PatchPoints:
    """Points of patches.

    Attributes:
        place: S, shape (n, dim), [length].
        tangents: S,_a, shape (n, dim − 1, dim).
        second: S,_ab, shape (n, dim − 1, dim − 1, dim).
        normal: Outward unit normals, shape (n, dim).
    """

    place: np.ndarray
    tangents: np.ndarray
    second: np.ndarray
    normal: np.ndarray
    functions: PatchValues


def patch_points(patches: SmoothPatches, coefficients: np.ndarray, local: np.ndarray) -> PatchPoints:
    """Evaluate patches.

    `coefficients`: those of the patch of each point, shape (n, n_functions, dim); `local`: local coordinates,
    shape (n, dim − 1).
    """
    at = patches.functions(local)
    place = np.einsum("nb,nbd->nd", at.value, coefficients)
    tangents = np.einsum("nba,nbd->nad", at.first, coefficients)
    second = np.einsum("nbac,nbd->nacd", at.second, coefficients)
    if local.shape[1] == 1:
        across = np.stack([tangents[:, 0, 1], -tangents[:, 0, 0]], axis=1)
    else:
        across = np.cross(tangents[:, 0], tangents[:, 1])
    length = np.linalg.norm(across, axis=1)[:, None]
    normal = across / np.where(length > 0.0, length, 1.0)
    return PatchPoints(place, tangents, second, normal, at)


@dataclass(frozen=True)
class ClosestPoints:
    """Search of closest points on a surface as it lies now.

    Attributes:
        points: Coordinates of the surface's nodes, shape (n_nodes, dim), [length].
        coefficients: Coefficients of the patches, shape (n_facets, n_functions, dim), [length].
        reach: Distance beyond which no point is wanted, [length].
        apart: Facets on which each target has no point, shape (n_targets, n_facets); None for other bodies.
        margin: Distance beyond the rim at which points count, in half widths of a facet.
        hold: Distance beyond the last facet up to which it is kept, in local coordinates.
    """

    patches: SmoothPatches
    points: np.ndarray
    coefficients: np.ndarray
    reach: float = np.inf
    apart: sp.csr_matrix | None = None
    margin: float = 0.1
    hold: float = 1e-6

    def find(
        self,
        targets: np.ndarray,
        normals: np.ndarray,
        facet: np.ndarray,
        local: np.ndarray,
        met: np.ndarray | None = None,
    ) -> Projection:
        """Return the closest points of targets that face the surface.

        A target keeps its last facet as long as its closest point is barely outside it: on an edge between
        two facets it would else change sides for ever.

        `targets`: points, shape (n, dim), [length]; `normals`: outward unit normals there, shape (n, dim);
        `facet`: their last facets, −1 where there is none, shape (n,); `local`: last local coordinates, shape
        (n, dim − 1); `met`: whether they may lie behind facets where a body meets itself, shape (n,); by
        default those that have a last facet.
        """
        known = np.flatnonzero(facet >= 0)
        kept = self._solve(targets, normals, known, facet[known], local[known])
        kept = kept.part((kept.beside <= self.hold) & (np.abs(kept.gap) <= self.reach))
        waiting = np.setdiff1d(np.arange(len(targets)), kept.point)
        if len(waiting) == 0:
            return replace(kept, lost=waiting)
        found = self._searched(targets, normals, waiting, facet >= 0 if met is None else met)
        found = join([kept, found.part(np.abs(found.gap) <= self.reach)])
        return replace(found, lost=np.setdiff1d(found.lost, found.point))

    def _searched(
        self, targets: np.ndarray, normals: np.ndarray, waiting: np.ndarray, met: np.ndarray
    ) -> Projection:
        """Return the closest points among the facets nearest to the waiting targets.

        Where a body meets itself, only targets that ``met`` it before may lie behind a facet: others are
        apart from it by walls of the body.
        """
        corners = self.points[self.patches.facets]
        centroids = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centroids[:, None], axis=2).max(axis=1)
        tree, rounding = cKDTree(centroids), coordinate_rounding(self.points)
        if self.apart is not None:
            pair, facet = self._allowed(tree, targets, waiting, radius.max())
            found = self._from_middles(targets, normals, pair, facet)
            return best_projections(found.part(met[found.point] | (found.gap > -0.05 * self.reach)), rounding)
        distance, _ = tree.query(targets[waiting])
        waiting = waiting[distance <= self.reach + 2 * radius.max()]
        pair, facet = nearest_facets(tree, targets[waiting])
        near = self._from_middles(targets, normals, waiting[pair].ravel(), facet.ravel())
        near = best_projections(near.part(near.beside == 0.0), rounding)
        still = np.setdiff1d(waiting, near.point)
        pairs = facets_in_reach(tree, radius, targets, still)
        reached = join([self._from_middles(targets, normals, *each) for each in pairs])
        return join([near, best_projections(reached, rounding)])

    def _allowed(
        self, tree: cKDTree, targets: np.ndarray, waiting: np.ndarray, radius: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pair the waiting targets with all facets within reach that are allowed to them."""
        lists = tree.query_ball_point(targets[waiting], self.reach + radius)
        pair = np.repeat(waiting, [len(each) for each in lists])
        facet = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.asarray, lists)]).astype(np.int64)
        assert self.apart is not None
        if not len(pair):  # some versions of scipy take no empty places of a sparse matrix
            return pair, facet
        allowed = ~np.asarray(self.apart[pair, facet], dtype=bool).ravel()
        return pair[allowed], facet[allowed]

    def _from_middles(
        self, targets: np.ndarray, normals: np.ndarray, point: np.ndarray, facet: np.ndarray
    ) -> Projection:
        width = targets.shape[1] - 1
        middle = np.full((len(point), width), 1 / 3 if self.patches.corners == 3 else 0.0)
        return self._solve(targets, normals, point, facet, middle)

    def _solve(
        self,
        targets: np.ndarray,
        normals: np.ndarray,
        point: np.ndarray,
        facet: np.ndarray,
        local: np.ndarray,
    ) -> Projection:
        """Solve (x − S)·S,_a = 0 for pairs of targets and facets; keep those in or barely beside it."""
        # Relative to the facet's own corner it is as exact far from the origin as near it.
        start = self.points[self.patches.facets[facet, 0]]
        target, coefficients = targets[point] - start, self.coefficients[facet].copy()
        coefficients[:, : n_values(self.patches.corners, self.patches.order)] -= start[:, None]
        local = self._iterated(coefficients, target, local.copy())
        at = patch_points(self.patches, coefficients, local)
        away = target - at.place
        slope, length = np.einsum("nad,nd->na", at.tangents, away), np.linalg.norm(at.tangents, axis=2)
        size, rounding = length.max(axis=1, initial=0.0), coordinate_rounding(self.points)
        tolerance = 1e-9 * (size + np.linalg.norm(away, axis=1)) + rounding
        solved = (np.abs(slope) <= tolerance[:, None] * length).all(axis=1)
        beside = outside(local, self.patches.corners)
        beside = np.where(beside <= 1e-9 + rounding / np.maximum(size, rounding), 0.0, beside)
        facing = np.einsum("nd,nd->n", at.normal, normals[point]) < 0
        near = (
            _second(at, away)[2]
            & facing
            & (beside <= self.margin * (0.5 if self.patches.corners == 3 else 1.0))
        )
        gap = np.einsum("nd,nd->n", at.normal, away)
        lost = np.unique(point[near & ~solved])
        found = Projection(point, facet, local, gap, at.normal, beside, lost)
        return found.part(near & solved)

    def _iterated(
        self, coefficients: np.ndarray, target: np.ndarray, local: np.ndarray, steps: int = 25
    ) -> np.ndarray:
        """Return local coordinates after Newton steps from given ones."""
        at = np.arange(len(local))  # the pairs still iterating
        for count in range(steps):
            here = patch_points(self.patches, coefficients[at], local[at])
            step = _step(here, target[at] - here.place)
            # A target far beyond the facet belongs to another one.
            local[at] = np.clip(local[at] + step, -3, 3)
            moving = np.abs(step).max(axis=1) > 1e-9  # quadratic convergence: next comes rounding
            if count >= 8:
                moving &= outside(local[at], self.patches.corners) < 1.0
            at = at[moving]
            if len(at) == 0:
                break
        return local


def _step(here: PatchPoints, away: np.ndarray) -> np.ndarray:
    """Return Newton's step towards the closest point, that of Gauss and Newton where it is not convex."""
    metric, matrix, convex = _second(here, away)
    matrix = np.where(convex[:, None, None], matrix, metric)
    size = np.maximum(np.trace(metric, axis1=1, axis2=2), np.finfo(float).tiny)
    regular = np.linalg.det(matrix) > 1e-24 * size ** matrix.shape[1]
    matrix[~regular] = np.eye(matrix.shape[1])
    right = np.einsum("nad,nd->na", here.tangents, away)
    step = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    return np.clip(np.where(regular[:, None], step, 0.0), -1.0, 1.0)


def _second(here: PatchPoints, away: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return S,_a·S,_b, H of half the squared distance, and whether that is clearly convex.

    Where it is not, a target lies beyond the centre of a patch's curvature: the place is not the closest.
    """
    metric = np.einsum("nad,nbd->nab", here.tangents, here.tangents)
    matrix = metric - np.einsum("nabd,nd->nab", here.second, away)
    least = np.linalg.eigvalsh(matrix)[:, 0]
    return metric, matrix, least > 1e-3 * np.linalg.eigvalsh(metric)[:, 0]


def summed_normals(surface: FacetedSurface, points: np.ndarray) -> np.ndarray:
    """Return the sums of the area vectors around nodes, within planes of symmetry, shape (n, dim), [length²].

    `points`: present coordinates of its nodes, shape (n, dim), [length].
    """
    summed = np.zeros_like(points)
    np.add.at(summed, surface.facets, corner_products(points, surface.facets))
    return surface.within(summed, surface.mirrored)


def moved_surface(surface: FacetedSurface, points: np.ndarray) -> FacetedSurface:
    """Return a surface in its present place, made of its facets. Areas stay those of the reference.

    `points`: present coordinates of its nodes, shape (n, dim), [length].
    """
    summed = summed_normals(surface, points)
    length = np.linalg.norm(summed, axis=1)
    averaged = summed / np.where(length > 0.0, length, 1.0)[:, None]
    return replace(surface, points=points, averaged=averaged, relief=None)


def summed_normals_by_points(surface: FacetedSurface, along: np.ndarray) -> sp.csr_matrix:
    """Return v·δN for the sums N of `summed_normals` and given vectors v, shape (n, n · dim).

    `along`: v, zero in components that planes of symmetry take away, shape (n, dim).
    """
    facets, dim = surface.facets, surface.dim
    corners, v = surface.points[facets], along[facets]
    if dim == 2:
        # Both ends of an edge d have the product (d_y, −d_x).
        turned = np.stack([-v[:, :, 1], v[:, :, 0]], axis=2)
        ends = (np.broadcast_to(facets[:, end, None], facets.shape) for end in (0, 1))
        parts = list(zip(ends, (-turned, turned), strict=True))
    else:
        ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        by_ahead, by_behind = np.cross(behind, v), np.cross(v, ahead)
        parts = [
            (np.roll(facets, -1, axis=1), by_ahead),
            (np.roll(facets, 1, axis=1), by_behind),
            (facets, -by_ahead - by_behind),
        ]
    row = np.tile(np.repeat(facets.ravel(), dim), len(parts))
    column = np.concatenate([(dim * node[..., None] + np.arange(dim)).ravel() for node, _ in parts])
    value = np.concatenate([part.ravel() for _, part in parts])
    size = len(surface.nodes)
    return Csr((value, (row, column)), shape=(size, dim * size))


#: What decides where ways between places that meet do not, along the axes of the surface: square to no side
#: that meshes usually have.
LEANING = np.array([0.4796, 0.7311, 0.4853])
#: Lengths that differ by less than this part count as the same: which node is first among them may not depend
#: on rounding, nor on how the body lies in space.
ALIKE = 1e-6


@dataclass(frozen=True)
class Roles:
    """Slaves and masters on a surface that meets itself: one of two places that meet, never both.

    Both would be kept out twice, by forces that are not unique. A node that has a point keeps it. Nodes that
    begin to meet others are masters where these are slaves already. Else the ways count that lead from them
    to their points in the undeformed body: all nodes whose ways go forward along the axis to which most ways
    are parallel are slaves. So those of one side of a fold are, as a whole.

    Attributes:
        places: Its nodes in the undeformed body, shape (n_nodes, dim), [length].
        candidates: Its nodes that may be slaves, shape (n_candidates,).
        touched: Whether a candidate moves a patch, shape (n_facets, n_candidates).
    """

    patches: SmoothPatches
    places: np.ndarray
    candidates: np.ndarray
    touched: sp.csr_matrix

    def are_slaves(self, found: Projection, last: np.ndarray) -> np.ndarray:
        """Return which closest points make their candidates slaves, shape (n,).

        `last`: last facets of all candidates, −1 where there is none, shape (n_candidates,).
        """
        known = last[found.point] >= 0
        return known | (self._go_forward(found, known) & ~self._are_masters(found, last))

    def _go_forward(self, found: Projection, known: np.ndarray, light: float = 0.1) -> np.ndarray:
        """Return which ways to closest points go forward, those of known slaves mostly do, shape (n,).

        `light`: weight of the leaning compared with one way, of length one.
        """
        weights = self.patches.weights(found.facet, self.patches.functions(found.local).value)
        way = weights @ self.places - self.places[self.candidates[found.point]]
        way /= np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)[:, None]
        leaning = light * self._leaning
        _, axes = np.linalg.eigh(way.T @ way / max(len(way), 1) + np.outer(leaning, leaning))
        along = way @ axes[:, ::-1] * np.sign((way[known].sum(axis=0) + leaning) @ axes[:, ::-1])
        chosen = np.argmax(np.abs(along) >= 0.5, axis=1)  # in space one of three is, in the plane one of two
        return np.asarray(along[np.arange(len(way)), chosen] > 0.0)

    @cached_property
    def _leaning(self) -> np.ndarray:
        """Return a direction that turns with the body, shape (dim,): nodes decide, by their numbers."""
        arms = self.places - self.places.mean(axis=0)
        direction = np.zeros(arms.shape[1])
        for share in LEANING[: arms.shape[1]]:
            lengths = np.linalg.norm(arms, axis=1)
            if lengths.max() == 0.0:
                break
            first = int(np.argmax(lengths >= (1.0 - ALIKE) * lengths.max()))
            axis = arms[first] / lengths[first]
            direction += share * axis
            arms = arms - np.outer(arms @ axis, axis)
        return direction

    def _are_masters(self, found: Projection, last: np.ndarray) -> np.ndarray:
        """Return which candidates move the patches of slaves that move their own, shape (n,)."""
        met = np.flatnonzero(last >= 0)
        slaves = self.touched[found.facet][:, met]
        theirs = self.touched[last[met]][:, found.point]
        return np.asarray(slaves.multiply(theirs.T).sum(axis=1)).ravel() > 0.0
