"""What bodies with a chart miss outside their facets is known, and what quantities miss by it."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactProblem, LinearState, Scene, Support, TotalForce, goal_error
from fenics_contact._adaptive.boundary_defect import boundary_defect
from fenics_contact.design import Movement, Objective, TotalPotential
from fenics_contact.gallery import LinkShape, block, chain_link, rectangle
from fenics_contact.gallery.blocks import split_hexahedra
from fenics_contact.materials import PlaneStrain
from fenics_contact.mesh import Chart, refined


def bent(places: np.ndarray) -> np.ndarray:
    """Angle, radius and what is along the axis."""
    angle, radius, *rest = places.T
    return np.column_stack([radius * np.sin(angle), radius * np.cos(angle), *rest])


def bar(n: tuple[int, int] = (16, 6)) -> BodyMesh:
    """A quarter of a ring in the plane."""
    flat = rectangle((0.0, 2.0), (np.pi / 2, 3.0), n)
    return BodyMesh(bent(flat.points), flat.cells, flat.surfaces, chart=Chart(bent, flat.points))


def pulled(mesh: BodyMesh) -> LinearState:
    scene = Scene(
        {"bar": Body(mesh, PlaneStrain(1e3, 0.3))},
        [Support("bar", "x0", (0.0, 0.0))],
        [TotalForce("bar", "x1", (1.0, -2.0))],
    )
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9).solve(adjoint=True)
    assert isinstance(state, LinearState)
    return state


def everywhere(mesh: BodyMesh) -> BodyMesh:
    return refined(mesh, np.ones(mesh.n_cells, dtype=bool)).mesh


@pytest.mark.parametrize("objective", [TotalPotential(), Movement("bar", "x1", (0.0, -1.0))], ids=["J", "u"])
def test_what_facets_cost_a_quantity_is_known(objective: Objective) -> None:
    """Compared with fine cells between the same facets, and with fine cells on the true ring."""
    coarse = bar()
    found = goal_error(pulled(coarse), objective).geometry
    on_ring, on_facets = (
        goal_error(pulled(everywhere(everywhere(mesh))), objective).value
        for mesh in (coarse, coarse.with_chart(None))
    )
    assert 0.6 < found / (on_ring - on_facets) < 1.1


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_facets_that_move_so_far_enclose_the_true_volume(cell: str) -> None:
    shape = LinkShape(n_around=18, n_a=2, n_b=5, cell=cell)
    mesh, away = chain_link(shape).mesh, []
    for level in range(2):
        if level:
            marked = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1), axis=1) < 15.0
            mesh = refined(mesh, marked).mesh
        moved = mesh.moved(mesh.points + boundary_defect(mesh))
        away.append((shape.volume - moved.volume) / (shape.volume - mesh.volume))
    assert np.abs(away).max() < 0.06


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("hanging", [False, True])
def test_rims_stay_in_the_planes_where_curved_sides_end(cell: str, hanging: bool) -> None:
    straight = block((0.0, 2.0, 0.0), (np.pi / 2, 3.0, 1.0), (8, 2, 3))
    mesh = BodyMesh(bent(straight.points), straight.cells, chart=Chart(bent, straight.points))
    mesh = split_hexahedra(mesh) if cell == "tetrahedron" else mesh
    if hanging:
        mesh = refined(
            mesh, np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - [0, 3, 0], axis=1) < 1.2
        ).mesh
    way, (x, y, z) = boundary_defect(mesh), mesh.points.T
    assert np.abs(way).max() > 0.005
    for side, axis in ((x, 0), (y, 1), (z, 2), (z - 1.0, 2)):
        on_side = np.abs(side) < 1e-9
        assert np.abs(way[on_side, axis]).max() < 0.05 * np.abs(way).max()
    radius = np.hypot(x, y)
    inside = (radius > 2.2) & (radius < 2.8)
    assert np.abs(way[inside & (z > 0.1) & (z < 0.9)]).max() == 0.0
    exact = 5.0 * np.pi / 4.0
    moved = mesh.moved(mesh.points + way)
    assert abs(exact - moved.volume) < 0.35 * (exact - mesh.volume)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_rims_move_until_their_chords_enclose_the_true_area(cell: str) -> None:
    """By two thirds of what edges miss in their middles: a whole bulge for what a parabola covers."""
    straight = block((0.0, 2.0, 0.0), (np.pi / 2, 3.0, 1.0), (8, 2, 3))
    mesh = BodyMesh(bent(straight.points), straight.cells, chart=Chart(bent, straight.points))
    mesh = split_hexahedra(mesh) if cell == "tetrahedron" else mesh
    way, (x, y, z) = boundary_defect(mesh), mesh.points.T
    rim = np.flatnonzero((np.abs(z) < 1e-9) & (np.abs(np.hypot(x, y) - 3.0) < 1e-9))
    rim = rim[np.argsort(x[rim])][1:-1]  # at its ends edges of other sides move it, too
    angle = np.arctan2(x[rim[-1]], y[rim[-1]]) - np.arctan2(x[rim[0]], y[rim[0]])

    def sector(points: np.ndarray) -> float:
        first, other = points[rim[:-1], :2], points[rim[1:], :2]
        return 0.5 * float(np.sum(other[:, 0] * first[:, 1] - other[:, 1] * first[:, 0]))

    true, before, after = 4.5 * angle, sector(mesh.points), sector(mesh.points + way)
    assert abs(true - after) < 0.05 * (true - before)
