"""Hyperelastic materials: rubber, compressible and nearly incompressible."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import Body, BodyMesh, ContactProblem, Scene, Support, box_partition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.mechanics import MaterialStep
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    Ogden,
    PlaneStrain,
    StVenantKirchhoff,
)
from fenics_contact.materials.hyperelastic import is_nonlinear, power_sum
from fenics_contact.mesh import quadratic
from tests.materials.bodies import box, in_halves
from tests.materials.deformed import (
    Patch,
    derivative_errors,
    equilibrium,
    patch_of,
    rotation,
    skew_patch,
    smooth_field,
)
from tests.materials.elements import whole
from tests.materials.stretches import EXPONENTS, MODELS, MODULI, Energy, stress

CELLS = ("triangle", "quadrilateral", "tetrahedron", "hexahedron", "tetrahedron10")
RUBBER = NeoHooke(young_modulus=10.0, poisson_ratio=0.3)


@pytest.fixture(scope="module", params=CELLS)
def patch(request: pytest.FixtureRequest) -> Patch:
    return patch_of(Body(skew_patch(request.param), RUBBER))


def test_force_is_the_gradient_of_the_energy_and_stiffness_that_of_the_force(patch: Patch) -> None:
    u = smooth_field(patch.points, 0.2)
    found = patch.at(u)
    assert 0.3 < found.least_jacobian < 0.95
    assert np.abs(found.stiffness - found.stiffness.T).max() < 1e-13 * np.abs(found.stiffness).max()
    in_force, in_stiffness = derivative_errors(patch, u)
    assert in_force < 1e-8
    assert in_stiffness < 1e-8


def test_a_rotation_has_neither_force_nor_energy(patch: Patch) -> None:
    turned = patch.at(patch.deformed(rotation(patch.mesh.components)))
    stretched = patch.at(patch.deformed(1.3 * np.eye(patch.mesh.components)))
    assert np.abs(turned.force).max() < 1e-13 * np.abs(stretched.force).max()
    assert abs(turned.energy) < 1e-13 * stretched.energy
    assert turned.least_jacobian == pytest.approx(1.0, abs=1e-13)


def test_forces_turn_with_a_deformed_body(patch: Patch) -> None:
    dim = patch.mesh.components
    u, Q = smooth_field(patch.points, 0.2), rotation(dim, 1.1)
    straight, turned = patch.at(u), patch.at((patch.points + u) @ Q.T - patch.points)
    assert turned.energy == pytest.approx(straight.energy, rel=1e-12)
    forces = straight.force.reshape(-1, dim) @ Q.T
    np.testing.assert_allclose(turned.force.reshape(-1, dim), forces, atol=1e-12 * np.abs(forces).max())
    assert np.abs(forces - straight.force.reshape(-1, dim)).max() > 0.1 * np.abs(forces).max()


def test_the_undeformed_body_is_linearly_elastic(patch: Patch) -> None:
    found, linear = patch.at(np.zeros(patch.mesh.size)), patch.linear_stiffness()
    assert np.abs(found.force).max() < 1e-14
    assert found.energy == 0.0
    assert np.abs(found.stiffness - linear).max() < 1e-13 * np.abs(linear).max()


def test_small_strains_of_a_neo_hookean_body_are_those_of_hooke(patch: Patch) -> None:
    hooke = (PlaneStrain if patch.mesh.components == 2 else IsotropicElasticity)(10.0, 0.3)
    found, expected = patch.linear_stiffness(), whole(Body(patch.body.mesh, hooke)).stiffness
    assert np.abs(found - expected).max() < 1e-13 * np.abs(found).max()


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral9", "tetrahedron10", "hexahedron"])
def test_the_least_jacobian_of_a_homogeneous_deformation_is_its_determinant(cell: str) -> None:
    mesh = skew_patch(cell)
    patch = patch_of(Body(mesh, RUBBER))
    F = (np.eye(3) + 0.3 * np.sin(np.arange(9.0)).reshape(3, 3))[: mesh.dim, : mesh.dim]
    found = patch.mechanics.jacobians(patch.deformed(F).ravel())
    assert found.min() == pytest.approx(np.linalg.det(F), rel=1e-12)


def test_a_cell_turned_inside_out_shows_in_the_least_jacobian() -> None:
    patch = patch_of(Body(skew_patch("hexahedron"), RUBBER))
    u = np.zeros_like(patch.points)
    u[np.argmax(patch.points[:, 0])] = [-4.0, 0.0, 0.0]
    found = patch.at(u)
    assert found.least_jacobian < 0
    assert np.isnan(found.energy)


def test_linear_materials_beside_a_nonlinear_one_stay_linear() -> None:
    """Each region alone gives what it adds to the whole, which is a sum over cells."""
    mesh = in_halves(skew_patch("tetrahedron"))
    hooke, rubber = IsotropicElasticity(5.0, 0.2), RUBBER
    body = patch_of(Body(mesh, {"left": hooke, "right": rubber}))
    soft = patch_of(Body(mesh, {"left": IsotropicElasticity(1e-9, 0.2), "right": rubber}))
    u = smooth_field(body.points, 0.2)
    left = whole(Body(mesh, {"left": hooke, "right": IsotropicElasticity(1e-9, 0.2)})).stiffness
    mixed, right = body.at(u), soft.at(u)
    assert np.abs(mixed.stiffness - left - right.stiffness).max() < 1e-8
    np.testing.assert_allclose(mixed.force, left @ u.ravel() + right.force, atol=1e-8)
    assert mixed.energy == pytest.approx(u.ravel() @ left @ u.ravel() / 2 + right.energy, abs=1e-8)
    assert 0.1 < right.energy / mixed.energy < 0.9


def test_forms_of_deformations_are_compiled_for_nonlinear_materials_alone() -> None:
    patch = patch_of(Body(skew_patch("triangle"), NeoHooke(1.0, 0.2)))
    kinds = [name[0] for name in patch.forms.compiled]
    assert kinds == ["stiffness", "energy", "internal force", "tangent"]
    patch_of(Body(skew_patch("triangle"), NeoHooke(2.0, 0.4)), patch.forms)
    assert len(patch.forms.compiled) == 4, "numbers are no part of the forms"
    scene = Scene({"body": Body(box("triangle"), PlaneStrain(1.0, 0.2))})
    forms = FormLibrary(MPI.COMM_SELF)
    forms.prepare(scene)
    forms.prepare_mechanics(scene)
    assert [name[0] for name in forms.compiled] == ["stiffness"]


def test_nonlinear_materials_say_so() -> None:
    assert is_nonlinear(RUBBER)
    assert not is_nonlinear(PlaneStrain(1.0, 0.3))


def test_far_from_the_origin_the_response_is_the_same() -> None:
    mesh = skew_patch("hexahedron")
    near, far = (patch_of(Body(mesh.moved(mesh.points + shift), RUBBER)) for shift in (0.0, 1e6))
    u = smooth_field(near.points)
    assert np.abs(near.at(u).force - far.at(u).force).max() < 1e-7 * np.abs(near.at(u).force).max()


# Hyperelastic models against formulas in principal stretches.


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
            r"shear modulus 2 \(c10 \+ c01\) and the bulk modulus must be positive, got -2 .* force",
        ),
        (lambda: MooneyRivlin(1.0, 0.1, 0.0), r"must be positive, got 2.2 and 0: give force"),
        (lambda: Ogden((1.0,), (-2.0,), 5.0), r"shear modulus ½ Σ μ_p α_p and .* got -1 and 5"),
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


# Nearly incompressible bodies: mean dilatations of cells, and Cook's membrane without locking.
SHEAR, BULK = 80.1938, 400_942.0
#: Cook's membrane, force 100: vertical displacement of the upper right corner, after E. A. de Souza Neto et
#: al., Design of simple low order finite elements for large strain analysis of nearly incompressible solids,
#: Int. J. Solids Struct. 33 (1996) 3277-3296. The F-bar elements of that paper, 30 on an edge, give 6.89.
TIP = 6.9


LONG = (pytest.mark.slow, pytest.mark.claim)


@pytest.mark.parametrize(
    "cell",
    [
        "quadrilateral",
        "triangle6",
        "quadrilateral9",
        pytest.param("hexahedron", marks=LONG),
        pytest.param("tetrahedron10", marks=LONG),
        pytest.param("hexahedron27", marks=LONG),
    ],
)
def test_forces_and_tangents_of_mean_dilatations_are_derivatives(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), MooneyRivlin(1.0, 0.5, 1e3, mean_dilatation=True)))
    u = smooth_field(patch.points, 0.2)
    in_force, in_stiffness = derivative_errors(patch, u)
    assert in_force < 1e-8
    assert in_stiffness < 1e-8
    found = patch.at(u).stiffness
    assert np.abs(found - found.T).max() < 1e-13 * np.abs(found).max()


QUADRATIC = ("triangle6", "quadrilateral9", "tetrahedron10", "hexahedron27")
BY_CELLS = {
    "neo-Hooke": NeoHooke(1.0, 0.49, mean_dilatation=True),
    "Mooney-Rivlin": MooneyRivlin(0.2, 0.05, 50.0, mean_dilatation=True),
    "Ogden": Ogden((0.6,), (1.8,), 50.0, mean_dilatation=True),
    "J2": J2Plasticity(1.0, 0.3, 1e-3, 1e-3, mean_dilatation=True),
}
OBLIQUE = np.array([[1.0, 0.2, 0.1], [0.1, 0.9, -0.1], [0.05, 0.1, 1.1]])


def one_cell(cell: str) -> BodyMesh:
    """One oblique cell."""
    linear = cell.rstrip("0123456789")
    mesh = box(linear, (1, 1, 1))
    A = OBLIQUE[: mesh.dim, : mesh.dim]
    nodes, first = np.unique(mesh.cells[0], return_inverse=True)
    alone = BodyMesh(mesh.points[nodes] @ A.T, first.reshape(1, -1))
    return alone if linear == cell else quadratic(alone)


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron", *QUADRATIC])
@pytest.mark.parametrize(
    "material", ["neo-Hooke", "Mooney-Rivlin", "J2", pytest.param("Ogden", marks=pytest.mark.slow)]
)
def test_only_rigid_motions_of_a_cell_are_without_energy(cell: str, material: str) -> None:
    patch = patch_of(Body(one_cell(cell), BY_CELLS[material]))
    stiffness = patch.at(np.zeros(patch.points.shape)).stiffness.toarray()
    stiff = np.linalg.eigvalsh((stiffness + stiffness.T) / 2)
    rigid = 3 if patch.points.shape[1] == 2 else 6
    assert np.abs(stiff[:rigid]).max() < 1e-12 * stiff[-1]
    assert stiff[rigid] > 1e-6 * stiff[-1]


def test_the_dilatation_of_a_hexahedron27_is_linear_and_feels_what_is_conformal() -> None:
    patch = patch_of(Body(one_cell("hexahedron27"), BY_CELLS["Mooney-Rivlin"]))
    x, b = patch.points - patch.points.mean(axis=0), 1e-4 * np.array([0.3, -0.5, 0.8])
    u = 2 * (x @ b)[:, None] * x - (x**2).sum(axis=1)[:, None] * b
    edges = np.diag([2.0, 1.0, 1.0]) @ OBLIQUE.T  # one a row
    moments = np.linalg.det(edges) / 12 * edges.T @ edges
    assert patch.at(u).energy == pytest.approx(50.0 / 2 * 36 * b @ moments @ b, rel=2e-3)


def test_in_a_homogeneous_deformation_the_mean_dilatation_is_the_dilatation() -> None:
    mesh, rubber = skew_patch("hexahedron"), (10.0, 0.499)
    mean, plain = (patch_of(Body(mesh, NeoHooke(*rubber, mean_dilatation=on))) for on in (True, False))
    u = mean.deformed(np.array([[1.2, 0.1, 0.0], [0.0, 0.9, 0.2], [0.1, 0.0, 1.05]]))
    assert mean.at(u).energy == pytest.approx(plain.at(u).energy, rel=1e-12)
    np.testing.assert_allclose(mean.at(u).force, plain.at(u).force, atol=1e-10)
    smooth = smooth_field(mean.points, 0.2)
    assert mean.at(smooth).energy < 0.99 * plain.at(smooth).energy


def test_mean_dilatations_act_where_their_material_is() -> None:
    mesh = in_halves(skew_patch("hexahedron"))
    rubber, hooke = NeoHooke(10.0, 0.49, mean_dilatation=True), IsotropicElasticity(5.0, 0.2)
    mixed, whole = patch_of(Body(mesh, {"left": hooke, "right": rubber})), patch_of(Body(mesh, rubber))
    in_force, in_stiffness = derivative_errors(mixed, smooth_field(mixed.points, 0.2))
    assert max(in_force, in_stiffness) < 1e-8
    right = mixed.points[:, 0] > 1.6
    u = np.where(right[:, None], smooth_field(mixed.points, 0.2), 0.0)
    forces = [patch.at(u).force.reshape(-1, 3)[right] for patch in (mixed, whole)]
    np.testing.assert_allclose(*forces, atol=1e-12)


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_linear_simplices_are_refused(cell: str) -> None:
    message = r"mean_dilatation of MooneyRivlin needs cells .* got \w+, which lock: use hexahedra.*quadratic"
    with pytest.raises(InvalidInputError, match=message):
        Body(skew_patch(cell), MooneyRivlin(1.0, 0.0, 1e3, mean_dilatation=True))
    Body(skew_patch(cell), MooneyRivlin(1.0, 0.0, 1e3))


def cook(cell: str, count: int) -> BodyMesh:
    """Cook's membrane: corners (0, 0), (48, 44), (48, 60), (0, 44)."""
    mesh = rectangle((0, 0), (1, 1), (count, count), cell.rstrip("69"))
    x, y = mesh.points.T
    points = np.stack([48 * x, 44 * x + y * (44 - 28 * x)], axis=1)
    return mesh.moved(points) if cell.rstrip("69") == cell else quadratic(mesh.moved(points))


