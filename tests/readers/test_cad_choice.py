"""Faces of CAD files are chosen by name, by number, and by where they lie."""

from __future__ import annotations

import os
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fenics_contact import BodyMesh, read_cad
from fenics_contact.errors import InvalidInputError
from fenics_contact.readers import CadFace, InBox, OnCylinder, OnPlane, gmsh_model
from fenics_contact.shapes import Cylinder, Plane
from tests.readers.msh_files import changed_gmsh

WIDE, HIGH, RADIUS = 4.0, 1.0, 0.6


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate with two holes of one radius, along z at (1, 1) and (3, 1), and a small one along y."""
    path = tmp_path_factory.mktemp("cad") / "plate.step"
    with gmsh_model("plate") as gmsh:
        occ = gmsh.model.occ
        holes = [(3, occ.addCylinder(x, 1, 0, 0, 0, HIGH, RADIUS)) for x in (1, 3)]
        holes.append((3, occ.addCylinder(2, -1, 0.5, 0, 5, 0, 0.2)))
        occ.cut([(3, occ.addBox(0, 0, 0, WIDE, 2, HIGH))], holes)
        occ.synchronize()
        write(gmsh, path)
    return path


def write(gmsh: ModuleType, path: Path) -> None:
    """Write a CAD file; the library that writes STEP files talks."""
    silent, kept = os.open(os.devnull, os.O_WRONLY), os.dup(1)
    os.dup2(silent, 1)
    gmsh.write(str(path))
    os.dup2(kept, 1)


def read(path: Path, **surfaces: Any) -> BodyMesh:
    (mesh,) = read_cad(path, 0.6, surfaces=surfaces).values()
    return mesh


def middles(mesh: BodyMesh, name: str) -> np.ndarray:
    return np.asarray(mesh.points[mesh.surfaces[name]].mean(axis=1))


def test_faces_are_chosen_by_where_they_lie(plate: Path) -> None:
    upwards = (0.0, 0.0, 1.0)
    mesh = read(
        plate,
        top=OnPlane((9.0, 9.0, HIGH), (0.0, 0.0, -3.0)),
        left=OnCylinder(RADIUS, point=(1.0, 1.0, 7.0)),
        right=InBox((2.3, 0.3, -1.0), (3.7, 1.7, 2.0)),
        small=OnCylinder(0.2, (0.0, -1.0, 0.0)),
        ends=[OnPlane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), OnPlane((WIDE, 0.0, 0.0), (1.0, 0.0, 0.0))],
    )
    assert set(mesh.surfaces) == {"top", "left", "right", "small", "ends"}
    np.testing.assert_allclose(middles(mesh, "top")[:, 2], HIGH)
    np.testing.assert_allclose(np.abs(middles(mesh, "ends")[:, 0] - 2.0), 2.0)
    for name, x in (("left", 1.0), ("right", 3.0)):
        shape = mesh.shapes[name]
        assert isinstance(shape, Cylinder)
        assert (shape.radius, abs(shape.axis[2])) == (pytest.approx(RADIUS), pytest.approx(1.0))
        np.testing.assert_allclose(
            np.linalg.norm(middles(mesh, name)[:, :2] - (x, 1.0), axis=1), 0.55, atol=0.06
        )
    assert isinstance(mesh.shapes["top"], Plane)
    both = read(plate, holes=OnCylinder(RADIUS, upwards))
    assert set(np.sign(middles(both, "holes")[:, 0] - 2.0)) == {-1.0, 1.0}


def test_faces_are_chosen_by_a_function_and_by_number(plate: Path) -> None:
    seen: list[CadFace] = []

    def largest(face: CadFace) -> bool:
        seen.append(face)
        return face.kind == "plane" and face.area > 5.0

    mesh = read(plate, faces=largest)
    assert len(seen) == len({face.number for face in seen}) >= 9
    np.testing.assert_allclose(np.abs(middles(mesh, "faces")[:, 2] - 0.5), 0.5)
    (hole,) = [face for face in seen if face.radius is not None and face.centroid[0] < 1.5]
    assert hole.area == pytest.approx(2 * np.pi * RADIUS * HIGH)
    assert "  kind      cylinder" in repr(hole)
    by_number = [read(plate, bore=wanted).surfaces["bore"] for wanted in (hole.number, [str(hole.number)])]
    assert len(by_number[0]) == len(by_number[1]) > 6


def test_what_chooses_nothing_is_told_which_faces_there_are(plate: Path) -> None:
    listed = r": it has 1 \(plane, area 2.* 8 \(cylinder, radius 0.6, area 3.77, centroid \(1, 1, 0.5\)\)"
    for wanted, words in (
        (OnCylinder(0.61), r"on a cylinder of radius 0.61"),
        (
            OnCylinder(0.6, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
            r"radius 0.6 about the axis along \(1.*through \(0",
        ),
        (
            OnPlane((0, 0, 0.5), (0, 0, 1)),
            r"on the plane through \(0, 0, 0.5\) with the normal \(0.0, 0.0, 1",
        ),
        (InBox((0, 0, 0), (1, 1, 1)), r"wholly in the box from \(0, 0, 0\) to \(1, 1, 1\)"),
        (lambda face: False, "chosen by its function"),
        ("bore", "called 'bore'"),
    ):
        with pytest.raises(
            InvalidInputError, match=f"surface 'x' must have a face, none of file .* is .*{words}.*{listed}"
        ):
            read(plate, x=["1", wanted])


def test_a_face_cannot_be_two_surfaces(plate: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"face \d+ of .* cannot be of 'all' and 'hole': it has 1"):
        read(plate, all=InBox((-1, -1, -1), (9, 9, 9)), hole=OnCylinder(0.2))


def test_directions_must_be_directions() -> None:
    with pytest.raises(InvalidInputError, match=r"OnPlane.normal must be 3 finite numbers, not all zero"):
        OnPlane((0, 0, 0), (0, 0, 0))
    with pytest.raises(InvalidInputError, match=r"OnCylinder.axis must be 3 finite numbers, not all zero"):
        OnCylinder(1.0, (0, 0, 0))
    with pytest.raises(InvalidInputError, match=r"OnCylinder.radius must be a number"):
        OnCylinder("wide")  # type: ignore[arg-type]


def test_names_that_gmsh_passes_on_choose_faces(
    plate: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """gmsh 4.8 reads the names of bodies only, newer ones those of faces too."""
    names = "lambda dim, tag: f\"Shapes/solid/{'wall' if dim == 2 and tag < 3 else ''}\""
    changed_gmsh(tmp_path, f"gmsh.model.getEntityName = {names}", monkeypatch)
    mesh = read(plate, wall="wall")
    np.testing.assert_array_equal(mesh.surfaces["wall"], read(plate, other=[1, 2]).surfaces["other"])
    with pytest.raises(
        InvalidInputError, match=r"'floor': it has 1 'wall' .plane, area 2, centroid .0, 1, 0.5"
    ):
        read(plate, floor="floor")


def test_arcs_and_edges_of_a_plane_part(tmp_path: Path) -> None:
    path = tmp_path / "quarter.geo"
    path.write_text(
        'SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 2, 2};\nDisk(2) = {0, 0, 0, 1};\n'
        "BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };\n"
    )
    surfaces = {"arc": OnCylinder(1.0, (0, 0, 1), (0, 0, 0)), "foot": OnPlane((0, 0, 0), (0, 1, 0))}
    (mesh,) = read_cad(path, 0.2, surfaces=surfaces).values()
    np.testing.assert_allclose(mesh.points[mesh.surfaces["foot"]][:, :, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(mesh.points[mesh.surfaces["arc"]], axis=2), 1.0)


@pytest.mark.parametrize(("unit", "factor"), [("(.MILLI.,.METRE.)", 1.0), ("($,.METRE.)", 1e3)])
def test_step_files_come_in_millimetres(plate: Path, tmp_path: Path, unit: str, factor: float) -> None:
    text = plate.read_text()
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    path = tmp_path / "unit.step"
    path.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", f"SI_UNIT{unit}"))
    (mesh,) = read_cad(path, 0.6 * factor, surfaces={"x": OnCylinder(0.2 * factor)}).values()
    assert mesh.points.max() == pytest.approx(factor * WIDE)


def edges(mesh: BodyMesh, name: str) -> np.ndarray:
    places = mesh.points[mesh.surfaces[name]]
    return np.asarray(np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2))


def test_surfaces_and_bodies_have_their_own_sizes(plate: Path, tmp_path: Path) -> None:
    holes = {"fine": (1.0, 1.0, 0.0), "plain": (3.0, 1.0, 0.0)}
    chosen = {name: OnCylinder(RADIUS, point=point) for name, point in holes.items()}
    (mesh,) = read_cad(plate, 0.6, surfaces=chosen, sizes={"fine": 0.1}).values()
    (even,) = read_cad(plate, 0.6, surfaces=chosen).values()
    assert edges(mesh, "fine").mean() == pytest.approx(0.1, rel=0.1)
    np.testing.assert_allclose(edges(mesh, "plain").mean(), edges(even, "plain").mean(), rtol=0.05)
    assert edges(even, "fine").mean() > 0.3
    # A body is coarser than the rest, a curve on its rim finer: the smallest size counts.
    squares = tmp_path / "squares.geo"
    squares.write_text("""
        SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 4, 4}; Rectangle(2) = {5, 0, 0, 4, 4};
        Physical Surface("left") = {1}; Physical Surface("right") = {2};
        Physical Curve("rim") = {5}; Physical Curve("side") = {1};
    """)
    bodies = {"coarse": "right", "other": ["left"]}
    both = read_cad(squares, 0.5, bodies, sizes={"coarse": 2.0, "rim": 0.25})
    assert edges(both["coarse"], "rim").max() == pytest.approx(0.25, rel=0.05)
    assert edges(both["other"], "side").max() == pytest.approx(0.5, rel=0.05)
    far = both["coarse"].points[:, 1] > 3.9
    assert np.diff(np.sort(both["coarse"].points[far, 0])).max() > 1.0


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ({"holes": 0.1}, r"sizes are of bodies and surfaces of .*'hole', got 'holes'"),
        ({"hole": 0.0}, "size of 'hole' must be above zero, got 0.0"),
        ({"hole": "fine"}, "size of 'hole' must be a finite number"),
    ],
)
def test_sizes_are_positive_and_of_what_exists(plate: Path, sizes: Any, words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        read_cad(plate, 0.6, surfaces={"hole": OnCylinder(RADIUS)}, sizes=sizes)


@pytest.fixture(scope="module")
def cubes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two unit cubes that meet in a face, which a STEP file has twice."""
    path = tmp_path_factory.mktemp("cad") / "cubes.step"
    with gmsh_model("cubes") as gmsh:
        for x in (0, 1):
            gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        write(gmsh, path)
    return path


def test_solids_of_a_body_that_share_a_face_are_offered_to_be_joined(cubes: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"'1' and '2' of body 'bar' meet in a face") as error:
        read_cad(cubes, 0.5, bodies={"bar": [1, 2]})
    recipe = re.search(r"join\.geo with (SetFactory.*;) and read that", str(error.value))
    assert recipe is not None
    joined = cubes.with_name("join.geo")
    joined.write_text(recipe[1] + "\n")
    bar = read_cad(joined, 0.5, bodies={"bar": [1, 2]})["bar"]
    assert bar.volume == pytest.approx(2.0)
    assert len(bar.surfaces) == 10  # not the face between the two
    assert len(bar.regions) == 2
    assert len(read_cad(cubes, 0.5)) == 2
