"""Bodies come out of XDMF files and dolfinx meshes whole, named by their tags."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fenics_contact import BodyMesh, _dolfinx
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import boundary_faces, quadratic
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.readers import from_dolfinx, read_xdmf
from tests.readers.xdmf_files import CELLS, bar, cell_tags, everywhere, facet_tags, meshio, write

__all__ = ["meshio"]


def check_bar(bodies: dict[str, BodyMesh], cell: str) -> None:
    """Check the two halves of the bar."""
    left, right = bodies["1"], bodies["2"]
    assert (left.cell_type, left.volume, right.volume) == (cell, pytest.approx(1.0), pytest.approx(1.0))
    assert left.points[:, 0].max() == right.points[:, 0].min() == 1.0
    assert (set(left.surfaces), set(right.surfaces)) == ({"4"}, {"3", "4"})
    end = vector_areas(right.points, right.surfaces["3"]).sum(axis=0)
    assert end == pytest.approx(np.eye(left.dim)[0])


@pytest.mark.parametrize("cell", CELLS)
def test_a_file_of_dolfinx_gives_every_cell_tag_as_a_body(cell: str, tmp_path: Path) -> None:
    mesh = bar(cell)
    bodies = read_xdmf(write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh), facet_tags(mesh)))
    check_bar(bodies, cell)


@pytest.mark.parametrize("cell", CELLS)
def test_a_mesh_in_memory_gives_the_same_bodies(cell: str) -> None:
    mesh = bar(cell)
    check_bar(from_dolfinx(mesh, cell_tags(mesh), facet_tags(mesh)), cell)


def check_closed(found: BodyMesh, known: BodyMesh) -> None:
    """Check that surface 3 is the whole boundary."""
    assert len(found.surfaces["3"]) == len(boundary_faces(known.cells, known.dim)[0])
    total = vector_areas(found.points, found.surfaces["3"]).sum(axis=0)
    np.testing.assert_allclose(total, 0.0, atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_quadratic_meshes_stay_so_in_memory_and_in_files(cell: str, tmp_path: Path) -> None:
    plane = cell in ("triangle", "quadrilateral")
    flat = (
        rectangle((0, 0), (2, 1), (4, 2), cell)
        if plane
        else block((0, 0, 0), (2, 1, 1), (4, 2, 2), cell=cell)
    )
    known = quadratic(flat)
    known = known.moved(known.points + 0.02 * np.sin(3 * known.points[:, ::-1]))
    mesh = _dolfinx.local_mesh(known.points, known.cells, known.cell_type)
    (body,) = from_dolfinx(mesh).values()
    np.testing.assert_array_equal(body.cells, known.cells)
    np.testing.assert_array_equal(body.points, known.points)
    tags = everywhere(mesh)
    (tagged,) = from_dolfinx(mesh, *tags).values()
    check_closed(tagged, known)
    if cell == "hexahedron" and _dolfinx.version() < (0, 6):
        with pytest.raises(InvalidInputError, match="Unknown value: hexahedron_27"):
            read_xdmf(write(tmp_path / "bar.xdmf", mesh, *tags))
        return
    (written,) = read_xdmf(write(tmp_path / "bar.xdmf", mesh, *tags), {"bar": 1}).values()
    assert (written.cell_type, written.volume) == (known.cell_type, pytest.approx(known.volume, rel=1e-12))
    check_closed(written, known)


def test_tags_get_names_and_become_regions(tmp_path: Path) -> None:
    mesh = bar("hexahedron")
    path = write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh), facet_tags(mesh))
    (body,) = read_xdmf(path, {"bar": {"steel": 1, "copper": 2}}, {"end": 3, "held": [3, 4]}).values()
    assert {name: cells.size for name, cells in body.regions.items()} == {"steel": 8, "copper": 8}
    assert body.points[body.cells[body.regions["steel"]], 0].max() == 1.0
    assert {name: len(facets) for name, facets in body.surfaces.items()} == {"end": 4, "held": 12}
    assert set(read_xdmf(path, {"bar": [1, 2]}, [])["bar"].regions) == {"1", "2"}
    assert list(read_xdmf(path, [2])) == ["2"]


def test_a_file_without_tags_is_one_body(tmp_path: Path) -> None:
    path = write(tmp_path / "bar.xdmf", bar("tetrahedron"))
    assert list(read_xdmf(path)) == ["mesh"]
    body = read_xdmf(path, {"bar": "mesh"})["bar"]
    assert (body.volume, dict(body.surfaces), dict(body.regions)) == (pytest.approx(2.0), {}, {})


def test_grids_are_chosen_by_name_where_several_would_do(tmp_path: Path) -> None:
    mesh = bar("triangle")
    path = write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh, "materials"), cell_tags(mesh, "bodies"))
    message = r"several grids that could be cell_tags: it has 'mesh' \(triangle\), 'materials' .*; name one"
    with pytest.raises(InvalidInputError, match=message):
        read_xdmf(path)
    assert list(read_xdmf(path, cell_tags="bodies")) == ["1", "2"]
    with pytest.raises(InvalidInputError, match=r"no grid for cell_tags='parts': it has 'mesh' \(triangle\)"):
        read_xdmf(path, cell_tags="parts")
    with pytest.raises(InvalidInputError, match="no grid for facet_tags='materials'"):
        read_xdmf(path, cell_tags="bodies", facet_tags="materials")


@pytest.mark.parametrize("dim", [2, 3])
def test_files_of_meshio_give_bodies_in_the_order_of_the_file(
    meshio: ModuleType, dim: int, tmp_path: Path
) -> None:
    plate = rectangle((0, 0), (4, 2), (4, 2))
    points = np.pad(plate.points, ((0, 0), (0, dim - 2)))
    tags = (plate.points[plate.cells, 0].max(axis=1) > 2.0) + 1
    cells = meshio.Mesh(points, {"quad": plate.cells}, cell_data={"gmsh:physical": [tags]})
    ends = np.concatenate([plate.surfaces["y0"], plate.surfaces["x1"]])
    facets = meshio.Mesh(points, {"line": ends}, cell_data={"gmsh:physical": [np.repeat([5, 6], [4, 2])]})
    meshio.write(tmp_path / "cells.xdmf", cells, data_format="XML")
    meshio.write(tmp_path / "facets.xdmf", facets, data_format="XML")
    names = {"floor": 5, "end": 6}
    (whole,) = read_xdmf(
        tmp_path / "cells.xdmf", {"plate": [1, 2]}, names, facet_file=tmp_path / "facets.xdmf"
    ).values()
    assert np.array_equal(whole.points, plate.points)
    assert np.array_equal(whole.cells, plate.cells)
    for ours, theirs in (("floor", "y0"), ("end", "x1")):
        assert {*map(tuple, whole.surfaces[ours])} == {*map(tuple, plate.surfaces[theirs])}
    assert whole.regions["2"].tolist() == np.flatnonzero(tags == 2).tolist()


def test_all_ranks_receive_the_bodies_that_rank_0_reads(mpirun: Callable[..., str], tmp_path: Path) -> None:
    mesh = bar("tetrahedron")
    path = write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh), facet_tags(mesh))
    script = f"""
        from mpi4py import MPI
        from fenics_contact.readers import read_xdmf
        bodies = read_xdmf("{path}", {{"bar": [1, 2]}}, {{"end": 3}}, comm=MPI.COMM_WORLD)
        found = [(name, round(body.volume, 9), *body.surfaces) for name, body in bodies.items()]
        every = MPI.COMM_WORLD.gather(found)
        if every:
            print(every)
    """
    assert mpirun(script, 2).strip() == str(2 * [[("bar", 2.0, "end")]])


DISTRIBUTED = """
    import hashlib
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    import dolfinx.fem, dolfinx.mesh
    from fenics_contact import Body, Scene, Support, Traction, solve_scene
    from fenics_contact.materials import IsotropicElasticity
    from fenics_contact.readers import from_dolfinx

    comm = MPI.COMM_WORLD
    kind = dolfinx.mesh.CellType.{cell}
    mesh = dolfinx.mesh.create_box(comm, [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]], [4, 2, 2], kind)
    owned = mesh.topology.index_map(3).size_local
    left = dolfinx.mesh.locate_entities(mesh, 3, lambda x: x[0] < 1.0 + 1e-9)
    values = np.full(owned + mesh.topology.index_map(3).num_ghosts, 2, dtype=np.int32)
    values[left] = 1
    cells = dolfinx.mesh.meshtags(mesh, 3, np.arange(len(values), dtype=np.int32), values)
    boundary = dolfinx.mesh.locate_entities_boundary
    sides = [boundary(mesh, 2, lambda x, at=at: np.isclose(x[0], at)) for at in (0, 2)]
    facets, tags = np.concatenate(sides), np.repeat([3, 4], list(map(len, sides))).astype(np.int32)
    order = np.argsort(facets)
    facets = dolfinx.mesh.meshtags(mesh, 2, facets[order], tags[order])
    bodies = from_dolfinx(mesh, cells, facets, {{"bar": {{"soft": 1, "hard": 2}}}})
    bar = bodies["bar"]
    ends = [np.sort(bar.surfaces[name], axis=None) for name in "34"]
    arrays = [bar.points, bar.cells, bar.regions["hard"], *ends]
    same = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()
    assert len(set(comm.allgather(same))) == 1
    body = Body(bar, {{"soft": IsotropicElasticity(10.0, 0.3), "hard": IsotropicElasticity(100.0, 0.3)}})
    state = solve_scene(Scene({{"bar": body}}, [Support("bar", "3", (0.0,) * 3)],
                              [Traction("bar", "4", (1.0, 0.2, 0.0))]), comm, tolerance=1e-10)
    u = state.gather_displacement("bar")
    make = getattr(dolfinx.fem, "functionspace", None)
    vectors = dolfinx.fem.VectorFunctionSpace if make is None else lambda m, e: make(m, (*e, (3,)))
    first, second = (vectors(mesh, ("Lagrange", degree)) for degree in (1, 2))
    found = bodies.function_on(first, {{"bar": u}}, "u")
    places = first.tabulate_dof_coordinates()
    number = [int(np.argmin(np.abs(bar.points - x).sum(axis=1))) for x in places]
    assert np.abs(found.x.array.reshape(-1, 3) - u[number]).max() == 0.0 and found.name == "u"
    finer = bodies.function_on(second, {{"bar": u}})
    again = dolfinx.fem.Function(first)
    again.interpolate(finer)
    assert np.abs(again.x.array - found.x.array).max() < 1e-12
    constant = (dolfinx.fem.FunctionSpace if make is None else make)(mesh, ("DG", 0))
    stiff = np.zeros(bar.n_cells)
    stiff[bar.regions["hard"]] = 1.0
    marks = bodies.function_on(constant, {{"bar": stiff}})
    assert np.array_equal(marks.x.array == 1.0, values == 2)
    if comm.rank == 0:
        print(same, float(np.round(np.abs(u).max(), 9)))