def tip_of(material: Material, cell: str, count: int, steps: int = 10) -> float:
    """Vertical displacement of the upper right corner under the vertical force 100, by Newton's method."""
    patch = patch_of(Body(cook(cell, count), material))
    x, y = patch.points.T
    free = np.repeat(x > 1e-9, 2)
    load = np.zeros(patch.points.shape)
    loaded = np.flatnonzero(x > 48 - 1e-9)
    edge = loaded[np.argsort(y[loaded])]
    weights = np.ones(len(edge))
    if len(edge) == count + 1:
        weights[[0, -1]] = 0.5
    else:  # Simpson's rule on each edge
        weights[1::2], weights[2:-1:2] = 4, 2
    load[edge, 1] = 100 * weights / weights.sum()
    u = np.zeros(patch.mesh.size)
    for step in range(1, steps + 1):
        u = equilibrium(patch, u, free, load.ravel() * step / steps)
    return float(u.reshape(-1, 2)[edge[-1], 1])


STIFF_RUBBER = MooneyRivlin(SHEAR / 2, 0.0, BULK, mean_dilatation=True)


def test_cooks_membrane_does_not_lock() -> None:
    errors = [abs(tip_of(STIFF_RUBBER, "quadrilateral", count) / TIP - 1) for count in (4, 8, 16)]
    assert errors[1] < 0.05
    assert errors[2] < 0.015
    assert errors[0] > 2 * errors[1] > 4 * errors[2], "it converges"
    assert tip_of(STIFF_RUBBER, "triangle6", 8, 16) == pytest.approx(TIP, rel=0.015)
    assert tip_of(MooneyRivlin(SHEAR / 2, 0.0, BULK), "quadrilateral", 8) < 0.4 * TIP, "points of cells lock"


