"""Subdomains on elastic foundations, and small ones of rings, are as easily glued as others."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    Scene,
    Spring,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact.feti.soft_motions import SoftMotions, SoftMotionsOfFace
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results.linear_state import LinearState, as_linear

YOUNG = 2.1e5
STEEL = IsotropicElasticity(YOUNG, 0.3)


@cache
def cube(n: int, stiffness: float) -> LinearState:
    """A cube of n³ subdomains, H/h = 4, on a foundation under its lower side, or clamped there."""
    mesh = block((0, 0, 0), (1, 1, 1), (4 * n,) * 3)
    held = {"supports": [Support("cube", "z0")]}
    if np.isfinite(stiffness):
        held = {"supports": [], "foundations": [ElasticFoundation("cube", "z0", (stiffness,) * 3)]}
    scene = Scene({"cube": Body(mesh, STEEL)}, loads=[Traction("cube", "z1", (20.0, 0.0, -50.0))], **held)
    parts = {"cube": box_partition(mesh, (n,) * 3)}
    return as_linear(solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-6), "products")


@pytest.mark.parametrize("share", [5.0, 0.5, 5e-3, 5e-5, 5e-7])
@pytest.mark.parametrize("n", [2, 3])
def test_soft_foundations_cost_at_most_little_more_than_clamps(n: int, share: float) -> None:
    """Without their coarse space 51 products at 27 subdomains, and 78 at 64, against 13 and 14."""
    clamped = cube(n, np.inf).solution.products
    assert cube(n, share * YOUNG).solution.products <= 1.3 * clamped


def ring(n: int, radius: float) -> LinearState:
    """A ring of a square section of n² subdomains, H/h = 4, clamped at its foot."""
    mesh = rectangle((radius, 0), (radius + 1, 1), (4 * n, 4 * n))
    scene = Scene(
        {"ring": Body(mesh, STEEL, axisymmetric=True)},
        [Support("ring", "y0")],
        [Traction("ring", "y1", (20.0, -50.0))],
    )
    parts = {"ring": box_partition(mesh, (n, n))}
    return as_linear(solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-6), "products")


@pytest.mark.parametrize("radius", [1.0, 100.0])
def test_rings_of_many_small_subdomains_are_easily_glued(radius: float) -> None:
    """Hoop strains alone hold a small part: without its motions 39 to 256 products, and more with each."""
    few, many = (ring(n, radius).solution.products for n in (4, 8))
    assert few <= 25
    assert many <= few + 3


def test_hoop_strains_resist_the_motions_of_a_small_part_alone() -> None:
    body = Body(rectangle((0, 0), (1, 1), (3, 3)), STEEL, axisymmetric=True)
    softest = []
    for radius in (10.0, 1e3):
        (part,) = ring(1, radius).torn.subdomains
        assert part.resisted.shape[1] == 2
        np.testing.assert_allclose(part.resisted.T @ part.kernel, 0.0, atol=1e-10)
        energy = part.resisted.T @ (part.stiffness @ part.resisted)
        np.testing.assert_allclose(energy, np.diag(part.resistance), atol=1e-9 * part.resistance.max())
        softest.append(part.resistance.min() / part.typical_stiffness)
    assert softest[0] < 1e-2
    assert softest[1] == pytest.approx(1e-4 * softest[0], rel=0.3)
    assert (body.kinematics.nearly_rigid(body.mesh.points)[body.mesh.points[:, 0] == 0.0, 0] == 0.0).all()


def test_firm_foundations_are_left_as_they_are() -> None:
    state = cube(2, 1e6 * YOUNG)
    assert state.dual.soft_motions.count == 0
    assert all(part.resisted.shape[1] in (0, 6) for part in state.torn.subdomains)


def test_the_answer_is_that_of_one_subdomain() -> None:
    """By one factor, without gluing: displacements and the force of the foundation."""
    mesh, found = block((0, 0, 0), (1, 1, 1), (6, 6, 6)), []
    scene = Scene(
        {"cube": Body(mesh, STEEL)}, [], [Traction("cube", "z1", (20.0, 0.0, -50.0))],
        foundations=[ElasticFoundation("cube", "z0", (40.0, 90.0, 70.0))],
    )  # fmt: skip
    for parts in ((1, 1, 1), (2, 2, 2)):
        state = solve_scene(
            scene, MPI.COMM_SELF, partitions={"cube": box_partition(mesh, parts)}, tolerance=1e-12
        )
        found.append(state.gather_displacement("cube"))
        assert state.balance().imbalance < 1e-9
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8, atol=1e-8 * np.abs(found[0]).max())


def test_the_preconditioner_keeps_the_equilibrium_of_what_floats_and_bounds_the_spectrum() -> None:
    state = cube(2, 1e-2 * YOUNG)
    problem = state.dual.problem
    identity = np.eye(problem.layout.size)
    assert state.dual.soft_motions.count == 6 * 4
    every = sp.identity(problem.layout.size, format="csr")
    second = SoftMotionsOfFace.build(state.dual.soft_motions, np.ones(len(identity)), every, every)
    M = np.column_stack([second(problem.preconditioner, column) for column in identity])
    assert np.abs(M - M.T).max() < 1e-6 * np.abs(M).max()  # S is in single precision
    assert np.abs(problem.coarse.matrix @ M).max() < 1e-12 * np.abs(M).max()
    F = np.column_stack([problem.operator(column) for column in identity])
    values = np.linalg.eigvals(M @ F).real
    values = values[values > 1e-3]
    assert len(values) == problem.layout.size - problem.coarse.m
    assert values.max() < 3.0 * values.min()  # 5000 times without the coarse space


def test_motions_are_separate_and_have_their_stiffness() -> None:
    state = cube(2, 3.0)
    resting = [part for part in state.torn.subdomains if part.resisted.shape[1]]
    assert len(resting) == 4
    for part in resting:
        assert part.kernel.shape[1] == 0
        R = part.resisted
        np.testing.assert_allclose(R.T @ R, np.eye(6), atol=1e-12)
        np.testing.assert_allclose(R.T @ (part.stiffness @ R), np.diag(part.resistance), atol=1e-9)
        assert part.typical_stiffness < part.stiffness.diagonal().mean()


@pytest.mark.parametrize(("law", "most"), [((), 30), ((Coulomb(0.3),), 60)])
def test_contact_on_a_soft_bed_takes_few_products(law, most: int) -> None:
    """Without the coarse space 67 and 426 on the soft bed, and 75 with that of the face's own basis alone."""
    low, up = block((0, 0, 0), (1, 1, 1), (8, 8, 8)), block((0.1, 0.1, 1.0), (0.9, 0.9, 1.6), (6, 6, 4))
    parts = {"low": box_partition(low, (2, 2, 2)), "up": box_partition(up, (2, 2, 1))}
    products, pressed = [], []
    for stiffness in (1e7, 10.0):
        scene = Scene(
            {"low": Body(low, STEEL), "up": Body(up, STEEL)},
            [Support("up", "z1", (0.001, 0.0, -0.002))],
            [],
            [ContactPair(Surface("up", "z0"), Surface("low", "z1"), *law)],
            foundations=[ElasticFoundation("low", "z0", (stiffness,) * 3)],
        )
        state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-8)
        products.append(state.solution.products)
        pressed.append(state.contact.normal_force.sum())
    assert max(products) <= most
    assert pressed[1] == pytest.approx(10.0 * 0.002, rel=1e-3)


