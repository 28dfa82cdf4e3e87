"""How many steps Newton's method takes, and when it takes forces and gaps for zero."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactProblem,
    LoadSequence,
    LoadStep,
    NewtonSteps,
    Scene,
    TangentNewton,
    solve_scene,
)
from fenics_contact._fem.mechanics import HyperelasticMechanics, MaterialStep
from fenics_contact._large_deformations import newton
from fenics_contact._large_deformations.tangent_step import tangent_step
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import NeoHooke
from fenics_contact.qp import FaceNewton, solve
from fenics_contact.results.deformed_state import AnyState
from tests.models.deformed import patch_of
from tests.nonlinear.scenes import cut, pressed, rounded

RUBBER = NeoHooke(1.0, 0.4999, mean_dilatation=True)


def of(material: NeoHooke, scene: Scene) -> Scene:
    return replace(scene, bodies={name: Body(body.mesh, material) for name, body in scene.bodies.items()})


@pytest.fixture(scope="module")
def dragged() -> list[list[AnyState]]:
    """A block pressed and dragged: of ordinary rubber and of such that hardly changes its volume."""
    mesh = rounded(4)
    found = []
    for material in (NeoHooke(1.0, 0.3), RUBBER):
        scenes = [of(material, pressed(mesh, depth, way)) for depth, way in ((0.1, 0.0), (0.1, 0.05))]
        sequence = LoadSequence(ContactProblem(scenes[0], MPI.COMM_SELF, partitions=cut(mesh, 2)))
        found.append(
            [sequence.advance(LoadStep(str(n), supports=scene.supports)) for n, scene in enumerate(scenes)]
        )
    return found


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tolerance": 2.0}, "tolerance of TangentNewton must lie between 0 and 1, got 2.0: .* 1e-08"),
        ({"forcing": 0.0}, "forcing of TangentNewton must lie between 0 and 1, got 0.0"),
        ({"nested": 1.0}, "nested of TangentNewton must lie between 0 and 1, got 1.0: .* 0.01"),
        ({"max_steps": 0}, "max_steps of TangentNewton must be an integer of at least 1, got 0"),
        ({"max_products": 2.5}, r"TangentNewton.max_products must be an integer, got 2.5"),
    ],
)
def test_numbers_of_newtons_method_are_checked(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        TangentNewton(**given)


def test_settings_of_load_steps_are_checked() -> None:
    with pytest.raises(InvalidInputError, match=r"AutomaticSteps.snaps must be True or False, got 'no'"):
        AutomaticSteps(snaps="no")  # type: ignore[arg-type]


def test_nearly_incompressible_bodies_take_hardly_more_steps_than_others(
    dragged: list[list[AnyState]],
) -> None:
    """Tangents have the pressures that a step foresaw: those of its end would grow with its square."""
    counts = [[len(state.solution.history) for state in states] for states in dragged]
    steps = NewtonSteps.of(dragged[-1])
    assert [len(run) for run in steps.residuals] == counts[-1]
    assert steps.reduction.max() < 1e-2, "superlinear"
    assert max(counts[0]) <= 5
    assert max(counts[1]) <= 7


def test_preconditioners_leave_the_stiffness_of_modes_to_multipliers(
    dragged: list[list[AnyState]],
) -> None:
    """With that stiffness they took 75 and 548 products."""
    ordinary, incompressible = (sum(state.solution.products for state in states) for states in dragged)
    assert 0 < ordinary <= 58
    assert 0 < incompressible <= 160


def test_the_ends_of_load_steps_are_told_in_a_line() -> None:
    steps = NewtonSteps(((1e-16,), (0.5, 0.1, 1e-3, 1e-8, 2e-9), (0.1, 0.01), (0.2, 1e-2, 1e-4, 1e-7)))
    assert steps.reduction == pytest.approx([1e-5, 0.1, 1e-3])
    assert str(steps) == (
        "Newton's method: 3.0 steps a load step, at most 5; residuals at the end of a median one "
        "2e-01, 1e-02, 1e-04, 1e-07; its best step leaves 1e-03 of them, of the worst load step 1e-01"
    )
    assert str(NewtonSteps.of([])) == "Newton's method: no load step with several steps"


def test_tangents_of_mean_dilatations_have_the_pressures_that_a_step_foresaw() -> None:
    """The tangent after a step is that of the same forces with their pressures extrapolated along it."""
    patch = patch_of(Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), RUBBER))
    mechanics = patch.mechanics
    step = 0.03 * np.random.default_rng(1).standard_normal(patch.mesh.size)
    plain, foreseen = (
        mechanics.at(step, MaterialStep(origin=origin)).stiffness for origin in (None, 0.0 * step)
    )
    again = mechanics.at(step, MaterialStep(origin=step)).stiffness
    assert abs(again - plain).max() < 1e-12 * abs(plain).max()
    assert abs(foreseen - plain).max() > 1e-3 * abs(plain).max()


def test_strains_near_rounding_are_solved() -> None:
    depth, mesh = 1e-10, block((0, 0, 0), (1, 1, 1), (3, 3, 3))
    state = solve_scene(pressed(mesh, depth), MPI.COMM_SELF, partitions=cut(mesh, 2))
    assert len(state.solution.history) <= 5
    reference = solve_scene(pressed(mesh, 1e-5), MPI.COMM_SELF, partitions=cut(mesh, 2))
    force, expected = state.contact.force / depth, reference.contact.force / 1e-5
    assert np.abs(force - expected).max() < 1e-4 * np.abs(expected).max()


def test_tangents_are_assembled_only_where_they_are_factored(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    assemble = HyperelasticMechanics._stiffness
    monkeypatch.setattr(
        HyperelasticMechanics, "_stiffness", lambda *given: (asked.append(1), assemble(*given))[1]
    )
    mesh = rounded(3)
    scenes = [pressed(mesh, depth) for depth in (0.05, 0.1)]
    sequence = LoadSequence(ContactProblem(scenes[0], MPI.COMM_SELF, partitions=cut(mesh, 1)))
    for scene in scenes:
        asked.clear()
        state = sequence.advance(LoadStep("press", supports=scene.supports))
    assert 0 < len(asked) == len(state.solution.history)


def test_contact_is_solved_as_a_whole_on_the_way_without_asking_why_it_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A failure there cuts the load step, whatever its reason, and with a limit of products."""
    solvers = list[FaceNewton]()

    def noted(problem: Any, bound: Any, solver: FaceNewton, *more: Any, **named: Any) -> Any:
        solvers.append(solver)
        return solve(problem, bound, solver, *more, **named)

    monkeypatch.setattr("fenics_contact._large_deformations.tangent_step.solve", noted)
    calls = itertools.count()

    def lost(*given: Any, **named: Any) -> Any:
        return tangent_step(*given, **named) if next(calls) else None  # as if no rows held tangents at first

    monkeypatch.setattr(newton, "tangent_step", lost)
    mesh = rounded(3)
    solve_scene(of(NeoHooke(1.0, 0.3), pressed(mesh, 0.05, 0.0)), MPI.COMM_SELF, partitions=cut(mesh, 2))
    at_rest, later = solvers
    assert at_rest == FaceNewton(at_rest.tolerance)
    assert later == replace(at_rest, doubts=False, max_products=TangentNewton().max_products)


def test_a_step_from_the_same_state_is_the_same_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a step tries and gives up leaves nothing behind: no start of slip, no care and no products."""
    take, compared = newton._Run.step, list[Any]()

    def twice(run: Any, state: Any) -> Any:
        before = state.evaluation.at.displacement.copy()
        once, again = take(run, state), take(run, state)
        assert np.array_equal(once.evaluation.at.displacement, again.evaluation.at.displacement)
        assert np.array_equal(once.evaluation.constraint_residual, again.evaluation.constraint_residual)
        assert (once.pace, once.effort) == (again.pace, again.effort)
        assert np.array_equal(state.evaluation.at.displacement, before)
        assert not np.array_equal(once.evaluation.at.displacement, before)
        compared.append(once)
        return again

    monkeypatch.setattr(newton._Run, "step", twice)
    mesh = rounded(3)
    scene = of(NeoHooke(1.0, 0.3), pressed(mesh, 0.1, 0.1))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(mesh, 2))
    assert len(compared) >= len(state.solution.history) > 3
