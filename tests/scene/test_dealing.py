"""Subdomains that are alike go to one rank, each rank gets its share of every body, and none goes without."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import box_partition
from fenics_contact._scene.dealing import Dealing
from fenics_contact._scene.memory import Subdomains
from fenics_contact.study.scenes.chain_links import chain, graded_links


def dealing(bodies: list[list[int]], once: float = 3.0, each: float = 1.0) -> Dealing:
    """Bodies by the kinds of their subdomains, all of the same price."""
    kind = np.concatenate([np.array(kinds) for kinds in bodies])
    body = np.repeat(np.arange(len(bodies)), [len(kinds) for kinds in bodies])
    return Dealing(body, kind, np.full(len(kind), once), np.full(len(kind), each))


def factored(dealt: np.ndarray, kind: np.ndarray) -> int:
    return len({*zip(dealt.tolist(), kind.tolist(), strict=True)})


KINDS = st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=30), min_size=1, max_size=4)


@given(KINDS, st.data())
def test_no_rank_goes_without_and_each_has_about_its_share_of_every_body(
    bodies: list[list[int]], data: st.DataObject
) -> None:
    total = sum(map(len, bodies))
    ranks = data.draw(st.integers(1, total))
    cards = dealing(bodies, once=0.0)
    dealt = cards.among(ranks)
    counts = np.array([np.bincount(dealt[cards.body == k], minlength=ranks) for k in range(len(bodies))])
    assert (counts.sum(axis=0) > 0).all()
    if ranks <= min(map(len, bodies)):
        shares = np.array([[len(kinds) / ranks] for kinds in bodies])
        assert (np.abs(counts - shares) < 2.0).all()


@given(KINDS, st.integers(1, 8))
def test_ranks_have_hardly_more_factors_than_there_are_kinds(bodies: list[list[int]], ranks: int) -> None:
    cards = dealing(bodies)
    # Each rank of each body completes its share with some of a kind that others have, too.
    assert factored(cards.among(ranks), cards.kind) <= len(set(cards.kind.tolist())) + len(bodies) * ranks


def test_what_is_alike_goes_together_also_in_other_bodies() -> None:
    halves = [[0, 1, 2, 3, 3, 2, 1, 0], [3, 2, 1, 0, 0, 1, 2, 3]]
    cards = dealing(halves)
    dealt = cards.among(2)
    assert factored(dealt, cards.kind) == 4
    for number in range(2):
        assert np.bincount(dealt[cards.body == number]).tolist() == [4, 4]


def test_what_is_alike_in_two_bodies_alone_goes_together() -> None:
    cards = dealing([[3, 4, 0, 2, 1], [3, 4, 0, 2, 1]])
    assert factored(cards.among(2), cards.kind) <= 6


def test_neighbours_go_together_where_nothing_is_alike() -> None:
    dealt = dealing([list(range(8)), list(range(8, 14))]).among(2)
    assert dealt.tolist() == [0] * 4 + [1] * 4 + [0] * 3 + [1] * 3


def test_bodies_of_one_subdomain_each_are_spread() -> None:
    assert sorted(dealing([[0], [1], [2], [3]]).among(4).tolist()) == [0, 1, 2, 3]


def test_one_heavy_subdomain_takes_no_other_along() -> None:
    cards = Dealing(np.zeros(4, int), np.arange(4), np.zeros(4), np.array([1000.0, 10.0, 10.0, 10.0]))
    assert cards.among(2).tolist() == [0, 1, 1, 1]


def test_a_large_kind_is_divided_and_a_small_excess_is_not() -> None:
    assert np.bincount(dealing([[0] * 12]).among(3)).tolist() == [4, 4, 4]
    cards = dealing([[0] * 5 + [1] * 4])
    assert factored(cards.among(2), cards.kind) == 2


@pytest.mark.parametrize("name", ["chain", "block"])
def test_two_ranks_have_as_many_kinds_as_one(name: str) -> None:
    if name == "chain":
        scene = chain(graded_links((48, 4, 8)))
        parts = {body: box_partition(each.mesh, (8, 1, 2)) for body, each in scene.bodies.items()}
    else:
        mesh = block_mesh((16, 8, 8))
        scene, parts = block_on_plane(mesh, 0.3), {"block": box_partition(mesh, (4, 2, 2))}
    known = Subdomains.of(scene, parts)
    assert known.kinds(2) == known.kinds() < len(known.size)
    for number in np.unique(known.body):
        mine, other = np.bincount(known.dealt(2)[known.body == number], minlength=2)
        assert abs(mine - other) <= 0.3 * (mine + other)
