"""A graded link has its small cells where links touch, and all else as a uniform one has it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fenics_contact import box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import Link, LinkShape, chain, chain_link, two_links
from fenics_contact.gallery.ring import drawn_together
from fenics_contact.mesh import scaled_jacobian
from fenics_contact.mesh.quality import jacobians

#: The grading that the docstring of `LinkShape` names, and the radius of the contact circle there.
GRADING, CIRCLE = 2.1, 2.95
CELLS = ["hexahedron", "tetrahedron"]


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
def test_the_volume_converges_to_that_of_the_smooth_link(cell: str) -> None:
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
    with pytest.raises(InvalidInputError, match=f"grading must lie between 0 and 8, got {grading}"):
        LinkShape(grading=grading)


def test_places_are_drawn_to_the_spot_and_ends_stay() -> None:
    places = np.linspace(2.0, 6.0, 9)
    middle, start = drawn_together(places, 4.0, 2.0), drawn_together(places, 2.0, 2.0)
    assert middle[[0, 4, 8]] == pytest.approx([2.0, 4.0, 6.0])
    assert start[[0, 8]] == pytest.approx([2.0, 6.0])
    assert np.diff(middle)[[3, 4]] == pytest.approx(2.0 * np.sinh(0.5) / np.sinh(2.0))
    assert np.all(np.diff(start, 2) > 0.0)
    assert drawn_together(places, 4.0, 0.0) is places
