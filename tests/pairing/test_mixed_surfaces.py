"""Surfaces of triangles and quadrilaterals in contact: patch tests, sliding, ties, what acts on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    RigidSurface,
    Scene,
    Spring,
    Support,
    Surface,
    Tie,
    TotalForce,
    contact_area,
    solve_scene,
)
from fenics_contact._surfaces.facets import quadrature_areas, shape_functions
from fenics_contact._surfaces.pieces import shape_weights
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import is_triangle
from fenics_contact.results.fields import contact_fields
from tests.fem.mixed_cells import ORDERS, mixed_bar
from tests.fem.several_ranks import displacement_of
from tests.pairing.mixed_surfaces import LOWER, UPPER, displacement_on, pressed, raised, wavy

#: Whether the meshes match, and bodies deform much.
CASES = [
    (order, *case)
    for case in (
        ("node", True, False),
        ("mortar", False, False),
        ("node", True, True),
        ("mortar", False, True),
    )
    for order in ORDERS
    if not (order == "serendipity" and case[2])
]


@pytest.mark.parametrize(("order", "discretisation", "alike", "much"), CASES)
def test_an_even_pressure_passes(order: str, discretisation: str, alike: bool, much: bool) -> None:
    """Triangles and quadrilaterals on both sides, none of these a parallelogram."""
    lower = ORDERS[order](wavy(mixed_bar()))
    upper = raised(ORDERS[order](wavy(mixed_bar(), 1.0 if alike else -0.5)))
    assert is_triangle(upper.surfaces["z0"]).sum() == 8
    scene = pressed(lower, upper, ContactPair(UPPER, LOWER, discretisation=discretisation), much)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10 if much else 1e-11)
    rate = state.gather_displacement("upper")[:, 2].min() / 2.0
    if not much:
        assert rate == pytest.approx(-0.01, rel=1e-9)
    for name, mesh in (("lower", lower), ("upper", upper)):
        exact = mesh.points * [0.0, 0.0, rate]
        np.testing.assert_allclose(state.gather_displacement(name), exact, atol=1e-10)
    np.testing.assert_allclose(state.contact.pressure, 5.0 if much else 1.0, rtol=1e-8)
    assert contact_area(state) == pytest.approx(2.0, rel=1e-9)
    # By nodes those at corners of quadratic triangles alone have no force, but a pressure in the fields.
    fields = contact_fields(state.contact, scene, state.torn.decomposition.tearing, "upper")
    shown = fields["contact_pressure"][upper.nodes_of("z0")]
    np.testing.assert_allclose(shown, 5.0 if much else 1.0, rtol=1e-8)


def test_the_scene_finds_whether_surfaces_match() -> None:
    lower = wavy(mixed_bar())
    for size, chosen in ((1.0, "node"), (-0.5, "mortar")):
        scene = pressed(lower, raised(wavy(mixed_bar(), size)), ContactPair(UPPER, LOWER))
        assert scene.contacts[0].discretisation == chosen
        assert scene.plan().multipliers["normal"] == 15


@pytest.mark.parametrize("order", ["linear", "quadratic"])
def test_tied_surfaces_are_stretched_evenly(order: str) -> None:
    lower, upper = (ORDERS[order](wavy(mixed_bar(), size)) for size in (1.0, -0.5))
    scene = pressed(lower, raised(upper), Tie(UPPER, LOWER, discretisation="mortar"))
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-12)
    exact = raised(upper).points * [0.0, 0.0, -0.01]
    np.testing.assert_allclose(state.gather_displacement("upper"), exact, atol=1e-11)


@pytest.mark.parametrize("ranks", [2, 4])
def test_every_number_of_ranks_has_the_same_answer(ranks: int, mpirun: Callable[..., str]) -> None:
    alone = np.array(displacement_on(MPI.COMM_SELF))
    answer = displacement_of("tests.pairing.mixed_surfaces", ranks, mpirun)
    np.testing.assert_allclose(answer, alone, atol=1e-8 * np.abs(alone).max())


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_bar_slides_far_over_another_one(discretisation: str) -> None:
    """From triangles over quadrilaterals; friction is its coefficient times the pressure all the way."""
    small = mixed_bar()
    upper = small.moved(0.5 * small.points + [0.15, 0.25, 1.0])
    pair = ContactPair(UPPER, LOWER, Coulomb(0.2), discretisation=discretisation)
    soft = NeoHooke(100.0, 0.3)
    scene = Scene(
        {"lower": Body(wavy(mixed_bar()), soft), "upper": Body(upper, soft)},
        [Support("lower", "z0"), Support("upper", "z1", (0.7, 0.0, -0.02))],
        contacts=[pair],
    )
    state = solve_scene(scene, MPI.COMM_SELF)
    forces = state.contact.force.sum(axis=0)
    assert state.contact.normal_force.sum() > 0.5
    assert abs(forces[0] / forces[2]) == pytest.approx(0.2, rel=0.05)
    up, down = (part.force for part in state.reactions())
    np.testing.assert_allclose(up, -down, atol=1e-6 * np.abs(up).max())


def test_springs_foundations_and_rigid_surfaces_act_on_all_facets() -> None:
    mesh, soft = wavy(mixed_bar()), IsotropicElasticity(100.0, 0.0)
    areas = quadrature_areas(mesh.points, mesh.surfaces["z1"])
    assert areas.sum() == pytest.approx(2.0, rel=1e-12)
    body = {"bar": Body(mesh, soft)}
    held = [Support("bar", "x0", (0.0, None, None)), Support("bar", "y0", (None, 0.0, None))]
    push = [TotalForce("bar", "z1", (0.0, 0.0, -2.0))]
    # In series with an elasticity of 100 · 2 / 1: a bed of 50 · 2, as a whole the same.
    for bed in (ElasticFoundation("bar", "z0", 50.0), ElasticFoundation("bar", "z0", 100.0, total=True)):
        scene = Scene(body, held, push, foundations=[bed])
        moved = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-12).gather_displacement("bar")
        np.testing.assert_allclose(moved[:, 2], -0.02 - 0.01 * mesh.points[:, 2], atol=1e-10)
    spring = Spring(Surface("bar", "z0"), (1.0, 0.5, -1.0), (0.0, 0.0, 100.0))
    scene = Scene(body, held, push, springs=[spring])
    moved = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-12).gather_displacement("bar")
    np.testing.assert_allclose(moved[:, 2], -0.02 - 0.01 * mesh.points[:, 2], atol=1e-10)
    plate = RigidSurface("bar", "z1", (1.0, 0.5, 1.0), (0.0, 0.0, None), (0.0,) * 3, (0.0, 0.0, -2.0))
    state = solve_scene(Scene(body, [Support("bar", "z0"), *held, plate]), MPI.COMM_SELF, tolerance=1e-12)
    np.testing.assert_allclose(state.gather_displacement("bar"), mesh.points * [0.0, 0.0, -0.01], atol=1e-10)


@pytest.mark.parametrize("make", [lambda mesh: mesh, quadratic], ids=["linear", "quadratic"])
def test_functions_on_pieces_are_those_of_whole_facets(make) -> None:  # type: ignore[no-untyped-def]
    """They reproduce places on flat facets; derivatives are compared with differences."""
    mesh: BodyMesh = make(wavy(mixed_bar()))
    surface = true_surface(mesh, "z1", "faceted")
    assert surface.corners == 3
    assert surface.cut.is_mixed
    assert surface.areas.sum() == pytest.approx(2.0, rel=1e-12)
    facet = np.repeat(np.arange(len(surface.facets)), 3)
    local = np.random.default_rng(0).uniform(0.1, 0.4, (len(facet), 2))
    values, slopes = shape_functions(local, 3)
    nodes, weights = shape_weights(surface, facet, values)
    place = np.einsum("mk,mkd->md", values, surface.points[surface.facets[facet]])
    np.testing.assert_allclose(np.einsum("mk,mkd->md", weights, surface.points[nodes]), place, atol=1e-13)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-13)
    gradients, step = surface.cut.gradients(facet, values, slopes), 1e-6
    for axis in range(2):
        ends = [shape_functions(local + way * step * np.eye(2)[axis], 3)[0] for way in (1, -1)]
        high, low = (shape_weights(surface, facet, end)[1] for end in ends)
        np.testing.assert_allclose(gradients[:, :, axis], (high - low) / (2 * step), atol=1e-8)
    by = np.random.default_rng(1).uniform(-1, 1, weights.shape)
    pulled = surface.cut.pulled_back(facet, values, by)
    np.testing.assert_allclose(
        np.einsum("mk,mka->ma", pulled, slopes), np.einsum("mj,mja->ma", by, gradients), atol=1e-10
    )
