"""What is wrong with a file of a mesh is named."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

from fenics_contact import read_cad, read_mesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import from_meshio, read_msh
from tests.readers.mesh_files import joined, with_tags
from tests.readers.msh_files import (
    CUBE,
    HEXAHEDRON,
    PRISM,
    QUADRILATERAL,
    TETRAHEDRON,
    TRIANGLE,
    TRIANGLE_10,
    changed_gmsh,
    write_22,
)

SQUARE = CUBE[:4]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidInputError, match=r"must be a file '.*none\.msh', there is none: check the name"
    ):
        read_msh(tmp_path / "none.msh")


def test_a_file_of_another_kind_is_not_run_as_a_script(tmp_path: Path) -> None:
    script = tmp_path / "part.geo"
    script.write_text(f'Printf("hello") > "{tmp_path / "trace"}";')
    with pytest.raises(
        InvalidInputError, match=r"must be a \.msh file, which starts with \$MeshFormat, it starts"
    ):
        read_msh(script)
    assert not (tmp_path / "trace").exists()


def test_a_broken_file_is_answered_with_what_gmsh_says(tmp_path: Path) -> None:
    broken = tmp_path / "broken.msh"
    broken.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 1 1 1\n$EndEntities\n")
    with pytest.raises(
        InvalidInputError, match=r"gmsh can read, it says: Could not read entities: write it again"
    ):
        read_msh(broken)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_file_that_crashes_gmsh_is_refused_on_all_ranks(
    ranks: int, tmp_path: Path, mpirun: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_22(tmp_path / "f.msh", CUBE, [(TETRAHEDRON, 1, (0, 1, 2, 4))], {(3, 1): "lug"})
    changed_gmsh(tmp_path, "import os; gmsh.merge = lambda _: os.kill(os.getpid(), 11)", monkeypatch)
    script = f"""
        import sys
        from mpi4py import MPI
        from fenics_contact.errors import InvalidInputError
        from fenics_contact.readers import read_msh

        sys.path.insert(0, {str(tmp_path)!r})
        try:
            read_msh({str(path)!r}, comm=MPI.COMM_WORLD)
        except InvalidInputError as error:
            sys.stdout.write(str(error) + chr(10))
    """
    answers = mpirun(script, ranks).splitlines()
    assert len(answers) == ranks
    words = r"gmsh's reading of file '.*f\.msh' must end, but the process crashed \(signal 11,"
    assert all(re.match(words, answer) for answer in answers)


def test_a_drawing_that_crashes_the_mesher_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "box.geo"
    path.write_text('SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\n')
    changed_gmsh(tmp_path, "import os; gmsh.model.mesh.generate = lambda _: os.abort()", monkeypatch)
    with pytest.raises(InvalidInputError, match=r"box\.geo' must .* crashed \(signal 6, .*write it again"):
        read_cad(path, 1.0)


def test_a_file_without_cells_is_refused(tmp_path: Path) -> None:
    path = write_22(tmp_path / "lines.msh", SQUARE, [(1, 1, (0, 1))], {(1, 1): "line"})
    with pytest.raises(InvalidInputError, match="must hold cells, it has none"):
        read_msh(path)


def test_a_cell_without_a_group_is_refused(tmp_path: Path) -> None:
    path = write_22(tmp_path / "plain.msh", SQUARE, [(QUADRILATERAL, 0, range(4))], {})
    with pytest.raises(InvalidInputError, match=r"every surface with cells must .* surfaces \[1\] of file"):
        read_msh(path)


def test_a_flipped_cell_is_refused_with_its_body(tmp_path: Path) -> None:
    path = write_22(tmp_path / "f.msh", CUBE, [(TETRAHEDRON, 1, (0, 2, 1, 4))], {(3, 1): "lug"})
    message = "body 'lug' of file .* is no sound mesh: every cell must .* Jacobian, 1 of 1 are inverted"
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path)


def test_a_flipped_cell_among_others_in_the_plane_is_refused(tmp_path: Path) -> None:
    cells = [(TRIANGLE, 1, (0, 1, 2)), (TRIANGLE, 1, (0, 3, 2))]
    path = write_22(tmp_path / "f.msh", SQUARE, cells, {(2, 1): "lug"})
    with pytest.raises(InvalidInputError, match="1 of 2 are inverted or flat; the worst is cell 1"):
        read_msh(path)


def test_duplicate_nodes_are_refused_with_their_body(tmp_path: Path) -> None:
    points = np.array(SQUARE)[[0, 1, 2, 0, 2, 3]].tolist()
    path = write_22(
        tmp_path / "d.msh", points, [(TRIANGLE, 1, (0, 1, 2)), (TRIANGLE, 1, (3, 4, 5))], {(2, 1): "lug"}
    )
    with pytest.raises(InvalidInputError, match=r"body 'lug' of file .* 4 of 6 nodes coincide with another"):
        read_msh(path)


@pytest.mark.parametrize(
    ("kind", "points", "message"),
    [
        (
            TRIANGLE_10,
            [*SQUARE[:3], *(7 * [(0.5, 0, 0)])],
            r"'Triangle 10': such cells are not read: .* Mesh\.ElementOrder = 1 or 2",
        ),
    ],
)
def test_quadratic_cells_without_a_counterpart_are_refused_with_what_to_do(
    kind: int, points: list[tuple[float, ...]], message: str, tmp_path: Path
) -> None:
    path = write_22(tmp_path / "q.msh", points, [(kind, 1, range(len(points)))], {(2, 1): "lug"})
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path)


def test_an_inverted_prism_is_named(tmp_path: Path) -> None:
    path = write_22(tmp_path / "p.msh", CUBE, [(PRISM, 1, (4, 5, 6, 0, 1, 2))], {(3, 1): "lug"})
    with pytest.raises(InvalidInputError, match=r"1 of 1 are inverted or flat; the worst is cell 0 at"):
        read_msh(path)


def test_cells_of_two_types_make_two_bodies_or_one(tmp_path: Path) -> None:
    points = [*SQUARE, (2, 0, 0)]
    cells = [(QUADRILATERAL, 1, (0, 1, 2, 3)), (TRIANGLE, 2, (1, 4, 2)), (1, 3, (0, 1)), (1, 3, (1, 4))]
    path = write_22(tmp_path / "m.msh", points, cells, {(2, 1): "a", (2, 2): "b", (1, 3): "floor"})
    bodies = read_msh(path)
    assert [body.cell_type for body in bodies.values()] == ["quadrilateral", "triangle"]
    assert [body.surfaces["floor"].shape for body in bodies.values()] == [(1, 2), (1, 2)]
    both = read_msh(path, {"ab": ["a", "b"]})["ab"]
    assert both.cells_in_words == "1 triangle and 1 quadrilateral"
    assert both.surfaces["floor"].shape == (2, 2)
    assert [len(cells) for cells in both.regions.values()] == [1, 1]


def test_surfaces_alone_are_no_solid(tmp_path: Path) -> None:
    faces = [(0, 1, 2, 3), (0, 1, 5, 4)]
    path = write_22(tmp_path / "s.msh", CUBE, [(QUADRILATERAL, 1, face) for face in faces], {(2, 1): "skin"})
    with pytest.raises(
        InvalidInputError, match=r"plane of constant z, those of file .* reach over 1 in z: put"
    ):
        read_msh(path)


def test_a_surface_beside_the_cells_is_refused(tmp_path: Path) -> None:
    cells = [(HEXAHEDRON, 1, range(8)), (QUADRILATERAL, 2, (0, 1, 2, 3)), (QUADRILATERAL, 2, (0, 1, 6, 7))]
    path = write_22(tmp_path / "b.msh", CUBE, cells, {(3, 1): "lug", (2, 2): "cut"})
    message = r"1 of 2 facets of 'cut' of file .* are none, first at \(0\.5, 0\.5, 0\.5\): mesh both"
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path)
    assert dict(read_msh(path, surfaces=[])["lug"].surfaces) == {}


def test_nodes_far_out_of_the_plane_do_not_matter_without_cells(tmp_path: Path) -> None:
    path = write_22(tmp_path / "o.msh", [*SQUARE, (0, 0, 9)], [(QUADRILATERAL, 1, range(4))], {(2, 1): "lug"})
    assert read_msh(path)["lug"].n_nodes == 4


# A mesh file that cannot become bodies says why.
POINTS = np.array(CUBE, dtype=float)


def test_a_missing_file_of_meshio_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must be a file '.*none\.vtu', there is none: check"):
        read_mesh(tmp_path / "none.vtu")


def test_an_ending_that_says_nothing_is_answered_with_those_that_do(tmp_path: Path) -> None:
    (tmp_path / "part.step").write_text("ISO-10303-21;")
    with pytest.raises(
        InvalidInputError, match=r"must end in one of .*\.bdf .*\.vtu.*: rename it, or give file"
    ):
        read_mesh(tmp_path / "part.step")


@pytest.mark.parametrize("ending", [".vtu", ".inp", ".mesh"])
def test_a_broken_file_is_answered_with_what_meshio_says(
    ending: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"broken{ending}"
    path.write_text("*ELEMENT, TYPE=C3D8\n1,2\n")
    with pytest.raises(InvalidInputError, match=r"must be a mesh that meshio can read, it says: \w+"):
        read_mesh(path)
    assert capfd.readouterr() == ("", "")


def test_a_library_that_a_format_needs_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "part.med").write_text("")
    with pytest.raises(InvalidInputError, match=r"meshio needs the library 'h5py' to read .*part\.med"):
        read_mesh(tmp_path / "part.med")


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([("line", [[0, 1]])], "must hold cells, it has 1 of type 'line'"),
        ([], "must hold cells, it has none at all"),
        (
            [("hexahedron", [range(8)]), ("hexahedron64", [list(range(8)) * 8])],
            "has 'hexahedron64': mesh it without",
        ),
        ([("quad", [[0, 1, 2, 3]]), ("quad", [[0, 1, 5, 4]])], "must lie in a plane of constant z"),
        (
            [("hexahedron", [range(8)]), ("tetra10", [[0, 1, 2, 4, 5, 6, 7, 3, 1, 2]])],
            "body 'mesh' of the mesh of meshio has both linear and quadratic cells",
        ),
        ([("tetra", [[0, 1, 2, 3]])], "is no sound mesh: every cell must have a positive Jacobian"),
    ],
)
def test_cells_that_bodies_cannot_have_are_refused(
    cells: list[tuple[str, list[list[int]]]], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        from_meshio(meshio.Mesh(POINTS, [(name, np.array(rows)) for name, rows in cells]))


def test_hexahedra_of_20_and_27_nodes_in_one_mesh_are_refused() -> None:
    cells = [("quad8", np.arange(8)[None]), ("quad9", np.arange(9)[None])]
    square = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    with pytest.raises(
        InvalidInputError, match=r"must have one number of nodes, .* 1 of type 'quad8', 1 of type"
    ):
        from_meshio(meshio.Mesh(np.array(square, dtype=float), cells))


def test_cells_without_a_label_are_refused_unless_bodies_are_chosen() -> None:
    mesh = joined()
    del mesh.cell_sets["tool"]
    with pytest.raises(
        InvalidInputError, match=r"every cell of .* must have a cell set, .* 6 of 14 do not, first of type"
    ):
        from_meshio(mesh)
    assert list(from_meshio(mesh, ["table"])) == ["table"]


def test_a_set_of_everything_asks_which_sets_are_bodies() -> None:
    mesh = joined()
    mesh.cell_sets["ALL"] = [np.arange(len(block.data)) for block in mesh.cells]
    with pytest.raises(InvalidInputError, match="are of 'tool' and 'ALL': say which cell labels"):
        from_meshio(mesh)
    assert list(from_meshio(mesh, ["table", "tool"], ["top", "bottom"])) == ["table", "tool"]


def test_a_set_that_does_not_fit_the_cells_is_refused() -> None:
    mesh = joined()
    mesh.cell_sets["both"] = [np.array([0])]
    with pytest.raises(
        InvalidInputError, match=r"cell set 'both' of .* must list cells of each of the 4 blocks"
    ):
        from_meshio(mesh)


def test_two_kinds_of_numbers_ask_which_is_meant() -> None:
    mesh = with_tags(joined(), "part")
    mesh.cell_data["colour"] = mesh.cell_data["part"]
    with pytest.raises(InvalidInputError, match=r"has \['part', 'colour'\]: give labels="):
        from_meshio(mesh)
    assert list(from_meshio(mesh, labels="colour")) == ["1", "2"]


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ("sets", r"labels=\"sets\" needs cell sets, .* has none: .* \['part'\]"),
        ("parts", r"cell data of integers \['part'\], got 'parts'"),
    ],
)
def test_labels_that_are_not_there_are_answered_with_those_that_are(labels: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        from_meshio(with_tags(joined(), "part"), labels=labels)


def test_a_wanted_set_of_nodes_without_a_facet_is_refused() -> None:
    mesh = joined()
    mesh.point_sets["corner"] = np.array([0, 1])
    assert "corner" not in from_meshio(mesh)["table"].surfaces
    message = "2 nodes of 'corner' of the mesh of meshio hold no whole facet"
    with pytest.raises(InvalidInputError, match=message):
        from_meshio(mesh, surfaces=["corner"])
