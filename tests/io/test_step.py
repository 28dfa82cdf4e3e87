"""Designed bodies as STEP files: read back they have the designed surface, and the same answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

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
    solve_scene,
)
from fenics_contact.design import BundleTrust, MovedSurface, PressureNorm
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, block, chain_link, half_disc, side_of
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import CadError, write_design_table, write_step, write_stl
from fenics_contact.output.cad import fitted, flat_sides
from fenics_contact.readers import OnPlane, gmsh_model
from tests.io.designed_block import lid, variables

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
    with pytest.raises(CadError, match=r"must not fold over itself, it does at s = "):
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
