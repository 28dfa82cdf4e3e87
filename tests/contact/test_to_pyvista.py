"""A state as pyvista's MultiBlock holds what its files hold, on every rank."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from fenics_contact import write_vtu
from fenics_contact.errors import InvalidInputError, MissingRequirementError
from tests.viz.plane_states import plane_block
from tests.viz.states import pulled, touching_blocks

STATES = {
    "hexahedron": lambda: touching_blocks("hexahedron"),
    "tetrahedron": lambda: touching_blocks("tetrahedron"),
    "quadrilateral": lambda: plane_block("quadrilateral"),
    "triangle": lambda: plane_block("triangle"),
    "hexahedron27": lambda: pulled("hexahedron27"),
    "tetrahedron10": lambda: pulled("tetrahedron10"),
    "quadrilateral9": lambda: pulled("quadrilateral9"),
    "triangle6": lambda: pulled("triangle6"),
}


@pytest.mark.parametrize("cell", list(STATES))
def test_the_blocks_hold_the_fields_of_the_files(cell: str, tmp_path: Path) -> None:
    state = STATES[cell]()
    blocks, files = state.to_pyvista(), pv.read(write_vtu(state, tmp_path))
    assert blocks.keys() == list(state.scene.bodies) == files.keys()
    for name, body in state.scene.bodies.items():
        ours, theirs = blocks[name], files[name]
        np.testing.assert_array_equal(ours.celltypes, theirs.celltypes)
        np.testing.assert_array_equal(ours.cell_connectivity, theirs.cell_connectivity)
        np.testing.assert_allclose(ours.points, theirs.points)
        for mine, written in ((ours.point_data, theirs.point_data), (ours.cell_data, theirs.cell_data)):
            assert set(mine.keys()) == set(written.keys())
            assert len(mine.keys()) >= 2
            for key in mine.keys():
                np.testing.assert_allclose(mine[key], written[key], err_msg=key)
        assert np.abs(ours.point_data["displacement"]).max() > 0
        sizes = ours.compute_cell_sizes()
        volume = sizes["Volume" if body.mesh.dim == 3 else "Area"].sum()
        assert volume == pytest.approx(body.mesh.volume), "the nodes of a cell are out of order"


def test_points_are_moved_by_the_factor_asked_for() -> None:
    state = touching_blocks()
    name = next(iter(state.scene.bodies))
    still, moved = state.to_pyvista()[name], state.to_pyvista(deformed=3.0)[name]
    np.testing.assert_allclose(moved.points - still.points, 3.0 * state.gather_displacement(name), atol=1e-12)
    assert np.ptp(moved.points - still.points) > 0
    with pytest.raises(InvalidInputError, match=r"deformed must be finite, got nan: give the factor"):
        state.to_pyvista(np.nan)


def test_without_pyvista_the_error_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingRequirementError, match=r"needs pyvista.*pip install 'fenics_contact\[viz\]'"):
        touching_blocks().to_pyvista()


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import Coulomb
    from tests.contact.gallery import partitions, two_blocks

    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=partitions(scene), tolerance=1e-6)
    for name, block in zip(state.scene.bodies, state.to_pyvista()):
        numbers = [block.point_data["displacement"].sum(), block.cell_data["von_mises"].sum()]
        numbers = MPI.COMM_WORLD.gather([block.n_points, block.n_cells, *np.round(numbers, 4)])
        if MPI.COMM_WORLD.rank == 0:
            for line in numbers:
                print(*line)
"""


def test_every_rank_holds_all_of_it(mpirun: Callable[..., str]) -> None:
    lines = [line.split() for line in mpirun(RANKS, 2).splitlines()]
    expected = [
        [
            block.n_points,
            block.n_cells,
            block.point_data["displacement"].sum(),
            block.cell_data["von_mises"].sum(),
        ]
        for block in touching_blocks().to_pyvista()
        for _ in range(2)
    ]
    np.testing.assert_allclose(np.array(lines, dtype=float), expected, atol=2e-4, rtol=1e-4)
