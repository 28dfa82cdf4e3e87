"""A .msh file that cannot become bodies says why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import read_msh
from tests.mesh_io.msh_files import (
    CUBE,
    HEXAHEDRON,
    PRISM,
    PYRAMID,
    QUADRILATERAL,
    QUADRILATERAL_8,
    TETRAHEDRON,
    TRIANGLE,
    TRIANGLE_10,
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
        (
            QUADRILATERAL_8,
            [*SQUARE, (0.5, 0, 0), (1, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0)],
            r"'Quadrilateral 8': set Mesh\.SecondOrderIncomplete = 0",
        ),
    ],
)
def test_quadratic_cells_without_a_counterpart_are_refused_with_what_to_do(
    kind: int, points: list[tuple[float, ...]], message: str, tmp_path: Path
) -> None:
    path = write_22(tmp_path / "q.msh", points, [(kind, 1, range(len(points)))], {(2, 1): "lug"})
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path)


@pytest.mark.parametrize(("kind", "nodes"), [(PRISM, (0, 1, 2, 4, 5, 6)), (PYRAMID, (0, 1, 2, 3, 4))])
def test_prisms_and_pyramids_are_refused(kind: int, nodes: tuple[int, ...], tmp_path: Path) -> None:
    path = write_22(tmp_path / "p.msh", CUBE, [(kind, 1, nodes)], {(3, 1): "lug"})
    with pytest.raises(InvalidInputError, match=r"must be tetrahedra or hexahedra .* '(Prism|Pyramid)"):
        read_msh(path)


def test_cells_of_two_types_make_two_bodies_but_not_one(tmp_path: Path) -> None:
    points = [*SQUARE, (2, 0, 0)]
    cells = [(QUADRILATERAL, 1, (0, 1, 2, 3)), (TRIANGLE, 2, (1, 4, 2)), (1, 3, (0, 1)), (1, 3, (1, 4))]
    path = write_22(tmp_path / "m.msh", points, cells, {(2, 1): "a", (2, 2): "b", (1, 3): "floor"})
    bodies = read_msh(path)
    assert [body.cell_type for body in bodies.values()] == ["quadrilateral", "triangle"]
    assert [body.surfaces["floor"].shape for body in bodies.values()] == [(1, 2), (1, 2)]
    message = "body 'ab' of file .* has 1 of type quadrilateral and 1 of type triangle: mesh it with one"
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path, {"ab": ["a", "b"]})


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
    message = r"1 of 2 facets of 'cut' of file .* are none, first at \(0\.5, 0\.5, 0\.5\): mesh bodies"
    with pytest.raises(InvalidInputError, match=message):
        read_msh(path)
    assert dict(read_msh(path, surfaces=[])["lug"].surfaces) == {}


def test_nodes_far_out_of_the_plane_do_not_matter_without_cells(tmp_path: Path) -> None:
    path = write_22(tmp_path / "o.msh", [*SQUARE, (0, 0, 9)], [(QUADRILATERAL, 1, range(4))], {(2, 1): "lug"})
    assert read_msh(path)["lug"].n_nodes == 4
