"""Subdomains are dealt out to ranks evenly, in order, and none goes without."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from fenics_contact._fem.forms import FormLibrary, cell_stiffness
from fenics_contact.feti.decomposition import _spread_over_ranks, tear
from tests.feti.scenes import touching_blocks

COSTS = st.lists(st.integers(1, 10**6), min_size=1, max_size=60)


@given(COSTS, st.data())
def test_no_rank_is_empty_and_runs_are_consecutive(costs: list[int], data: st.DataObject) -> None:
    ranks = data.draw(st.integers(1, len(costs)))
    owner = _spread_over_ranks(np.array(costs), ranks)
    assert set(owner) == set(range(ranks))
    assert (np.diff(owner) >= 0).all()


@pytest.mark.parametrize(("items", "ranks"), [(8, 1), (8, 2), (8, 8), (12, 4), (32, 4)])
def test_equal_costs_are_shared_equally(items: int, ranks: int) -> None:
    owner = _spread_over_ranks(np.full(items, 480), ranks)
    assert (np.bincount(owner) == items // ranks).all()


def test_one_heavy_subdomain_does_not_take_a_neighbour_along() -> None:
    owner = _spread_over_ranks(np.array([1000, 10, 10, 10]), 2)
    assert owner.tolist() == [0, 1, 1, 1]


def test_nodes_and_subdomains_of_all_bodies_are_numbered_through() -> None:
    scene, partitions = touching_blocks()
    forms = FormLibrary(MPI.COMM_SELF)
    forms.prepare(scene)
    tearing = tear(scene, partitions, 3, cell_stiffness(scene, forms))
    assert tearing.body_names == ("lower", "upper", "third")
    assert tearing.subdomain_offset.tolist() == [0, 4, 7, 9]
    assert tearing.n_subdomains == 9
    for index, name in enumerate(tearing.body_names):
        mesh = scene.bodies[name].mesh
        for cell in range(mesh.n_cells):
            nodes = tearing.global_nodes(name, mesh.cells[cell])
            subdomain = partitions[name][cell] + tearing.subdomain_offset[index]
            for node in nodes:
                copies = slice(tearing.first_copy[node], tearing.first_copy[node + 1])
                assert subdomain in tearing.copy_subdomain[copies]
    pairs = np.column_stack([tearing.copy_node, tearing.copy_subdomain])
    assert np.array_equal(pairs, np.unique(pairs, axis=0)), "copies are sorted, each is there once"
