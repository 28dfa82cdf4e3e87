"""An XDMF file that cannot become bodies says why."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import from_dolfinx, read_xdmf
from tests.readers.msh_files import CUBE
from tests.readers.xdmf_files import bar, cell_tags, facet_tags, meshio, third_order_triangle, write

import dolfinx.mesh  # isort: skip

__all__ = ["meshio"]


def written(module: ModuleType, path: Path, points: object, cells: dict[str, list[list[int]]]) -> Path:
    """Write cells with meshio, each with tag 1."""
    tags = [np.ones(len(rows), dtype=int) for rows in cells.values()]
    module.write(path, module.Mesh(np.array(points, float), cells, cell_data={"t": tags}), data_format="XML")
    return path


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must be a file '.*none\.xdmf', there is none"):
        read_xdmf(tmp_path / "none.xdmf")
    path = write(tmp_path / "bar.xdmf", bar("triangle"))
    with pytest.raises(InvalidInputError, match=r"must be a file '.*facets\.xdmf', there is none"):
        read_xdmf(path, facet_file=tmp_path / "facets.xdmf")


def test_the_hdf5_file_is_no_xdmf_file(tmp_path: Path) -> None:
    path = write(tmp_path / "bar.xdmf", bar("triangle"))
    with pytest.raises(InvalidInputError, match=r"must be an XDMF file, it is no XML .* not the \.h5 file"):
        read_xdmf(path.with_suffix(".h5"))


def test_a_missing_hdf5_file_is_answered_with_what_dolfinx_says(tmp_path: Path) -> None:
    path = write(tmp_path / "bar.xdmf", bar("triangle"))
    path.with_suffix(".h5").unlink()
    with pytest.raises(
        InvalidInputError, match=r"with its HDF5 file beside it, dolfinx says: .*write it again"
    ):
        read_xdmf(path)


def test_a_tag_that_is_not_there_is_answered_with_those_that_are(tmp_path: Path) -> None:
    mesh = bar("tetrahedron")
    path = write(tmp_path / "bar.xdmf", mesh, cell_tags(mesh), facet_tags(mesh))
    with pytest.raises(InvalidInputError, match=r"body 'bar' needs the cell tag 7, file .* has 1, 2$"):
        read_xdmf(path, {"bar": [1, 7]})
    with pytest.raises(InvalidInputError, match=r"surface 'top' needs the facet tag 9, .* has 3, 4$"):
        read_xdmf(path, surfaces={"top": 9})
    with pytest.raises(InvalidInputError, match=r"surface 'top' needs the facet tag 9, .* has none at all"):
        read_xdmf(write(tmp_path / "plain.xdmf", mesh), surfaces={"top": 9})


def test_a_cell_without_a_tag_is_refused() -> None:
    mesh = bar("triangle")
    tags = dolfinx.mesh.meshtags(mesh, 2, np.arange(12, dtype=np.int32), np.ones(12, dtype=np.int32))
    with pytest.raises(
        InvalidInputError, match=r"every cell of mesh of dolfinx must have a tag, .* 4 of 16 do not"
    ):
        from_dolfinx(mesh, tags)


def test_a_tagged_facet_inside_a_body_is_refused() -> None:
    mesh = bar("quadrilateral")
    mesh.topology.create_connectivity(1, 2)
    inner = np.sort(dolfinx.mesh.locate_entities(mesh, 1, lambda x: np.isclose(x[0], 1.0))).astype(np.int32)
    tags = dolfinx.mesh.meshtags(mesh, 1, inner, np.full(inner.size, 8, dtype=np.int32))
    with pytest.raises(InvalidInputError, match="2 facets of '8' of mesh of dolfinx lie inside body 'mesh'"):
        from_dolfinx(mesh, None, tags)
    both = from_dolfinx(mesh, cell_tags(mesh), tags)
    assert [body.surfaces["8"].shape for body in both.values()] == [(2, 2), (2, 2)]


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ({"wedge": [[0, 1, 2, 4, 5, 6]]}, "has 'wedge': mesh it without"),
        (
            {"hexahedron20": [[*range(8), *range(8), *range(4)]]},
            "'(hexahedron_20|hex_20)': such cells are not read: .* linear or quadratic ones",
        ),
        ({"quad": [[0, 1, 2, 3]], "triangle": [[4, 5, 6]]}, r"is mixed: write .* \(facet_file=\.\.\.\)"),
        ({"line": [[0, 1]]}, r"must have tetrahedra, .* it has 'Grid' \(polyline\)"),
        ({"quad": [[0, 1, 2, 3], [4, 5, 6, 7]]}, "plane of constant z, those of file .* reach over 1 in z"),
        (
            {"quad": [[0, 1, 2, 3], [0, 1, 5, 4]]},
            "2 of 8 in grid 'Grid' of file .* do not, first node 6: remove",
        ),
    ],
)
def test_cells_that_no_body_can_have_are_refused(
    meshio: ModuleType, cells: dict[str, list[list[int]]], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_xdmf(written(meshio, tmp_path / "bad.xdmf", CUBE, cells))


def test_tagged_facets_that_are_not_in_the_mesh_are_refused(meshio: ModuleType, tmp_path: Path) -> None:
    cells = written(meshio, tmp_path / "cells.xdmf", CUBE[:4], {"quad": [[0, 1, 2, 3]]})
    facets = written(meshio, tmp_path / "facets.xdmf", CUBE[:4], {"line": [[0, 1], [0, 2]]})
    with pytest.raises(InvalidInputError, match=r"1 of 2 in grid 'Grid' of file .* are on none: write both"):
        read_xdmf(cells, facet_file=facets)


def test_facets_on_other_nodes_are_refused(meshio: ModuleType, tmp_path: Path) -> None:
    cells = written(meshio, tmp_path / "cells.xdmf", CUBE[:4], {"quad": [[0, 1, 2, 3]]})
    facets = written(meshio, tmp_path / "facets.xdmf", CUBE[1:3], {"line": [[0, 1]]})
    with pytest.raises(InvalidInputError, match=r"facets.xdmf' must be on the nodes of the mesh, .* 2 nodes"):
        read_xdmf(cells, facet_file=facets)


def test_cells_listed_left_handed_are_turned(meshio: ModuleType, tmp_path: Path) -> None:
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 0, 1), (1, 0, -1)]
    cells = {"tetra": [[0, 2, 1, 3], [0, 2, 1, 4]]}
    body = read_xdmf(written(meshio, tmp_path / "t.xdmf", points, cells), surfaces=[])["1"]
    assert body.volume == pytest.approx(1.0 / 3.0)
    assert [set(cell) for cell in body.cells.tolist()] == [{0, 1, 2, 3}, {0, 1, 2, 4}]


def test_a_cell_flipped_over_its_neighbour_is_refused(meshio: ModuleType, tmp_path: Path) -> None:
    cells = {"triangle": [[0, 1, 2], [1, 0, 3]]}  # both above the edge from 0 to 1
    message = r"1 faces of file .* have both on one side, first at \(0\.5, 0\), where a cell is flipped"
    with pytest.raises(InvalidInputError, match=message):
        read_xdmf(written(meshio, tmp_path / "f.xdmf", CUBE[:4], cells))


def test_a_mesh_of_dolfinx_of_third_order_is_refused() -> None:
    mesh = third_order_triangle()
    with pytest.raises(InvalidInputError, match="triangle of order 3: such cells are not read"):
        from_dolfinx(mesh)
