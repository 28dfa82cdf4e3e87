"""Meshes are built from given nodes and cells, and every number on them can be traced back to a given one."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import _dolfinx
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
