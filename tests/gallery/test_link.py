"""Links of chains."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fenics_contact import BodyMesh, box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import Chain, Link, LinkShape, TwoLinks, chain, chain_link, two_links
from fenics_contact.gallery.links import PULL_AXIS
from fenics_contact.gallery.ring import WireSection, drawn_together
from fenics_contact.mesh import boundary_faces, scaled_jacobian
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.partition import check_face_connected
from fenics_contact.mesh.quality import jacobians
from tests.mesh.counts import torn_node_counts

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
        ({"n_around": 50}, r"n_around must be a multiple of 6, got 50: take 48"),
        ({"n_around": 6}, "n_around must be an integer of at least 12, got 6"),
        ({"n_a": 0}, "n_a must be an integer of at least 1, got 0"),
        ({"n_b": 1}, "n_b must be an integer of at least 2, got 1"),
        ({"cell": "wedge"}, "cell must be one of .*, got 'wedge'"),
        ({"inner_radius": 0.0}, "inner_radius must be positive, got 0.0"),
        ({"straight": -1.0}, "straight must be positive, got -1.0"),
        ({"straight": np.nan}, "straight must be a finite number below"),
        ({"thickness": -2.0}, "thickness and width must be positive, got -2.0 and 16.0"),
        ({"width": np.inf}, "width must be a finite number below"),
        (
            {"roundness": 1.0},
            "roundness must lie between 0 and 1, got 1.0",
        ),
        ({"roundness": 0.0}, "got 0.0: take 0.9"),
        (
            {"thickness": 5.0},
            "a section 5.0 thick and 16.0 wide is too slender for roundness 0.9: lower that",
        ),
    ],
)
def test_a_shape_that_is_no_link_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        LinkShape(**change)


def test_links_need_no_gmsh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert chain_link(LinkShape(n_around=12, n_a=1, n_b=2)).mesh.n_cells == 24


# A graded link has its small cells where links touch, and all else as a uniform one has it.

#: The grading that the docstring of `LinkShape` names, and the radius of the contact circle there.
GRADING, CIRCLE = 2.1, 2.95


@pytest.fixture(scope="module", params=CELLS)
def graded(request: pytest.FixtureRequest) -> Link:
    """The graded link of the published size; it cannot be written to."""
    return chain_link(LinkShape(grading=GRADING, cell=request.param))


def distance(first: Link, second: Link, crown: str) -> float:
    """Smallest distance of the nodes of a crown of the second link from the smooth crown of the first."""
    nodes = second.mesh.points[np.unique(second.mesh.surfaces[crown])]
    return float(first.mesh.shapes["contact"].distance(nodes).min())


def lattice(link: Link) -> np.ndarray:
    """Return the nodes as (n_around, n_a + 1, n_b + 1, 3)."""
    shape = link.shape
    return link.mesh.points.reshape(shape.n_around, shape.n_a + 1, shape.n_b + 1, 3)


def crown(link: Link) -> np.ndarray:
    """Return the nodes of the contact surface as (along, across, 3)."""
    return link.mesh.points[link.crown.nodes].reshape(*link.crown.counts, 3)


def cells_across(places: np.ndarray) -> int:
    """Count the cells between -CIRCLE and CIRCLE."""
    return int(np.count_nonzero(np.abs(places) <= CIRCLE)) - 1


def test_eight_cells_lie_across_the_contact_circle_in_both_directions(graded: Link) -> None:
    nodes = crown(graded)
    along, across = (count // 2 for count in graded.crown.counts)
    assert nodes[along, across] == pytest.approx(np.zeros(3), abs=1e-12)
    assert cells_across(nodes[:, across, 2]) >= 8
    assert cells_across(nodes[along, :, 1]) >= 8
    uniform = crown(chain_link())
    assert cells_across(uniform[:, 10, 2]) == 2


def test_cells_at_the_spot_are_alike_in_all_directions(graded: Link) -> None:
    nodes = lattice(graded)
    around, across = graded.shape.n_around // 16, graded.shape.n_b // 2
    spot = nodes[around, 0, across]
    sizes = [
        np.linalg.norm(nodes[index] - spot)
        for index in ((around + 1, 0, across), (around, 1, across), (around, 0, across + 1))
    ]
    assert max(sizes) < 1.15 * min(sizes)


def test_both_crowns_are_graded_and_mirror_images(graded: Link) -> None:
    nodes, shape = lattice(graded), graded.shape
    near = np.roll(nodes, -(shape.n_around // 16), axis=0)
    far = np.roll(near, shape.n_around // 2, axis=0)
    assert near[0, 0, shape.n_b // 2] == pytest.approx(np.zeros(3), abs=1e-12)
    turned = (far - [-shape.opening, 0.0, 0.0]) * [-1.0, 1.0, -1.0]
    assert near == pytest.approx(turned, abs=1e-10)
    assert near[1:, :, ::-1] == pytest.approx(near[:0:-1] * [1.0, -1.0, -1.0], abs=1e-10)


def test_cells_grow_without_jumps_along_the_ring_and_across(graded: Link) -> None:
    nodes, shape = lattice(graded), graded.shape
    middle = nodes[:, [0, -1], shape.n_b // 2].mean(axis=1)
    along = np.linalg.norm(np.roll(middle, -1, axis=0) - middle, axis=1)
    across = np.diff(crown(graded)[graded.crown.counts[0] // 2, :, 1])
    for sizes in (along, across):
        growth = np.roll(sizes, -1) / sizes
        assert np.maximum(growth, 1.0 / growth).max() < 1.35
    assert along.max() > 7.0 * along.min(), "nothing was graded"


def test_cell_numbers_and_subdomains_are_those_of_the_uniform_link(graded: Link) -> None:
    uniform = chain_link(replace(graded.shape, grading=0.0))
    assert np.array_equal(graded.mesh.cells, uniform.mesh.cells)
    assert graded.mesh.grid is not None
    assert np.array_equal(graded.mesh.grid, uniform.mesh.grid)
    partition = box_partition(graded.mesh, (8, 1, 1))
    for x in (0.0, -graded.shape.opening):
        pole = np.linalg.norm(graded.mesh.points - [x, 0.0, 0.0], axis=1).argmin()
        assert np.unique(partition[np.any(graded.mesh.cells == pole, axis=1)]).size == 1


def test_legs_hand_cells_over_to_the_crowns() -> None:
    spacing = LinkShape(grading=GRADING).spacing
    assert (spacing.quarter, spacing.leg) == (10, 4)
    assert 4 * spacing.quarter + 2 * spacing.leg == 48
    assert (LinkShape().spacing.quarter, LinkShape().spacing.leg) == (8, 8)


def test_cells_are_sound(graded: Link) -> None:
    mesh = graded.mesh
    assert jacobians(mesh.points, mesh.cells).min() > 0.0
    least = 0.2 if graded.shape.cell == "hexahedron" else 0.003
    assert scaled_jacobian(mesh.points, mesh.cells).min() > least


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    "change",
    [
        {"grading": 8.0},
        {"n_around": 12, "n_a": 1, "n_b": 2},
        {"n_around": 18, "n_b": 5, "straight": 3.0},
        {"n_around": 36, "n_b": 7, "straight": 300.0},
        {"roundness": 0.5, "width": 9.0},
    ],
    ids=str,
)
def test_other_links_may_be_graded_as_well(change: dict[str, float], cell: str) -> None:
    link = chain_link(LinkShape(**{"grading": 3.0, "cell": cell, **change}))  # type: ignore[arg-type]
    assert jacobians(link.mesh.points, link.mesh.cells).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_the_volume_of_a_graded_link_converges_to_that_of_the_smooth_link(cell: str) -> None:
    errors = []
    for k in (4, 8):
        shape = LinkShape(n_around=12 * k, n_a=2 * k, n_b=3 * k, cell=cell, grading=GRADING)
        errors.append(1.0 - chain_link(shape).mesh.volume / shape.volume)
    assert errors[1] > 0.0
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_design_parameters_are_parts_of_the_arcs_length(graded: Link) -> None:
    section, (x, y, z) = graded.shape.section, crown(graded).transpose(2, 0, 1)
    s, t = graded.crown.parameters.T.reshape(2, *graded.crown.counts)
    assert np.pi * (s - 0.5) == pytest.approx(np.arctan2(z, x + graded.shape.inner_radius))
    assert section.half_angle * (2 * t - 1) == pytest.approx(np.arcsin(y / section.crown_radius))
    assert np.ptp(np.diff(s, axis=0)) > 0.05, "nothing was graded"


def test_design_directions_are_normals_of_the_torus(graded: Link) -> None:
    nodes, normals = crown(graded).reshape(-1, 3), graded.crown.directions
    radius = graded.shape.section.crown_radius
    middle = nodes - radius * normals
    ring = np.hypot(middle[:, 0] + graded.shape.inner_radius, middle[:, 2])
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    assert ring == pytest.approx(graded.shape.inner_radius + radius)
    assert middle[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_graded_links_touch_in_pairs_and_in_chains() -> None:
    shape = LinkShape(n_around=36, n_a=4, n_b=12, grading=GRADING)
    pair = two_links(shape, gap=0.1)
    assert distance(pair.first, pair.second, "contact") == pytest.approx(0.1, abs=1e-12)
    assert pair.second.mesh.points[:, 0].min() + shape.thickness == pytest.approx(-0.1, abs=1e-3)
    three = chain([shape, replace(shape, grading=1.0), shape])
    for one, other in pairwise(three.links):
        assert distance(one, other, "grip") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("grading", [-0.1, 8.1])
def test_a_grading_out_of_bounds_is_refused(grading: float) -> None:
    with pytest.raises(InvalidInputError, match=f"grading must be from 0 to 8, got {grading}"):
        LinkShape(grading=grading)


def test_places_are_drawn_to_the_middle_and_ends_stay() -> None:
    places = np.linspace(-1.0, 1.0, 9)
    drawn = drawn_together(places, 2.0)
    assert drawn[[0, 4, 8]] == pytest.approx([-1.0, 0.0, 1.0])
    assert np.diff(drawn)[[3, 4]] == pytest.approx(np.sinh(0.5) / np.sinh(2.0))
    assert np.all(np.diff(drawn[4:], 2) > 0.0)
    assert drawn_together(places, 0.0) is places


# Two links are interlocked and touch at their crowns, or the reason why not is given.
def distances(first: BodyMesh, second: BodyMesh, name: str = "contact") -> np.ndarray:
    """Distance of the nodes of the second's surface from the smooth contact crown of the first."""
    return first.shapes["contact"].distance(second.points[np.unique(second.surfaces[name])])