def test_a_stiff_body_beside_does_not_spoil_it() -> None:
    """Rows are scaled between parts of different stiffness, and motions with them."""
    soft, hard = block((0, 0, 0), (1, 1, 1), (8, 8, 8)), block((0, 0, 1), (1, 1, 2), (8, 8, 8))
    parts = {name: box_partition(mesh, (2, 2, 2)) for name, mesh in (("soft", soft), ("hard", hard))}
    products = []
    for stiffness in (5.0 * YOUNG, 1e-3 * YOUNG):
        scene = Scene(
            {"soft": Body(soft, STEEL), "hard": Body(hard, IsotropicElasticity(1e3 * YOUNG, 0.3))},
            [],
            [Traction("hard", "z1", (20.0, 0.0, -50.0))],
            ties=[Tie(Surface("hard", "z0"), Surface("soft", "z1"))],
            foundations=[ElasticFoundation("soft", "z0", (stiffness,) * 3)],
        )
        products.append(solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-6).solution.products)
    assert products[1] <= products[0] + 2


def test_none_are_none() -> None:
    state = cube(2, np.inf)
    problem, rows = state.dual.problem, state.dual.problem.layout.size
    motions = SoftMotions.of(state.torn, problem.coarse.matrix, 1.0, 1.0, np.ones(rows))
    assert motions.count == 0
    assert not motions.needed
    assert state.dual.soft_motions.count == 0


