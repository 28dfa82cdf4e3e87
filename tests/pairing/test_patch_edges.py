"""Smooth patches meet in one tangent plane along their edges, whatever becomes of the nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact._pairing.sliding.closest import patch_points
from fenics_contact._pairing.sliding.patches import (
    SmoothPatches,
    n_functions,
    patch_functions,
    turning_functions,
)
from fenics_contact._surfaces.facets import corner_places, nodal_areas
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.cell_types import FACET_TYPES, quadrature
from tests.pairing.sliding_scenes import on_arch, on_patches, shaken, sliding

CELLS = ("hexahedron", "tetrahedron")
#: Places along an edge.
ALONG = np.array([0.0, 0.01, 0.3, 0.5, 0.8, 1.0])


def shaken_patches(kind: str, order: int) -> tuple[SmoothPatches, np.ndarray]:
    """Return the patches of an arch and its nodes out of shape, unevenly."""
    scene = on_arch(kind, master_cells=8 // order, order=order)
    meeting = on_patches(sliding(scene))
    x = shaken(scene)[meeting.master.nodes]
    return meeting.patches, x + 0.03 * np.sin(9.0 * x[:, ::-1]) * np.cos(7.0 * x)


def shared_edges(patches: SmoothPatches) -> tuple[np.ndarray, np.ndarray]:
    """Return facets and places of the edges that two facets share, shape (n, 2) each."""
    ends = np.stack([patches.facets, np.roll(patches.facets, -1, axis=1)], axis=2).reshape(-1, 2)
    _, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    both = np.flatnonzero(np.diff(edge.ravel()[order]) == 0)
    pairs = np.stack([order[both], order[both + 1]], axis=1)
    return np.divmod(pairs, patches.corners)


def on_edge(patches: SmoothPatches, place: np.ndarray, t: float) -> np.ndarray:
    """Return local coordinates at t of edges."""
    corners = corner_places(patches.corners)
    return (1 - t) * corners[place] + t * corners[(place + 1) % patches.corners]


def largest_jump(patches: SmoothPatches, x: np.ndarray) -> float:
    """Return how far normals on both sides of edges are apart, in radians."""
    (one, other), (here, there) = (each.T for each in shared_edges(patches))
    assert len(one) > 40
    coefficients, jump = patches.coefficients(x), 0.0
    for t in ALONG:
        a = patch_points(patches, coefficients[one], on_edge(patches, here, t))
        b = patch_points(patches, coefficients[other], on_edge(patches, there, 1 - t))
        assert a.place == pytest.approx(b.place, abs=1e-12)
        jump = max(jump, np.linalg.norm(a.normal - b.normal, axis=1).max())
    return jump


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", CELLS)
def test_normals_agree_on_both_sides_of_edges_out_of_shape(kind: str, order: int) -> None:
    patches, x = shaken_patches(kind, order)
    assert largest_jump(patches, x) < 1e-11
    size = n_functions(patches.corners, order)
    edges_alone = np.arange(patches.control.shape[0]) % size < size - 2 * patches.corners
    without = patches.control.multiply(edges_alone[:, None]).tocsr()
    assert largest_jump(replace(patches, control=without), x) > 0.01


@pytest.mark.parametrize("corners", [3, 4])
def test_a_turning_function_turns_its_own_edge_alone(corners: int) -> None:
    place, t = corner_places(corners), np.linspace(0.0, 1.0, 7)
    wanted = np.stack([3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t)], axis=1)
    for edge in range(corners):
        after, across = np.roll(place, -1, axis=0)[edge], np.roll(place, 1, axis=0)[edge] - place[edge]
        local = (1 - t[:, None]) * place[edge] + t[:, None] * after
        value, first, _ = turning_functions(local, corners)
        assert np.abs(value).max() < 1e-14
        turn = np.einsum("nka,a->nk", first, across)
        assert turn[:, 2 * edge : 2 * edge + 2] == pytest.approx(wanted, abs=1e-13)
        assert np.abs(np.delete(turn, [2 * edge, 2 * edge + 1], axis=1)).max() < 1e-13


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("corners", [3, 4])
def test_derivatives_of_patch_functions_are_those_of_difference_quotients(corners: int, order: int) -> None:
    local = np.random.default_rng(3).uniform(0.1, 0.4, (6, 2)) - (0.9 if corners == 4 else 0.0)
    step, at = 1e-6, patch_functions(local, corners, order)
    for axis in range(2):
        ahead, behind = (patch_functions(local + s * step * np.eye(2)[axis], corners, order) for s in (1, -1))
        value, first = (
            (f - g) / (2 * step) for f, g in ((ahead.value, behind.value), (ahead.first, behind.first))
        )
        assert at.first[:, :, axis] == pytest.approx(value, abs=1e-8)
        assert at.second[:, :, :, axis] == pytest.approx(first, abs=1e-8)
    assert np.abs(at.second[:, 3 * corners :]).max() > 0.1


def plates(cell: str) -> tuple[BodyMesh, str]:
    """A body of quadratic cells of unequal sides, and the name of its top."""
    if cell in CELLS:
        return quadratic(block((0, 0, 0), (2, 1, 1), (3, 2, 1), cell)), "z1"
    return quadratic(rectangle((0, 0), (2, 1), (3, 1), cell)), "y1"


@pytest.mark.parametrize("cell", [*CELLS, "quadrilateral", "triangle"])
def test_a_uniform_pressure_on_smooth_patches_has_the_forces_of_quadratic_facets(cell: str) -> None:
    """None at the corners of triangles; patches through all nodes alike would have a sixth there."""
    mesh, top = plates(cell)
    surface = true_surface(mesh, top, "faceted")
    patches = SmoothPatches.of(surface)
    kind = FACET_TYPES[patches.corners, mesh.dim]
    places, weights = quadrature(kind, 16)
    local = places if patches.corners == 3 else 2 * places - 1
    count = len(patches.facets)
    facet = np.repeat(np.arange(count), len(places))
    at = patches.weights(facet, patches.functions(np.tile(local, (count, 1))).value)
    area = nodal_areas(surface.points, surface.facets).sum(axis=1) / weights.sum()
    forces = at.T @ (np.repeat(area, len(places)) * np.tile(weights, count))
    expected = np.zeros(len(surface.nodes))
    np.add.at(expected, surface.whole, nodal_areas(surface.points, surface.whole))
    assert np.abs(at - at.multiply(at > 0)).max() > 0.01, "not only the facets themselves"
    np.testing.assert_allclose(forces, expected, atol=2e-5)