def test_a_torn_body_of_mean_dilatations_is_in_equilibrium_as_a_whole() -> None:
    mesh = rectangle((0, 0), (2, 1), (8, 4))
    rubber = NeoHooke(3.0, 0.499, mean_dilatation=True)
    supports = [Support("body", "x0"), Support("body", "x1", (0.1, 0.05))]
    problem = ContactProblem(
        Scene({"body": Body(mesh, rubber)}, supports),
        MPI.COMM_SELF,
        partitions={"body": box_partition(mesh, (2, 2))},
        tolerance=1e-9,
    )
    found = problem.solve().gather_displacement("body")
    patch = patch_of(Body(mesh, rubber))
    inside = np.abs(patch.points[:, 0] - 1) < 1 - 1e-9
    force = patch.at(found[patch.mesh.nodes]).force.reshape(-1, 2)
    assert np.abs(force[inside]).max() < 1e-6 * np.abs(force).max()
    assert np.abs(patch.at(0.0 * force).stiffness - patch.linear_stiffness()).max() > 1.0, (
        "not that of points"
    )


def test_tangents_of_cells_that_turn_far_in_one_step_are_finite() -> None:
    """To first order a turn by 120° would make the volume negative."""
    patch = patch_of(Body(skew_patch("quadrilateral"), NeoHooke(10.0, 0.499, mean_dilatation=True)))
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = patch.deformed(np.array([[c, -s], [s, c]])).ravel()
    found = patch.mechanics.at(turned, MaterialStep(origin=np.zeros_like(turned))).stiffness
    np.testing.assert_allclose(found.toarray(), patch.at(turned).stiffness.toarray(), rtol=1e-12)
