"""Materials with a history on meshes: forces, tangents, and what the Gauss points remember."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene
from fenics_contact._fem.composition import composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.kinematics import GaussPoints
from fenics_contact._fem.mechanics import History, MaterialStep, Mechanics, Response
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.subdomain import SubdomainMesh, cut_out
from fenics_contact.materials import (
    FinitePlasticity,
    HistoryMaterial,
    IsotropicElasticity,
    J2Plasticity,
    NeoHooke,
)
from tests.models.bodies import box, in_halves
from tests.models.deformed import Patch, patch_of, skew_patch, smooth_field

CELLS = ("triangle6", "quadrilateral", "tetrahedron", "hexahedron", "tetrahedron10")
SMALL = J2Plasticity(200.0, 0.3, 1.0, 2.0, 5.0)
LARGE = FinitePlasticity(200.0, 0.3, 1.0, 2.0)
MEAN = replace(SMALL, mean_dilatation=True)
BY_MEANS = ("triangle6", "quadrilateral", "hexahedron", "tetrahedron10")
BY_PROJECTIONS = (*BY_MEANS, "quadrilateral9", "hexahedron27")


def answer(patch: Patch, u: np.ndarray, history: np.ndarray | None = None) -> Response:
    return patch.mechanics.at(np.asarray(u).ravel(), MaterialStep(history))


@pytest.mark.parametrize(
    ("material", "cell"),
    [*((m, cell) for m in (SMALL, LARGE) for cell in CELLS), *((MEAN, cell) for cell in BY_PROJECTIONS)],
)
def test_stiffness_is_the_derivative_of_the_force(material: HistoryMaterial, cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), material))
    u = smooth_field(patch.points, 0.1)
    history = answer(patch, u).history
    assert (history[..., 6] > 1e-3).all()
    further = 1.4 * u + smooth_field(patch.points[:, ::-1], 0.03)
    here, direction = answer(patch, further, history), np.cos(np.arange(u.size) ** 1.5)
    ahead, behind = (answer(patch, further.ravel() + s * 1e-6 * direction, history) for s in (1, -1))
    quotient, exact = (ahead.force - behind.force) / 2e-6, here.stiffness @ direction
    assert np.abs(quotient - exact).max() < 1e-7 * np.abs(exact).max()
    assert here.energy is None
    assert 0 < here.least_jacobian < 1
    assert here.history.shape == (patch.body.mesh.n_cells, here.history.shape[1], 7)


@pytest.mark.parametrize("cell", CELLS)
def test_the_unloaded_body_is_linearly_elastic_of_one_pattern(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), LARGE))
    first, linear = answer(patch, np.zeros(patch.mesh.size)), patch.linear_stiffness()
    assert np.abs(first.force).max() == 0.0
    np.testing.assert_allclose(first.stiffness.toarray(), linear, atol=1e-12 * np.abs(linear).max())
    later = answer(patch, smooth_field(patch.points))
    np.testing.assert_array_equal(later.stiffness.indices, first.stiffness.indices)
    assert np.abs(later.stiffness.toarray() - linear).max() > 0.1 * np.abs(linear).max()


@pytest.mark.parametrize("cell", BY_MEANS)
def test_points_of_a_cell_feel_its_mean_change_of_volume(cell: str) -> None:
    whole, mean = (patch_of(Body(skew_patch(cell), material)) for material in (SMALL, MEAN))
    u = smooth_field(whole.points, 0.02)
    pressures = [np.trace(answer(patch, u).stress, axis1=2, axis2=3) for patch in (whole, mean)]
    assert np.ptp(pressures[0], axis=1).min() > 0.01 * np.abs(pressures[0]).max()
    # What quadratic tetrahedra keep of the variation at points has a bulk modulus of G/50.
    bulk, shear = 200.0 / 3 / 0.4, 200.0 / 2.6
    kept = np.sqrt(0.02 * shear / bulk) if cell == "tetrahedron10" else 0.0
    size = np.abs(pressures[1]).max()
    np.testing.assert_allclose(
        np.ptp(pressures[1], axis=1), kept * np.ptp(pressures[0], axis=1), atol=1e-12 * size
    )
    # Where the strain is the same everywhere, it is its own mean.
    even = whole.points @ np.full((whole.points.shape[1],) * 2, 0.01)
    forces = [answer(patch, even).force for patch in (whole, mean)]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-12 * np.abs(forces[0]).max())


def test_means_of_large_strain_and_of_cells_without_variation_are_refused() -> None:
    class Soft(J2Plasticity):
        finite = True

    with pytest.raises(InvalidInputError, match="needs small strain, Soft is for large ones"):
        Body(skew_patch("hexahedron"), Soft(200.0, 0.3, 1.0, mean_dilatation=True))
    with pytest.raises(InvalidInputError, match="got a mesh of tetrahedra"):
        Body(skew_patch("tetrahedron"), MEAN)


def test_forces_are_in_equilibrium_and_turn_with_the_body() -> None:
    patch = patch_of(Body(skew_patch("hexahedron"), LARGE))
    u = smooth_field(patch.points, 0.2)
    first = answer(patch, u)
    Q = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    forces = first.force.reshape(-1, 3)
    size = np.abs(forces).max()
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12 * size)
    np.testing.assert_allclose(np.cross(patch.points + u, forces).sum(axis=0), 0.0, atol=1e-11 * size)
    turned = answer(patch, (patch.points + u) @ Q.T - patch.points, first.history)
    np.testing.assert_allclose(turned.force.reshape(-1, 3), forces @ Q.T, atol=1e-10 * size)
    np.testing.assert_allclose(turned.history, first.history, atol=1e-12)
    np.testing.assert_allclose(turned.stress, Q @ first.stress @ Q.T, atol=1e-9 * np.abs(first.stress).max())
    np.testing.assert_allclose(first.stress, first.stress.swapaxes(2, 3), atol=1e-12)
    deviator = first.stress - np.trace(first.stress, axis1=2, axis2=3)[..., None, None] / 3 * np.eye(3)
    F = np.eye(3) + GaussPoints(patch.mesh.space, "hexahedron", patch.points).gradient(u.ravel())
    equivalent = np.sqrt(1.5) * np.linalg.norm(deviator, axis=(2, 3)) * np.linalg.det(F)
    law = LARGE.yield_stress + LARGE.isotropic_hardening * first.history[..., 6]
    np.testing.assert_allclose(equivalent, law, rtol=1e-9)


@pytest.mark.parametrize(
    "other", [IsotropicElasticity(50.0, 0.2), NeoHooke(50.0, 0.2)], ids=["linear", "neo"]
)
def test_bodies_of_several_materials_add_them_up(other: IsotropicElasticity | NeoHooke) -> None:
    mesh = in_halves(skew_patch("hexahedron"))
    lower, upper = mesh.regions
    mixed = patch_of(Body(mesh, {lower: LARGE, upper: other}))
    u = smooth_field(mixed.points, 0.1)
    found = answer(mixed, u)
    alone = patch_of(Body(mesh, LARGE)).mechanics.at(u.ravel()).history
    here = np.isin(mixed.mesh.cells, mesh.regions[lower])
    assert 0 < here.sum() < len(here)
    np.testing.assert_allclose(found.history[here], alone[here], atol=1e-14)
    assert not found.history[~here].any()
    assert np.isnan(found.stress[~here]).all()
    assert np.isfinite(found.stress[here]).all()
    direction = np.cos(np.arange(u.size) ** 1.5)
    ahead, behind = (answer(mixed, u.ravel() + s * 1e-6 * direction) for s in (1, -1))
    exact = found.stiffness @ direction
    assert np.abs((ahead.force - behind.force) / 2e-6 - exact).max() < 1e-7 * np.abs(exact).max()
    swapped, whole = patch_of(Body(mesh, {lower: other, upper: LARGE})), patch_of(Body(mesh, LARGE))
    again, expected = (answer(each, -u, answer(each, u).history) for each in (swapped, whole))
    np.testing.assert_allclose(again.history[~here], expected.history[~here], atol=1e-14)
    one_and_other = patch_of(Body(mesh, {lower: LARGE, upper: replace(LARGE, yield_stress=0.5)}))
    more = answer(one_and_other, u)
    np.testing.assert_allclose(more.history[here], alone[here], atol=1e-14)
    assert (more.history[~here, :, 6] > alone[~here, :, 6]).all()


def parts_of(body: Body, halves: np.ndarray, forms: FormLibrary) -> list[tuple[SubdomainMesh, Mechanics]]:
    meshes = [cut_out(k, "body", body, np.flatnonzero(halves == k)) for k in range(2)]
    return [
        (
            mesh,
            forms.mechanics(
                composition(body, mesh.cells),
                body.mesh.cell_type,
                mesh.space,
                body.mesh.points[np.sort(mesh.nodes)],
            ),
        )
        for mesh in meshes
    ]


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron10", "triangle6"])
def test_the_history_does_not_depend_on_the_subdomains(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), LARGE))
    scene = Scene({"body": patch.body})
    field = np.empty_like(patch.points)
    field[patch.mesh.nodes] = smooth_field(patch.points, 0.1)
    whole = answer(patch, field[patch.mesh.nodes])
    start = History.unloaded(scene)
    unloaded = start.values["body"]
    kept = start.advanced(MPI.COMM_SELF, [("body", patch.mesh.cells, whole.history)])
    for halves in (np.arange(patch.body.mesh.n_cells) % 2, np.arange(patch.body.mesh.n_cells) < 1):
        parts = parts_of(patch.body, halves, patch.forms)
        new = [
            (
                mesh.body,
                mesh.cells,
                mechanics.at(field[mesh.nodes].ravel(), MaterialStep(unloaded[mesh.cells])).history,
            )
            for mesh, mechanics in parts
        ]
        np.testing.assert_allclose(
            start.advanced(MPI.COMM_SELF, new).values["body"], kept.values["body"], atol=1e-13
        )
    assert kept.values["body"][..., 6].min() > 1e-3
    assert not start.values["body"].any()


def test_a_history_of_something_else_is_refused() -> None:
    body = Body(box("hexahedron", (2, 1, 1)), SMALL)
    patch = patch_of(body)
    with pytest.raises(InvalidInputError, match=r"must have shape \(2, 8, 7\).*got \(3, 8, 7\)"):
        patch.mechanics.at(np.zeros(patch.mesh.size), MaterialStep(np.zeros((3, 8, 7))))


def test_bodies_without_memory_have_no_history() -> None:
    scene = Scene({"body": Body(box("hexahedron", (1, 1, 1)), IsotropicElasticity(1.0, 0.3))})
    history = History.unloaded(scene)
    assert not history.values
