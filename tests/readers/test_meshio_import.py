"""Bodies come out of the mesh files of other programs whole, named, and with nodes of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

from fenics_contact import BodyMesh, read_mesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh import quadratic
from fenics_contact.readers import from_meshio
from tests.conftest import ROOT
from tests.readers.mesh_files import area, bodies, joined, with_tags
from tests.readers.xdmf_files import bar, cell_tags, facet_tags, write

UP, DOWN = [0.0, 0.0, 1.0], [0.0, 0.0, -2.0]


def check(found: dict[str, BodyMesh], names: tuple[str, str], bottom: str, top: str) -> None:
    """Check that the table and the tool are the ones that were written, with the named surfaces."""
    expected = bodies()
    assert list(found) == list(names)
    for name, mesh in zip(names, expected.values(), strict=True):
        np.testing.assert_allclose(found[name].points, mesh.points, atol=1e-12)
        np.testing.assert_array_equal(found[name].cells, mesh.cells)
    assert area(found[names[0]], bottom) == DOWN
    assert area(found[names[1]], top) == UP


def test_cell_sets_of_an_abaqus_file_are_bodies_and_surfaces_and_so_are_node_sets(tmp_path: Path) -> None:
    path = tmp_path / "press.inp"
    joined().write(path)
    found = read_mesh(path)
    check(found, ("table", "tool"), "bottom", "top")
    check(found, ("table", "tool"), "held", "pushed")
    assert set(found["table"].surfaces) == {"bottom", "held"}


def test_element_sets_that_abaqus_names_where_elements_begin_stay_with_them(tmp_path: Path) -> None:
    """The first block has no name, two others share one: meshio alone gives them to the wrong blocks."""
    nodes = [(x, y, z) for x in range(4) for y in (0, 1) for z in (0, 1)]

    def cube(k: int) -> str:
        corners = [4 * k + j for j in (1, 5, 7, 3, 2, 6, 8, 4)]
        return ",".join(map(str, [k + 1, *corners]))

    lines = ["*NODE", *(f"{n},{x},{y},{z}" for n, (x, y, z) in enumerate(nodes, 1))]
    lines += ["*Element, type=S4", "9,1,2,4,3", "*ELEMENT,TYPE=C3D8,ELSET=ends", cube(0)]
    lines += ["*ELEMENT, type=C3D8, elset=middle", cube(1), "*ELEMENT,TYPE=C3D8,ELSET=ends", cube(2)]
    path = tmp_path / "bar.inp"
    path.write_text("\n".join([*lines, "*STEP", ""]))
    bar = read_mesh(path, {"bar": ["ends", "middle"]})["bar"]
    assert {name: cells.tolist() for name, cells in bar.regions.items()} == {"ends": [0, 2], "middle": [1]}
    assert bar.volume == pytest.approx(3.0)


def test_nodes_under_several_headings_of_an_abaqus_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "parts.inp"
    path.write_text("*NODE\n1,0,0,0\n*NODE\n2,1,0,0\n*NODE PRINT\n")
    with pytest.raises(
        InvalidInputError, match=r"under one \*NODE, it has 2, of which meshio keeps the last"
    ):
        read_mesh(path)


@pytest.mark.parametrize(
    ("ending", "name"),
    [(".bdf", "nastran:ref"), (".vtu", "material"), (".vtk", "material"), (".mesh", "medit:ref")],
)
def test_numbers_of_cells_are_bodies_and_surfaces(ending: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / f"press{ending}"
    with_tags(joined(), name).write(path)
    check(read_mesh(path), ("1", "2"), "11", "12")
    found = read_mesh(path, {"table": 1, "tool": "2"}, {"floor": 11, "lid": "12"}, labels=name)
    check(found, ("table", "tool"), "floor", "lid")


def test_names_that_gmsh_has_for_numbers_are_used() -> None:
    mesh = with_tags(joined(), "gmsh:physical")
    mesh.field_data = {"table": [1, 3], "tool": [2, 3], "bottom": [11, 2], "top": [12, 2]}
    check(from_meshio(mesh), ("table", "tool"), "bottom", "top")


def test_families_of_a_med_file_may_have_several_names() -> None:
    mesh = with_tags(joined(), "cell_tags", (-1, -2, -3, -4))
    mesh.cell_tags = {-1: ["table", "press"], -2: ["tool", "press"], -3: ["bottom"], -4: ["top"]}
    mesh.point_data["point_tags"] = np.where(np.isclose(mesh.points[:, 2], 2.5), 5, 0)
    mesh.point_tags = {5: ["pushed"]}
    found = from_meshio(mesh, ["table", "tool"])
    check(found, ("table", "tool"), "bottom", "top")
    assert area(found["tool"], "pushed") == UP
    regions = from_meshio(mesh, {"both": {"hard": "tool", "soft": "table"}})["both"].regions
    assert {name: len(cells) for name, cells in regions.items()} == {"hard": 6, "soft": 8}


def test_a_mesh_without_labels_is_one_body_or_its_pieces_or_its_blocks() -> None:
    mesh = joined()
    bare = meshio.Mesh(mesh.points, mesh.cells)
    one = from_meshio(bare)
    assert (list(one), one["mesh"].n_cells) == (["mesh"], 14)
    for labels in ("pieces", "blocks"):
        found = from_meshio(mesh, labels=labels)
        check(found, (f"{labels[:-1]} 1", f"{labels[:-1]} 2"), "bottom", "top")


def test_msh_and_xdmf_files_are_passed_on(tmp_path: Path) -> None:
    assert list(read_mesh(ROOT / "tests" / "data" / "two_boxes_41.msh")) == ["table", "tool"]
    mesh = bar("hexahedron")
    path = write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh), facet_tags(mesh))
    found = read_mesh(path, {"left": "1", "right": 2}, {"end": "3"})
    assert [round(body.volume, 9) for body in found.values()] == [1.0, 1.0]
    assert area(found["right"], "end") == [1.0, 0.0, 0.0]


def test_left_handed_cells_are_turned(tmp_path: Path) -> None:
    mesh = joined()
    mesh.cells[1].data = mesh.cells[1].data[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    mesh.write(tmp_path / "press.inp")
    check(read_mesh(tmp_path / "press.inp"), ("table", "tool"), "bottom", "top")


def test_plane_cells_lose_their_constant_z_coordinate(tmp_path: Path) -> None:
    points = np.array([[0, 0, 3], [1, 0, 3], [1, 1, 3], [0, 1, 3], [2, 0, 3]], dtype=float)
    cells = [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 2, 4]]), ("line", [[0, 1], [1, 4]])]
    tags = [np.array([1]), np.array([2]), np.array([7, 7])]
    meshio.Mesh(points, cells, cell_data={"part": tags}).write(tmp_path / "plate.vtu")
    found = read_mesh(tmp_path / "plate.vtu")
    assert [body.cell_type for body in found.values()] == ["quadrilateral", "triangle"]
    assert [area(body, "7") for body in found.values()] == [[0.0, -1.0], [0.0, -1.0]]


@pytest.mark.parametrize("ending", [".vtu", ".msh", ".inp"])
def test_quadratic_tetrahedra_stay_so_whatever_the_order_of_their_nodes(ending: str, tmp_path: Path) -> None:
    """Abaqus and CalculiX call them C3D10; gmsh exchanges the last two midpoints."""
    bent = quadratic(block((0, 0, 0), (2, 1, 1), (2, 2, 2), cell="tetrahedron"))
    bent = bent.moved(bent.points + 0.05 * np.sin(bent.points[:, [1, 2, 0]]))
    tags, path = [np.full(bent.n_cells, 1)], tmp_path / f"bent{ending}"
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    sets = {"bar": [np.arange(bent.n_cells)]} if ending == ".inp" else {}
    written = meshio.Mesh(
        bent.points, [("tetra10", bent.cells)], cell_data={} if sets else data, cell_sets=sets,
        point_sets={"low": np.unique(bent.surfaces["z0"])} if sets else {},
    )  # fmt: skip
    written.write(path, **({"file_format": "gmsh22"} if ending == ".msh" else {}))
    (found,) = read_mesh(path).values()
    assert (found.cell_type, found.volume) == ("tetrahedron10", pytest.approx(bent.volume, rel=1e-12))
    np.testing.assert_allclose(found.points[found.cells], bent.points[bent.cells], atol=1e-12)
    if sets:
        assert "C3D10" in path.read_text()
        assert found.surfaces["low"].shape == bent.surfaces["z0"].shape
    (linear,) = read_mesh(path, corners_only=True, file_format="gmsh" if ending == ".msh" else None).values()
    assert linear.cell_type == "tetrahedron"


def test_midpoints_in_another_order_are_put_right_or_refused(tmp_path: Path) -> None:
    """In the whole file by their places; of a single cell they make it an inverted one."""
    straight = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1), cell="tetrahedron"))
    cells = straight.cells[:, [0, 1, 2, 3, 9, 8, 7, 6, 5, 4]]
    found = from_meshio(meshio.Mesh(straight.points, [("tetra10", cells)]))["mesh"]
    np.testing.assert_array_equal(found.cells, straight.cells)
    cells = straight.cells.copy()
    cells[0] = cells[0, [0, 1, 2, 3, 5, 4, 6, 7, 8, 9]]
    with pytest.raises(
        InvalidInputError, match=r"'mesh' of .* is no sound mesh: every cell .* 1 of 12 are inv"
    ):
        from_meshio(meshio.Mesh(straight.points, [("tetra10", cells)]))


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
def test_quadratic_hexahedra_stay_so_whatever_the_order_of_their_nodes(ending: str, tmp_path: Path) -> None:
    bent = quadratic(block((0, 0, 0), (2, 1, 1), (2, 2, 2)))
    bent = bent.moved(bent.points + 0.1 * np.sin(bent.points[:, [1, 2, 0]]))
    tags = [np.full(bent.n_cells, 1), np.full(4, 5)]
    cells = [("hexahedron27", bent.cells), ("quad9", bent.surfaces["z0"])]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    path = tmp_path / f"bent{ending}"
    meshio.Mesh(bent.points, cells, cell_data=data).write(
        path, **({"file_format": "gmsh22"} if "m" in ending else {})
    )
    found = read_mesh(path)["1"]
    assert (found.cell_type, found.volume) == ("hexahedron27", pytest.approx(bent.volume, rel=1e-12))
    assert found.surfaces["5"].shape == (4, 9)
    np.testing.assert_allclose(found.points[found.cells], bent.points[bent.cells], atol=1e-12)


@pytest.mark.parametrize("inverted", [False, True])
def test_nodes_in_another_order_than_vtks_are_told_by_their_places(inverted: bool) -> None:
    """The order of HEX27 in Exodus: centre first, then the faces, other than VTK's."""
    bent = quadratic(block((0, 0, 0), (2, 1, 1), (3, 2, 2)))
    bent = bent.moved(bent.points + 0.05 * np.sin(bent.points[:, [1, 2, 0]]))
    cells = bent.cells[:, [*range(20), 26, 24, 25, 20, 21, 22, 23]]
    if inverted:
        cells = cells[:, [4, 5, 6, 7, 0, 1, 2, 3, *range(8, 27)]]
    found = from_meshio(meshio.Mesh(bent.points, [("hexahedron27", cells)]))["mesh"]
    assert found.volume == pytest.approx(bent.volume, rel=1e-12)
    np.testing.assert_array_equal(np.sort(found.cells), np.sort(bent.cells))


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_of_the_serendipity_family_get_the_missing_centres(dim: int) -> None:
    """Moved by a map of that family, they keep exactly the geometry: the volume is that of the map."""
    solid = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1)))
    mesh = solid if dim == 3 else quadratic(from_meshio(two_squares())["mesh"])

    def bent(x: np.ndarray) -> np.ndarray:
        return np.column_stack([x[:, 0] + 0.1 * x[:, 1] ** 2, *x[:, 1:].T])

    keep, name = (20, "hexahedron20") if dim == 3 else (8, "quad8")
    used = np.zeros(mesh.n_nodes, dtype=bool)
    used[mesh.cells[:, :keep]] = True
    points = np.where(used[:, None], bent(mesh.points), 1e3)
    cells, face = [(name, mesh.cells[:, :keep])], "quad8" if dim == 3 else "line3"
    cells.append((face, mesh.surfaces["x0"][:, :8] if dim == 3 else mesh.cells[:1, [3, 0, 7]]))
    sets = {"part": [np.arange(2), np.zeros(0, int)], "end": [np.zeros(0, int), np.arange(1)]}
    found = from_meshio(meshio.Mesh(points, cells, cell_sets=sets))["part"]
    assert found.order == 2
    assert found.n_nodes == mesh.n_nodes
    np.testing.assert_allclose(found.points[found.cells], bent(mesh.points)[mesh.cells], atol=1e-12)
    assert area(found, "end")[0] == pytest.approx(-1.0)
    linear = from_meshio(meshio.Mesh(points, cells, cell_sets=sets), corners_only=True)["part"]
    assert linear.order == 1


def two_squares() -> meshio.Mesh:
    points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]]
    return meshio.Mesh(np.array(points), [("quad", np.array([[0, 1, 4, 3], [1, 2, 5, 4]]))])


def test_all_ranks_receive_the_bodies_that_rank_0_reads(mpirun: Callable[..., str], tmp_path: Path) -> None:
    joined().write(tmp_path / "press.inp")
    script = f"""
        from mpi4py import MPI
        from fenics_contact import read_mesh
        bodies = read_mesh("{tmp_path / "press.inp"}", ["tool"], ["top"], comm=MPI.COMM_WORLD)
        found = [(name, round(body.volume, 9), *body.surfaces) for name, body in bodies.items()]
        try:
            read_mesh("nowhere.inp", comm=MPI.COMM_WORLD)
        except ValueError as error:
            found.append("there is none" in str(error))
        every = MPI.COMM_WORLD.gather(found)
        if every:
            print(every)
    """
    rank = [("tool", 1.0, "top"), True]
    assert mpirun(script, 2).strip() == str([rank, rank])
