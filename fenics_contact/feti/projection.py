"""Closest-point projection of slave nodes onto a faceted master surface along its continuous normal field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.feti.surface import FacetedSurface, outside, shape_functions

#: Facets tried for each node, nearest centroids first; the second round is for nodes the first leaves over.
CANDIDATES = (9, 64)
NEWTON_STEPS = 25
#: How far outside a facet a projection may lie, in local coordinates: rounding on shared edges, no more.
EDGE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Projection:
    """Where points project to. Only points that have a projection are listed.

    Attributes:
        point: Which of the given points, ascending, shape (n,).
        facet: Facet hit, shape (n,).
        local: Local coordinates on it, shape (n, 2).
        gap: Signed distance along the normal, positive outside, shape (n,), [length].
        normal: Interpolated outward unit normal there, shape (n, 3).
    """

    point: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    gap: np.ndarray
    normal: np.ndarray


def interpolated_normal(weights: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate unit normals and scale back to unit length.

    Args:
        weights: Shape functions, shape (n, corners).
        normals: Nodal normals, shape (n, corners, 3).

    Returns:
        Unit normals, shape (n, 3), and the lengths before scaling, shape (n,).
    """
    mean = np.einsum("nk,nkd->nd", weights, normals)
    length = np.linalg.norm(mean, axis=1)
    return mean / length[:, None], length


def newton_matrix(
    points: np.ndarray, normals: np.ndarray, derivatives: np.ndarray, gap: np.ndarray, normal: np.ndarray,
    length: np.ndarray,
) -> np.ndarray:
    """Return ∂(x(ξ) + g n(ξ))/∂(ξ, g), shape (n, 3, 3); see `project` for the symbols."""
    tangents = np.einsum("nka,nkd->nda", derivatives, points)
    turned = np.einsum("nka,nkd->nda", derivatives, normals)
    turned = (turned - normal[:, :, None] * np.einsum("nd,nda->na", normal, turned)[:, None]) / length[:, None, None]
    return np.concatenate([tangents + gap[:, None, None] * turned, normal[:, :, None]], axis=2)


def project(points: np.ndarray, normals: np.ndarray, master: FacetedSurface) -> Projection:
    """Project points onto a surface: find ξ, g with x(ξ) + g n(ξ) = point.

    x(ξ) is the (bi)linear facet and n(ξ) the interpolated, normalised nodal normal. Because n is
    continuous, so are gap, normal and weights while a point slides from facet to facet. Of several
    projections the one with the smallest |g| counts; surfaces that face the same way do not touch.

    Args:
        points: Slave nodes, shape (n, 3), [length].
        normals: Their outward unit normals, shape (n, 3).
        master: The surface to project on.
    """
    tree = cKDTree(master.points[master.facets].mean(axis=1))
    found: list[Projection] = []
    waiting, tried = np.arange(len(points)), 0
    for candidates in CANDIDATES:
        wanted = np.arange(tried, min(candidates, len(master.facets))) + 1
        if len(waiting) == 0 or len(wanted) == 0:
            break
        _, facets = tree.query(points[waiting], k=wanted)
        tried = candidates
        best = _best(_solve(points, normals, master, np.repeat(waiting, len(wanted)), facets.ravel()))
        found.append(best)
        waiting = np.setdiff1d(waiting, best.point)
    return _concatenated(found)


def _solve(
    points: np.ndarray, normals: np.ndarray, master: FacetedSurface, point: np.ndarray, facet: np.ndarray
) -> Projection:
    """Solve for each (point, facet) pair by Newton's method; keep the pairs with an answer inside the facet."""
    nodes = master.facets[facet]
    corners, corner_normals, target = master.points[nodes], master.normals[nodes], points[point]
    size = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    local = np.full((len(point), 2), 0.0 if master.corners == 4 else 1 / 3)
    gap = np.zeros(len(point))
    for _ in range(NEWTON_STEPS):
        values, derivatives = shape_functions(local, master.corners)
        normal, length = interpolated_normal(values, corner_normals)
        residual = np.einsum("nk,nkd->nd", values, corners) + gap[:, None] * normal - target
        matrix = newton_matrix(corners, corner_normals, derivatives, gap, normal, length)
        regular = np.abs(np.linalg.det(matrix)) > 1e-12 * size**2
        matrix[~regular] = np.eye(3)
        step = np.where(regular[:, None], -np.linalg.solve(matrix, residual[:, :, None])[:, :, 0], 0.0)
        # A point far beyond the facet belongs to another one; keeping it near keeps its iterates finite.
        local = np.clip(local + step[:, :2], -3, 3)
        gap = gap + step[:, 2]
        if np.all(np.abs(step[:, :2]).max(axis=1) < 1e-14):
            break
    values, _ = shape_functions(local, master.corners)
    normal, _ = interpolated_normal(values, corner_normals)
    residual = np.einsum("nk,nkd->nd", values, corners) + gap[:, None] * normal - target
    good = np.linalg.norm(residual, axis=1) < 1e-10 * (size + np.abs(gap))
    good &= outside(local, master.corners) <= EDGE_TOLERANCE
    good &= np.einsum("nd,nd->n", normal, normals[point]) < 0
    return Projection(point[good], facet[good], local[good], gap[good], normal[good])


def _best(found: Projection) -> Projection:
    """Keep the smallest |gap| of each point; of equal ones (a shared edge) that of the lowest facet."""
    rounded = np.round(np.abs(found.gap), 12)
    order = np.lexsort((found.facet, rounded, found.point))
    _, first = np.unique(found.point[order], return_index=True)
    keep = order[first]
    return Projection(*(getattr(found, name)[keep] for name in ("point", "facet", "local", "gap", "normal")))


def _concatenated(parts: list[Projection]) -> Projection:
    point = np.concatenate([part.point for part in parts])
    order = np.argsort(point)
    joined = [np.concatenate([getattr(p, n) for p in parts])[order] for n in ("facet", "local", "gap", "normal")]
    return Projection(point[order], *joined)
