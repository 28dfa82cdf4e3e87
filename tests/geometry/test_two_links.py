"""Two links are interlocked and touch at their crowns, or the reason why not is given."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry import (
    PULL_AXIS,
    BodyMesh,
    LinkShape,
    TwoLinks,
    axial_clearance,
    block,
    check_penetration,
    mutual_clearance,
    two_links,
)

CELLS = ["hexahedron", "tetrahedron"]


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
    closer = second.moved(second.points + 0.5 * PULL_AXIS)
    assert mutual_clearance(first, closer) == pytest.approx(-0.5)


def test_the_crowns_touch_and_no_node_penetrates(pair: TwoLinks) -> None:
    assert pair.clearance == pytest.approx(0.0, abs=1e-12)
    assert pair.faceting == pytest.approx(11.0 * (1.0 - np.cos(np.pi / 32)))
    ways = [
        axial_clearance(pair.first.mesh, pair.second.mesh),
        axial_clearance(pair.second.mesh, pair.first.mesh),
    ]
    for _, distance in ways:
        assert distance.size > 50
        assert distance.min() > -1e-12
        assert np.count_nonzero(distance < pair.faceting) < 0.2 * distance.size, "they touch at one spot only"


def test_the_spot_lies_inside_the_contact_surfaces(pair: TwoLinks) -> None:
    for link in (pair.first, pair.second):
        nodes = link.crown.nodes.reshape(link.crown.counts)
        x, y, z = link.mesh.points[nodes[nodes.shape[0] // 2, nodes.shape[1] // 2]]
        assert (abs(x) < pair.faceting, y, z) == (True, pytest.approx(0.0), pytest.approx(0.0))
        assert np.abs(link.mesh.points[nodes][:, [0, -1]]).max(axis=(0, 1)).min() > 5.0


def test_the_gap_between_the_crowns_follows_their_curvatures() -> None:
    shape = LinkShape(n_around=192, n_a=1, n_b=40)
    pair = two_links(shape, gap=0.25)
    nodes, distance = axial_clearance(pair.first.mesh, pair.second.mesh)
    _, y, z = pair.first.mesh.points[nodes].T
    near = np.hypot(y, z) < 2.0
    assert near.sum() > 30
    difference = 1.0 / shape.section.crown_radius - 1.0 / shape.inner_radius
    formula = 0.25 + difference * (y**2 + z**2) / 2.0
    assert distance[near] == pytest.approx(formula[near], abs=2.0 * pair.faceting)
    assert formula[near].max() > 0.25 + 10.0 * pair.faceting, "the facets hide the curvature"


@pytest.mark.parametrize("gap", [0.0, 0.7, -0.04])
def test_the_measured_clearance_is_the_gap_asked_for(gap: float) -> None:
    pair = two_links(gap=gap)
    assert pair.clearance == pytest.approx(gap, abs=1e-12)
    assert mutual_clearance(pair.first.mesh, pair.second.mesh) == pair.clearance


@pytest.mark.parametrize("n_b", [5, 6])
@pytest.mark.parametrize("cell", CELLS)
def test_coarse_links_touch_as_well(cell: str, n_b: int) -> None:
    pair = two_links(LinkShape(n_around=12, n_a=2, n_b=n_b, cell=cell))
    assert pair.clearance == pytest.approx(0.0, abs=1e-12)
    assert np.abs(pair.second.mesh.points[:, 0].min() + 16.0) < pair.faceting


def test_links_of_different_shape_may_be_paired() -> None:
    thin = LinkShape(
        thickness=12.0, width=12.0, inner_radius=10.0, n_around=24, n_a=2, n_b=6, cell="tetrahedron"
    )
    pair = two_links(LinkShape(n_around=24, n_a=2, n_b=6), thin)
    assert (pair.first.mesh.cell_type, pair.second.mesh.cell_type) == ("hexahedron", "tetrahedron")
    assert pair.clearance == pytest.approx(0.0, abs=1e-12)


def test_a_start_that_penetrates_is_refused_with_the_depth() -> None:
    with pytest.raises(
        InvalidInputError, match=r"more than the faceting of 0\.053 at the start, these would by 0\.5:"
    ):
        two_links(gap=-0.5)


def test_a_moved_start_that_penetrates_is_refused_with_the_depth(pair: TwoLinks) -> None:
    second = pair.second.mesh
    pushed = second.moved(second.points + 0.3 * PULL_AXIS)
    with pytest.raises(InvalidInputError, match=r"these would by 0\.3: move them apart"):
        check_penetration(mutual_clearance(pair.first.mesh, pushed), pair.faceting)


def test_a_gap_that_is_no_number_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"gap must be a finite number of less than .*, got nan"):
        two_links(gap=np.nan)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (
            {"inner_radius": 8.9},
            {},
            r"below the other link's inner_radius, got 8\.998\d+ for link 2 against 8\.9 for",
        ),
        (
            {},
            {"roundness": 0.5},
            r"one spot only if .* got 17\.4\d+ for link 2 against 11 for link 1: make inner",
        ),
        (
            {},
            {"width": 22.0, "thickness": 20.0},
            r"wire of link 2 .* 22 wide and 20 thick for an opening 22 wide and 48",
        ),
        (
            {"straight": 1.0, "inner_radius": 9.5},
            {"thickness": 21.0},
            "got a wire 16 wide and 21 thick for an open.* 20 long",
        ),
    ],
)
def test_links_that_cannot_touch_properly_are_refused(
    first: dict[str, float], second: dict[str, float], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        two_links(LinkShape(**first), LinkShape(**second))  # type: ignore[arg-type]


def test_surfaces_that_are_nowhere_opposite_are_infinitely_far_apart() -> None:
    pair = two_links(LinkShape(n_around=12, n_a=1, n_b=2))
    aside = pair.second.mesh.moved(pair.second.mesh.points + np.array([0.0, 500.0, 0.0]))
    assert mutual_clearance(pair.first.mesh, aside) == np.inf


def test_surfaces_along_the_axis_have_no_clearance() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    sideways = BodyMesh(mesh.points, mesh.cells, {"contact": mesh.surfaces["y1"]})
    assert [array.size for array in axial_clearance(sideways, sideways)] == [0, 0]
