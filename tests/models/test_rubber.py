"""Hyperelastic models against formulas in principal stretches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import ufl
from scipy.optimize import brentq

from fenics_contact import Body
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    Hyperelasticity,
    IsotropicElasticity,
    MooneyRivlin,
    NeoHooke,
    Ogden,
    PlaneStrain,
    StVenantKirchhoff,
)
from fenics_contact.materials.elastic import lame
from fenics_contact.materials.hyperelastic import power_sum
from tests.models.deformed import (
    derivative_errors,
    equilibrium,
    patch_of,
    rotation,
    skew_patch,
    smooth_field,
)
from tests.models.elements import whole

#: Energy density of principal stretches.
Energy = Callable[[np.ndarray], complex]
LAMBDA, MU = lame(10.0, 0.3)
EXPONENTS, MODULI = (1.3, -2.0), (2.0, -0.4)


def volume(x: np.ndarray) -> complex:
    return 12.0 / 2 * (x.prod() - 1) ** 2


def neo_hooke(x: np.ndarray) -> complex:
    log_J = np.log(x.prod())
    return MU / 2 * ((x**2).sum() - 3 - 2 * log_J) + LAMBDA / 2 * log_J**2


def st_venant_kirchhoff(x: np.ndarray) -> complex:
    E = (x**2 - 1) / 2
    return LAMBDA / 2 * E.sum() ** 2 + MU * (E**2).sum()


def mooney_rivlin(x: np.ndarray) -> complex:
    isochoric = (x / x.prod() ** (1 / 3)) ** 2
    return 1.5 * (isochoric.sum() - 3) + 0.5 * ((1 / isochoric).sum() - 3) + volume(x)


def ogden(x: np.ndarray) -> complex:
    isochoric = x / x.prod() ** (1 / 3)
    terms = zip(MODULI, EXPONENTS, strict=True)
    return sum(mu / a * ((isochoric**a).sum() - 3) for mu, a in terms) + volume(x)


MODELS: dict[str, tuple[Hyperelasticity, Energy]] = {
    "NeoHooke": (NeoHooke(10.0, 0.3), neo_hooke),
    "StVenantKirchhoff": (StVenantKirchhoff(10.0, 0.3), st_venant_kirchhoff),
    "MooneyRivlin": (MooneyRivlin(1.5, 0.5, 12.0), mooney_rivlin),
    "Ogden": (Ogden(MODULI, EXPONENTS, 12.0), ogden),
}


def stress(energy: Energy, stretches: np.ndarray, direction: int) -> float:
    """First Piola-Kirchhoff stress along a principal direction, by a complex step."""
    ahead = stretches.astype(complex)
    ahead[direction] += 1e-30j
    return float(np.imag(energy(ahead)) / 1e-30)


def uniaxial(energy: Energy, stretch: float, dim: int) -> tuple[float, float]:
    """Stress and lateral stretch of a bar; in the plane it keeps its width along z."""

    def stretches(lateral: float) -> np.ndarray:
        return np.array([stretch, lateral, lateral if dim == 3 else 1.0])

    lateral = brentq(lambda a: stress(energy, stretches(a), 1), 0.3, 2.0, xtol=1e-15)
    return stress(energy, stretches(lateral), 0), lateral


def check_uniaxial_tests(name: str, dim: int) -> None:
    """Compare one cell with the formulas in tension and compression."""
    material, energy = MODELS[name]
    cell = block((0,) * 3, (1,) * 3, (1,) * 3) if dim == 3 else rectangle((0, 0), (1, 1), (1, 1))
    patch = patch_of(Body(cell, material))
    free = patch.points > 1e-9
    free[:, 0] = False
    for stretch in (0.8, 1.2, 1.5):
        u = np.zeros(patch.points.shape)
        u[:, 0] = (stretch - 1) * patch.points[:, 0]
        found = equilibrium(patch, u.ravel(), free.ravel(), np.zeros(u.size))
        end = patch.points[:, 0] > 0.5
        force = patch.at(found).force.reshape(-1, dim)[end, 0].sum()
        lateral = 1 + found.reshape(-1, dim)[np.argmax(patch.points[:, 1]), 1]
        expected = uniaxial(energy, stretch, dim)
        assert (force, lateral) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", MODELS)
def test_a_bar_in_plane_strain_follows_the_formula_of_its_model(name: str) -> None:
    check_uniaxial_tests(name, 2)


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("name", MODELS)
def test_a_bar_in_space_follows_the_formula_of_its_model(name: str) -> None:
    check_uniaxial_tests(name, 3)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_consistent_derivatives_and_feels_no_rotation(name: str) -> None:
    patch = patch_of(Body(skew_patch("quadrilateral"), MODELS[name][0]))
    stretched = patch.deformed(np.diag([1.8, 1.0]))
    for u in (smooth_field(patch.points, 0.2), smooth_field(patch.points, 1e-6), stretched):
        in_force, in_stiffness = derivative_errors(patch, u)
        assert in_force < (1e-8 if np.abs(u).max() > 1e-3 else 1e-3)
        assert in_stiffness < 1e-8
    turned = patch.at(patch.deformed(rotation(2)))
    assert np.abs(turned.force).max() < 1e-13 * np.abs(patch.at(stretched).force).max()
    assert abs(turned.energy) < 1e-13 * patch.at(stretched).energy


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_isotropic_elasticity_under_small_strains(name: str) -> None:
    material, _ = MODELS[name]
    shear, bulk = 2 * (1.5 + 0.5), 12.0
    if name == "Ogden":
        shear = sum(mu * alpha for mu, alpha in zip(MODULI, EXPONENTS, strict=True)) / 2
    young, poisson = 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
    if name in ("NeoHooke", "StVenantKirchhoff"):
        young, poisson = 10.0, 0.3
    mesh = skew_patch("quadrilateral")
    patch = patch_of(Body(mesh, material))
    expected = whole(Body(mesh, PlaneStrain(young, poisson))).stiffness.toarray()
    for found in (patch.linear_stiffness(), patch.at(np.zeros(patch.mesh.size)).stiffness.toarray()):
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def value(expression: object) -> float:
    return float(ufl.as_ufl(expression)(()))


@pytest.mark.parametrize("power", [0.5, 0.65, 2.5, -1.2, 1.0, -3.0])
@pytest.mark.parametrize(
    "pair", [(1.0, 1.0), (1.0, 1 + 1e-9), (4.0, 0.5), (4.0, 4.0), (0.2, 0.2 + 1e-7), (25.0, 0.2), (1.7, 0.9)]
)
def test_power_sums_are_exact_also_at_equal_numbers(power: float, pair: tuple[float, float]) -> None:
    x = np.array([*pair, 1 / np.prod(pair)])
    first, second = x.sum(), (1 / x).sum()
    found = value(power_sum(ufl.as_ufl(float(first)), ufl.as_ufl(float(second)), power))
    assert found == pytest.approx((x**power).sum(), rel=2e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NeoHooke(-1.0, 0.3), "young_modulus must be a positive number"),
        (lambda: NeoHooke(1.0, 0.5), "poisson_ratio must lie between -1 and 0.5"),
        (lambda: StVenantKirchhoff(1.0, 0.7), "poisson_ratio must lie between -1 and 0.5"),
        (
            lambda: MooneyRivlin(1.0, -2.0, 5.0),
            r"got the shear modulus 2 \(c10 \+ c01\) = -2 .* force per area",
        ),
        (lambda: MooneyRivlin(1.0, 0.1, 0.0), r"bulk_modulus 0: give constants"),
        (lambda: Ogden((1.0,), (-2.0,), 5.0), r"got the shear modulus ½ Σ μ_p α_p = -1"),
        (
            lambda: Ogden((1.0, 2.0), (2.0,), 5.0),
            r"exponents must be 2 finite numbers, got .*: give one μ and",
        ),
        (lambda: Ogden((1.0,), (0.0,), 5.0), r"exponents must not be zero, got \(0.0,\): leave out"),
        (lambda: NeoHooke(1.0, 0.3, "yes"), r"NeoHooke.mean_dilatation must be True or False, got 'yes'"),
    ],
)
def test_constants_out_of_range_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_models_in_space_and_in_the_plane_have_the_same_shear_modulus() -> None:
    material, _ = MODELS["MooneyRivlin"]
    young, poisson = 9 * 12 * 4 / (3 * 12 + 4), (3 * 12 - 2 * 4) / (6 * 12 + 2 * 4)
    mesh = skew_patch("hexahedron")
    expected = whole(Body(mesh, IsotropicElasticity(young, poisson))).stiffness
    assert np.abs(whole(Body(mesh, material)).stiffness - expected).max() < 1e-12 * expected.max()