def test_friction_between_a_body_on_a_soft_wall_and_another() -> None:
    """What balances bodies spares friction that turns and springs, which close jumps as they are soft.

    Products were 151 with the foundation and 149 with the springs.
    """
    low, up = block((0, 0, 0), (2, 2, 1), (6, 6, 3)), block((0, 0, 1), (1.5, 2, 2), (6, 8, 4))
    parts = {"low": box_partition(low, (2, 2, 1)), "up": box_partition(up, (2, 2, 1))}
    k = 400.0
    walls = [ElasticFoundation("up", "x0", (1e4, 1e3, 1e2))]
    springs = [
        Spring(Surface("up", "x0"), (-1, 1, 1.5), (k, k / 4, k / 4000)),
        Spring(Surface("up", "y1"), (0.7, 4, 1.5), (k / 40, k / 2, 0.0)),
    ]
    for held, most in (({"foundations": walls}, 125), ({"springs": springs}, 70)):
        scene = Scene(
            {"low": Body(low, STEEL), "up": Body(up, STEEL)},
            [Support("low", "z0")],
            [TotalForce("up", "z1", (80.0, 20.0, -1000.0))],
            [ContactPair(Surface("up", "z0"), Surface("low", "z1"), Tresca(30.0))],
            **held,
        )
        state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-6)
        assert state.solution.products <= most


@pytest.mark.parametrize("stiffness", [1e6, 1e4, 400.0])
def test_springs_have_no_eigenvalue_of_their_own(stiffness: float) -> None:
    """The preconditioner closes jumps by bodies and springs, each as it is soft: up to 6e6 without."""
    mesh = block((0, 0, 0), (1.5, 2, 1), (3, 4, 2))
    ends = (("x0", (-1, 1, 0.5)), ("y0", (0.7, -1, 0.5)), ("z0", (0.7, 1, -1)))
    along = (stiffness, stiffness / 50, stiffness / 9)
    scene = Scene(
        {"block": Body(mesh, STEEL)}, [], [Traction("block", "z1", (0.2, 0.0, -0.5))],
        springs=[Spring(Surface("block", side), far, along) for side, far in ends],
    )  # fmt: skip
    parts = {"block": box_partition(mesh, (1, 2, 1))}
    system = as_linear(solve_scene(scene, MPI.COMM_SELF, partitions=parts), "springs").dual
    problem, motions = system.problem, system.soft_motions
    identity, every = np.eye(problem.layout.size), sp.identity(problem.layout.size, format="csr")
    second = SoftMotionsOfFace.build(motions, motions.weight, every, every)
    P = np.column_stack([problem.coarse.project(column) for column in identity])
    F = np.column_stack([problem.operator(column) for column in identity])
    M = np.column_stack([second(problem.preconditioner, column) for column in identity])
    assert np.linalg.eigvals(P @ M @ P @ F @ P).real.max() < 3.0
