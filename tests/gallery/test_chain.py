"""Chains: every link touches the one before, alternately turned."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import Chain, Link, LinkShape, chain, two_links

COARSE = LinkShape(n_around=24, n_a=2, n_b=6)
THIN = LinkShape(thickness=12.0, width=12.0, inner_radius=10.0, n_around=24, n_a=2, n_b=6)


def distance(one: Link, other: Link) -> float:
    """Smallest distance of the nodes of a far crown from the smooth contact crown of the link before."""
    far = other.mesh.points[np.unique(other.mesh.surfaces["grip"])]
    return float(one.mesh.shapes["contact"].distance(far).min())


@pytest.fixture(scope="module")
def five() -> Chain:
    return chain([COARSE] * 5)


def test_neighbours_touch_and_all_others_are_apart(five: Chain) -> None:
    assert five.pairs == ((0, 1), (1, 2), (2, 3), (3, 4))
    for one, other in pairwise(five.links):
        assert distance(one, other) == pytest.approx(0.0, abs=1e-12)
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
    assert [distance(one, other) for one, other in pairwise(built.links)] == pytest.approx(
        [0.4] * 2, abs=1e-9
    )
    first, second = built.links[1].mesh, built.links[2].mesh
    assert np.ptp(first.points[:, 0]) < np.ptp(second.points[:, 0]), "the links are alike"


def test_a_chain_of_one_link_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="at least two links, got 1: give the shape of every"):
        chain([COARSE])


def test_links_that_do_not_fit_are_named_by_their_place() -> None:
    fat = LinkShape(width=22.0, thickness=20.0, n_around=24, n_a=2, n_b=6)
    with pytest.raises(InvalidInputError, match="the wire of link 3 must pass through the opening of link 2"):
        chain([COARSE, COARSE, fat])
