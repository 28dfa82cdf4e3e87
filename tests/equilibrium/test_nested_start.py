"""States on coarse meshes start those on finer ones: few products, which do not grow, and the same answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, ContactProblem, Scene, Status, Support, Surface
from fenics_contact._adaptive.refined_scene import refine_scene
from fenics_contact._equilibrium.starts import solve_from_coarse
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.dual_solve import solve_dual
from fenics_contact.results.linear_state import LinearState
from tests.equilibrium import nested_cases
from tests.equilibrium.nested_cases import SCENES, cut, disc_on_block, refined_near

SELF = MPI.COMM_SELF


@pytest.mark.parametrize("name", SCENES)
def test_on_the_same_meshes_the_start_is_the_answer(name: str) -> None:
    scene = SCENES[name]()
    before = ContactProblem(scene, SELF, partitions=cut(scene, 3), tolerance=1e-10).solve()
    # Where rows of ties depend on each other they are regularised by 1e-4, and fluid goes its way again.
    wanted = 1e-3 if name in ("ties", "tie beside", "preload", "fluid") else 1e-6
    again = ContactProblem(scene, SELF, partitions=cut(scene, 5), tolerance=wanted)
    state = again.solve(start=before, refinements={})
    assert before.solution.products > 5
    assert state.solution.history[-1].note.startswith("the answer already")
    assert state.energies.strain == pytest.approx(before.energies.strain, rel=wanted)


@pytest.mark.parametrize("name", SCENES)
def test_the_answer_on_finer_meshes_does_not_depend_on_the_start(name: str) -> None:
    scene = SCENES[name]()
    coarse = ContactProblem(scene, SELF, partitions=cut(scene, 2), tolerance=1e-6).solve()
    middle = scene.points.mean(axis=0)
    fine = refined_near(scene, tuple(middle), 0.3 * float(np.ptp(scene.points, axis=0).max()))
    assert fine.refinements
    partitions = cut(fine.scene, 4)
    cold, started = (
        ContactProblem(fine.scene, SELF, partitions=partitions, tolerance=1e-8).solve(**start)
        for start in ({}, {"start": coarse, "refinements": fine.refinements})
    )
    for body in fine.scene.bodies:
        one, other = (state.gather_displacement(body) for state in (cold, started))
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-6 * np.abs(one).max())
    assert started.solution.products <= cold.solution.products + 2
    # Loads do not balance the start, and no part of the way into equilibrium does either.
    assert "cut to" not in started.solution.history[0].note


def linear(state: AnyState) -> LinearState:
    assert isinstance(state, LinearState)
    return state


@pytest.fixture(scope="module")
def levels() -> list[LinearState]:
    """States on ever finer meshes near a contact, in ever more subdomains, each from the last one."""
    scene = disc_on_block()
    states = [linear(ContactProblem(scene, SELF, partitions=cut(scene, 1)).solve())]
    for level in range(5):
        fine = refined_near(scene, (0.0, 0.0), 4.0 * 0.8**level)
        scene = fine.scene
        problem = ContactProblem(scene, SELF, partitions=cut(scene, 2 + level))
        states.append(linear(problem.solve(start=states[-1], refinements=fine.refinements)))
    return states


@pytest.fixture(scope="module")
def cold(levels: list[LinearState]) -> LinearState:
    """The last of them from nothing."""
    return linear(ContactProblem.following(levels[-1]).solve(start=None))


def test_products_do_not_grow_with_the_level(levels: list[LinearState], cold: LinearState) -> None:
    sizes = [state.counts["torn_unknowns"] for state in levels]
    products = [state.solution.products for state in levels[1:]]
    assert sizes[-1] > 10 * sizes[0]
    assert max(products) <= 25
    assert np.median(products[-3:]) <= np.median(products[:3]) + 5  # single ones take 7 to 30
    assert products[-1] <= 0.6 * cold.solution.products
    assert cold.energies.strain == pytest.approx(levels[-1].energies.strain, rel=1e-4)


def test_small_parts_of_rings_start_as_well() -> None:
    """Forces that balance on all their motions: else 28 to 176 products on these meshes."""
    flat, steel = disc_on_block(friction=None), IsotropicElasticity(2.1e5, 0.3)
    away = np.array([100.0, 0.0])
    rings = {
        name: Body(body.mesh.placed(np.eye(2), away), steel, axisymmetric=True)
        for name, body in flat.bodies.items()
    }
    states = [ContactProblem(replace(flat, bodies=rings), SELF).solve()]
    for level in range(5):
        fine = refined_near(states[-1].scene, (100.0, 0.0), 4.0 * 0.8**level)
        problem = ContactProblem(fine.scene, SELF, partitions=cut(fine.scene, 2 + level))
        states.append(problem.solve(start=states[-1], refinements=fine.refinements))
    assert max(linear(state).solution.products for state in states) <= 35


def test_few_faces_are_needed(levels: list[LinearState], cold: LinearState) -> None:
    assert min(levels[-1].contact.count(status) for status in Status) > 2
    assert levels[-1].solution.iterations <= 3 < cold.solution.iterations


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_start_alike(ranks: int, mpirun: Callable[..., str]) -> None:
    script = Path(nested_cases.__file__)
    one, several = (np.array(mpirun(script, count).split(), dtype=float) for count in (1, ranks))
    assert one[0] == several[0] > 0
    np.testing.assert_allclose(several, one, rtol=1e-6)


def test_an_overlap_that_facets_of_the_coarse_mesh_explained_is_kept(
    caplog: pytest.LogCaptureFixture,
) -> None:
    steel = PlaneStrain(1.0, 0.3)
    low, top = rectangle((0.0, 0.0), (2.0, 1.0), (3, 1)), rectangle((0.0, 0.94), (2.0, 2.0), (2, 1))
    scene = Scene(
        {"low": Body(low, steel), "top": Body(top, steel)},
        [Support("low", "y0"), Support("top", "y1")],
        contacts=[ContactPair(Surface("top", "y0"), Surface("low", "y1"))],
    )
    coarse = ContactProblem(scene, SELF).solve()
    fine = refine_scene(scene, {"low": [0, 1, 2], "top": [0, 1]})
    with pytest.raises(InvalidInputError, match=r"must not overlap at the start: .* 0\.06 inside"):
        ContactProblem(fine.scene, SELF).solve()
    caplog.clear()
    state = ContactProblem(fine.scene, SELF).solve(start=coarse, refinements=fine.refinements)
    assert "overlap by up to 0.06 before they are loaded" in caplog.text
    uneven = np.ptp(coarse.contact.pressure) + np.ptp(state.contact.pressure)
    assert uneven < 0.05
    assert state.contact.pressure.mean() == pytest.approx(coarse.contact.pressure.mean(), rel=0.05)


def test_starts_that_do_not_fit_are_refused() -> None:
    scene = disc_on_block(cells=2)
    coarse = ContactProblem(scene, SELF).solve()
    fine = refined_near(scene, (0.0, 0.0), 6.0)

    def solved(**start: object) -> None:
        ContactProblem(fine.scene, SELF).solve(**start)  # type: ignore[arg-type]

    with pytest.raises(InvalidInputError, match="start must have"):
        solved(start=coarse)
    with pytest.raises(InvalidInputError, match="refinements need the state on the meshes that were refined"):
        solved(refinements=fine.refinements)
    part = {"disc": fine.refinements["disc"]}
    with pytest.raises(InvalidInputError, match=r"refinements must lead .* got others, of \['disc'\]"):
        solved(start=coarse, refinements=part)


def test_a_start_that_leads_nowhere_is_left_for_a_cold_one(caplog: pytest.LogCaptureFixture) -> None:
    coarse = linear(ContactProblem(SCENES["quarter"](), SELF, tolerance=1e-8).solve())
    wrong = np.abs(coarse.solution.multiplier).max() * np.cos(
        7.0 * np.arange(len(coarse.solution.multiplier))
    )
    hasty = FaceNewton(1e-6, patience=0)
    before, cold = coarse.dual.products, solve_dual(coarse.dual, FaceNewton(1e-6))
    products = coarse.dual.products
    assert products == before + cold.products
    with caplog.at_level("INFO"):
        found = solve_from_coarse(coarse.dual, hasty, wrong)
    assert found.products == coarse.dual.products - products
    assert f"led nowhere in {found.history[0].products} products: begun cold" in caplog.text
    assert found.history[0].outer == 0 < found.history[-1].outer
    assert [step.iteration for step in found.history] == list(range(found.iterations))
    assert not any("rescue" in step.method for step in found.history if step.outer == 0)
    np.testing.assert_allclose(found.multiplier, cold.multiplier, atol=1e-4 * np.abs(cold.multiplier).max())
