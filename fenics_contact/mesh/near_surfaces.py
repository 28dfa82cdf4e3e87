"""Surfaces that may touch, if a mesh file does not name them: facets that face each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import corners_of, vector_areas

FACING = 0.5
"""Facets face each other if their normals are opposite within 60 degrees: smallest cosine of that angle."""
_NEIGHBOURS = 8
"""Facets of the other body that are examined for each facet, nearest centres first."""


def near_surfaces(
    meshes: Mapping[str, BodyMesh], distance: float, along: float = 0.0
) -> tuple[dict[str, BodyMesh], list[tuple[str, str]]]:
    """Name the facets of bodies that face another body within a distance.

    Facets are treated as plane: two of them are near if they overlap, within the distance and 60 degrees of
    parallel. `distance`: largest one across the gap; `along`: how far beyond these facets the surfaces reach,
    for bodies that slide. Returns the bodies with a surface "near B" on A and "near A" on B for every pair,
    and the pairs of names, each in the order of the bodies.
    """
    if not 0.0 < distance < np.inf:
        raise InvalidInputError(f"distance must be positive and finite, got {distance}: give the largest gap")
    sides = {name: _Side(mesh) for name, mesh in meshes.items()}
    surfaces = {name: dict(mesh.surfaces) for name, mesh in meshes.items()}
    pairs = []
    for one, other in combinations(meshes, 2):
        if not sides[one].may_meet(sides[other], distance):
            continue
        first, second = sides[one].over(sides[other], distance), sides[other].over(sides[one], distance)
        near = {one: first[0] | second[1], other: first[1] | second[0]}
        if not (near[one].any() and near[other].any()):
            continue
        pairs.append((one, other))
        near = {name: sides[name].grown(mask, along) for name, mask in near.items()}
        for a, b in ((one, other), (other, one)):
            if f"near {b}" in surfaces[a]:
                raise InvalidInputError(f"body {a!r} must have no surface 'near {b}' yet: rename or use it")
            surfaces[a][f"near {b}"] = sides[a].facets[near[a]]
    return {name: replace(mesh, surfaces=surfaces[name]) for name, mesh in meshes.items()}, pairs


class _Side:
    """The boundary of a body, facet by facet."""

    def __init__(self, mesh: BodyMesh) -> None:
        self.facets, _ = mesh.boundary
        corners = mesh.points[corners_of(self.facets, mesh.dim)]
        self.centre = corners.mean(axis=1)
        self.radius = np.linalg.norm(corners - self.centre[:, None], axis=2).max(axis=1)
        area = vector_areas(mesh.points, self.facets)
        self.normal = area / np.linalg.norm(area, axis=1)[:, None]
        self.low, self.high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))

    def may_meet(self, other: _Side, distance: float) -> bool:
        """Whether the bounding boxes of both are near each other."""
        return bool(np.all((self.low <= other.high + distance) & (other.low <= self.high + distance)))

    def grown(self, mask: np.ndarray, along: float) -> np.ndarray:
        """Return a mask of facets and of those around them that face the same way, within a distance."""
        if along <= 0.0:
            return mask
        chosen = np.flatnonzero(mask)
        away, nearest = cKDTree(self.centre[chosen]).query(self.centre)
        alike = np.einsum("nd,nd->n", self.normal, self.normal[chosen[nearest]]) > FACING
        return np.asarray(mask | (alike & (away <= along + self.radius)))

    def over(self, other: _Side, distance: float) -> tuple[np.ndarray, np.ndarray]:
        """Return masks of the facets whose centre lies over one of the other body's, and of the latter."""
        count = min(_NEIGHBOURS, len(other.centre))
        _, nearest = cKDTree(other.centre).query(self.centre, count)
        nearest = nearest.reshape(len(self.centre), count)
        away = other.centre[nearest] - self.centre[:, None]
        normal = other.normal[nearest]
        across = np.abs(np.einsum("nkd,nkd->nk", away, normal))
        along = np.sqrt(np.maximum(np.einsum("nkd,nkd->nk", away, away) - across**2, 0.0))
        opposed = np.einsum("nd,nkd->nk", self.normal, normal) < -FACING
        match = opposed & (across <= distance) & (along <= other.radius[nearest])
        theirs = np.zeros(len(other.centre), dtype=bool)
        theirs[nearest[match]] = True
        return match.any(axis=1), theirs
