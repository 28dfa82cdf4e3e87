"""By how much gaps are wrong where true surfaces lie over facets, and how fast that falls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from benchmarks.true_surfaces.bodies import seat
from benchmarks.true_surfaces.measuring import WAYS
from fenics_contact import BodyMesh
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import project
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.gallery import LinkShape, chain_link, half_cylinder, half_disc, hemisphere
from fenics_contact.shapes.simple import closest_points

#: Cells across 45 degrees, of the link around a sixth of the ring.
CELLS = (4, 8, 16, 32)
#: That of a mesh whose facets lie across those of all others: points off these tell what they are wrong by.
NOT_NESTED = 27
#: Points, and how far they lie off the surface at most, relative to its size.
POINTS, OFF = 2000, 0.01
#: How far points stay off the border of the surface, where nothing tells how it goes on.
BORDER = 0.25


def _link(cells: int) -> BodyMesh:
    size = 2 * 16.0
    mesh = chain_link(LinkShape(n_around=6 * cells, n_a=2, n_b=2 * cells)).mesh
    return mesh.placed(np.eye(3), np.zeros(3), 2 / size)


SURFACES: dict[str, Callable[[int], BodyMesh]] = {
    "disc": lambda n: half_disc(1.0, n, grading=0.0),
    "cylinder": lambda n: half_cylinder(1.0, 1.0, n, n, grading=0.0),
    "ball": lambda n: hemisphere(1.0, n, grading=0.0),
    "seat": lambda n: seat(np.array([1.01, 1.5]), n),
    "crown of a chain link": _link,
}


def gap_errors(_: MPI.Comm, name: str) -> dict[str, Any]:
    """Return errors of gaps on all meshes of a surface, root mean squares, and their order, by way.

    By one process.
    """
    build = SURFACES[name]
    meshes = [build(cells) for cells in CELLS]
    points, normals, gaps = _near(build(NOT_NESTED))
    missed = {}
    for way in WAYS:
        surfaces = [true_surface(mesh, "contact", way) for mesh in meshes]
        missed[way] = [float(f"{_miss(each, points, normals, gaps):.3e}") for each in surfaces]
    orders = {way: round(float(np.log2(each[-3] / each[-1]) / 2), 1) for way, each in missed.items()}
    return {"surface": name, "errors": missed, "orders": orders}


def _miss(surface: FacetedSurface, points: np.ndarray, normals: np.ndarray, gaps: np.ndarray) -> float:
    """Return the root mean square error of the gaps between points and a surface."""
    found = project(points, -normals, surface)
    if len(found.point) < POINTS:
        raise RuntimeError(f"{POINTS - len(found.point)} points do not project on the surface")
    return float(np.sqrt(np.mean((found.gap - gaps[found.point]) ** 2)))


def _near(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points near the shape of a mesh's contact surface, its normals there, and their distances."""
    rng = np.random.default_rng(1)
    shape, facets = mesh.shapes["contact"], mesh.surfaces["contact"]
    facets = facets[_inside(mesh, facets)]
    weights = rng.dirichlet(np.ones(facets.shape[1]), POINTS)
    corners = mesh.points[facets[rng.integers(len(facets), size=POINTS)]]
    feet = closest_points(shape, np.einsum("nk,nkd->nd", weights, corners))
    normals, gaps = shape.normals(feet), rng.uniform(0.0, OFF, POINTS)
    return feet + gaps[:, None] * normals, normals, gaps


def _inside(mesh: BodyMesh, facets: np.ndarray) -> np.ndarray:
    """Tell which facets lie more than a coarse cell off the border of their surface."""
    if mesh.dim == 2:
        sides: np.ndarray = facets.ravel()
    else:
        sides = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    found, times = np.unique(sides, axis=0, return_counts=True)
    border = mesh.points[np.unique(found[times == 1])]
    distance, _ = cKDTree(border).query(mesh.points[facets].mean(axis=1))
    return np.asarray(distance > BORDER)
