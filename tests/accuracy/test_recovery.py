"""The recovered gradient: exact where it should be, on any mesh; zero estimates where nothing is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import Body, BodyMesh, Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, hemisphere, rectangle, rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic as quadratic_cells
from tests.accuracy.fields import (
    cubic,
    estimated,
    linear,
    norm,
    quadratic,
    recovered,
    scene_of,
    steel,
    torn_field,
    torn_up,
)
from tests.models.bodies import bent, box, in_halves
from tests.models.elements import CELLS

MESHES: dict[str, Callable[[], BodyMesh]] = {
    **{f"bent {cell}": lambda cell=cell: bent(box(cell, (4, 3, 3))) for cell in CELLS},
    "half ball": lambda: hemisphere(1.0, 4),
    "half disc": lambda: half_disc(1.0, 6),
    "thin plate": lambda: block((0, 0, 0), (1000, 1000, 1), (6, 6, 3)),
    "graded": lambda: rectangle_lattice([np.cumsum(3.0 ** np.arange(7)), np.linspace(0, 1, 5)]),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_linear_displacement_has_no_error_on_any_mesh(name: str) -> None:
    mesh = MESHES[name]()
    field, slope = linear(mesh.dim)
    torn = torn_up(scene_of(mesh), 2)
    size = norm(torn, torn_field(torn, field))
    assert size > 0.01 * np.abs(slope).max()
    found = estimated(scene_of(mesh), field, 2)
    assert found.total < 1e-9 * size
    assert found.by_cell("body").shape == (mesh.n_cells,)


@pytest.mark.parametrize("name", MESHES)
def test_the_recovered_gradient_of_a_quadratic_displacement_is_exact_at_every_node(name: str) -> None:
    mesh = MESHES[name]()
    field, gradient = quadratic(mesh.dim)
    sites, found = recovered(scene_of(mesh), field, 2)
    expected = gradient(sites.points)
    assert sites.count == mesh.n_nodes
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
    assert estimated(scene_of(mesh), field).total > 1e-3, "the cells cannot follow"


@pytest.mark.parametrize("name", [f"bent {cell}" for cell in ("triangle", "quadrilateral", "hexahedron")])
def test_on_quadratic_cells_the_recovered_gradient_of_a_cubic_displacement_is_exact(name: str) -> None:
    mesh = quadratic_cells(MESHES[name]())
    assert mesh.order == 2
    field, gradient = cubic(mesh.dim)
    sites, found = recovered(scene_of(mesh), field, 2)
    expected = gradient(sites.points)
    assert sites.count == mesh.n_nodes
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
    assert estimated(scene_of(mesh), field).total > 1e-4, "the cells cannot follow"
    straight, _ = quadratic(mesh.dim)
    assert estimated(scene_of(mesh), straight).total < 1e-3 * estimated(scene_of(mesh), field).total


def test_bodies_of_linear_and_of_quadratic_cells_have_estimates_side_by_side() -> None:
    low, high = rectangle((0, 0), (2, 1), (6, 4)), rectangle((0, 1), (2, 2), (5, 3))
    bodies = {"low": Body(quadratic_cells(low), steel(2)), "high": Body(high, steel(2))}
    field, _ = cubic(2)
    alone = {name: estimated(Scene({name: body}), field, 2).by_body[name] for name, body in bodies.items()}
    found = estimated(Scene(bodies), field, 3)
    assert found.by_body == pytest.approx(alone, rel=1e-9)
    assert found.by_cell("low").shape == (24,)
    assert np.linalg.norm(found.by_cell("low")) == pytest.approx(alone["low"])


def test_a_mesh_with_one_layer_of_cells_still_recovers_what_its_nodes_tell() -> None:
    mesh = rectangle((0, 0), (6, 1), (12, 1))
    sites, found = recovered(
        scene_of(mesh), lambda p: np.stack([-p[:, 0] * p[:, 1], p[:, 0] ** 2 / 2], axis=1)
    )
    x, y = sites.points.T
    expected = np.stack([np.stack([-y, -x], axis=1), np.stack([x, 0 * x], axis=1)], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("cell", CELLS)
def test_a_body_of_one_cell_tells_nothing(cell: str) -> None:
    mesh = box(cell, (1, 1, 1))
    one = BodyMesh(mesh.points[mesh.cells[0]], np.arange(mesh.cells.shape[1])[None])
    scene, (field, _) = Scene({"body": Body(one, steel(one.dim))}), quadratic(one.dim)
    found, torn = estimated(scene, field), torn_up(scene)
    assert one.n_cells == 1
    assert np.isfinite(found.total)
    assert found.total < 1e-2 * norm(torn, torn_field(torn, field))


def test_a_body_at_rest_and_one_that_moves_rigidly_have_no_error() -> None:
    scene = scene_of(bent(box("hexahedron")))
    assert estimated(scene, np.zeros_like).total == 0.0
    turn = np.array([[0.0, -0.2, 0.1], [0.2, 0.0, -0.3], [-0.1, 0.3, 0.0]])
    found = estimated(scene, lambda points: points @ turn.T + 10.0)
    strained = estimated(scene, lambda points: points**2 @ turn.T)
    assert found.total < 1e-12 * strained.total


def test_strains_may_jump_where_materials_meet() -> None:
    mesh = in_halves(rectangle((0, 0), (2, 1), (8, 4)))
    soft, stiff = PlaneStrain(10.0, 0.0), PlaneStrain(1000.0, 0.0)

    def kinked(points: np.ndarray) -> np.ndarray:
        x = points[:, 0] - 1.0
        return np.stack([np.where(x < 0, 0.1 * x, 0.001 * x), 0 * x], axis=1)

    apart = estimated(scene_of(mesh, {"left": soft, "right": stiff}), kinked, 3)
    alike = estimated(scene_of(mesh, {"left": soft, "right": soft}), kinked, 3)
    assert apart.total < 1e-10 * alike.total
    assert alike.total > 0.01


def test_the_estimate_is_independent_of_units_and_directions() -> None:
    mesh = bent(box("tetrahedron", (3, 2, 2)))
    field, _ = quadratic(3)
    known = estimated(scene_of(mesh), field)
    far = replace(mesh, points=1e3 * mesh.points)
    found = estimated(scene_of(far, IsotropicElasticity(1e-3, 0.3)), lambda p: 1e3 * field(p / 1e3))
    # Energies count force · length: moduli times 1e-6, volumes times 1e9.
    assert found.total == pytest.approx(known.total * np.sqrt(1e3), rel=1e-9)
    turn, _ = np.linalg.qr(np.cos(np.arange(9.0)).reshape(3, 3))
    turn *= np.sign(np.linalg.det(turn))
    turned = replace(mesh, points=mesh.points @ turn.T)
    found = estimated(scene_of(turned), lambda p: field(p @ turn) @ turn.T)
    np.testing.assert_allclose(found.by_cell("body"), known.by_cell("body"), rtol=1e-9)


def test_a_pure_rotation_leaves_no_energy_below_zero() -> None:
    scene = scene_of(bent(box("tetrahedron")))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for size in (1e-3, 1.0, 1e3):
        parts = estimated(scene, lambda points, size=size: size * points @ turn.T).by_cell("body")
        assert np.all(np.isfinite(parts))
        assert parts.max() < 1e-9 * size


def test_an_unknown_body_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"body must be one of \['body'\], got 'wheel': take a name"):
        estimated(scene_of(box("triangle")), np.zeros_like).by_cell("wheel")


def test_parts_add_up_and_do_not_depend_on_the_partition() -> None:
    soft = box("tetrahedron", (3, 2, 2))
    scene = Scene({"a": Body(bent(box("hexahedron")), steel(3)), "b": Body(bent(soft), steel(3))})
    field, _ = quadratic(3)
    whole, cut = estimated(scene, field), estimated(scene, field, 3)
    assert set(whole.by_body) == {"a", "b"}
    assert whole.total == pytest.approx(np.hypot(*whole.by_body.values()), rel=1e-12)
    for name, share in whole.by_body.items():
        assert share > 0.1 * whole.total
        assert share == pytest.approx(np.linalg.norm(whole.by_cell(name)), rel=1e-12)
        np.testing.assert_allclose(cut.by_cell(name), whole.by_cell(name), rtol=1e-8)
