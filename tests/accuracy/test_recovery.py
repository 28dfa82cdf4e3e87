"""Recovered stresses and smooth solutions, of all materials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import ufl
from ufl.domain import extract_unique_domain

from fenics_contact import Body, BodyMesh, Scene, Support, ThermalStrain
from fenics_contact._accuracy.discretisation import discretisation_error, moduli
from fenics_contact._fem.forms import FormLibrary
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, hemisphere, rectangle, rectangle_lattice
from fenics_contact.materials import (
    Elasticity,
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
    strain,
)
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
from tests.accuracy.smooth import PLANE as SMOOTH_PLANE
from tests.accuracy.smooth import Found, mesh_of, solved
from tests.materials.bodies import bent, box, in_halves
from tests.materials.elements import CELLS, PLANE
from tests.materials.materials import LAME, EnergyByEntries, Foundation, FromEnergy, FromStress

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


# The energy of the difference for every kind of material, user-written ones included.
AXES = material_axes((1, 2, 0.5), (0, 1, 1))
WOOD = OrthotropicElasticity((11.0, 0.9, 0.5), (0.37, 0.42, 0.6), (0.7, 0.6, 0.05), AXES)


@dataclass(frozen=True)
class Graded(Elasticity):
    """Stiffer along x: E = E_0 (1 + slope x)."""

    slope: float

    @property
    def parameters(self) -> tuple[float]:
        return (self.slope,)

    def stress(self, u: Any, parameters: Any) -> Any:
        x = ufl.SpatialCoordinate(extract_unique_domain(u))
        return (1 + parameters[0] * x[0]) * (ufl.div(u) * ufl.Identity(len(u)) + 2 * strain(u))


def space_moduli(material: Material) -> np.ndarray:
    scene = scene_of(box("hexahedron", (1, 1, 1)), material)
    (body,) = scene.bodies.values()
    return moduli(torn_up(scene).decomposition.forms, material, body.element)


def test_moduli_of_isotropic_materials_are_those_of_hooke() -> None:
    lame, shear = IsotropicElasticity(1000.0, 0.3).parameters
    one = np.eye(3)
    expected = (
        lame * np.einsum("ki,lj->kilj", one, one)
        + shear * (np.einsum("kl,ij->kilj", one, one) + np.einsum("kj,il->kilj", one, one))
    ).reshape(9, 9)
    np.testing.assert_allclose(space_moduli(IsotropicElasticity(1000.0, 0.3)), expected, atol=1e-9)


def test_springs_that_resist_displacements_add_nothing_to_the_moduli() -> None:
    without, held = (space_moduli(Foundation(springs)) for springs in (1.0, 50.0))
    np.testing.assert_allclose(held, without, atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_models_written_by_users_have_the_estimate_of_those_of_the_package(cell: str) -> None:
    mesh = bent(box(cell))
    field, _ = quadratic(mesh.dim)
    expected = estimated(
        scene_of(mesh, (PlaneStrain if cell in PLANE else IsotropicElasticity)(210.0, 0.3)), field
    )
    assert expected.total > 0.01
    for model in (FromEnergy, FromStress, *([EnergyByEntries] if cell in PLANE else [])):
        found = estimated(scene_of(mesh, model(*LAME)), field)  # type: ignore[abstract]
        np.testing.assert_allclose(found.by_cell("body"), expected.by_cell("body"), rtol=1e-9)


@pytest.mark.parametrize("cell", CELLS)
def test_moduli_that_vary_are_integrated_where_they_are(cell: str) -> None:
    mesh = bent(box(cell))
    field, _ = quadratic(mesh.dim)
    known = estimated(scene_of(mesh, FromStress(1.0, 1.0)), field)
    even = estimated(scene_of(mesh, Graded(0.0)), field)
    np.testing.assert_allclose(even.by_cell("body"), known.by_cell("body"), rtol=1e-9)
    graded = estimated(scene_of(mesh, Graded(2.0)), field)
    middle = mesh.points[mesh.cells].mean(axis=1)[:, 0]
    ratio = graded.by_cell("body") / known.by_cell("body")
    np.testing.assert_allclose(ratio, np.sqrt(1 + 2.0 * middle), rtol=0.05)


def test_what_varies_and_what_does_not_share_a_body() -> None:
    mesh = in_halves(box("quadrilateral"))
    field, _ = quadratic(2)
    alone = estimated(scene_of(mesh, {"left": FromStress(1.0, 1.0), "right": FromStress(2.0, 1.0)}), field)
    mixed = estimated(scene_of(mesh, {"left": Graded(0.0), "right": FromStress(2.0, 1.0)}), field, 3)
    np.testing.assert_allclose(mixed.by_cell("body"), alone.by_cell("body"), rtol=1e-9)


PAIRS: dict[str, list[Any]] = {
    "hexahedron": [WOOD, OrthotropicElasticity((22.0, 1.8, 1.0), (0.37, 0.42, 0.6), (1.4, 1.2, 0.1), AXES)],
    "triangle": [PlaneStress(5.0, 0.3), PlaneStress(10.0, 0.3)],
    "quadrilateral": [OrthotropicPlaneStress((e, e / 2), 0.3, e / 3) for e in (11.0, 22.0)],
}


@pytest.mark.parametrize("cell", PAIRS)
def test_twice_the_moduli_are_twice_the_energy(cell: str) -> None:
    mesh = bent(box(cell))
    field, _ = quadratic(mesh.dim)
    one, two = (estimated(scene_of(mesh, kind), field).total for kind in PAIRS[cell])
    assert one > 1e-3
    assert two == pytest.approx(np.sqrt(2) * one, rel=1e-9)


def test_thermal_strain_is_no_error() -> None:
    mesh = box("hexahedron")
    rollers = [("x0", (0.0, None, None)), ("y0", (None, 0.0, None)), ("z0", (None, None, 0.0))]
    material = IsotropicElasticity(100.0, 0.3, thermal_expansion=1e-3)
    bare = scene_of(mesh, material)
    scene = Scene(bare.bodies, [Support("body", *roller) for roller in rollers], [ThermalStrain("body", 7.0)])
    free = estimated(scene, lambda points: 7e-3 * points)
    bending = estimated(scene, lambda points: 7e-3 * points**2)
    assert free.total < 1e-12 * bending.total


def test_nothing_is_compiled_for_moduli_that_are_constant() -> None:
    field, _ = quadratic(3)
    for material, more in ((WOOD, 0), (Graded(1.0), 1)):
        torn = torn_up(scene_of(box("hexahedron"), material))
        forms: FormLibrary = torn.decomposition.forms
        before = forms.compiled
        for _ in range(2):
            assert discretisation_error(torn, torn_field(torn, field)).total > 0
        assert len(forms.compiled) == len(before) + more


# Effectivity and rate of the estimate where the solution is smooth and known, for every type of cell.
def estimate(found: Found) -> float:
    return discretisation_error(found.state.torn, found.state.conforming_displacement).total


def series(
    cell: str, sizes: Sequence[int], shake: float, poisson: float = 0.3
) -> tuple[np.ndarray, np.ndarray]:
    """Print and return true errors and estimates."""
    states = [solved(mesh_of(cell, n, shake), poisson) for n in sizes]
    error, estimates = np.array([(found.total, estimate(found)) for found in states]).T
    rates = [np.nan, *(np.log(error[:-1] / error[1:]) / np.log(np.divide(sizes[1:], sizes[:-1])))]
    print(f"\n{cell}, inner nodes moved by {shake} cells, ν = {poisson}: cells | error, rate | effectivity")
    for n, e, rate, found in zip(sizes, error, rates, estimates, strict=True):
        print(f"  {n:3d} | {e:.5f} {rate:5.2f} | {found / e:.3f}")
    return error, estimates


@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_is_close_to_the_error_and_falls_at_its_rate(cell: str) -> None:
    sizes = (8, 16) if cell in SMOOTH_PLANE else (4, 8)
    error, found = series(cell, sizes, 0.15)
    assert error[0] > 0.1, "too good to show anything"
    np.testing.assert_allclose(found / error, 1.0, atol=0.06)
    assert np.log2(found[0] / found[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("cell", ["triangle6", "quadrilateral9", "tetrahedron10", "hexahedron27"])
def test_the_estimate_of_quadratic_cells_falls_at_the_rate_of_their_error(cell: str) -> None:
    sizes = (4, 6) if cell in ("tetrahedron10", "hexahedron27") else (6, 12)
    error, found = series(cell, sizes, 0.15)
    np.testing.assert_allclose(found / error, 1.0, atol=0.15)
    assert np.log(error[0] / error[1]) / np.log(sizes[1] / sizes[0]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("cell", CELLS)
def test_cells_have_their_own_share_of_the_error(cell: str) -> None:
    found = solved(mesh_of(cell, 12 if cell in SMOOTH_PLANE else 6, 0.15), parts=2)
    shares = discretisation_error(found.state.torn, found.state.conforming_displacement).by_cell("body")
    assert found.error.max() > 3 * found.error.min(), "cells are too alike to tell them apart"
    assert np.quantile(np.abs(np.log(shares / found.error)), 0.9) < np.log(1.35)
    assert np.corrcoef(shares, found.error)[0, 1] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("shake", [0.0, 0.15])
@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_becomes_exact(cell: str, shake: float) -> None:
    sizes = (4, 8, 16, 32) if cell in SMOOTH_PLANE else (3, 6, 12, 18)
    error, found = series(cell, sizes, shake)
    np.testing.assert_allclose(found / error, 1.0, atol=0.08)
    assert found[-1] / error[-1] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("cell", CELLS)
def test_the_estimate_stays_close_near_incompressibility(cell: str) -> None:
    sizes = (4, 8, 16, 32) if cell in SMOOTH_PLANE else (3, 6, 12)
    error, found = series(cell, sizes, 0.0, 0.499)
    np.testing.assert_allclose(found / error, 1.0, atol=0.08)
