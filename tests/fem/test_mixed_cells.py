"""Bodies of several shapes of cells: patch tests of all orders, bending, ranks, fields, what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    solve_scene,
)
from fenics_contact._accuracy.discretisation import discretisation_error
from fenics_contact.design.motion import DesignGeometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import (
    bisection_partition,
    in_vtk_order,
    joined_cells,
    quadratic,
    refined,
    serendipity,
)
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import is_triangle
from tests.fem.graded import pulled
from tests.fem.mixed_cells import ORDERS, displacement_on, mixed_bar, mixed_plate, named_sides, shaken
from tests.fem.several_ranks import displacement_of


@pytest.fixture(scope="module", params=list(ORDERS))
def bar(request: pytest.FixtureRequest) -> BodyMesh:
    return shaken(ORDERS[request.param](shaken(mixed_bar(), 0.03)), 0.01)


@pytest.mark.parametrize("subdomains", [1, 4])
def test_an_even_stress_is_even_in_all_shapes(bar: BodyMesh, subdomains: int) -> None:
    partition = {"bar": bisection_partition(bar, subdomains)}
    scene = pulled(bar, IsotropicElasticity(100.0, 0.3))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partition, tolerance=1e-12)
    exact = bar.points * [0.01, -0.003, -0.003]
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-10 * np.abs(exact).max())
    for stress in (state.gather_nodal_stress("bar")[0], state.gather_stress("bar")):
        np.testing.assert_allclose(stress, np.broadcast_to(np.diag([1.0, 0, 0]), stress.shape), atol=1e-9)
    assert bar.volume == pytest.approx(2.0, rel=1e-13)
    assert state.reactions()[0].force[0] == pytest.approx(-1.0)


def test_large_strains_are_even_as_well(bar: BodyMesh) -> None:
    state = solve_scene(pulled(bar, NeoHooke(100.0, 0.3), 10.0), MPI.COMM_SELF, tolerance=1e-9)
    moved = state.gather_displacement("bar")
    rate = moved[np.argmax(bar.points.sum(axis=1))] / [2.0, 1.0, 1.0]
    assert rate[0] > 0.1
    np.testing.assert_allclose(moved, bar.points * rate, atol=1e-8)


@pytest.mark.parametrize("order", list(ORDERS))
def test_an_even_stress_is_even_in_the_plane(order: str) -> None:
    mesh = shaken(ORDERS[order](shaken(mixed_plate(), 0.03)), 0.01)
    partition = {"bar": bisection_partition(mesh, 3)}
    scene = pulled(mesh, PlaneStrain(100.0, 0.3))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partition, tolerance=1e-12)
    exact = mesh.points * [0.0091, -0.0039]
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-10 * np.abs(exact).max())


def test_quadratic_cells_bend_exactly() -> None:
    """Pure bending has a quadratic displacement, u = (x y, −(x² + ν y² − ν z²) / 2, −ν y z)."""
    nu = 0.3

    def given(at: np.ndarray) -> np.ndarray:
        x, y, z = at.T
        return 0.01 * np.column_stack([x * y, -(x**2 + nu * y**2 - nu * z**2) / 2, -nu * y * z])

    for mesh in (quadratic(mixed_bar()), serendipity(quadratic(mixed_bar()))):
        parts = tuple(lambda at, i=i: given(at)[:, i] for i in range(3))
        sides = [Support("bar", side, parts) for side in ("x0", "x1", "y0", "y1", "z0", "z1")]
        scene = Scene({"bar": Body(mesh, IsotropicElasticity(100.0, nu))}, sides)
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-12)
        np.testing.assert_allclose(state.gather_displacement("bar"), given(mesh.points), atol=1e-12)


@pytest.mark.parametrize("ranks", [2, 4])
def test_every_number_of_ranks_has_the_same_answer(ranks: int, mpirun: Callable[..., str]) -> None:
    alone = np.array(displacement_on(MPI.COMM_SELF))
    assert np.abs(alone).max() > 0.01
    answer = displacement_of("tests.fem.mixed_cells", ranks, mpirun)
    np.testing.assert_allclose(answer, alone, atol=1e-9 * np.abs(alone).max())


def test_all_shapes_yield_alike() -> None:
    mesh = mixed_bar()
    steel = J2Plasticity(100.0, 0.3, 0.5, isotropic_hardening=10.0)
    state = solve_scene(pulled(mesh, steel, 1.0), MPI.COMM_SELF, tolerance=1e-9)
    moved = state.gather_displacement("bar")
    assert moved[:, 0].max() == pytest.approx(2 * (0.01 + 0.5 / 10.0), rel=1e-6)


def test_the_estimate_of_the_error_is_near_the_error() -> None:
    """That by quadratic cells on the same mesh; the force is on triangles and quadrilaterals."""
    works, estimate = [], 0.0
    for mesh in (mixed_bar(), quadratic(mixed_bar())):
        body = Body(mesh, IsotropicElasticity(100.0, 0.3))
        force = TotalForce("bar", "z1", (0.0, 0.0, -0.01))
        state = solve_scene(Scene({"bar": body}, [Support("bar", "x0")], [force]), MPI.COMM_SELF)
        np.testing.assert_allclose(state.reactions()[0].force, [0.0, 0.0, 0.01], atol=1e-9)
        works.append(state.torn.load @ state.torn_displacement)
        estimate = estimate or discretisation_error(state.torn, state.torn_displacement).total
    assert works[1] > works[0]
    assert 0.6 < estimate / np.sqrt(works[1] - works[0]) < 1.1


@pytest.mark.parametrize("order", list(ORDERS))
def test_prisms_in_contact_pass_an_even_pressure(order: str) -> None:
    """On their triangles; the boxes match, as quadratic facets are in contact by nodes."""

    def prisms(bottom: float) -> BodyMesh:
        box = block((0, 0, bottom), (1, 1, bottom + 1), (2, 2, 1))
        halves = box.cells[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
        return ORDERS[order](named_sides(box.points, joined_cells({"prism": halves})))

    lower, upper = prisms(0.0), prisms(1.0)
    assert lower.surfaces["z1"].shape == (8, 3 if order == "linear" else 6)
    soft = IsotropicElasticity(100.0, 0.0)
    scene = Scene(
        {"lower": Body(lower, soft), "upper": Body(upper, soft)},
        [
            Support("lower", "z0"),
            Support("upper", "x0", (0.0, None, None)),
            Support("upper", "y0", (None, 0.0, None)),
        ],
        [Traction("upper", "z1", (0.0, 0.0, -1.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    np.testing.assert_allclose(state.contact.pressure, 1.0, rtol=1e-8)
    exact = upper.points * [0.0, 0.0, -0.01]
    np.testing.assert_allclose(state.gather_displacement("upper"), exact, atol=1e-11)


def test_triangles_and_quadrilaterals_are_masters_of_one_slave() -> None:
    bar, soft = mixed_bar(), IsotropicElasticity(100.0, 0.0)
    top = bar.surfaces["z1"]
    parts = {"t": top[is_triangle(top)], "q": top[~is_triangle(top)]}
    lower = BodyMesh(bar.points, bar.cells, {**bar.surfaces, **parts})
    upper = block((0, 0, 1), (2, 1, 2), (3, 2, 1))
    slave = Surface("upper", "z0")
    scene = Scene(
        {"bar": Body(lower, soft), "upper": Body(upper, soft)},
        [
            Support("bar", "z0"),
            Support("upper", "x0", (0.0, None, None)),
            Support("upper", "y0", (None, 0.0, None)),
        ],
        [Traction("upper", "z1", (0.0, 0.0, -1.0))],
        [ContactPair(slave, Surface("bar", name), discretisation="mortar") for name in parts],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    np.testing.assert_allclose(state.gather_displacement("upper"), upper.points * [0, 0, -0.01], atol=1e-10)


def test_what_is_not_built_is_refused_in_words() -> None:
    mesh = mixed_bar()
    soft = IsotropicElasticity(100.0, 0.0)
    with pytest.raises(InvalidInputError, match=r"refined needs cells of one shape, .* 28 pyramids, "):
        refined(mesh, [0])
    scene = Scene({"bar": Body(mesh, soft)}, [Support("bar", "x0")])
    with pytest.raises(InvalidInputError, match=r"a design needs bodies with one shape .* has 40 tetra"):
        DesignGeometry(scene, None, [])
    lean = serendipity(quadratic(block((0, 0, 0), (1, 1, 1), (1, 1, 1))))
    whole = Scene({"box": Body(lean, soft)}, [Support("box", "x0")])
    with pytest.raises(InvalidInputError, match=r"a design with body 'box' needs complete cells, 7 cen"):
        DesignGeometry(whole, None, [])
    with pytest.raises(InvalidInputError, match=r"6/15/18 for prisms, .* nodes, got 7: "):
        in_vtk_order(mesh.points, np.arange(7)[None])
