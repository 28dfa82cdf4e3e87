"""Designs in files, STEP among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    RigidPlane,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
    minimize,
    read_cad,
    read_field,
    solve_scene,
    write_vtu,
)
from fenics_contact.design import BundleTrust, MovedSurface, PressureNorm, StrainEnergy
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, block, chain_link, half_disc, side_of
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import CadError, ResultSeries, write_design_table, write_step, write_stl
from fenics_contact.output.cad import fitted, flat_sides
from fenics_contact.output.paraview import StoredFields, fields_of_result, stored_fields
from fenics_contact.readers import OnPlane, gmsh_model
from tests.output.designed_block import lid, variables
from tests.output.states import touching_blocks

RISE = 0.06


def crowned(mesh: BodyMesh) -> BodyMesh:
    """A block of 4 × 2 × 1 whose upper side rises towards x = 0."""
    points = mesh.points.copy()
    points[:, 2] *= 1 + RISE * (1 - (points[:, 0] / 4) ** 2)
    return mesh.moved(points)


def pressed(mesh: BodyMesh) -> Scene:
    """A quarter of a crowned pad under a load that presses it against a rigid plane."""
    return Scene(
        {"pad": Body(mesh, IsotropicElasticity(2.1e4, 0.3))},
        [Support("pad", "x0", (0.0, None, None)), Support("pad", "y0", (None, 0.0, None))],
        [Traction("pad", "z0", (0.0, 0.0, 25.0))],
        [ContactPair(Surface("pad", "z1"), RigidPlane((0, 0, 1 + RISE), (0, 0, -1)))],
    )


def crown(net: tuple[int, int] = (5, 4), cells: tuple[int, int, int] = (16, 8, 5)) -> ShapeProblem:
    scene = pressed(crowned(block((0, 0, 0), (4, 2, 1), cells)))
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF), SurfaceDesign("pad", "z1", net), PressureNorm(p=6.0)
    )


@pytest.mark.slow
@pytest.mark.claim
def test_an_optimised_body_read_back_meshed_and_solved_has_the_same_objective(tmp_path: Path) -> None:
    problem = crown()
    most = np.full((5, 4), 0.05)
    most[-1] = 0.0  # where no symmetry holds the rim
    method = BundleTrust(tolerance=1e-3, max_evaluations=12, raise_on_failure=False)
    result = minimize(problem, np.zeros(20), method, bounds=(-most.ravel(), most.ravel()))
    assert result.value < 0.9 * problem.first.value
    written = write_step(problem, result.x, tmp_path / "pad.step")
    assert written.deviation < 1e-6 * 4
    assert written.sides < 0.1 * np.abs(result.x).max(), "the mesh bulges a little beside the surface"
    assert written.volume == pytest.approx(problem.volume(result.x)[0], rel=1e-3)
    planes = {name: OnPlane((0, 0, 0), np.eye(3)["xyz".index(name[0])]) for name in ("x0", "y0", "z0")}
    found = read_cad(written.path, 0.25, surfaces={**planes, "z1": lambda face: face.lower[2] > 0.9}, order=2)
    (mesh,) = found.values()
    again = problem.objective.value(solve_scene(pressed(mesh), problem.comm), problem.geometry.forms)
    assert again == pytest.approx(result.value, rel=0.01)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_body_read_back_has_the_designed_surface(
    dim: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    problem, alpha = lid(dim), variables(dim)
    written = write_step(problem, alpha, tmp_path / "pad.step")
    (mesh,) = read_cad(written.path, 0.5).values()
    shape = next(one for one in mesh.shapes.values() if type(one).__name__ == "SplinePatch")
    places = np.random.default_rng(0).uniform(0.02, 0.98, (50, dim - 1))
    surface = MovedSurface(problem.designs[0], problem.scene.bodies["pad"].mesh, alpha)
    assert np.abs(shape.distance(surface.before(places))).max() > 0.03
    assert np.abs(shape.distance(surface.after(places))).max() < 1e-7
    assert len(mesh.shapes) == 2 * dim
    assert written.volume == pytest.approx(problem.volume(alpha)[0], rel=4e-3)
    assert mesh.volume == pytest.approx(written.volume, rel=5e-3)
    assert capfd.readouterr().out == "", "OpenCASCADE's statistics are not printed"


@pytest.mark.slow
@pytest.mark.claim
def test_two_ranks_write_the_same_files(mpirun: Callable[..., str], tmp_path: Path) -> None:
    mpirun(Path(__file__).with_name("designs_on_ranks.py"), 2, str(tmp_path / "two"))
    for name, write in (("lid.csv", write_design_table), ("pad.stl", write_stl), ("pad.step", write_step)):
        write(lid(), variables(), tmp_path / "one" / name)
    one, two = ((tmp_path / folder) for folder in ("one", "two"))
    assert (one / "lid.csv").read_text() == (two / "lid.csv").read_text()
    assert (one / "pad.stl").read_bytes()[80:] == (two / "pad.stl").read_bytes()[80:]
    lines = [(folder / "pad.step").read_text().splitlines()[8:] for folder in (one, two)]
    assert len(lines[0]) == len(lines[1]) > 100


def test_a_surface_alone_is_one_face_in_the_unit_that_is_told(tmp_path: Path) -> None:
    written = write_step(lid(), variables(), tmp_path / "lid.step", solid=False, scale=1000.0)
    assert written.volume is None
    with gmsh_model("read") as gmsh:
        gmsh.merge(str(written.path))
        counts = [len(gmsh.model.getEntities(dim)) for dim in range(4)]
        low = gmsh.model.getBoundingBox(-1, -1)
    assert counts == [4, 4, 1, 0]
    assert low[3] - low[0] == pytest.approx(4000.0, rel=1e-6)


def test_a_surface_that_folds_or_that_no_spline_follows_is_refused() -> None:
    mesh = half_disc(2.0, 4, symmetry="")
    surface = MovedSurface(SurfaceDesign("disc", side_of(mesh, "contact"), 1), mesh, np.array([-1.0]))
    fit = fitted(surface, 1e-4)
    assert fit.deviation <= 4e-4
    with pytest.raises(CadError, match=r"folds over itself at s = "):
        fitted(replace(surface, alpha=np.array([-3.0])), 1e-4)
    with pytest.raises(CadError, match=r"129 points along each parameter leave .* the surface has kinks"):
        fitted(surface, 1e-16)


def test_a_body_without_flat_sides_beside_its_surface_is_refused() -> None:
    link = chain_link(LinkShape(n_around=24, n_a=4, n_b=8))
    with pytest.raises(CadError, match=r"its mesh has \d\d\d: write the surfaces alone"):
        flat_sides(link.mesh, link.mesh.points, [link.crown])


def test_a_rim_over_two_flat_sides_is_refused() -> None:
    straight = block((0, 0, 0), (4, 2, 1), (4, 2, 1))
    points = straight.points.copy()
    points[:, 1] -= np.where(points[:, 1] == 0, np.maximum(points[:, 0] - 2, 0) / 4, 0)
    top = side_of(straight, "z1")
    assert len(flat_sides(straight, points, [top])) == 5
    bent = straight.moved(points)
    with pytest.raises(CadError, match="each side of a designed surface must be one edge of a flat side"):
        flat_sides(bent, bent.points, [top])


def test_a_rim_that_leaves_its_flat_side_is_refused(tmp_path: Path) -> None:
    problem = crown((2, 1), (4, 2, 2))
    with pytest.raises(CadError, match=r"must stay within .* of the flat side at it, it leaves it by 0\.0"):
        write_step(problem, np.array([0.0, 0.2]), tmp_path / "pad.step")
    assert not list(tmp_path.iterdir())


def test_sides_that_do_not_enclose_a_body_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fenics_contact.output.cad.flat_sides", lambda *given: flat_sides(*given)[:-1])
    with pytest.raises(CadError, match=r"must enclose it, 4 flat ones and 1 designed .* leave 4 open edges"):
        write_step(lid(), variables(), tmp_path / "pad.step")


def test_the_reason_of_opencascade_is_passed_on(tmp_path: Path) -> None:
    with pytest.raises(
        CadError, match=r"OpenCASCADE must be able to build the sides of a body, it reported: .*"
    ):
        write_step(lid(), variables(), tmp_path / "pad.step", scale=1e-10)


def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidInputError, match=r"a file \.step or \.stp and a scale above zero, got 'a.stl'"
    ):
        write_step(lid(), variables(), tmp_path / "a.stl")


# Designed surfaces as tables and triangles: read back they are the surface.
def table_of(path: Path) -> dict[str, np.ndarray]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    numbers = np.array([line.split(",") for line in lines[1:]], dtype=float)
    return dict(zip(lines[0].split(","), numbers.T, strict=True))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_table_has_the_nodes_as_the_design_moves_them(dim: int, tmp_path: Path) -> None:
    problem, alpha = lid(dim), variables(dim)
    table = table_of(write_design_table(problem, alpha, tmp_path / "lid.csv", length="m"))
    axes, nodes = "xyz"[:dim], problem.designs[0].lattice.nodes
    moved = np.column_stack([table[f"{axis}_moved"] for axis in axes])
    before = np.column_stack([table[axis] for axis in axes])
    assert np.ptp(table["movement"]) > 0.05
    np.testing.assert_allclose(moved, problem.points_of(alpha)["pad"][nodes], atol=1e-14)
    np.testing.assert_allclose(before, problem.scene.bodies["pad"].mesh.points[nodes], atol=1e-14)
    assert "lengths in m," in (tmp_path / "lid.csv").read_text()


def test_a_table_on_lines_of_its_own_lies_on_the_polynomial_of_the_net(tmp_path: Path) -> None:
    path = write_design_table(lid(), variables(), tmp_path / "lid.csv", lines=(7, 3))
    table = table_of(path)
    np.testing.assert_allclose(table["s"], np.repeat(np.arange(7) / 6, 3))
    np.testing.assert_allclose(table["x"], 4 * table["s"], atol=1e-14)
    design = lid().designs[0]
    at_corners = table["movement"][[0, 2, 18, 20]]
    np.testing.assert_allclose(at_corners, variables().reshape(design.counts)[[0, 0, -1, -1], [0, -1, 0, -1]])
    field = read_field(path, "movement")
    np.testing.assert_allclose(field.values, table["movement"])


def test_an_stl_file_is_the_closed_boundary_of_the_moved_body(tmp_path: Path) -> None:
    problem, alpha = lid(cell="tetrahedron"), variables()
    read = meshio.read(write_stl(problem, alpha, tmp_path / "pad.stl"))
    corners = read.points[read.cells_dict["triangle"]].astype(float)
    volume = np.linalg.det(corners).sum() / 6
    assert abs(volume - 8.0) > 1e-3
    assert volume == pytest.approx(problem.volume(alpha)[0], rel=1e-6)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert np.abs(outward.sum(axis=0)).max() < 1e-6, "the boundary is closed"


def test_an_stl_of_hexahedra_has_two_triangles_for_every_facet(tmp_path: Path) -> None:
    read = meshio.read(write_stl(lid(), 0 * variables(), tmp_path / "pad.stl"))
    corners = read.points[read.cells_dict["triangle"]].astype(float)
    assert len(corners) == 2 * 2 * (8 * 4 + 8 * 2 + 4 * 2)
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(8.0)


def test_a_surface_that_two_designs_move_is_refused(tmp_path: Path) -> None:
    mesh = block((0, 0, 0), (4, 2, 1), (16, 4, 4))
    scene = Scene({"pad": Body(mesh, IsotropicElasticity(100.0, 0.3))})
    nets = SurfaceDesign("pad", "z1", net=(3, 3)), SurfaceDesign("pad", "x1", net=(3, 3))
    problem = ShapeProblem(ContactProblem(scene, MPI.COMM_SELF), nets, StrainEnergy())
    alpha = np.zeros(18)
    write_design_table(problem, alpha, tmp_path / "lid.csv")
    alpha[9 + 4] = 0.05
    with pytest.raises(InvalidInputError, match=r"that on 'pad' is moved by 0\.\d+ by another, too"):
        write_design_table(problem, alpha, tmp_path / "lid.csv")


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"there are 1 designs, got number 1: count from 0"):
        write_design_table(lid(), variables(), tmp_path / "lid.csv", design=1)
    with pytest.raises(
        InvalidInputError, match=r"at least 2 lines along each of the 2 parameters, got \(5,\)"
    ):
        write_design_table(lid(), variables(), tmp_path / "lid.csv", lines=(5,))
    with pytest.raises(InvalidInputError, match=r"alpha must have shape \(12,\), got \(3,\)"):
        write_design_table(lid(), np.zeros(3), tmp_path / "lid.csv")
    with pytest.raises(InvalidInputError, match=r"the scene is plane: write its profile"):
        write_stl(lid(2), variables(2), tmp_path / "pad.stl")
    with pytest.raises(InvalidInputError, match=r"one of \['pad'\], which designs move, got 'lid'"):
        write_stl(lid(), variables(), tmp_path / "pad.stl", body="lid")
    assert not list(tmp_path.iterdir())


# Files of fields are read back, those of a series in their order and with their labels.
def test_a_state_is_read_by_body(tmp_path: Path) -> None:
    state = touching_blocks()
    (member,) = stored_fields(write_vtu(state, tmp_path))
    grids = member.read()
    assert list(grids) == ["lower", "upper block"]
    moved = grids["lower"].point_data["displacement"]
    assert np.array_equal(moved, state.gather_displacement("lower"))
    (single,) = stored_fields(tmp_path / "state_lower.vtu")
    assert list(single.read()) == ["state_lower"]


def test_members_of_a_series_come_in_their_order(tmp_path: Path) -> None:
    series = ResultSeries(tmp_path, "history", MPI.COMM_SELF)
    for value, label in ((0.0, "pressed"), (0.5, ""), (1.0, "sheared")):
        series.add(touching_blocks(), value, label)
    write_vtu(touching_blocks(), tmp_path)
    found = fields_of_result(tmp_path)
    assert found == series.path, "a single state comes before a series"
    members = stored_fields(found)
    assert [(member.value, member.label) for member in members] == [
        (0.0, "pressed"),
        (0.5, ""),
        (1.0, "sheared"),
    ]
    assert all(list(member.read()) == ["lower", "upper block"] for member in members)


def test_a_folder_without_fields_has_none(tmp_path: Path) -> None:
    assert fields_of_result(tmp_path) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<VTKFile><Collection>", r"must be a whole .pvd file, got .*: write it again"),
        ("<VTKFile><Collection/></VTKFile>", r"must name at least one file of fields, it names none"),
        ('<VTKFile><DataSet timestep="a" file="b"/></VTKFile>', r"must be a whole .pvd file, got could not"),
        ('<VTKFile><DataSet timestep="1"/></VTKFile>', r"must be a whole .pvd file, got 'file'"),
    ],
)
def test_what_is_no_series_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.pvd").write_text(text)
    with pytest.raises(InvalidInputError, match=message):
        stored_fields(tmp_path / "a.pvd")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"a file of fields must exist, '.*gone.vtm' does not"):
        StoredFields(tmp_path / "gone.vtm").read()
