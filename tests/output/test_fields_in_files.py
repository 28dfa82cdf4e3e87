"""What VTU and XDMF files hold is what the state holds, read back by VTK's own readers and by meshio."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import State, Status, write_vtu
from fenics_contact._accuracy.discretisation import discretisation_error
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import write_xdmf
from fenics_contact.output.paraview import checked_name, file_of_each
from tests.output.states import touching_blocks
from tests.pictures.plane_states import plane_block
from tests.results.stress_cases import composite, solved
from tests.scenes import partitions

CELLS = ("hexahedron", "tetrahedron")
VTK_CELLS = {"hexahedron": pv.CellType.HEXAHEDRON, "tetrahedron": pv.CellType.TETRA}


def assert_same_field(
    places: np.ndarray, values: np.ndarray, other_places: np.ndarray, others: np.ndarray
) -> None:
    """Compare two fields that list the same places in different orders."""
    first, second = (np.lexsort(np.round(x, 5).T) for x in (places, other_places))
    np.testing.assert_allclose(places[first], other_places[second], atol=1e-6)
    np.testing.assert_allclose(values[first], others[second], rtol=1e-6, atol=1e-9)


def assert_stress_of(state: State, body: str, grid: pv.DataSet) -> None:
    """Compare the stress of a file with the state's own, cell by cell."""
    function = state.von_mises[body]
    middle = function.function_space.tabulate_dof_coordinates()
    assert function.x.array.min() > 0
    stress = grid.cell_data["von_mises"].ravel()
    assert_same_field(grid.cell_centers().points, stress, middle, function.x.array)


@pytest.mark.parametrize("cell", CELLS)
def test_vtu_files_hold_mesh_displacement_and_stress(cell: str, tmp_path: Path) -> None:
    state = touching_blocks(cell)
    read = pv.read(write_vtu(state, tmp_path / "new"))
    assert read.keys() == ["lower", "upper block"]
    for name, body in state.scene.bodies.items():
        np.testing.assert_array_equal(read[name].points, body.mesh.points)
        np.testing.assert_array_equal(read[name].cells_dict[VTK_CELLS[cell]], body.mesh.cells)
        displacement = state.gather_displacement(name)
        assert np.abs(displacement).max() > 0
        np.testing.assert_array_equal(read[name].point_data["displacement"], displacement)
        assert_stress_of(state, name, read[name])
        components = state.gather_stress(name)[:, (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)]
        np.testing.assert_array_equal(read[name].cell_data["stress"], components)
        assert read[name].cell_data["principal_stress"].shape == (body.mesh.n_cells, 3)


@pytest.mark.parametrize("make", [touching_blocks, plane_block])
def test_vtu_files_hold_the_stress_at_nodes_for_pyvista_and_meshio(
    make: Callable[[], State], tmp_path: Path
) -> None:
    state = make()
    blocks = pv.read(write_vtu(state, tmp_path))
    files = file_of_each(state.scene.bodies, tmp_path, "state", ".vtu")
    for name in state.scene.bodies:
        (tensor,) = state.gather_nodal_stress(name)
        assert np.abs(tensor[:, 0, 1]).max() > 1e-3 * np.abs(tensor).max() > 0.0
        deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        for data in (blocks[name].point_data, meshio.read(files[name]).point_data):
            xx, yy, zz, xy, yz, xz = data["nodal_stress"].T
            found = np.stack([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
            np.testing.assert_array_equal(found, tensor)
            np.testing.assert_allclose(
                data["nodal_principal_stress"], np.linalg.eigvalsh(tensor)[:, ::-1], rtol=1e-12, atol=1e-9
            )
            equivalent = np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2))
            np.testing.assert_allclose(data["nodal_von_mises"], equivalent, rtol=1e-12)


def test_vtu_files_hold_at_a_node_between_materials_the_larger_stress(tmp_path: Path) -> None:
    state = solved(composite(), MPI.COMM_SELF)
    data = pv.read(write_vtu(state, tmp_path))["bar"].point_data
    low, high = state.gather_nodal_stress("bar")
    between = ~np.isnan(low[:, 0, 0]) & ~np.isnan(high[:, 0, 0])
    assert between.sum() > 10
    np.testing.assert_array_equal(data["nodal_stress"][between, 0], high[between, 0, 0])
    assert data["nodal_stress"][between, 0].min() > 2 * low[between, 0, 0].max()
    only = np.isnan(high[:, 0, 0])
    np.testing.assert_array_equal(data["nodal_stress"][only, 0], low[only, 0, 0])


