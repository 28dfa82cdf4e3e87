"""Bodies meshed from CAD keep the true shapes of their surfaces, whichever kernel of gmsh knows these."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import BodyMesh, read_cad
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh import refined
from fenics_contact.readers import OnCylinder, from_gmsh_model, gmsh_model
from fenics_contact.readers.cad_shapes import cad_shapes
from fenics_contact.shapes import Cylinder, Plane, Revolved, Sphere, SurfaceShape, Torus
from fenics_contact.shapes.combined import Joined
from fenics_contact.shapes.simple import closest_points
from tests.shapes.curvatures import principal_curvatures

OFF = (0.1, -0.2, 0.3)


@pytest.fixture
def model() -> Iterator[Any]:
    with gmsh_model("test") as gmsh:
        kept = gmsh.option.getNumber("Mesh.MeshSizeMax")
        yield gmsh
        gmsh.option.setNumber("Mesh.MeshSizeMax", kept)


def meshed(gmsh: Any, size: float, surfaces: dict[str, list[int]] | None = None, dim: int = 3) -> BodyMesh:
    """Mesh the volumes (in the plane, faces) of a model as one body; surfaces go by numbers by default."""
    named = surfaces or {str(tag): [tag] for _, tag in gmsh.model.getEntities(dim - 1)}
    parts = [tag for _, tag in gmsh.model.getEntities(dim)]
    for each, groups in ((dim, {"body": parts}), (dim - 1, named)):
        for name, tags in groups.items():
            gmsh.model.setPhysicalName(each, gmsh.model.addPhysicalGroup(each, tags), name)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(dim)
    return from_gmsh_model()["body"]


def points(shape: SurfaceShape, count: int = 2000, near: float = 0.2) -> np.ndarray:
    x = np.random.default_rng(4).uniform(-2.0, 3.0, (count, shape.dim))  # type: ignore[attr-defined]
    x = x[np.abs(shape.distance(x)) < near]
    assert len(x) > 20
    return x


def require_same(shape: SurfaceShape, exact: SurfaceShape, tolerance: float) -> None:
    x = points(exact)
    np.testing.assert_allclose(shape.distance(x), exact.distance(x), atol=tolerance)
    np.testing.assert_allclose(shape.normals(x), exact.normals(x), atol=10 * tolerance)
    np.testing.assert_allclose(shape.curvatures(x), exact.curvatures(x), atol=100 * tolerance)


def require_on_nodes(mesh: BodyMesh, tolerance: float = 1e-12) -> None:
    for name, facets in mesh.surfaces.items():
        nodes = mesh.points[np.unique(facets)]
        np.testing.assert_allclose(mesh.shapes[name].distance(nodes), 0.0, atol=tolerance)


@pytest.mark.parametrize(
    ("add", "numbers", "exact"),
    [
        ("addTorus", (*OFF, 1.5, 0.4), Torus(OFF, (0, 0, 1), 1.5, 0.4)),
        ("addSphere", (*OFF, 1.1), Sphere(OFF, 1.1)),
        ("addCylinder", (*OFF, 1.0, 2.0, 3.0, 0.8), Cylinder(OFF, (1, 2, 3), 0.8)),
        ("addCone", (0, 0, 0, 0, 0, 2, 1.0, 0.5), Revolved(Plane((1.0, 0.0), (4, 1)), (0, 0, 0), (0, 0, 1))),
    ],
)
def test_round_faces_are_known_again(
    model: Any, add: str, numbers: tuple[float, ...], exact: SurfaceShape
) -> None:
    getattr(model.model.occ, add)(*numbers)
    model.model.occ.synchronize()
    mesh = meshed(model, 0.5)
    require_on_nodes(mesh)
    require_same(mesh.shapes["1"], exact, 1e-12)
    assert type(mesh.shapes["1"]) is type(exact)
    assert all(isinstance(mesh.shapes[name], Plane) for name in mesh.shapes if name != "1")


def test_what_is_cut_out_has_its_normals_point_into_the_hole(model: Any) -> None:
    occ = model.model.occ
    bar = occ.cut([(3, occ.addBox(-1, -1, -1, 2, 2, 2))], [(3, occ.addCylinder(0, 0, -2, 0, 0, 4, 0.5))])
    occ.cut(bar[0], [(3, occ.addSphere(1.2, 0, 0, 0.5))])
    occ.synchronize()
    mesh = meshed(model, 0.4)
    require_on_nodes(mesh)
    hole, dent = [shape for shape in mesh.shapes.values() if not isinstance(shape, Plane)]
    require_same(hole, Cylinder((0, 0, 0), (0, 0, 1), 0.5, hollow=True), 1e-12)
    require_same(dent, Sphere((1.2, 0, 0), 0.5, hollow=True), 1e-12)
    flat = {shape.normal for shape in mesh.shapes.values() if isinstance(shape, Plane)}
    assert {tuple(np.round(normal).astype(int)) for normal in flat} == {
        tuple(sign * row) for row in np.eye(3, dtype=int) for sign in (1, -1)
    }


def test_two_bodies_see_the_face_between_them_from_their_sides(model: Any) -> None:
    occ = model.model.occ
    occ.fragment([(3, occ.addBox(-1, -1, 0, 2, 2, 1))], [(3, occ.addCylinder(0, 0, 0, 0, 0, 1, 0.5))])
    occ.synchronize()
    for (_, tag), name in zip(model.model.getEntities(3), ("pin", "plate"), strict=True):
        model.model.setPhysicalName(3, model.model.addPhysicalGroup(3, [tag]), name)
    round_ones = [tag for _, tag in model.model.getEntities(2) if model.model.getType(2, tag) == "Cylinder"]
    model.model.setPhysicalName(2, model.model.addPhysicalGroup(2, round_ones), "between")
    model.option.setNumber("Mesh.MeshSizeMax", 0.3)
    model.model.mesh.generate(3)
    bodies = from_gmsh_model()
    x = np.array([[0.2, 0.0, 0.5], [0.9, 0.0, 0.5]])
    pin, plate = bodies["pin"], bodies["plate"]
    if pin.volume > plate.volume:
        pin, plate = plate, pin
    np.testing.assert_allclose(pin.shapes["between"].distance(x), [-0.3, 0.4], atol=1e-12)
    np.testing.assert_allclose(plate.shapes["between"].distance(x), [0.3, -0.4], atol=1e-12)


def test_several_faces_are_one_surface(model: Any) -> None:
    """Side and ends of a cylinder: the distance is that from the nearest, beside a ridge from one of both."""
    model.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1.0)
    model.model.occ.synchronize()
    mesh = meshed(model, 0.25, {"all": [1, 2, 3]})
    shape = mesh.shapes["all"]
    assert isinstance(shape, Joined)
    require_on_nodes(mesh)
    x = np.random.default_rng(5).uniform(-1.5, 2.5, (4000, 3))
    radial, axial = np.hypot(x[:, 0], x[:, 1]) - 1.0, np.abs(x[:, 2] - 1.0) - 1.0
    beside = (radial > 0) & (axial > 0)
    assert beside.sum() > 100
    inside_of_one = np.maximum(radial, axial)
    found = shape.distance(x)
    np.testing.assert_allclose(found[~beside], inside_of_one[~beside], atol=1e-12)
    assert (found[beside] > 0).all()
    near = beside & (inside_of_one > 0.02) & (inside_of_one < 0.3)
    np.testing.assert_allclose(found[near], inside_of_one[near], atol=1e-2)
    sides = shape.normals(np.array([[1.1, 0.0, 1.0], [0.1, 0.2, 2.2], [0.1, 0.2, -0.2]]))
    np.testing.assert_allclose(sides, [[1, 0, 0], [0, 0, 1], [0, 0, -1]], atol=1e-12)
    other_way_round = Joined(shape.shapes, [part[:, ::-1] for part in shape.facets])
    np.testing.assert_array_equal(other_way_round.distance(x), found)
    bend = shape.curvatures(np.array([[1.0, 0.0, 1.0], [0.1, 0.2, 2.0]]))
    np.testing.assert_allclose(bend, [np.diag([0.0, 1.0, 0.0]), np.zeros((3, 3))], atol=1e-12)


def test_closed_faces_have_no_border(model: Any) -> None:
    occ = model.model.occ
    occ.cut([(3, occ.addSphere(0, 0, 0, 1))], [(3, occ.addSphere(0.1, 0, 0, 0.5))])
    occ.synchronize()
    faces = [tag for _, tag in model.model.getEntities(2)]
    shell = meshed(model, 0.3, {"both": faces}).shapes["both"]
    x = np.random.default_rng(7).uniform(-1.0, 1.0, (500, 3))
    outer, inner = np.linalg.norm(x, axis=1) - 1.0, 0.5 - np.linalg.norm(x - [0.1, 0.0, 0.0], axis=1)
    np.testing.assert_allclose(shell.distance(x), np.where(-outer < np.abs(inner), outer, inner), atol=1e-12)


def test_halves_of_one_face_are_one_shape(model: Any) -> None:
    occ = model.model.occ
    occ.fragment([(3, occ.addTorus(0, 0, 0, 1.5, 0.4))], [(2, occ.addDisk(0, 0, 0.1, 3, 3))])
    occ.synchronize()
    occ.remove([(2, tag) for _, tag in occ.getEntities(2) if not model.model.getAdjacencies(2, tag)[0].size])
    occ.synchronize()
    tubes = [tag for _, tag in model.model.getEntities(2) if model.model.getType(2, tag) == "Torus"]
    assert len(tubes) > 1
    mesh = meshed(model, 0.3, {"tube": tubes})
    require_same(mesh.shapes["tube"], Torus((0, 0, 0), (0, 0, 1), 1.5, 0.4), 1e-12)
    assert isinstance(mesh.shapes["tube"], Torus)


def test_a_free_form_face_is_a_spline_also_at_its_poles(model: Any) -> None:
    axes = np.array([1.0, 0.7, 0.5])
    ball = model.model.occ.addSphere(0, 0, 0, 1)
    model.model.occ.dilate([(3, ball)], 0, 0, 0, *axes)
    model.model.occ.synchronize()
    mesh = meshed(model, 0.2, {"egg": [tag for _, tag in model.model.getEntities(2)]})
    egg = mesh.shapes["egg"]
    x = np.random.default_rng(6).normal(size=(300, 3))
    x = axes * np.vstack([x / np.linalg.norm(x, axis=1)[:, None], [[0, 0, 1], [0, 0, -1], [1e-6, 0, 1]]])
    normals = x / axes**2 / np.linalg.norm(x / axes**2, axis=1)[:, None]
    for height in (-0.05, 0.0, 0.2):
        there = x + height * normals
        np.testing.assert_allclose(egg.distance(there), height, atol=2e-6)
        np.testing.assert_allclose(egg.normals(there), normals, atol=5e-4)
    ends = principal_curvatures(egg, np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, -0.7, 0.0]]))
    a, b, c = axes
    np.testing.assert_allclose(
        ends, [[c / a**2, c / b**2], [a / b**2, a / c**2], [b / a**2, b / c**2]], rtol=2e-3
    )
    np.testing.assert_allclose(egg.distance(closest_points(egg, x + 0.2)), 0.0, atol=1e-12)


def test_a_free_form_hole_is_a_spline_inside_out(model: Any) -> None:
    ball = model.model.occ.addSphere(0, 0, 0, 1)
    model.model.occ.dilate([(3, ball)], 0, 0, 0, 1.0, 0.7, 0.5)
    model.model.occ.cut([(3, model.model.occ.addBox(-2, -2, -2, 4, 4, 4))], [(3, ball)])
    model.model.occ.synchronize()
    faces = [tag for _, tag in model.model.getEntities(2) if model.model.getType(2, tag) != "Plane"]
    hole = meshed(model, 0.4, {"hole": faces}).shapes["hole"]
    x = np.array([[0.0, 0.0, 0.6], [1.2, 0.0, 0.0], [0.0, 0.6, 0.0]])
    np.testing.assert_allclose(hole.distance(x), [-0.1, -0.2, 0.1], atol=2e-6)
    np.testing.assert_allclose(hole.normals(x), -np.eye(3)[[2, 0, 1]], atol=5e-4)


def test_a_step_file_keeps_its_shapes(model: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    occ = model.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 4, 3, 1))], [(3, occ.addCylinder(2, 1, 0, 0, 0, 1, 0.6))])
    occ.synchronize()
    path = tmp_path / "plate.step"
    model.write(str(path))
    capfd.readouterr()  # the library that writes STEP files talks
    (plate,) = read_cad(path, 0.5).values()
    assert plate.volume == pytest.approx(12 - 0.36 * np.pi, rel=0.05)
    (hole,) = [name for name, shape in plate.shapes.items() if isinstance(shape, Cylinder)]
    assert len(plate.shapes) == len(plate.surfaces) == 7
    require_on_nodes(plate)
    require_same(plate.shapes[hole], Cylinder((2, 1, 0), (0, 0, 1), 0.6, hollow=True), 1e-9)
    (again,) = read_cad(path, 0.5, surfaces={"bore": [hole]}).values()
    assert set(again.shapes) == {"bore"}
    edges = np.linalg.norm(again.points[again.cells[:, 1]] - again.points[again.cells[:, 0]], axis=1)
    assert edges.max() < 1.0
    with pytest.raises(
        InvalidInputError, match=r"surface 'bore' must have a face, .* 'none': it has 1 \(plane, area"
    ):
        read_cad(path, 0.5, surfaces={"bore": ["none"]})


@pytest.mark.parametrize("order", [1, 2])
def test_quadratic_cells_are_curved_like_the_model(model: Any, tmp_path: Path, order: int) -> None:
    occ = model.model.occ
    occ.cut([(3, occ.addBox(-3, -3, 0, 6, 6, 2))], [(3, occ.addCylinder(0, 0, -1, 0, 0, 4, 1))])
    occ.synchronize()
    path = tmp_path / "plate.brep"
    model.write(str(path))
    (mesh,) = read_cad(path, 1.5, surfaces={"bore": OnCylinder(1.0)}, order=order).values()
    assert mesh.order == order
    require_on_nodes(mesh)
    error = abs(mesh.volume / (72 - 2 * np.pi) - 1)
    assert error < 2e-4 if order == 2 else error > 2e-3
    if order == 2:
        assert mesh.surfaces["bore"].shape[1] == 6
        with pytest.raises(InvalidInputError, match="order must be 1 or 2, got 3: linear or quadratic cells"):
            read_cad(path, 1.5, order=3)


GEO = """
lc = 0.2;
Point(1) = {0, 0, 0, lc}; Point(2) = {1, 0, 0, lc}; Point(3) = {0, 1, 0, lc};
Point(4) = {2, 0, 0, lc}; Point(5) = {0, 2, 0, lc};
Circle(1) = {2, 1, 3}; Circle(2) = {4, 1, 5}; Line(3) = {2, 4}; Line(4) = {3, 5};
Curve Loop(1) = {3, 2, -4, -1};
Plane Surface(1) = {1};
"""
PLANE = 'Physical Surface("body") = {1}; Physical Curve("inner") = {1}; Physical Curve("outer") = {2};\n'
SPACE = """
out[] = Extrude {0, 0, 0.5} { Surface{1}; Layers{3}; };
Physical Volume("body") = {out[1]};
Physical Surface("inner") = {out[5]}; Physical Surface("outer") = {out[3]};
Physical Surface("top") = {out[0]};
"""


def test_arcs_of_the_built_in_kernel_are_circles_in_the_plane(tmp_path: Path) -> None:
    path = tmp_path / "quarter.geo"
    path.write_text(GEO + PLANE)
    mesh = read_cad(path)["body"]
    require_on_nodes(mesh)
    require_same(mesh.shapes["inner"], Sphere((0.0, 0.0), 1.0, hollow=True), 1e-12)
    require_same(mesh.shapes["outer"], Sphere((0.0, 0.0), 2.0), 1e-12)
    assert set(mesh.shapes) == {"inner", "outer"}


def test_other_ranks_receive_the_shapes(tmp_path: Path) -> None:
    path = tmp_path / "quarter.geo"
    path.write_text(GEO + PLANE)
    alone, sent = read_cad(path)["body"], read_cad(path, comm=MPI.COMM_SELF)["body"]
    assert len(sent.shapes) == 2
    assert sent.shapes == alone.shapes


def test_extruded_arcs_of_the_built_in_kernel_are_cylinders(tmp_path: Path) -> None:
    path = tmp_path / "quarter.geo"
    path.write_text(GEO + SPACE)
    mesh = read_cad(path)["body"]
    require_on_nodes(mesh, 1e-8)
    require_same(mesh.shapes["inner"], Cylinder((0, 0, 0), (0, 0, 1), 1.0, hollow=True), 1e-7)
    require_same(mesh.shapes["outer"], Cylinder((0, 0, 0), (0, 0, 1), 2.0), 1e-7)
    require_same(mesh.shapes["top"], Plane((0, 0, 0.5), (0, 0, 1)), 1e-12)


def test_curves_of_a_plane_part(model: Any) -> None:
    """An ellipse, which is a spline, and a disc cut out of it."""
    occ = model.model.occ
    occ.cut([(2, occ.addDisk(0, 0, 0, 2, 1))], [(2, occ.addDisk(0.2, 0.1, 0, 0.5, 0.5))])
    occ.synchronize()
    mesh = meshed(model, 0.1, dim=2)
    require_on_nodes(mesh, 1e-9)
    hole, oval = sorted(mesh.shapes.values(), key=lambda shape: type(shape).__name__)
    require_same(hole, Sphere((0.2, 0.1), 0.5, hollow=True), 1e-12)
    angle = np.linspace(0.0, 7.0, 100)
    x = np.column_stack([2 * np.cos(angle), np.sin(angle)])
    normals = x / [4.0, 1.0] / np.linalg.norm(x / [4.0, 1.0], axis=1)[:, None]
    np.testing.assert_allclose(oval.distance(x + 0.1 * normals), 0.1, atol=1e-9)
    np.testing.assert_allclose(oval.normals(x), normals, atol=1e-6)
    np.testing.assert_allclose(principal_curvatures(oval, x[:1]), [[2.0]], rtol=1e-4)


def test_shapes_need_gmsh_no_more_and_can_be_sent(tmp_path: Path) -> None:
    with gmsh_model("test") as gmsh:
        ball = gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.dilate([(3, ball)], 0, 0, 0, 1, 0.7, 0.5)
        gmsh.model.occ.addCylinder(3, 0, 0, 0, 0, 1, 0.5)
        gmsh.model.occ.synchronize()
        for (_, tag), name in zip(gmsh.model.getEntities(3), ("egg", "can"), strict=True):
            gmsh.model.setPhysicalName(3, gmsh.model.addPhysicalGroup(3, [tag]), name)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], 5)
        gmsh.model.mesh.generate(3)
        bodies = from_gmsh_model()
        plain = from_gmsh_model(shapes=False)
    assert [dict(body.shapes) for body in plain.values()] == [{}, {}]
    x = np.random.default_rng(1).uniform(-2.0, 4.0, (50, 3))
    assert isinstance(bodies["can"].shapes["5"], Joined)
    for body in bodies.values():
        shape = body.shapes["5"]
        before = shape.distance(x)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(shape)).distance(x), before)
        nodes = body.points[np.unique(body.surfaces["5"])]
        np.testing.assert_allclose(shape.distance(nodes), 0.0, atol=1e-5)


def test_what_the_model_does_not_have_is_named(model: Any) -> None:
    model.model.occ.addSphere(0, 0, 0, 1)
    model.model.occ.synchronize()
    mesh = meshed(model, 0.5, {"skin": [1]})
    assert isinstance(cad_shapes(mesh, {"skin": "skin"})["skin"], Sphere)
    with pytest.raises(
        InvalidInputError,
        match=r"^surface 'skin' needs physical group 'peel', the model has 'skin'",
    ):
        cad_shapes(mesh, {"skin": "peel"})
    with pytest.raises(InvalidInputError, match=r"^cad_shapes names surface 'core', the body has \['skin'\]"):
        cad_shapes(mesh, {"core": "skin"})
    assert cad_shapes(mesh.moved(1.1 * mesh.points)) == {}
    tags, places, _ = model.model.mesh.getNodes()
    for tag, place in zip(tags, places.reshape(-1, 3), strict=True):
        model.model.mesh.setNode(tag, 1.1 * place, [])
    assert dict(from_gmsh_model()["body"].shapes) == {}, "the mesh has left the geometry"


def test_a_model_without_geometry_has_no_shapes(model: Any, tmp_path: Path) -> None:
    model.model.occ.addSphere(0, 0, 0, 1)
    model.model.occ.synchronize()
    meshed(model, 0.5, {"skin": [1]})
    path = tmp_path / "ball.msh"
    model.write(str(path))
    with gmsh_model("mesh alone") as gmsh:
        gmsh.merge(str(path))
        body = from_gmsh_model()["body"]
    assert set(body.surfaces) == {"skin"}
    assert dict(body.shapes) == {}


def test_without_a_model_it_is_said_what_is_needed() -> None:
    with pytest.raises(
        InvalidInputError, match=r"^cad_shapes needs a model in memory, gmsh is not initialised"
    ):
        cad_shapes(block((0, 0, 0), (1, 1, 1), (1, 1, 1)))


def test_what_is_no_cad_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"there must be a file '.*none.step', there is none"):
        read_cad(tmp_path / "none.step")
    for name, message in (
        ("beam.msh", "must be a CAD file, .step, .*: read a mesh with `read_msh`"),
        ("beam.step", "must be one that gmsh can read and mesh, it says: .*: open it in gmsh"),
    ):
        (tmp_path / name).write_text("nothing")
        with pytest.raises(InvalidInputError, match=message):
            read_cad(tmp_path / name)
    with pytest.raises(InvalidInputError, match="size must be above zero, got -1"):
        read_cad(tmp_path / "beam.step", -1)


def test_a_surface_of_several_faces_is_refined_as_its_faces_are(model: Any) -> None:
    """Beside a ridge the middle of a coarse facet may be nearer to the next face than to its own."""
    occ = model.model.occ
    bar = occ.addCylinder(-1.2, 0.0, 0.0, 2.4, 0.0, 0.0, 0.35)
    occ.fuse([(3, occ.addCylinder(0.0, 0.0, -1.0, 0.0, 0.0, 2.0, 0.5))], [(3, bar)])
    occ.synchronize()
    mesh = meshed(model, 0.9)
    names = list(mesh.shapes)
    shape = Joined(
        [mesh.shapes[name] for name in names], [mesh.points[mesh.surfaces[name]] for name in names]
    )
    skin = np.concatenate([mesh.surfaces[name] for name in names])
    joined = BodyMesh(mesh.points, mesh.cells, {"skin": skin}, shapes={"skin": shape})
    marked = np.random.default_rng(1).choice(mesh.n_cells, mesh.n_cells // 8, replace=False)
    fine, same = refined(mesh, marked).mesh, refined(joined, marked).mesh
    np.testing.assert_allclose(same.points, fine.points, atol=1e-9)
    for name, facets in fine.surfaces.items():
        np.testing.assert_allclose(mesh.shapes[name].distance(fine.points[np.unique(facets)]), 0.0, atol=1e-7)
