"""The energy of the difference for every kind of material, user-written ones included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import ufl
from ufl.domain import extract_unique_domain

from fenics_contact import Scene, Support, ThermalStrain
from fenics_contact._accuracy.discretisation import discretisation_error, moduli
from fenics_contact._fem.forms import FormLibrary
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
from tests.accuracy.fields import estimated, quadratic, scene_of, torn_field, torn_up
from tests.models.bodies import bent, box, in_halves
from tests.models.elements import CELLS, PLANE
from tests.models.materials import LAME, EnergyByEntries, Foundation, FromEnergy, FromStress

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
    return moduli(torn_up(scene).decomposition.forms, material, "hexahedron")


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
