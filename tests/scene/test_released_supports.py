"""Load steps whose supports hold other components than before: released ones, added ones, kept ones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    HoldCurrent,
    LoadSequence,
    LoadStep,
    RigidSurface,
    Roller,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.averages import nodal_sum
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState, DeformedState
from tests.conftest import run_on_ranks
from tests.equilibrium.friction_steps import FLOOR, FRICTION, coulomb_reference, sheared_block
from tests.scene.released_cases import HARDENING, LENGTH, LOAD, PULL, YIELD, YOUNG, both

#: A block on a floor with friction: pressed and pushed, let go along x, pushed back, let go along x and y.
TOP = ((0.0, 0.0, -0.01), (0.012, 0.0, -0.01), (None, 0.0, -0.01), (-0.004, 0.0, -0.01), (None, None, -0.01))
#: What holds its foot, nodes in contact among them: nothing, along x, along y, along both, nothing.
FOOT = (None, (0.001, None, None), (None, 0.003, None), (0.0, 0.004, None), None)


@pytest.fixture(scope="module", params=[1, 2])
def bars(request: pytest.FixtureRequest) -> dict[str, Any]:
    if request.param == 1:
        return both(MPI.COMM_SELF)
    found = json.loads(run_on_ranks(Path(__file__).with_name("released_cases.py"), 2))
    assert found["elastic"]["ranks"] == 2
    return dict(found)


def test_an_elastic_bar_is_where_its_loads_take_it_whatever_held_it_before(bars: dict[str, Any]) -> None:
    stretched, pulled = LOAD * LENGTH / YOUNG, YOUNG * PULL / LENGTH
    found = bars["elastic"]
    np.testing.assert_allclose(found["end"], [PULL, *[stretched] * 3, 0.0, PULL], atol=1e-9)
    np.testing.assert_allclose(found["reaction"], [-pulled, *[-LOAD] * 3, 0.0, -pulled], atol=1e-6)


def test_a_plastic_bar_springs_back_by_its_elastic_strain_alone(bars: dict[str, Any]) -> None:
    # In tension ε_p = (E ε − σ_y) / (E + H), then everything is elastic up to the last yield stress.
    plastic = (YOUNG * PULL / LENGTH - YIELD) / (YOUNG + HARDENING)
    stretched, pulled = (plastic + LOAD / YOUNG) * LENGTH, YOUNG * (PULL / LENGTH - plastic)
    found = bars["plastic"]
    np.testing.assert_allclose(found["end"], [PULL, *[stretched] * 3, plastic * LENGTH, PULL], rtol=1e-7)
    expected = [-pulled, *[-LOAD] * 3, 0.0, -pulled]
    np.testing.assert_allclose(found["reaction"], expected, atol=1e-6 * pulled)


def pushed(scene: Scene, scale: float = 1.0) -> list[LoadStep]:
    return [
        LoadStep(
            f"step {k}",
            supports=[Support("block", "z1", tuple(None if v is None else scale * v for v in value))],
        )
        for k, value in enumerate(TOP)
    ]


def test_friction_after_a_release_is_that_of_an_independent_solver() -> None:
    scene = sheared_block(Coulomb(FRICTION))
    mesh = scene.bodies["block"].mesh
    side = mesh.surfaces["x0"]
    foot = side[mesh.points[side][:, :, 2].max(axis=1) < 0.4]
    mesh = replace(mesh, surfaces={**mesh.surfaces, "foot": foot})
    scene = replace(scene, bodies={"block": replace(scene.bodies["block"], mesh=mesh)})
    steps = [
        step if held is None else replace(step, supports=[*step.supports, Support("block", "foot", held)])
        for step, held in zip(pushed(scene), FOOT, strict=True)
    ]
    cut = {"block": box_partition(mesh, (2, 1, 1))}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-9))
    states, before = solve_steps(problem, steps), None
    for step, state in zip(steps, states, strict=True):
        before, force = coulomb_reference(step.applied_to(scene), before)
        np.testing.assert_allclose(state.contact.force, force, rtol=0, atol=1e-5 * np.abs(force).max())
    locked = np.abs(states[-1].contact.friction_force).sum()
    fresh = solve_scene(pushed(scene)[-1].applied_to(scene), MPI.COMM_SELF, partitions=cut, tolerance=1e-9)
    assert locked != pytest.approx(np.abs(fresh.contact.friction_force).sum(), rel=1e-2)
    ways = [np.einsum("na,nad->nd", s.contact.slip, s.contact.points.tangents) for s in states]
    last = states[-1].contact
    total = np.einsum("na,nad->nd", last.total_slip, last.points.tangents)
    np.testing.assert_allclose(total, sum(ways), atol=1e-8)


def test_friction_after_a_release_of_bodies_that_move_is_that_of_small_displacements() -> None:
    scale = 1e-3
    forces = []
    for material in (IsotropicElasticity(1000.0, 0.3), NeoHooke(1000.0, 0.3)):
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2))
        pair = ContactPair(Surface("block", "z0"), FLOOR, Coulomb(FRICTION))
        scene = Scene({"block": Body(mesh, material)}, contacts=[pair])
        problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
        forces.append([state.contact.force for state in solve_steps(problem, pushed(scene, scale))])
    for small, large in zip(*forces, strict=True):
        np.testing.assert_allclose(large, small, rtol=0, atol=2e-4 * np.abs(small).max())


def test_a_history_with_released_supports_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    file = tmp_path / "steps.npz"

    def run(count: int, *, resume: bool) -> list[AnyState]:
        scene = sheared_block(Coulomb(FRICTION))
        problem = ContactProblem(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-9))
        kept = [Support("block", "z1", (HoldCurrent(), HoldCurrent(), -0.01))]
        steps = [*pushed(scene)[:3], LoadStep("keep", supports=kept), *pushed(scene)[3:]]
        sequence = LoadSequence(problem, checkpoint=Checkpoint(file, resume=resume))
        return [sequence.advance(step) for step in steps[:count]]

    run(4, resume=False)
    found = run(6, resume=True)
    assert [state.solution.products for state in found[:4]] == [1] * 4
    expected = run(6, resume=False)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.contact.force, other.contact.force, atol=1e-7)
    # What is kept stays; its reaction changes only by what the solver's tolerance leaves.
    moved = [state.gather_displacement("block") for state in expected[2:4]]
    assert np.abs(moved[1] - moved[0]).max() < 1e-8


def test_ties_rollers_and_rigid_surfaces_come_and_go() -> None:
    steel = IsotropicElasticity(1000.0, 0.3)
    low, high = block((0, 0, 0), (2, 1, 1), (4, 2, 2)), block((0, 0, 1), (2, 1, 2), (5, 3, 2))
    tie = Tie(Surface("high", "z0"), Surface("low", "z1"))
    foot, load = Support("low", "z0"), Traction("high", "z1", (5.0, 0.0, 3.0))
    scene = Scene({"low": Body(low, steel), "high": Body(high, steel)}, [foot], [load], ties=[tie])
    slope = (1.0, 0.0, 1.0)
    held = [
        [foot],
        [foot, Roller("high", "x1", 0.01, slope)],
        [foot, RigidSurface("high", "z1", (1, 0.5, 2), rotation=(0.0, 0.0, 0.0))],
        [foot, Support("high", "x1", (None, 0.02, None))],
        [foot],
    ]
    cut = {"low": box_partition(low, (2, 1, 1)), "high": box_partition(high, (2, 1, 1))}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-10)
    states = solve_steps(problem, [LoadStep(str(k), supports=each) for k, each in enumerate(held)])
    for each, state in zip(held, states, strict=True):
        fresh = solve_scene(replace(scene, supports=each), MPI.COMM_SELF, partitions=cut, tolerance=1e-10)
        for body in scene.bodies:
            expected = fresh.gather_displacement(body)
            size = np.abs(expected).max()
            np.testing.assert_allclose(state.gather_displacement(body), expected, atol=1e-8 * size)
        assert state.torn.subdomains[0].matrix is states[0].torn.subdomains[0].matrix, "matrices stay"


def test_a_roller_keeps_what_nodes_have_along_its_direction() -> None:
    steel, direction = IsotropicElasticity(1000.0, 0.0), (3.0, 4.0, 0.0)
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    scene = Scene(
        {"bar": Body(mesh, steel)}, [Support("bar", "x0")], [Traction("bar", "x1", (2.0, 1.0, 0.0))]
    )
    kept = [Support("bar", "x0"), Roller("bar", "x1", HoldCurrent(), direction)]
    loaded, after = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), [LoadStep("load"), LoadStep("keep", [], kept)]
    )
    end = mesh.points[:, 0] == 2.0
    along = [state.gather_displacement("bar")[end] @ np.array(direction) / 5.0 for state in (loaded, after)]
    np.testing.assert_allclose(along[1], along[0], atol=1e-9)
    assert np.abs(along[0]).min() > 1e-3


def test_steps_that_cannot_be_are_refused() -> None:
    scene = sheared_block(Coulomb(0.3))
    sequence = LoadSequence(ContactProblem(replace(scene, contacts=[]), MPI.COMM_SELF))
    sequence.advance(pushed(scene)[0])
    with pytest.raises(InfeasibleError):
        sequence.advance(LoadStep("free", [Traction("block", "x1", (1.0, 0.0, 0.0))], []))
    varying = LoadStep("x", supports=lambda t: [Support("block", "z1", (HoldCurrent(), t, 0.0))], time=1.0)
    with pytest.raises(
        InvalidInputError, match=r"LoadStep 'x' as functions of time cannot HoldCurrent: give"
    ):
        sequence.advance(varying)
    soft = Scene({"block": Body(scene.bodies["block"].mesh, NeoHooke(1.0, 0.3))}, [Support("block", "z0")])
    sequence = LoadSequence(ContactProblem(soft, MPI.COMM_SELF))
    sequence.advance(LoadStep("rest"))
    driven = [Support("block", "z0"), RigidSurface("block", "z1", (0, 0, 1), (0.0, 0.0, 0.1))]
    with pytest.raises(InvalidInputError, match="must be there from the first step on, that on 'z1'"):
        sequence.advance(LoadStep("drive", supports=driven))


def test_what_acted_before_a_release_is_in_equilibrium_with_what_supports_carried() -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2))
    pair = ContactPair(Surface("block", "z0"), FLOOR, Coulomb(FRICTION))
    scene = Scene({"block": Body(mesh, NeoHooke(1000.0, 0.3))}, contacts=[pair])
    cut = {"block": box_partition(mesh, (2, 1, 1))}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut)
    state = solve_steps(problem, pushed(scene)[:2])[-1]
    assert isinstance(state, DeformedState)
    after = replace(state.scene, supports=[Support("block", "z1", (None, 0.0, -0.01))])
    equilibria = problem._deformed(after)
    acted, start = equilibria._held_otherwise(after, state)
    found = equilibria._equations.evaluate_at(acted, start)
    assert found.residuals.coarse < 1e-7
    assert found.residuals.gluing < 1e-7
    assert found.residuals.natural < 1e-7
    top = state.torn.decomposition.tearing.global_nodes("block", np.unique(mesh.surfaces["z1"]))
    carried = nodal_sum(state.torn.decomposition, acted.torn.load)[top].sum(axis=0)
    assert carried[0] == pytest.approx(float(state.reactions()["block z1"].force[0]), rel=1e-6)
    assert abs(carried[0]) > 1.0
    assert np.abs(carried[1:]).max() < 1e-9 * abs(carried[0])
