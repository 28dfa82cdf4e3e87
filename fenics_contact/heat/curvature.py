"""How the curvature of surfaces changes the resistance of the gap in front of them."""

from __future__ import annotations

import numpy as np

from fenics_contact._pairing.points import tangent_frames
from fenics_contact._surfaces.facets import FacetedSurface, quadrature_areas
from fenics_contact.mesh.cell_types import FACET_TYPES
from fenics_contact.mesh.faces import of_one_shape


def principal_curvatures(surface: FacetedSurface) -> np.ndarray:
    """Return the curvatures at the nodes, positive where the surface bulges, (n, dim − 1), [1 / length].

    Those of the surface to which its normals belong: along an edge d between two nodes they change by S d,
    with a symmetric tensor S in the tangent plane; the one that fits all edges around a node best is taken.
    All of the change is needed: around nodes of quadrilaterals edges have two directions alone, in which its
    part along d leaves the twist open.
    """
    dim, normals = surface.dim, surface.normals
    first, second = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
    along, turn = surface.points[second] - surface.points[first], normals[second] - normals[first]
    length = np.linalg.norm(along, axis=1)
    node, count = np.concatenate([first, second]), len(surface.nodes)
    along, turn = (np.tile(each.T / length, 2).T for each in (along, turn))
    if dim == 2:
        mean = np.bincount(node, (turn * along).sum(axis=1), count) / np.bincount(node, minlength=count)
        if not surface.measure.varies:
            return mean[:, None]
        radius = surface.points[:, 0]
        hoop = np.divide(normals[:, 0], radius, out=mean.copy(), where=radius > 0.0)
        return np.column_stack([mean, hoop])
    frames = tangent_frames(normals)[node]
    s, t = np.einsum("ead,ed->ae", frames, along)
    none = np.zeros_like(s)
    basis = np.stack([np.column_stack([s, t, none]), np.column_stack([none, s, t])], axis=1)
    matrix, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(matrix, node, np.einsum("eai,eaj->eij", basis, basis))
    np.add.at(right, node, np.einsum("eai,ead,ed->ei", basis, frames, turn))
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


def stretch(surface: FacetedSurface) -> np.ndarray:
    """Return the areas of curved quadratic facets around nodes, over those of the linear pieces, (n,).

    Mortar couples pieces, whose areas are wrong by the second order, while temperatures are not.
    """
    true, flat = np.zeros((2, len(surface.nodes)))
    for numbers, facets in of_one_shape(surface.whole):
        kind = FACET_TYPES[facets.shape[1], surface.dim]
        pieces = facets[:, kind.pieces].reshape(-1, kind.pieces.shape[1])
        areas = quadrature_areas(surface.points, pieces, surface.measure).reshape(len(facets), -1).sum(axis=1)
        np.add.at(flat, facets, areas[:, None])
        np.add.at(true, facets, quadrature_areas(surface.points, facets, surface.measure)[:, None])
    return true / flat if surface.by_pieces else np.ones_like(true)
