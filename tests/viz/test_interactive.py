"""Scenes for a browser are whole pages that hold the bodies; without the libraries there is a picture."""

from __future__ import annotations

import base64
import io
import json
import re
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, MissingRequirementError
from fenics_contact.viz import InteractiveScene, Picture, interactive
from fenics_contact.viz.interactive_layers import CONTENTS
from tests.viz.plane_states import plane_block
from tests.viz.states import pulled, touching_blocks


def scene_in(page: str) -> dict[str, Any]:
    """Read what the viewer of a page would show."""
    (packed,) = re.findall(r'const base64Str = "([^"]+)"', page)
    with zipfile.ZipFile(io.BytesIO(base64.b64decode(packed))) as archive:
        return dict(json.loads(archive.read("index.json")))


def points_in(page: str) -> np.ndarray:
    """Return the points of all meshes of a page, (n, 3)."""
    arrays = scene_in(page)["hashes"].values()
    kinds = {"Float32Array": np.float32, "Float64Array": np.float64}
    found = [
        np.frombuffer(base64.b64decode(array["content"]), dtype=kinds[array["type"]])
        for array in arrays
        if array["vtk"] == "vtkPoints"
    ]
    return np.concatenate([values.reshape(-1, 3) for values in found])


@pytest.mark.parametrize("field", list(CONTENTS))
@pytest.mark.parametrize("state", [touching_blocks, plane_block], ids=["space", "plane"])
def test_a_page_holds_the_bodies_and_what_is_asked_for(state: Callable[[], State], field: str) -> None:
    scene = interactive(state(), field, title="A & B")
    assert isinstance(scene, InteractiveScene)
    assert scene.html is not None
    assert "A &amp; B" in scene.html
    assert 'src="http' not in scene.html, "the page needs the network"
    points = points_in(scene.html)
    for body in state().scene.bodies.values():
        corner = np.pad(body.mesh.points.max(axis=0), (0, 3 - body.mesh.dim))
        size = float(np.ptp(body.mesh.points, axis=0).max())
        assert np.linalg.norm(points - corner, axis=1).min() < 0.1 * size, "a body is missing"
    legend = field == "contact_status"
    assert all((f"</span>{name}" in scene.html) == legend for name in ("open", "stick", "slip"))


def test_points_are_drawn_where_the_deformation_moves_them() -> None:
    state = pulled("hexahedron27")
    ends = []
    for factor in (0.0, 2.0):
        scene = interactive(state, deformed=factor)
        assert isinstance(scene, InteractiveScene)
        assert scene.html is not None
        ends.append(points_in(scene.html)[:, 0].max())
    stretch = float(state.gather_displacement("bar")[:, 0].max())
    assert stretch > 0.01
    assert ends[1] - ends[0] == pytest.approx(2 * stretch, rel=1e-3)


def test_jupyter_shows_the_page_in_a_frame_and_a_file_holds_it(tmp_path: Path) -> None:
    scene = interactive(plane_block(), path=tmp_path / "new" / "state.html")
    assert isinstance(scene, InteractiveScene)
    assert scene.html is not None
    assert Path(scene).read_text() == scene.html
    assert str(scene) == str(tmp_path / "new" / "state.html")
    shown = scene._repr_mimebundle_()["text/html"]
    assert shown.startswith("<iframe srcdoc=")
    assert shown.count('"') == 4, "quotes of the page end the frame"
    assert InteractiveScene(None)._repr_mimebundle_() == {"text/plain": ""}
    with pytest.raises(InvalidInputError, match=r"not written: give the function a path"):
        Path(InteractiveScene("<html>"))


@pytest.mark.parametrize("field", list(CONTENTS))
def test_without_the_libraries_there_is_a_picture(field: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trame_vtk.modules.vtk.serializers", None)
    picture = interactive(plane_block(), field)
    assert isinstance(picture, Picture)
    assert picture.png is not None


def test_a_file_without_the_libraries_is_refused_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "trame_vtk.modules.vtk.serializers", None)
    with pytest.raises(MissingRequirementError, match=r"need pyvista\[jupyter\].*contact\[notebooks\]"):
        interactive(plane_block(), path=tmp_path / "state.html")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"field": "stress"}, r"field must be one of von_mises, displacement, .*got 'stress'"),
        ({"deformed": np.inf}, r"deformed must be finite, got inf"),
        ({"path": "state.png"}, r"scenes are HTML files, got the name 'state.png': let it end in '.html'"),
        ({"clim": (1.0, 0.0)}, r"clim must be a finite range"),
    ],
)
def test_options_that_cannot_be_shown_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        interactive(plane_block(), **options)


def test_the_contact_of_a_scene_without_contact_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"'contact_pressure' needs a scene with contact, got"):
        interactive(pulled("triangle6"), "contact_pressure")


RANKS = """
    import sys
    from pathlib import Path
    from mpi4py import MPI
    from fenics_contact.contact import solve_scene
    from fenics_contact.scene import Coulomb
    from fenics_contact.viz import interactive
    from tests.contact.gallery import partitions, two_blocks

    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    shown = interactive(state, path=folder / "state.html")
    sys.modules["trame_vtk.modules.vtk.serializers"] = None
    fallen_back = interactive(state)
    answers = comm.gather((shown.html is not None, str(shown) == str(shown.path), type(fallen_back).__name__))
    if comm.rank == 0:
        print(*answers, *(path.name for path in folder.glob("*.html")))
"""


@pytest.mark.slow
def test_of_two_ranks_one_has_the_page_and_both_fall_back_together(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    lines = mpirun(RANKS, 2, tmp_path).strip()
    assert lines == "(True, True, 'Picture') (False, True, 'Picture') state.html"
