"""Meshes of dolfinx, on any number of ranks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact import _dolfinx
from tests.conftest import run_on_ranks
from tests.dolfinx.samples import CELLS, Sample, box, shuffled


def skewed_block(cell: str) -> Sample:
    return shuffled(box(cell, (2, 3, 1), (2, 3, 2)))


@pytest.mark.parametrize("cell", CELLS)
def test_every_cell_keeps_its_nodes(cell: str) -> None:
    mesh = skewed_block(cell)
    nodes = _dolfinx.cell_nodes(_dolfinx.local_mesh(mesh.points, mesh.cells, cell))
    assert nodes.shape == mesh.cells.shape
    rows = np.unique(np.sort(nodes, axis=1), axis=0)
    assert np.array_equal(rows, np.unique(np.sort(mesh.cells, axis=1), axis=0))


@pytest.mark.parametrize("cell", CELLS)
def test_every_cell_knows_which_of_the_given_ones_it_is(cell: str) -> None:
    mesh = skewed_block(cell)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, cell)
    given = _dolfinx.input_cells(own)
    assert not np.array_equal(given, np.arange(len(mesh.cells))), "dolfinx renumbered nothing"
    np.testing.assert_array_equal(
        np.sort(_dolfinx.cell_nodes(own), axis=1), np.sort(mesh.cells, axis=1)[given]
    )


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("components", ["vector", "scalar"])
def test_every_dof_sits_on_the_node_it_is_said_to_sit_on(cell: str, components: str) -> None:
    mesh = skewed_block(cell)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, cell)
    vector = components == "vector"
    space = _dolfinx.coefficient(own, "u").function_space if vector else _dolfinx.scalar_space(own, 1)
    nodes, dofs = _dolfinx.node_dofs(space)
    assert np.array_equal(nodes, np.arange(len(mesh.points)))
    assert np.array_equal(np.sort(dofs), np.arange(len(mesh.points)))
    assert not np.array_equal(dofs, nodes), "dolfinx renumbered nothing: nothing was tested"
    place = space.tabulate_dof_coordinates()[dofs, : mesh.dim]
    np.testing.assert_allclose(place, mesh.points[nodes], atol=1e-14)
    assert space.dofmap.index_map_bs == (mesh.dim if vector else 1)


@pytest.mark.parametrize("cell", CELLS)
def test_moved_coordinates_reach_the_nodes_they_are_meant_for(cell: str) -> None:
    mesh = skewed_block(cell)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, cell)
    stretch = np.array([[1.0, 0.2, 0.0], [0.0, 2.0, 0.0], [0.1, 0.0, 3.0]])[: mesh.dim, : mesh.dim]
    moved = mesh.points @ stretch + 7.0
    _dolfinx.update_coordinates(own, moved)
    space = _dolfinx.scalar_space(own, 1)
    nodes, dofs = _dolfinx.node_dofs(space)
    place = space.tabulate_dof_coordinates()[dofs]
    np.testing.assert_allclose(place[:, : mesh.dim], moved[nodes], atol=1e-14)
    assert np.all(place[:, mesh.dim :] == 0.0)


@pytest.mark.parametrize("cell", CELLS)
def test_facets_are_found_whatever_the_order_of_their_vertices(cell: str) -> None:
    mesh = skewed_block(cell)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, cell)
    corners = np.array(_dolfinx.facet_vertices(cell))
    for facets in mesh.surfaces.values():
        rng = np.random.default_rng(5)
        shuffled = rng.permuted(facets, axis=1)[rng.permutation(len(facets))]
        cells, local = _dolfinx.match_facets(own, shuffled)
        assert len(cells) == len(facets)
        found = np.take_along_axis(_dolfinx.cell_nodes(own)[cells], corners[local], axis=1)
        assert {frozenset(row) for row in found.tolist()} == {frozenset(row) for row in facets.tolist()}


@pytest.mark.parametrize("cell", CELLS)
def test_facets_of_other_meshes_are_left_out(cell: str) -> None:
    mesh = skewed_block(cell)
    half = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.0
    used, local = np.unique(mesh.cells[half], return_inverse=True)
    own = _dolfinx.local_mesh(mesh.points[used], local.reshape(half.sum(), -1), cell)
    here = mesh.points[mesh.surfaces["y0"]][:, :, 0].max(axis=1) <= 1.0
    assert here.any()
    assert not here.all()
    numbered = np.full(len(mesh.points), len(used))  # a node that this mesh does not have
    numbered[used] = np.arange(len(used))
    cells, _ = _dolfinx.match_facets(own, numbered[mesh.surfaces["y0"]])
    assert len(cells) == here.sum()
    assert [len(part) for part in _dolfinx.match_facets(own, mesh.surfaces["y0"][:0])] == [0, 0]


# Cells of a distributed mesh live where they are meant to, also when some rank has none.
SCRIPT = Path(__file__).with_name("meshes_on_ranks.py")
Found = dict[str, list[dict[str, Any]]]


@pytest.fixture(scope="module", params=[2, 4])
def ranks(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def found(ranks: int) -> Found:
    """What every rank found, by the way in which the cells were dealt out."""
    answer: Found = json.loads(run_on_ranks(SCRIPT, ranks, timeout=60))
    assert len(answer) == 20
    assert all(len(reports) == ranks for reports in answer.values())
    return answer


def test_every_cell_lives_on_its_rank(found: Found) -> None:
    for name, reports in found.items():
        assert all(report["cells stay"] for report in reports), name
        assert sum(report["cells"] for report in reports) == reports[0]["all cells"], name


def test_ranks_without_cells_were_among_them(found: Found) -> None:
    empty = [name for name, reports in found.items() if min(report["cells"] for report in reports) == 0]
    assert len(empty) == 12


def test_ranks_agree_on_the_nodes_that_they_share(found: Found) -> None:
    for name, reports in found.items():
        nodes = 5 * 4 if name.startswith(("triangle", "quadrilateral")) else 5 * 4 * 4
        assert {report["all nodes"] for report in reports} == {nodes}, name
        owned = sorted(node for report in reports for node in report["owned nodes"])
        assert owned == list(range(nodes)), name


def test_nodes_are_where_they_should_be_and_values_reach_all_copies(found: Found) -> None:
    for name, reports in found.items():
        assert max(report["misplaced"] for report in reports) < 1e-14, name
        assert max(report["unheard"] for report in reports) == 0.0, name
