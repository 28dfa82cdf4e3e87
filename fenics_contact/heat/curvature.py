"""How the curvature of surfaces changes the resistance of the gap in front of them."""

from __future__ import annotations

import numpy as np

from fenics_contact._pairing.points import tangent_frames
from fenics_contact._surfaces.facets import FacetedSurface


def principal_curvatures(surface: FacetedSurface) -> np.ndarray:
    """Return the curvatures at the nodes, positive where the surface bulges, (n, dim − 1), [1 / length].

    Those of the surface to which its normals belong: along an edge d between two nodes it is
    (n₂ − n₁)·d / d², and the tensor that fits all edges around a node best is taken.
    """
    dim, normals = surface.dim, surface.normals
    first, second = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
    along = surface.points[second] - surface.points[first]
    length = np.linalg.norm(along, axis=1)
    bend = np.einsum("ed,ed->e", normals[second] - normals[first], along) / length**2
    node, bend, along = np.concatenate([first, second]), np.tile(bend, 2), np.tile(along.T / length, 2).T
    count = len(surface.nodes)
    if dim == 2:
        mean = np.bincount(node, bend, count) / np.bincount(node, minlength=count)
        if not surface.measure.varies:
            return mean[:, None]
        radius = surface.points[:, 0]
        hoop = np.divide(normals[:, 0], radius, out=mean.copy(), where=radius > 0.0)
        return np.column_stack([mean, hoop])
    frames = tangent_frames(normals)[node]
    s, t = np.einsum("ead,ed->ae", frames, along)
    basis = np.column_stack([s**2, 2.0 * s * t, t**2])
    matrix, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(matrix, node, basis[:, :, None] * basis[:, None, :])
    np.add.at(right, node, basis * bend[:, None])
    a, b, c = np.einsum("nij,nj->in", np.linalg.pinv(matrix, rcond=1e-8, hermitian=True), right)
    middle, half = (a + c) / 2.0, np.hypot((a - c) / 2.0, b)
    return np.column_stack([middle - half, middle + half])


def shells(surface: FacetedSurface, place: np.ndarray, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what curvature makes of gaps, relative to plane ones, (n,) each.

    Their resistance, ∫ ds / Π (1 + κ g s) from 0 to 1, and the area of the surface over that opposite.

    `place`: positions of points among the nodes of the surface, (n,); `gap`: (n,), [length].
    """
    curvature = principal_curvatures(surface)[place]
    steps, weights = np.polynomial.legendre.leggauss(16)
    width = curvature * np.maximum(gap, 0.0)[:, None]
    # A shell that would end in a point has no other side there: facets of edges are no such shells.
    places = np.append(0.5 * (steps + 1.0), 1.0)
    layers = np.maximum(1.0 + width[:, None] * places[:, None], 0.05).prod(axis=2)
    return (0.5 * weights / layers[:, :-1]).sum(axis=1), 1.0 / layers[:, -1]