@pytest.fixture(scope="module", params=CELLS)
def pair(request: pytest.FixtureRequest) -> TwoLinks:
    """Two links of the paper's size, of either cell type; they cannot be written to."""
    return two_links(LinkShape(cell=request.param))


def test_the_second_link_is_the_first_one_turned_by_90_degrees(pair: TwoLinks) -> None:
    first, second = pair.first.mesh, pair.second.mesh
    assert first.points.max(axis=0) - first.points.min(axis=0) == pytest.approx([80.0, 16.0, 54.0])
    assert second.points.max(axis=0) - second.points.min(axis=0) == pytest.approx([80.0, 54.0, 16.0])
    assert second.volume == pytest.approx(first.volume)


def test_pulling_the_second_link_presses_the_crowns_together(pair: TwoLinks) -> None:
    first, second = pair.first.mesh, pair.second.mesh
    grips = [mesh.points[np.unique(mesh.surfaces["grip"])] @ PULL_AXIS for mesh in (first, second)]
    assert grips[0].max() < -30.0 < 30.0 < grips[1].min()
    assert distances(first, second.moved(second.points + 0.5 * PULL_AXIS)).min() == pytest.approx(-0.5)


def test_the_smooth_crowns_touch_at_one_spot(pair: TwoLinks) -> None:
    for one, other in ((pair.first, pair.second), (pair.second, pair.first)):
        distance = distances(one.mesh, other.mesh)
        assert distance.min() == pytest.approx(0.0, abs=1e-12)
        place = other.mesh.points[np.unique(other.mesh.surfaces["contact"])]
        assert np.abs(place[distance < 0.05]).max() < 3.0, "they touch elsewhere, too"
        nodes = one.crown.nodes.reshape(one.crown.counts)
        assert np.abs(one.mesh.points[nodes[nodes.shape[0] // 2, nodes.shape[1] // 2]]).max() < 1e-12
        assert np.abs(one.mesh.points[nodes][:, [0, -1]]).max(axis=(0, 1)).min() > 5.0


def test_the_gap_between_the_crowns_follows_their_curvatures() -> None:
    shape = LinkShape(n_around=192, n_a=1, n_b=40)
    pair = two_links(shape, gap=0.25)
    _, y, z = pair.second.mesh.points[np.unique(pair.second.mesh.surfaces["contact"])].T
    near = np.hypot(y, z) < 2.0
    assert near.sum() > 30
    difference = 1.0 / shape.section.crown_radius - 1.0 / shape.inner_radius
    formula = 0.25 + difference * (y**2 + z**2) / 2.0
    # At 2 mm the higher orders of both tori are a tenth of what their curvatures open.
    assert distances(pair.first.mesh, pair.second.mesh)[near] == pytest.approx(formula[near], abs=0.004)
    assert formula[near].max() > 0.28


@pytest.mark.parametrize("gap", [0.0, 0.7])
def test_the_clearance_is_the_gap_asked_for(gap: float) -> None:
    pair = two_links(gap=gap)
    assert distances(pair.first.mesh, pair.second.mesh).min() == pytest.approx(gap, abs=1e-12)


@pytest.mark.parametrize("n_b", [5, 6])
@pytest.mark.parametrize("cell", CELLS)
def test_coarse_links_touch_as_well(cell: str, n_b: int) -> None:
    pair = two_links(LinkShape(n_around=12, n_a=2, n_b=n_b, cell=cell))
    height = 16.0 * (1.0 - np.cos(np.pi / 12))  # of the circle over the longest of its 12 facets
    assert abs(pair.second.mesh.points[:, 0].min() + 16.0) < height
    distance = distances(pair.first.mesh, pair.second.mesh).min()
    assert -1e-12 < distance < height


def test_links_of_different_shape_may_be_paired() -> None:
    thin = LinkShape(
        thickness=12.0, width=12.0, inner_radius=10.0, n_around=24, n_a=2, n_b=6, cell="tetrahedron"
    )
    pair = two_links(LinkShape(n_around=24, n_a=2, n_b=6), thin)
    assert (pair.first.mesh.cell_type, pair.second.mesh.cell_type) == ("hexahedron", "tetrahedron")
    assert distances(pair.first.mesh, pair.second.mesh).min() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("build", [two_links, lambda gap: chain([LinkShape()] * 2, gap=gap)])
def test_a_start_that_penetrates_is_refused(build: Callable[..., object]) -> None:
    with pytest.raises(InvalidInputError, match=r"gap must not be negative, got -0\.5: loaded links"):
        build(gap=-0.5)


def test_a_gap_that_is_no_number_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"gap must be a finite number below .*, got nan"):
        two_links(gap=np.nan)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (
            {"inner_radius": 8.9},
            {},
            r"inner_radius of link 1 must exceed .* wire of link 2, got 8\.9 and 8\.998\d+",
        ),
        (
            {},
            {"roundness": 0.5},
            r"radius across the wire of link 2, got 11 and 17\.4\d+: enlarge",
        ),
        (
            {},
            {"width": 22.0, "thickness": 20.0},
            r"wire of link 2 .* got 22 x 20 for 22 x 48",
        ),
        (
            {"straight": 1.0, "inner_radius": 9.5},
            {"thickness": 21.0},
            "got 16 x 21 for 19 x 20",
        ),
    ],
)
def test_links_that_cannot_touch_properly_are_refused(
    first: dict[str, float], second: dict[str, float], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        two_links(LinkShape(**first), LinkShape(**second))  # type: ignore[arg-type]


# Chains: every link touches the one before, alternately turned.
COARSE = LinkShape(n_around=24, n_a=2, n_b=6)
THIN = LinkShape(thickness=12.0, width=12.0, inner_radius=10.0, n_around=24, n_a=2, n_b=6)


def distance_between(one: Link, other: Link) -> float:
    """Smallest distance of the nodes of a far crown from the smooth contact crown of the link before."""
    far = other.mesh.points[np.unique(other.mesh.surfaces["grip"])]
    return float(one.mesh.shapes["contact"].distance(far).min())


@pytest.fixture(scope="module")
def five() -> Chain:
    return chain([COARSE] * 5)


def test_neighbours_touch_and_all_others_are_apart(five: Chain) -> None:
    assert five.pairs == ((0, 1), (1, 2), (2, 3), (3, 4))
    for one, other in pairwise(five.links):
        assert distance_between(one, other) == pytest.approx(0.0, abs=1e-12)
    reach = [(link.mesh.points[:, 0].min(), link.mesh.points[:, 0].max()) for link in five.links]
    assert all(low < high for (_, high), (low, _) in pairwise(reach))
    assert all(high < low for (_, high), (low, _) in zip(reach[:-2], reach[2:], strict=True))


def test_rings_lie_in_the_xz_plane_and_the_xy_plane_in_turn(five: Chain) -> None:
    wide = [np.ptp(link.mesh.points, axis=0)[1:] for link in five.links]
    for number, (y, z) in enumerate(wide):
        assert (y < z) == (number % 2 == 0)
        assert sorted((y, z)) == pytest.approx(sorted(wide[0]))


def test_two_links_of_a_chain_lie_as_two_links_do(five: Chain) -> None:
    pair, first, second = two_links(COARSE), five.links[0].mesh.points, five.links[1].mesh.points
    assert np.array_equal(first, pair.first.mesh.points)
    other = pair.second.mesh.points
    assert np.ptp(second, axis=0) == pytest.approx(np.ptp(other, axis=0))
    assert second.min(axis=0) == pytest.approx(other.min(axis=0), abs=1e-9)


def test_the_clearances_are_the_gap_asked_for() -> None:
    built = chain([COARSE, THIN, COARSE], gap=0.4)
    assert [distance_between(one, other) for one, other in pairwise(built.links)] == pytest.approx(
        [0.4] * 2, abs=1e-9
    )
    first, second = built.links[1].mesh, built.links[2].mesh
    assert np.ptp(first.points[:, 0]) < np.ptp(second.points[:, 0]), "the links are alike"


def test_a_chain_of_one_link_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="needs two or more links, got 1: give all shapes"):
        chain([COARSE])


def test_links_that_do_not_fit_are_named_by_their_place() -> None:
    fat = LinkShape(width=22.0, thickness=20.0, n_around=24, n_a=2, n_b=6)
    with pytest.raises(InvalidInputError, match="the wire of link 3 must pass through the opening of link 2"):
        chain([COARSE, COARSE, fat])
