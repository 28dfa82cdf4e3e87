"""Where stiff and soft materials cross, cells become far smaller than elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    Limits,
    RigidSurface,
    Roller,
    Scene,
    Support,
    Traction,
    solve_scene,
    solve_to,
)
from fenics_contact._adaptive.crossings import (
    Crossings,
    around_crossings,
    left_at_crossings,
    refined_at_crossings,
)
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact.gallery import block, rectangle, rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from tests.scenes import AnySupport
from tools.random_scenes.corners import graded


def squares(mesh: BodyMesh, stiffer: float, hard: np.ndarray) -> Body:
    """A body with two Young's moduli."""
    regions = {"hard": np.flatnonzero(hard), "soft": np.flatnonzero(~hard)}
    plain = PlaneStrain if mesh.dim == 2 else IsotropicElasticity
    materials = {"hard": plain(1000.0 * stiffer, 0.3), "soft": plain(1000.0, 0.3)}
    return Body(replace(mesh, regions=regions), materials)


def checkered(mesh: BodyMesh, stiffer: float) -> Body:
    """Squares that cross at the origin."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    return squares(mesh, stiffer, middle[:, 0] * middle[:, 1] > 0.0)


def whole(cell: str = "triangle") -> BodyMesh:
    return rectangle((-1.0, -1.0), (1.0, 1.0), (4, 4), cell)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_crossings_are_where_materials_alternate(cell: str, order: int) -> None:
    mesh = whole(cell) if order == 1 else quadratic(whole(cell))
    body = checkered(mesh, 100.0)
    touching = np.isclose(body.mesh.points[body.mesh.cells], 0.0).all(axis=2).any(axis=1)
    known = (cell, order) != ("quadrilateral", 2)  # these are halved all together
    assert np.array_equal(around_crossings(body), np.flatnonzero(touching & known))
    assert touching.any()


def test_sides_and_corners_of_inclusions_and_materials_alike_are_no_crossings() -> None:
    middle = whole().points[whole().cells].mean(axis=1)
    assert len(around_crossings(checkered(whole(), 9.0))) == 0
    assert len(around_crossings(checkered(whole(), 11.0))) > 0
    assert len(around_crossings(squares(whole(), 100.0, middle[:, 0] > 0.0))) == 0
    assert len(around_crossings(squares(whole(), 100.0, (middle > 0.0).all(axis=1)))) == 0
    assert len(around_crossings(Body(whole(), PlaneStrain(1.0, 0.3)))) == 0
    assert len(around_crossings(checkered(block((-1, -1, 0), (1, 1, 1), (2, 2, 1)), 100.0))) == 0


@pytest.mark.parametrize("contrast", [11.0, 100.0, 1e8])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_exponents_of_squares_that_cross_are_those_of_theory(cell: str, contrast: float) -> None:
    found = Crossings.of(checkered(whole(cell), contrast), ())
    assert found.exponents == pytest.approx([4.0 / np.pi * np.arctan(contrast**-0.5)], rel=1e-3)


def column(contrast: float, cell: str, soft: str) -> Body:
    """Two squares, one on the other, and the left side of each as "low" and "high"."""
    mesh = rectangle((-1.0, -1.0), (0.0, 1.0), (1, 2), cell)
    left = mesh.surfaces["x0"]
    high = mesh.points[left].mean(axis=1)[:, 1] > 0.0
    parts = {**mesh.surfaces, "low": left[~high], "high": left[high]}
    above = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.0
    return squares(replace(mesh, surfaces=parts), contrast, above != (soft == "high"))


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("soft", ["low", "high"])
def test_fixed_surfaces_that_end_at_a_soft_material_beside_a_stiff_one_cross(cell: str, soft: str) -> None:
    body, other = column(100.0, cell, soft), {"low": "high", "high": "low"}[soft]
    rigid: list[AnySupport] = [Support("b", soft), RigidSurface("b", soft, (0.0, 0.0))]
    for support in rigid:
        found = Crossings.of(body, [support])
        assert body.mesh.points[found.nodes] == pytest.approx(np.array([[-1.0, 0.0]]))
        assert found.exponents == pytest.approx([2.0 / np.pi * np.arctan(0.1)], rel=1e-3)
    none: list[AnySupport] = [Support("b", other), Support("b", "x0"), Roller("b", soft), Support("b", "y0")]
    for support in none:
        assert len(Crossings.of(body, [support]).nodes) == 0
    assert len(Crossings.of(column(1.0, cell, soft), rigid).nodes) == 0


@pytest.mark.parametrize("soft", [True, False])
def test_crossings_are_known_where_one_side_has_smaller_cells(soft: bool) -> None:
    body = column(100.0, "quadrilateral", "high")
    scene = Scene({"b": body}, [Support("b", "high")])
    finer = refine_scene(scene, {"b": body.mesh.regions["soft" if soft else "hard"]}).scene
    found = Crossings.of(finer.bodies["b"], scene.supports)
    assert finer.bodies["b"].mesh.hanging
    assert finer.bodies["b"].mesh.points[found.nodes] == pytest.approx(np.array([[-1.0, 0.0]]))


@pytest.mark.parametrize(
    ("cell", "halvings", "width"), [("triangle", 4, 0.5**6), ("quadrilateral", 40, 1e-7)]
)
def test_cells_at_crossings_are_halved_down_to_rounding(cell: str, halvings: int, width: float) -> None:
    scene = Scene({"b": checkered(whole(cell), 100.0)}, [Support("b", "x0")])
    mesh = refined_at_crossings(SceneRefinement(scene, {}), halvings).scene.bodies["b"].mesh
    size = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1).min() / 2.0  # relative to the body
    assert 0.5 * width < size < 1.01 * width
    assert mesh.n_cells < 500


def stretched(body: Body) -> Scene:
    return Scene({"b": body}, [Support("b", "x0")], [Traction("b", "x1", (1.0, 0.0))])


def graded_energy(layers: int, contrast: float) -> float:
    """The energy on quadratic cells that get wider by 2.5 from layer to layer around the crossing."""
    lines = graded(layers, 2.5)(np.array([-1.0, 0.0, 1.0]))
    body = checkered(quadratic(rectangle_lattice([lines, lines])), contrast)
    return float(solve_scene(stretched(body), MPI.COMM_SELF, tolerance=1e-8).energies.strain)


def test_the_energy_of_squares_that_cross_is_within_what_is_stated() -> None:
    """Stated 4.3 % and 7.1 % off while cells at the crossing became smaller at the rate of others."""
    first, second, third = (graded_energy(layers, 100.0) for layers in (6, 9, 12))
    exact = third + (third - second) ** 2 / ((second - first) - (third - second))
    assert exact == pytest.approx(5.885e-4, rel=0.002)  # of meshes by another grading
    found = solve_to(stretched(checkered(whole(), 100.0)), "strain_energy", 0.055, MPI.COMM_SELF)
    assert found.reached
    assert abs(found.value - exact) < 0.5 * found.error
    assert found.levels[-1].unknowns < 3000


def test_the_energy_of_squares_that_cross_at_1000_to_1_is_within_what_is_stated() -> None:
    """Stated 4.7 % and 5 % off while what is missing was that of the last changes.

    Three layers more leave the same ratio of the error, by which even the finest mesh misses 3 %.
    """
    first, second = (graded_energy(layers, 1000.0) for layers in (9, 12))
    left = 2.5 ** (-6.0 * 4.0 / np.pi * np.arctan(1000.0**-0.5))
    exact = second + (second - first) * left / (1.0 - left)
    assert exact == pytest.approx(5.01e-4, rel=0.005)  # of meshes of 15 and 18 layers
    found = solve_to(stretched(checkered(whole(), 1000.0)), "strain_energy", 0.1, MPI.COMM_SELF)
    assert found.reached
    assert abs(found.value - exact) < found.error


def test_the_reason_names_crossings_where_most_of_the_error_lies_there() -> None:
    scene, limits = stretched(checkered(whole(), 1000.0)), Limits(unknowns=1000)
    found = solve_to(scene, "strain_energy", 0.01, MPI.COMM_SELF, limits=limits)
    assert not found.reached
    assert "; most of what is not known lies where stiff and soft materials cross" in found.reason
    mild = stretched(checkered(whole(), 5.0))
    assert "cross" not in solve_to(mild, "strain_energy", 1e-4, MPI.COMM_SELF, limits=limits).reason


def test_what_cells_at_crossings_miss_falls_as_theory_has_it() -> None:
    """By 2^−2α where they are halved, and cells of half the body are 0.25 wide: (1/4)^2α."""
    exponent = 4.0 / np.pi * np.arctan(0.1)
    scene = stretched(checkered(whole("quadrilateral"), 100.0))
    halved = refined_at_crossings(SceneRefinement(scene, {}), 1).scene
    assert left_at_crossings(scene) == pytest.approx(0.25 ** (2.0 * exponent), rel=1e-3)
    assert left_at_crossings(halved) == pytest.approx(0.125 ** (2.0 * exponent), rel=1e-3)
    assert left_at_crossings(stretched(checkered(whole(), 5.0))) == 0.0
