"""A chain link has the shape, the cells and the named surfaces that were asked for."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact import box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import Link, LinkShape, chain_link
from fenics_contact.gallery.ring import WireSection
from fenics_contact.mesh import boundary_faces, scaled_jacobian
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.partition import check_face_connected
from tests.partition.counts import torn_node_counts

CELLS = ["hexahedron", "tetrahedron"]


@pytest.fixture(scope="module")
def paper() -> Link:
    """The link of the paper's size; it cannot be written to."""
    return chain_link()


@pytest.fixture(scope="module", params=CELLS)
def small(request: pytest.FixtureRequest) -> Link:
    """A coarse link of either cell type; it cannot be written to."""
    return chain_link(LinkShape(n_around=24, n_a=3, n_b=6, cell=request.param))


def test_the_papers_link_has_7680_hexahedra(paper: Link) -> None:
    assert (paper.mesh.n_cells, paper.mesh.cell_type) == (48 * 8 * 20, "hexahedron")
    assert paper.mesh.n_nodes == 48 * 9 * 21


def test_the_papers_two_links_have_66528_torn_displacements_in_32_subdomains(paper: Link) -> None:
    partition = box_partition(paper.mesh, (8, 1, 2))
    check_face_connected(paper.mesh, partition)
    nodes = torn_node_counts(paper.mesh, partition)
    assert nodes.tolist() == 16 * [7 * 9 * 11]
    assert 2 * 3 * nodes.sum() == 66528
    assert np.bincount(partition).tolist() == 16 * [6 * 8 * 10]


def test_tetrahedra_inherit_the_grid_and_with_it_the_partition(paper: Link) -> None:
    split = chain_link(LinkShape(cell="tetrahedron"))
    partition = box_partition(split.mesh, (8, 1, 2))
    check_face_connected(split.mesh, partition)
    assert torn_node_counts(split.mesh, partition).tolist() == 16 * [693]
    assert np.array_equal(split.mesh.points, paper.mesh.points)


def test_cells_are_well_shaped(paper: Link, small: Link) -> None:
    assert scaled_jacobian(paper.mesh.points, paper.mesh.cells).min() > 0.25
    assert scaled_jacobian(small.mesh.points, small.mesh.cells).min() > 0.02


def test_no_cut_across_the_ring_meets_the_middle_of_a_crown(paper: Link) -> None:
    partition = box_partition(paper.mesh, (8, 1, 1))
    for x in (0.0, -paper.shape.opening):
        pole = np.linalg.norm(paper.mesh.points - [x, 0.0, 0.0], axis=1).argmin()
        assert np.unique(partition[np.any(paper.mesh.cells == pole, axis=1)]).size == 1


def test_the_ring_is_closed_and_watertight(small: Link) -> None:
    facets, _ = boundary_faces(small.mesh.cells)
    n = small.shape
    assert facets.shape[0] == 2 * n.n_around * (n.n_a + n.n_b) * (1 if facets.shape[1] == 4 else 2)
    assert vector_areas(small.mesh.points, facets).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    edges = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    euler = np.unique(facets).size - np.unique(edges, axis=0).shape[0] + facets.shape[0]
    assert euler == 0, "the surface of a ring is a torus"


@pytest.mark.parametrize("cell", CELLS)
def test_the_volume_converges_to_that_of_the_smooth_link(cell: str) -> None:
    errors = []
    for k in (2, 4):
        shape = LinkShape(n_around=12 * k, n_a=2 * k, n_b=3 * k, cell=cell)
        errors.append(1.0 - chain_link(shape).mesh.volume / shape.volume)
    assert errors[1] > 0.0
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_the_section_of_a_nearly_full_disc_has_its_area() -> None:
    assert WireSection(2.0, 2.0, 1.0 - 1e-9).area == pytest.approx(np.pi)
    assert WireSection(2.0, 3.0, 1e-9).area == pytest.approx(6.0)


def test_the_link_has_the_proportions_asked_for(paper: Link) -> None:
    low, high = paper.mesh.points.min(axis=0), paper.mesh.points.max(axis=0)
    assert high - low == pytest.approx([48.0 + 2 * 16.0, 16.0, 22.0 + 2 * 16.0])
    assert (low[0], high[0]) == (pytest.approx(-64.0), pytest.approx(16.0))


def test_contact_and_grip_are_the_inner_sides_of_the_two_crowns(small: Link) -> None:
    shape, points = small.shape, small.mesh.points
    assert set(small.mesh.surfaces) == {"contact", "grip"}
    for name, centre, sign in (
        ("contact", -shape.inner_radius, 1.0),
        ("grip", -shape.inner_radius - shape.straight, -1.0),
    ):
        facets = small.mesh.surfaces[name]
        assert facets.shape[0] == shape.n_around // 3 * shape.n_b * (1 if facets.shape[1] == 4 else 2)
        nodes = points[np.unique(facets)] - [centre, 0.0, 0.0]
        assert (sign * nodes[:, 0]).min() > -1e-9
        assert np.hypot(nodes[:, 0], nodes[:, 2]).max() < shape.centre_radius
        assert np.hypot(nodes[:, 0], nodes[:, 2]).min() == pytest.approx(shape.inner_radius)
        inwards = -np.sum(
            vector_areas(points, facets) * (points[facets].mean(axis=1) - [centre, 0, 0]), axis=1
        )
        assert inwards.min() > 0.0, "the normals point to the middle of the crown, out of the wire"


