"""Hyperelastic materials: forces, tangents and energies of distorted patches."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene
from fenics_contact._fem.forms import FormLibrary
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.materials.hyperelastic import is_nonlinear
from tests.models.bodies import box, in_halves
from tests.models.deformed import (
    Patch,
    derivative_errors,
    patch_of,
    rotation,
    skew_patch,
    smooth_field,
)
from tests.models.elements import whole

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
    turned = patch.at(patch.deformed(rotation(patch.mesh.dim)))
    stretched = patch.at(patch.deformed(1.3 * np.eye(patch.mesh.dim)))
    assert np.abs(turned.force).max() < 1e-13 * np.abs(stretched.force).max()
    assert abs(turned.energy) < 1e-13 * stretched.energy
    assert turned.least_jacobian == pytest.approx(1.0, abs=1e-13)


def test_forces_turn_with_a_deformed_body(patch: Patch) -> None:
    dim = patch.mesh.dim
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
    hooke = (PlaneStrain if patch.mesh.dim == 2 else IsotropicElasticity)(10.0, 0.3)
    found, expected = patch.linear_stiffness(), whole(Body(patch.body.mesh, hooke)).stiffness
    assert np.abs(found - expected).max() < 1e-13 * np.abs(found).max()


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral9", "tetrahedron10", "hexahedron"])
def test_the_least_jacobian_of_a_homogeneous_deformation_is_its_determinant(cell: str) -> None:
    mesh = skew_patch(cell)
    patch = patch_of(Body(mesh, RUBBER))
    F = (np.eye(3) + 0.3 * np.sin(np.arange(9.0)).reshape(3, 3))[: mesh.dim, : mesh.dim]
    found = patch.mechanics.least_jacobian(patch.deformed(F).ravel())
    assert found == pytest.approx(np.linalg.det(F), rel=1e-12)


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
