"""A mesh file that cannot become bodies says why."""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from fenics_contact import read_mesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import from_meshio
from tests.mesh_io.mesh_files import joined, with_tags
from tests.mesh_io.msh_files import CUBE

POINTS = np.array(CUBE, dtype=float)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
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
    with pytest.raises(InvalidInputError, match=r"meshio needs the library 'h5py' to read file .*part\.med"):
        read_mesh(tmp_path / "part.med")


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([("line", [[0, 1]])], "must hold cells, it has 1 of type 'line'"),
        ([], "must hold cells, it has none at all"),
        (
            [("hexahedron", [range(8)]), ("wedge", [[0, 1, 2, 4, 5, 6]])],
            "has 1 of type 'hexahedron', 1 of type 'wedge': mesh it without cells of type 'wedge'",
        ),
        ([("quad", [[0, 1, 2, 3]]), ("quad", [[0, 1, 5, 4]])], "must lie in a plane of constant z"),
        (
            [("hexahedron", [range(8)]), ("tetra", [[0, 1, 2, 4]])],
            "body 'mesh' of the mesh of meshio has 1 of type hexahedron and 1 of type tetrahedron: mesh it",
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
    with pytest.raises(InvalidInputError, match=r"every cell must have a cell set, .* 6 of 14 cells of type"):
        from_meshio(mesh)
    assert list(from_meshio(mesh, ["table"])) == ["table"]


def test_a_set_of_everything_asks_which_sets_are_bodies() -> None:
    mesh = joined()
    mesh.cell_sets["ALL"] = [np.arange(len(block.data)) for block in mesh.cells]
    with pytest.raises(InvalidInputError, match="belong to 'tool' and 'ALL': say which cell labels"):
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
        ("parts", r"has no such data 'parts': it has \['part'\]"),
    ],
)
def test_labels_that_are_not_there_are_answered_with_those_that_are(labels: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        from_meshio(with_tags(joined(), "part"), labels=labels)


def test_a_wanted_set_of_nodes_without_a_facet_is_refused() -> None:
    mesh = joined()
    mesh.point_sets["corner"] = np.array([0, 1])
    assert "corner" not in from_meshio(mesh)["table"].surfaces
    message = "2 nodes of 'corner' of the mesh of meshio hold those of none on the bodies"
    with pytest.raises(InvalidInputError, match=message):
        from_meshio(mesh, surfaces=["corner"])
