"""Derivatives of nodal normals, nodal areas and volumes by the nodes agree with difference quotients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.design.motion import volume_by_points
from fenics_contact.design.surface_derivatives import areas_pulled_back, normals_pulled_back
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic

CELLS = ("hexahedron", "tetrahedron")
PLANE_CELLS = ("quadrilateral", "triangle")
STEP = 1e-6
Reverse = Callable[[FacetedSurface, np.ndarray], np.ndarray]
REVERSE: dict[str, Reverse] = {"normals": normals_pulled_back, "areas": areas_pulled_back}


def crumpled(cell: str, order: int = 1) -> BodyMesh:
    """A block without any plane face, or a rectangle without any straight edge."""
    rng = np.random.default_rng(2)
    if cell in PLANE_CELLS:
        mesh = rectangle((0.0, 0.0), (2.0, 1.5), (4, 3), cell)
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.5, 1.0), (4, 3, 3), cell)
    if order == 2:
        mesh = quadratic(mesh)
    return mesh.moved(mesh.points + 0.04 / order**2 * rng.standard_normal(mesh.points.shape))


@pytest.mark.parametrize("what", REVERSE)
@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_normals_and_areas_agree_with_central_differences(cell: str, what: str) -> None:
    rng = np.random.default_rng(4)
    mesh = crumpled(cell)
    last = "z1" if mesh.dim == 3 else "y1"
    facets = np.concatenate([mesh.surfaces[last], mesh.surfaces["x1"]])
    surface = faceted_surface(mesh.points, facets)
    by, move = rng.standard_normal(getattr(surface, what).shape), rng.standard_normal(mesh.points.shape)
    up, down = (faceted_surface(mesh.points + sign * STEP * move, facets) for sign in (1, -1))
    quotient = np.sum(by * (getattr(up, what) - getattr(down, what))) / (2 * STEP)
    adjoint = np.sum(REVERSE[what](surface, by) * move[surface.nodes])
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-7)


@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_areas_on_which_a_pressure_bears_agree_with_central_differences(cell: str) -> None:
    rng = np.random.default_rng(4)
    mesh, name = crumpled(cell, 2), "x1"
    surface = true_surface(mesh, name, "faceted")
    by, move = rng.standard_normal(surface.areas.shape), rng.standard_normal(mesh.points.shape)
    up, down = (
        true_surface(mesh.moved(mesh.points + sign * STEP * move), name, "faceted") for sign in (1, -1)
    )
    quotient = by @ (up.areas - down.areas) / (2 * STEP)
    adjoint = np.sum(areas_pulled_back(surface, by) * move[surface.nodes])
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_nodal_areas_grow_with_the_square_of_a_plane_surface(cell: str) -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.5, 1.0), (4, 3, 1), cell)
    surface = faceted_surface(mesh.points, mesh.surfaces["z0"])
    gradient = areas_pulled_back(surface, np.ones(len(surface.nodes)))
    assert np.sum(gradient * surface.points) == pytest.approx(2 * 2.0 * 1.5)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_the_volume_agrees_with_central_differences(cell: str, order: int) -> None:
    mesh = crumpled(cell, order)
    move = np.random.default_rng(6).standard_normal(mesh.points.shape)
    up, down = (mesh.moved(mesh.points + sign * STEP * move).volume for sign in (1, -1))
    adjoint = np.sum(volume_by_points(mesh) * move)
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx((up - down) / (2 * STEP), rel=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_a_body_that_grows_by_its_own_coordinates_grows_by_three_times_its_volume(cell: str) -> None:
    mesh = crumpled(cell)
    assert np.sum(volume_by_points(mesh) * mesh.points) == pytest.approx(3 * mesh.volume, rel=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_inner_nodes_do_not_change_the_volume(cell: str) -> None:
    mesh = crumpled(cell)
    gradient = volume_by_points(mesh)
    outside = np.unique(np.concatenate([facets.ravel() for facets in mesh.surfaces.values()]))
    inside = np.setdiff1d(np.arange(mesh.n_nodes), outside)
    assert len(inside) > 5
    assert np.all(gradient[inside] == 0.0)
    assert np.abs(gradient[outside]).max(axis=1).min() > 1e-3