def test_the_area_of_contact_is_that_of_the_smooth_crown(paper: Link) -> None:
    section = paper.shape.section
    r, half = section.crown_radius, section.half_angle
    smooth = 2.0 * np.pi * r * ((paper.shape.inner_radius + r) * half - r * np.sin(half))
    areas = np.linalg.norm(vector_areas(paper.mesh.points, paper.mesh.surfaces["contact"]), axis=1)
    assert areas.sum() == pytest.approx(smooth, rel=3e-3)


def test_the_design_surface_is_the_contact_surface(small: Link) -> None:
    crown = small.crown
    assert np.array_equal(np.sort(crown.nodes), np.unique(small.mesh.surfaces["contact"]))
    assert crown.nodes.size == crown.counts[0] * crown.counts[1] == np.unique(crown.nodes).size


def test_design_parameters_run_along_the_ring_and_across_the_wire(small: Link) -> None:
    s, t = small.crown.parameters.T.reshape(2, *small.crown.counts)
    assert (s.min(), s.max(), t.min(), t.max()) == (0.0, 1.0, 0.0, 1.0)
    _, y, z = small.mesh.points[small.crown.nodes].T.reshape(3, *small.crown.counts)
    section = small.shape.section
    angle = np.pi * (s - 0.5)
    radius = small.shape.inner_radius + section.crown_radius * (
        1.0 - np.cos(section.half_angle * (2 * t - 1))
    )
    assert y == pytest.approx(section.crown_radius * np.sin(section.half_angle * (2 * t - 1)))
    assert z == pytest.approx(radius * np.sin(angle))


def test_design_directions_are_unit_normals_out_of_the_body(paper: Link) -> None:
    mesh, crown = paper.mesh, paper.crown
    assert np.linalg.norm(crown.directions, axis=1) == pytest.approx(np.ones(crown.nodes.size))
    facets = mesh.surfaces["contact"]
    nodal = np.zeros_like(mesh.points)
    np.add.at(nodal, facets.ravel(), np.repeat(vector_areas(mesh.points, facets), 4, axis=0))
    inner = np.all((crown.parameters > 0.0) & (crown.parameters < 1.0), axis=1)
    meshed = nodal[crown.nodes[inner]]
    cosine = np.sum(meshed * crown.directions[inner], axis=1) / np.linalg.norm(meshed, axis=1)
    assert inner.sum() == 15 * 19
    assert cosine.min() > 0.999


def test_a_placed_link_turns_its_directions_with_it(small: Link) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    placed = small.placed(turn, np.array([1.0, 2.0, 3.0]))
    assert placed.mesh.points == pytest.approx(small.mesh.points @ turn.T + [1.0, 2.0, 3.0])
    assert placed.crown.directions == pytest.approx(small.crown.directions @ turn.T)
    assert placed.mesh.volume == pytest.approx(small.mesh.volume)


def test_the_same_shape_gives_the_same_mesh_bit_for_bit(small: Link) -> None:
    again = chain_link(replace(small.shape))
    assert again.mesh.points.tobytes() == small.mesh.points.tobytes()
    assert again.mesh.cells.tobytes() == small.mesh.cells.tobytes()
    for name, facets in small.mesh.surfaces.items():
        assert again.mesh.surfaces[name].tobytes() == facets.tobytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_around": 50}, r"n_around must be a multiple of 6 .*, got 50: take 48"),
        ({"n_around": 6}, "n_around must be an integer of at least 12, got 6"),
        ({"n_a": 0}, "n_a must be an integer of at least 1, got 0"),
        ({"n_b": 1}, "n_b must be an integer of at least 2, got 1"),
        ({"cell": "wedge"}, "cell must be one of .*, got 'wedge'"),
        ({"inner_radius": 0.0}, "inner_radius must be positive, got 0.0"),
        ({"straight": -1.0}, "straight must be positive, got -1.0"),
        ({"straight": np.nan}, "straight must be a finite number of less than"),
        ({"thickness": -2.0}, "thickness and width must be positive, got -2.0 and 16.0"),
        ({"width": np.inf}, "width must be a finite number of less than"),
        (
            {"roundness": 1.0},
            r"roundness must lie between 0 .square. and 1 .disc, whose corner cells are flat.",
        ),
        ({"roundness": 0.0}, "got 0.0: take for example 0.9"),
        ({"thickness": 5.0}, "a section 5.0 thick and 16.0 wide is too slender for roundness 0.9: lower the"),
    ],
)
def test_a_shape_that_is_no_link_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        LinkShape(**change)


def test_links_need_no_gmsh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert chain_link(LinkShape(n_around=12, n_a=1, n_b=2)).mesh.n_cells == 24
