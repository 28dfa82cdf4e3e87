"""Two links are interlocked and touch at their crowns, or the reason why not is given."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, TwoLinks, chain, two_links
from fenics_contact.gallery.links import PULL_AXIS

CELLS = ["hexahedron", "tetrahedron"]


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
    with pytest.raises(InvalidInputError, match=r"gap must be zero or positive, got -0\.5: links"):
        build(gap=-0.5)


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
