"""Cellwise fields come in the order of the body's own cells, whatever order and ranks dolfinx gave them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _dolfinx
from fenics_contact.gallery import block
from fenics_contact.results.fields import cell_values


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_cell_values_come_in_the_order_of_the_body(cell: str) -> None:
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2), cell)
    mesh = _dolfinx.rank_mesh(MPI.COMM_SELF, body.points, body.cells, np.zeros(body.n_cells, int), cell)
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 0))
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    middle = body.points[body.cells].mean(axis=1)
    np.testing.assert_allclose(cell_values(function, body.cells), middle @ [1, 10, 100])


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    from fenics_contact.results.fields import cell_values
    from fenics_contact.gallery import block

    comm = MPI.COMM_WORLD
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2))
    rank = np.ones(body.n_cells, dtype=int)
    mesh = _dolfinx.rank_mesh(comm, body.points, body.cells, rank, "hexahedron")
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 0))
    middle = body.points[body.cells].mean(axis=1) @ [1, 10, 100]
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    np.testing.assert_allclose(cell_values(function, body.cells), middle)
    owned = comm.gather(mesh.topology.index_map(3).size_local)
    if comm.rank == 0:
        print(*owned)
"""


def test_cell_values_are_gathered_from_ranks_of_which_one_has_no_cell(mpirun: Callable[..., str]) -> None:
    assert mpirun(RANKS, 2).split() == ["0", "12"]