"""


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_distributed_mesh_gives_the_same_bodies_and_gets_its_fields_back(
    cell: str, mpirun: Callable[..., str]
) -> None:
    said = [mpirun(DISTRIBUTED.format(cell=cell), ranks).strip() for ranks in (1, 2, 4)]
    assert said[0] == said[1] == said[2]
    assert float(said[0].split()[1]) > 0.01


def vector_space(mesh: Any, degree: int) -> Any:
    if _dolfinx.version() < (0, 7):
        return _dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", degree))
    return _dolfinx.fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))


def test_values_of_quadratic_meshes_come_back_too() -> None:
    known = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1), cell="tetrahedron"))
    mesh = _dolfinx.local_mesh(known.points, known.cells, known.cell_type)
    bodies, space = from_dolfinx(mesh), vector_space(mesh, 2)
    values = known.points**2
    found = bodies.function_on(space, {"mesh": values})
    expected = _dolfinx.fem.Function(space)
    expected.interpolate(lambda x: x**2)
    np.testing.assert_allclose(found.x.array, expected.x.array, atol=1e-14)
    with pytest.raises(InvalidInputError, match="Lagrange of degree 2 or higher, or degree 0"):
        bodies.function_on(vector_space(mesh, 1), {"mesh": values})


def test_what_does_not_fit_the_space_is_refused() -> None:
    mesh = bar("tetrahedron")
    bodies, space = from_dolfinx(mesh, cell_tags(mesh)), vector_space(mesh, 1)
    alike = {name: body.points for name, body in bodies.items()}
    np.testing.assert_allclose(
        bodies.function_on(space, alike).x.array.reshape(-1, 3), space.tabulate_dof_coordinates(), atol=1e-14
    )
    assert "48 tetrahedra" in repr(bodies)
    for values, words in (
        ({"3": alike["1"]}, r"knows the bodies \['1', '2'\], got '3'"),
        ({"1": alike["1"][1:]}, r"'1' needs values of shape \(27, 3\), got \(26, 3\)"),
        (
            {"1": alike["1"], "2": alike["2"] + 1.0},
            r"share nodes, but differ by up to 1: bring them back one",
        ),
    ):
        with pytest.raises(InvalidInputError, match=words):
            bodies.function_on(space, values)
    with pytest.raises(InvalidInputError, match="needs a space on the mesh that the bodies were made of"):
        bodies.function_on(vector_space(bar("hexahedron"), 1), alike)
