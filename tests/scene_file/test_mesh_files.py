"""Bodies of scene files from mesh files and CAD files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import BodyMesh, read_scene_file
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.readers import gmsh_model, read_msh
from tests.conftest import ROOT


def mesh_from_file(mesh: dict[str, Any], **body: Any) -> BodyMesh:
    """The mesh of the only body of a scene."""
    data = {
        "meshes": {"m": mesh},
        "materials": {"s": {"young_modulus": 2.1e5, "poisson_ratio": 0.3}},
        "bodies": {"a": {"mesh": "m", "material": "s", **body}},
    }
    return read_scene_file(data, MPI.COMM_SELF).scene.bodies["a"].mesh


def test_bodies_come_from_mesh_files() -> None:
    data = ROOT / "tests" / "data" / "two_boxes_41.msh"
    known = read_msh(data)
    name = sorted(known)[0]
    found = mesh_from_file({"file": str(data)}, part=name)
    np.testing.assert_array_equal(found.points, known[name].points)
    with pytest.raises(SceneFileError, match="must be a body of the mesh 'm', one of"):
        mesh_from_file({"file": str(data)}, part="nothing")
    with pytest.raises(SceneFileError, match="labels and corners_only are for other formats than"):
        mesh_from_file({"file": str(data), "labels": "sets"})
    with pytest.raises(
        SceneFileError, match=r"size, sizes and order are for CAD files \(.step, .*: leave it out"
    ):
        mesh_from_file({"file": str(data), "size": 1.0})


def test_bodies_come_from_cad_files_with_their_shapes(tmp_path: Path) -> None:
    with gmsh_model("pin") as gmsh:
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "pin.brep"))
    mesh = {"file": str(tmp_path / "pin.brep"), "size": 0.2, "surfaces": {"mantle": 1}, "scale": 2.0}
    found = mesh_from_file(mesh)
    there = np.array([[3.0, 0.0, 1.0], [0.0, 2.0, 3.0]])
    np.testing.assert_allclose(found.shapes["mantle"].distance(there), [1.0, 0.0], atol=1e-12)
    by_place = {"mantle": {"faces": "on_cylinder", "radius": 1.0, "axis": [0, 0, 1]}}
    by_place["ends"] = [{"faces": "on_plane", "point": [0, 0, z], "normal": [0, 0, 1]} for z in (0, 2)]
    chosen = mesh_from_file({**mesh, "surfaces": by_place})
    np.testing.assert_array_equal(chosen.surfaces["mantle"], found.surfaces["mantle"])
    assert set(chosen.points[chosen.surfaces["ends"]][..., 2].ravel()) == {0.0, 4.0}
    for wrong, words in (
        ({"faces": "on_cylinder", "radius": 3.0}, "'x' must have a face, .* cylinder of radius 3: it has 1 "),
        ({"faces": "on_cylinder"}, r"surfaces\.x must have 'radius'"),
        ({"faces": "in_sphere"}, "must .*'in_box', 'on_plane'"),
        ({"faces": "on_cylinder", "radius": 1.0, "way": 1}, "way"),
        ([1, 2.5], r"surfaces\.x\.1 must be the name or number of a group or face, a list"),
        ([], r"surfaces\.x must"),
    ):
        with pytest.raises(SceneFileError, match=words):
            mesh_from_file({**mesh, "surfaces": {"x": wrong}})
    data = ROOT / "tests" / "data" / "two_boxes_41.msh"
    with pytest.raises(SceneFileError, match=r"faces are chosen by place in CAD files .*: choose groups"):
        mesh_from_file({"file": str(data), "surfaces": by_place})
    curved = mesh_from_file({**mesh, "order": 2})
    assert (curved.cell_type, found.cell_type) == ("tetrahedron10", "tetrahedron")
    coarse = mesh_from_file({**mesh, "size": 0.7})
    fine = mesh_from_file({**mesh, "size": 0.7, "sizes": {"mantle": 0.2}})
    assert len(fine.surfaces["mantle"]) > 2 * len(coarse.surfaces["mantle"])
    assert coarse.n_cells < found.n_cells
    with pytest.raises(SceneFileError, match=r"labels and corners_only are for other formats than CAD"):
        mesh_from_file({**mesh, "labels": "sets"})
