"""Gathered fields belong to the nodes and cells they are said to belong to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _dolfinx, io, viz
from fenics_contact.geometry import block
from fenics_contact.viz.fields import BodyFields, gather
from tests.viz.states import touching_blocks

GATHERERS = [viz.fields.cell_values, io.fields.cell_values]


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("gatherer", GATHERERS, ids=["viz", "io"])
def test_cell_values_come_in_the_order_of_the_body(gatherer: Callable[..., np.ndarray], cell: str) -> None:
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2), cell)
    mesh = _dolfinx.rank_mesh(MPI.COMM_SELF, body.points, body.cells, np.zeros(body.n_cells, int), cell)
    function = _dolfinx.Function(_dolfinx.scalar_space(mesh, 0))
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    middle = body.points[body.cells].mean(axis=1)
    np.testing.assert_allclose(gatherer(function, body.cells), middle @ [1, 10, 100])


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import _dolfinx, io, viz
    from fenics_contact.geometry import block

    comm = MPI.COMM_WORLD
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2))
    rank = np.ones(body.n_cells, dtype=int)
    mesh = _dolfinx.rank_mesh(comm, body.points, body.cells, rank, "hexahedron")
    function = _dolfinx.Function(_dolfinx.scalar_space(mesh, 0))
    middle = body.points[body.cells].mean(axis=1) @ [1, 10, 100]
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    for gatherer in (viz.fields.cell_values, io.fields.cell_values):
        np.testing.assert_allclose(gatherer(function, body.cells), middle)
    owned = comm.gather(mesh.topology.index_map(3).size_local)
    if comm.rank == 0:
        print(*owned)
"""


def test_cell_values_are_gathered_from_ranks_of_which_one_has_no_cell(mpirun: Callable[..., str]) -> None:
    assert mpirun(RANKS, 2).split() == ["0", "12"]


def test_nodal_stress_of_a_constant_is_the_constant_and_a_mean_else() -> None:
    body = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    still = np.zeros((body.n_nodes, 3))
    np.testing.assert_allclose(BodyFields(body, still, np.full(2, 7.0)).nodal_von_mises, 7.0)
    mean = BodyFields(body, still, np.array([1.0, 3.0])).nodal_von_mises
    np.testing.assert_allclose(mean[np.isclose(body.points[:, 0], 1.0)], 2.0)
    assert set(mean.round(12)) == {1.0, 2.0, 3.0}


def test_gathered_state_has_the_fields_of_its_functions() -> None:
    state = touching_blocks()
    bodies = gather(state)
    assert set(bodies) == {"lower", "upper"}
    for name, body in bodies.items():
        np.testing.assert_array_equal(body.displacement, state.gather_displacement(name))
        assert body.von_mises.min() > 0
        np.testing.assert_allclose(np.sort(body.von_mises), np.sort(state.von_mises[name].x.array))
    np.testing.assert_allclose(
        bodies["upper"].deformed(2.0) - bodies["upper"].mesh.points, 2 * bodies["upper"].displacement
    )
