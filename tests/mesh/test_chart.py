"""Built bodies are images of a map, and so are the new nodes of their refined meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, chain_link, rectangle
from fenics_contact.mesh import Chart, quadratic, refined, scaled_jacobian
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values
from fenics_contact.mesh.cuts import cut_between, sewn
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.mesh.refinement import Refinement

CELLS = ["hexahedron", "tetrahedron"]
SHAPE = LinkShape(n_around=18, n_a=2, n_b=4)


def link(cell: str = "hexahedron", grading: float = 0.0) -> BodyMesh:
    return chain_link(replace(SHAPE, cell=cell, grading=grading)).mesh


def everywhere(mesh: BodyMesh) -> BodyMesh:
    return refined(mesh, np.ones(mesh.n_cells, dtype=bool)).mesh


def outside(mesh: BodyMesh) -> np.ndarray:
    """Return the places (a, b) in the section of all nodes on the boundary that do not hang, shape (n, 2)."""
    nodes = np.unique(boundary_faces(mesh.cells, 3, mesh.hanging)[0])
    if mesh.hanging:
        nodes = np.setdiff1d(nodes, mesh.hanging.nodes)
    x, y, z = mesh.points[nodes].T
    # The centre line: a straight piece between two half circles.
    middle = np.clip(x, -SHAPE.inner_radius - SHAPE.straight, -SHAPE.inner_radius)
    return np.column_stack([np.hypot(x - middle, z) - SHAPE.centre_radius, y])


def off_the_section(places: np.ndarray) -> np.ndarray:
    """Return the distance of places from the nearest of the four arcs around the section."""
    section, (a, b) = SHAPE.section, np.abs(places.T)
    crown = np.hypot(a - (SHAPE.thickness / 2.0 - section.crown_radius), b) - section.crown_radius
    flank = np.hypot(a, b - (SHAPE.width / 2.0 - section.flank_radius)) - section.flank_radius
    return np.minimum(np.abs(crown), np.abs(flank))


@pytest.mark.parametrize("grading", [0.0, 1.0])
@pytest.mark.parametrize("cell", CELLS)
def test_the_volume_of_a_refined_link_converges_to_that_of_the_smooth_one(cell: str, grading: float) -> None:
    meshes = [link(cell, grading)]
    for _ in range(2):
        meshes.append(everywhere(meshes[-1]))
    coarse, middle, fine = (1.0 - mesh.volume / SHAPE.volume for mesh in meshes)
    assert fine > 0.0
    order = np.log2(coarse / middle), np.log2(middle / fine)
    assert order[1] == pytest.approx(2.0, abs=0.15)
    assert order[1] > order[0] - 0.05


@pytest.mark.parametrize("cell", CELLS)
def test_new_nodes_lie_on_the_arcs_around_the_section(cell: str) -> None:
    mesh = link(cell, 1.0)
    for reach in (20.0, 10.0):
        away = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - [14.0, 3.0, 0.0], axis=1)
        mesh = refined(mesh, away < reach).mesh
        places = outside(mesh)
        assert len(places) > 100
        assert off_the_section(places).max() < 1e-12
        for name, shape in mesh.shapes.items():
            nodes = np.setdiff1d(mesh.surfaces[name], mesh.hanging.nodes)
            assert np.abs(shape.distance(mesh.points[nodes])).max() < 1e-12


def test_layers_inside_are_halved_as_they_were_graded() -> None:
    """The mesh with twice as many cells of the same strengths is the mesh refined everywhere."""
    coarse = link(grading=0.0)
    fine = chain_link(replace(SHAPE, n_around=36, n_a=4, n_b=8)).mesh
    found = everywhere(coarse)
    # They start at different places of the ring.
    shift = 36 // 16 - 2 * (18 // 16)
    assert shift == 0
    assert np.abs(np.sort(found.points, axis=0) - np.sort(fine.points, axis=0)).max() < 1e-12


def test_nodes_move_onto_the_body_once_they_hang_no_more() -> None:
    mesh = link()
    half = refined(mesh, np.arange(0, mesh.n_cells, 3)).mesh
    assert half.hanging
    middle = half.points[half.hanging.masters].mean(axis=1)
    np.testing.assert_allclose(half.points[half.hanging.nodes], middle, atol=1e-13)
    rest = refined(half, np.flatnonzero(half.hanging.levels == 0)).mesh
    assert not rest.hanging
    assert off_the_section(outside(rest)).max() < 1e-12
    assert rest.volume == pytest.approx(everywhere(mesh).volume, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_a_link_is_refined_as_well_where_it_was_placed(cell: str) -> None:
    turn, mesh = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), link(cell)
    marked, shift = np.arange(0, mesh.n_cells, 5), np.array([3.0, -1.0, 2.0])
    there = refined(mesh.placed(turn, shift, 0.5).placed(turn, shift, 3.0), marked).mesh
    moved = refined(mesh, marked).mesh.placed(turn, shift, 0.5).placed(turn, shift, 3.0)
    np.testing.assert_allclose(there.points, moved.points, atol=1e-12)
    np.testing.assert_allclose(refined(mesh.moved(1.0 + mesh.points), marked).mesh.points, 1.0 + refined(
        mesh, marked).mesh.points, atol=1e-12)  # fmt: skip


def interpolated(values: np.ndarray, mesh: BodyMesh, fine: Refinement) -> np.ndarray:
    """Return values in the coarse cells at the fine nodes, shape (n_nodes, 3)."""
    weights = shape_values(CELL_TYPES[mesh.cell_type], fine.positions.reshape(-1, 3))
    weights = weights.reshape(*fine.mesh.cells.shape, -1)
    result = np.zeros((fine.mesh.n_nodes, 3))
    result[fine.mesh.cells] = np.einsum("ckn,cni->cki", weights, values[mesh.cells[fine.parents]])
    return result


@pytest.mark.parametrize("cell", CELLS)
def test_what_a_design_has_moved_is_refined_with_its_movement(cell: str) -> None:
    """Offsets from facets are those before the design, also on surfaces with shapes."""
    mesh, marked = link(cell), np.arange(40)
    wave = 0.2 * np.sin(0.2 * mesh.points[:, [1, 2, 0]])
    fine = refined(mesh.reshaped(mesh.points + wave), marked)
    before = refined(mesh, marked).mesh
    np.testing.assert_allclose(fine.mesh.origin.points, before.points, atol=1e-12)
    np.testing.assert_allclose(fine.mesh.points - before.points, interpolated(wave, mesh, fine), atol=1e-12)
    again = refined(fine.mesh, np.arange(40)).mesh
    np.testing.assert_allclose(again.origin.points, refined(before, np.arange(40)).mesh.points, atol=1e-12)


def test_a_deformed_body_has_no_chart() -> None:
    mesh = link()
    stretched = mesh.moved(mesh.points * [1.0, 1.0, 1.1])
    assert stretched.chart is None
    assert everywhere(stretched).volume == pytest.approx(stretched.volume, rel=0.01)


@pytest.mark.parametrize("cell", CELLS)
def test_quadratic_cells_follow_the_body_to_fourth_order(cell: str) -> None:
    coarse = chain_link(LinkShape(n_around=24, n_a=2, n_b=4, cell=cell)).mesh
    fine = chain_link(LinkShape(n_around=48, n_a=4, n_b=8, cell=cell)).mesh
    errors = [abs(1.0 - quadratic(mesh).volume / SHAPE.volume) for mesh in (coarse, fine)]
    assert np.log2(errors[0] / errors[1]) > 3.5
    again = refined(quadratic(link("tetrahedron")), np.arange(30)).mesh
    assert off_the_section(outside(again)).max() < 1e-12


@pytest.mark.parametrize(
    ("cell", "reaches"), [("hexahedron", (14.0, 8.0)), ("tetrahedron", (14.0, 8.0, 5.0))]
)
def test_cells_of_coarse_and_strongly_graded_links_stay_valid(cell: str, reaches: tuple[float, ...]) -> None:
    """Nodes that would invert cells are not put on their images, those inside before those outside."""
    mesh = chain_link(LinkShape(n_around=30, n_a=1, n_b=4, grading=2.1, cell=cell)).mesh
    for reach in reaches:
        away = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - [-18.0, -3.0, 12.0], axis=1)
        mesh = refined(mesh, away < reach).mesh
    assert mesh.chart is not None
    assert scaled_jacobian(mesh.points, mesh.cells).min() > 1e-3
    free = np.ones(mesh.n_nodes, dtype=bool)
    if mesh.hanging:
        free[mesh.hanging.nodes] = False
    off = np.flatnonzero(free & (np.abs(mesh.chart.points() - mesh.points).max(axis=1) > 1e-9))
    assert len(off) > 0, "nothing had to be kept valid"
    if cell == "tetrahedron":
        assert not np.isin(off, boundary_faces(mesh.cells)[0]).any()


def test_bodies_that_are_cut_and_sewn_keep_their_chart() -> None:
    mesh = link()
    first = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 2] < 0.0)
    cut = cut_between(mesh, "cut", first, np.setdiff1d(np.arange(mesh.n_cells), first))
    assert cut.chart is not None
    np.testing.assert_allclose(cut.chart.points(), cut.points, atol=1e-12)
    np.testing.assert_allclose(everywhere(sewn(cut)).points, everywhere(mesh).points, atol=1e-12)
    wave = 0.2 * np.sin(0.2 * mesh.points[:, [1, 2, 0]])
    moved = cut.reshaped(mesh.points + wave)
    np.testing.assert_allclose(
        everywhere(sewn(moved)).points, everywhere(mesh.reshaped(mesh.points + wave)).points, atol=1e-12
    )


def test_a_chart_of_ones_own_may_be_closed_and_in_the_plane() -> None:
    def ring(polar: np.ndarray) -> np.ndarray:
        angle, radius = polar.T
        return np.column_stack([radius * np.cos(angle), -radius * np.sin(angle)])

    flat = rectangle((0.0, 1.0), (2.0 * np.pi, 2.0), (12, 2))
    nodes, first, number = np.unique(
        ring(flat.points).round(9), axis=0, return_index=True, return_inverse=True
    )
    chart = Chart(ring, flat.points[first], period=2.0 * np.pi)
    mesh = BodyMesh(chart.points(), number.ravel()[flat.cells], chart=chart)
    assert len(nodes) == 36
    fine = everywhere(everywhere(mesh))
    assert np.linalg.norm(fine.points, axis=1).min() == pytest.approx(1.0, abs=1e-14)
    assert fine.volume == pytest.approx(3.0 * np.pi, rel=5e-3)


def twice(points: np.ndarray) -> np.ndarray:
    return 2.0 * points


WRONG: list[tuple[Callable[[BodyMesh], Chart], str]] = [
    (lambda flat: Chart(twice, flat.points), "the images of their coordinates by the chart, 5 of 6"),
    (lambda flat: Chart(lambda x: x, flat.points[1:]), r"Chart.coordinates must have shape \(6, 2\)"),
    (lambda flat: Chart(lambda x: x[:, 0], flat.points), r"finite points of shape \(6, 2\).*shape \(6,\)"),
    (lambda flat: Chart(np.log, flat.points - 1.0), "Chart.map must return finite points.*NaN"),
]  # fmt: skip


@pytest.mark.parametrize(("made", "message"), WRONG)
@pytest.mark.filterwarnings("ignore:invalid value", "ignore:divide by zero")
def test_wrong_charts_are_refused(made: Callable[[BodyMesh], Chart], message: str) -> None:
    flat = rectangle((0.0, 0.0), (2.0, 1.0), (2, 1))
    with pytest.raises(InvalidInputError, match=message):
        BodyMesh(flat.points, flat.cells, chart=made(flat))