def test_vtu_files_number_the_subdomains_of_all_bodies(tmp_path: Path) -> None:
    state = touching_blocks()
    read = pv.read(write_vtu(state, tmp_path))
    for first, (name, partition) in zip((0, 2), partitions(state.scene).items(), strict=True):
        np.testing.assert_array_equal(read[name].cell_data["subdomain"], first + partition)
        assert len(np.unique(partition)) == 2


def test_vtu_files_hold_further_fields_of_the_cells(tmp_path: Path) -> None:
    for state in (touching_blocks(), plane_block()):
        found = discretisation_error(state.torn, state.conforming_displacement)
        error = {body: found.by_cell(body) for body in state.scene.bodies}
        middle = {name: b.mesh.points[b.mesh.cells].mean(axis=1) for name, b in state.scene.bodies.items()}
        read = pv.read(write_vtu(state, tmp_path, cell_fields={"error": error, "middle": middle}))
        for name, body in state.scene.bodies.items():
            assert error[name].min() > 0
            np.testing.assert_array_equal(read[name].cell_data["error"], error[name])
            assert read[name].cell_data["middle"].shape == (body.mesh.n_cells, 3)


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ({}, r"the cell field 'error' must have 192 rows for body 'block', one per cell, got none"),
        ({"block": np.zeros(3)}, r"must have 192 rows for body 'block', one per cell, got shape \(3,\)"),
    ],
)
def test_a_field_that_does_not_fit_the_cells_is_refused(
    field: dict[str, np.ndarray], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        write_vtu(plane_block(), tmp_path, cell_fields={"error": field})
    assert not list(tmp_path.iterdir())


def test_vtu_files_hold_the_contact_of_the_slave(tmp_path: Path) -> None:
    state = touching_blocks()
    contact = state.contact
    read = pv.read(write_vtu(state, tmp_path))
    lower, upper = read["lower"].point_data, read["upper block"].point_data
    for status in Status:
        assert np.count_nonzero(upper["contact_status"] == status) == contact.count(status) > 0
    assert np.count_nonzero(upper["contact_status"] >= 0) == contact.points.count
    np.testing.assert_allclose(upper["contact_force"].sum(axis=0), contact.force.sum(axis=0))
    np.testing.assert_allclose(np.sort(upper["contact_pressure"])[-5:], np.sort(contact.pressure)[-5:])
    assert np.all(upper["contact_pressure"][upper["contact_status"] < Status.STICK] < 1e-9)
    slips = np.linalg.norm(upper["contact_slip"], axis=1)
    assert slips[upper["contact_status"] == Status.SLIP].min() > 0
    assert set(lower["contact_status"]) == {-1}
    assert not np.any(lower["contact_force"])


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_vtu_and_xdmf_files_of_plane_bodies_lie_in_the_plane(cell: str, tmp_path: Path) -> None:
    state = plane_block(cell)
    read = pv.read(write_vtu(state, tmp_path))["block"]
    mesh = state.scene.bodies["block"].mesh
    kind = {"quadrilateral": pv.CellType.QUAD, "triangle": pv.CellType.TRIANGLE}[cell]
    np.testing.assert_array_equal(read.cells_dict[kind], mesh.cells)
    np.testing.assert_array_equal(read.points[:, :2], mesh.points)
    displacement, force = read.point_data["displacement"], read.point_data["contact_force"]
    np.testing.assert_array_equal(displacement[:, :2], state.gather_displacement("block"))
    np.testing.assert_allclose(force[:, :2].sum(axis=0), state.contact.force.sum(axis=0))
    for vectors in (read.points, displacement, force):
        assert vectors.shape == (mesh.n_nodes, 3)
        assert not np.any(vectors[:, 2])
    assert_stress_of(state, "block", read)
    write_xdmf(state, tmp_path / "plane.xdmf")
    grids = pv.read(tmp_path / "plane_block.xdmf")
    assert {name for grid in grids for name in grid.array_names} >= {"displacement", "von_mises"}


def test_vtu_files_are_read_by_meshio_too(tmp_path: Path) -> None:
    state = touching_blocks()
    write_vtu(state, tmp_path, "chain")
    mesh = meshio.read(tmp_path / "chain_upper_block.vtu")
    np.testing.assert_array_equal(mesh.point_data["displacement"], state.gather_displacement("upper block"))
    assert mesh.cells[0].type == "hexahedron"


def test_writing_again_replaces_all_files_and_leaves_no_others(tmp_path: Path) -> None:
    wanted = {"state.vtm", "state_lower.vtu", "state_upper_block.vtu"}
    for name in wanted:
        (tmp_path / name).write_text("old")
    pv.read(write_vtu(touching_blocks(), tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == wanted


@pytest.mark.parametrize("name", ["", "folder/state", ".."])
def test_a_name_with_a_folder_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"name must be the beginning of a file's name"):
        write_vtu(touching_blocks(), tmp_path, name)


@pytest.mark.parametrize("cell", CELLS)
def test_xdmf_files_hold_displacement_and_stress(cell: str, tmp_path: Path) -> None:
    state = touching_blocks(cell)
    files = write_xdmf(state, tmp_path / "new" / "state.xdmf")
    assert {path.name for path in (tmp_path / "new").iterdir()} == {
        f"state_{body}.{suffix}" for body in ("lower", "upper_block") for suffix in ("xdmf", "h5")
    }
    for name, body in state.scene.bodies.items():
        assert "http://www.w3.org/2001/XInclude" in files[name].read_text(), "else VTK's reader crashes"
        found = {field: grid for grid in pv.read(files[name]) for field in grid.array_names}
        assert_stress_of(state, name, found["von_mises"])
        grid = found["displacement"]
        displacement = state.gather_displacement(name)
        assert_same_field(grid.points, grid.point_data["displacement"], body.mesh.points, displacement)


def test_xdmf_needs_its_suffix(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must be an XDMF file, got the name 'state.h5'"):
        write_xdmf(touching_blocks(), tmp_path / "state.h5")
    assert not list(tmp_path.iterdir())


def test_names_of_bodies_become_different_names_of_files() -> None:
    files = file_of_each(["a b", "a/b", "ä", "plain-1"], Path("folder"), "s", ".vtu")
    assert [path.as_posix() for path in files.values()] == [
        "folder/s_a_b.vtu",
        "folder/s_a_b_2.vtu",
        "folder/s__.vtu",
        "folder/s_plain-1.vtu",
    ]


RANKS = """
    import sys
    from pathlib import Path
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import write_vtu
    from fenics_contact.output import write_json, write_xdmf
    from tests.scenes import partitions
    from tests.output.states import blocks

    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    scene = blocks()
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    write_vtu(state, folder)
    write_xdmf(state, folder / "state.xdmf")
    write_json(folder / "ranks.json", {"ranks": comm.size}, comm=comm)

    (folder / "file").touch()
    comm.barrier()
    def fails(write):
        try:
            write()
        except Exception as error:
            return type(error).__name__
    caught = [
        fails(lambda: write_vtu(state, folder / "file")),
        fails(lambda: write_xdmf(state, folder / "file" / "state.xdmf")),
        fails(lambda: write_json(folder / "nan.json", [float("nan")], comm=comm)),
    ]
    everyone = comm.gather(caught)
    if comm.rank == 0:
        print(everyone)
"""


def test_two_ranks_write_the_same_files_and_share_their_errors(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    answer = mpirun(RANKS, 2, tmp_path)
    everyone = "['OutputError', 'OutputError', 'InvalidInputError']"
    assert answer.strip() == f"[{everyone}, {everyone}]"
    state, read = touching_blocks(), pv.read(tmp_path / "state.vtm")
    for name in state.scene.bodies:
        near = {"rtol": 1e-3, "atol": 1e-4 * np.abs(state.gather_displacement(name)).max()}
        one = state.gather_displacement(name)
        np.testing.assert_allclose(read[name].point_data["displacement"], one, **near)
        middle = read[name].cell_centers().points
        stress = {field: grid for grid in pv.read(tmp_path / f"state_{name.replace(' ', '_')}.xdmf")
                  for field in grid.array_names}["von_mises"]  # fmt: skip
        written = stress.cell_data["von_mises"].ravel()
        assert_same_field(stress.cell_centers().points, written, middle, read[name].cell_data["von_mises"])
    contact = pv.read(tmp_path / "state_upper_block.vtu").point_data["contact_status"]
    assert [np.count_nonzero(contact == status) for status in Status] == [
        state.contact.count(status) for status in Status
    ]
    assert (tmp_path / "ranks.json").read_text().split() == ["{", '"ranks":', "2", "}"]
    assert not (tmp_path / "nan.json").exists()


def test_names_of_bodies_that_are_too_long_for_a_disk_become_different_short_ones(tmp_path: Path) -> None:
    long = "b" * 300
    files = file_of_each([long, f"{long}c"], tmp_path, "state_0001", ".vtu")
    assert len(set(files.values())) == 2
    for path in files.values():
        assert path.name.startswith("state_0001_bbb")
        path.touch()
    assert files == file_of_each([long, f"{long}c"], tmp_path, "state_0001", ".vtu")
    assert files[long] not in file_of_each([long], tmp_path, "state_0002", ".vtu").values()
    with pytest.raises(InvalidInputError, match=r"name must have at most 200 bytes, got 300"):
        checked_name(tmp_path, long, ".vtu")
