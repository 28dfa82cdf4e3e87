"""Load steps with other contact pairs than before: another friction, another closure, pairs switched off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LinearClosure,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.qp import FaceNewton
from tests.equilibrium.friction_steps import FLOOR, FRICTION, coulomb_reference, sheared_block

LESS = 0.1
WALL = RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def held(shift: float, scale: float = 1.0) -> list[Support]:
    return [Support("block", "z1", (scale * shift, 0.0, -0.01 * scale))]


def problem_of(scene: Scene) -> ContactProblem:
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    solver = None if scene.is_nonlinear else FaceNewton(tolerance=1e-9)
    return ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=solver)


def test_less_friction_lets_a_block_spring_back_as_an_independent_solver_finds() -> None:
    scene = sheared_block(Coulomb(FRICTION))
    (pair,) = scene.contacts
    steps = [
        (FRICTION, LoadStep("press", supports=held(0.0))),
        (FRICTION, LoadStep("push", supports=held(0.02))),
        (LESS, LoadStep("less", contacts=[replace(pair, friction=Coulomb(LESS))])),
        (LESS, LoadStep("back", supports=held(0.01))),
        (FRICTION, LoadStep("more", contacts=[pair], supports=held(0.02))),
    ]
    states = solve_steps(problem_of(scene), [step for _, step in steps])
    before, supports = None, scene.supports
    for (friction, step), state in zip(steps, states, strict=True):
        supports = supports if step.supports is None else step.supports
        before, force = coulomb_reference(replace(scene, supports=supports), before, friction)
        np.testing.assert_allclose(state.contact.force, force, rtol=0, atol=1e-5 * np.abs(force).max())
    pushed, less = (state.contact.force[:, 0].sum() for state in states[1:3])
    assert abs(less) < 0.5 * abs(pushed)


def two_walls(material: IsotropicElasticity | NeoHooke) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2))
    pairs = [
        ContactPair(Surface("block", "z0"), FLOOR, Coulomb(FRICTION)),
        ContactPair(Surface("block", "y0"), WALL, Coulomb(LESS)),
    ]
    return Scene({"block": Body(mesh, material)}, contacts=pairs)


def on(state: State, pair: int) -> np.ndarray:
    return np.asarray(state.contact.force[state.contact.points.pair == pair].sum(axis=0))


def test_pairs_that_are_switched_off_carry_nothing_and_come_back() -> None:
    scale, found = 1e-3, []
    for material in (IsotropicElasticity(1000.0, 0.3), NeoHooke(1000.0, 0.3)):
        scene = two_walls(material)
        floor, wall = scene.contacts
        steps = [
            LoadStep("push", supports=held(0.02, scale)),
            LoadStep("no wall", contacts=[floor]),
            LoadStep("a wall", contacts=[floor, wall]),
        ]
        found.append(solve_steps(problem_of(scene), steps))
    for small, large in zip(*found, strict=True):
        assert len(small.contact.force) == len(large.contact.force)
        np.testing.assert_allclose(
            large.contact.force, small.contact.force, rtol=0, atol=2e-4 * np.abs(small.contact.force).max()
        )
    pushed, without, again = found[0]
    assert on(pushed, 1)[1] > 0.02 * on(pushed, 0)[2] > 0.0
    assert not (without.contact.points.pair == 1).any()
    assert on(again, 1)[1] > on(pushed, 1)[1], "the block has widened through the wall meanwhile"


def test_the_first_of_several_pairs_is_switched_off_where_displacements_are_small() -> None:
    scene = two_walls(IsotropicElasticity(1000.0, 0.3))
    frictionless = [replace(pair, friction=None) for pair in scene.contacts]
    steps = [
        LoadStep("both", supports=held(0.0), contacts=frictionless),
        LoadStep("one", contacts=frictionless[1:]),
    ]
    state = solve_steps(problem_of(scene), steps)[-1]
    alone = replace(scene, contacts=frictionless[1:], supports=held(0.0))
    expected = solve_scene(alone, MPI.COMM_SELF, tolerance=1e-9).contact.force
    np.testing.assert_allclose(state.contact.force, expected, atol=1e-7 * np.abs(expected).max())
    large = two_walls(NeoHooke(1000.0, 0.3))
    steps = [LoadStep("both", supports=held(0.0, 1e-3)), LoadStep("one", contacts=large.contacts[1:])]
    with pytest.raises(InvalidInputError, match=r"may leave out the last pairs alone, got 1 of 2: give"):
        solve_steps(problem_of(large), steps)


def test_another_closure_holds_from_its_step_on() -> None:
    scene = sheared_block(Coulomb(FRICTION))
    (pair,) = scene.contacts
    soft = replace(pair, closure=LinearClosure(500.0), friction=None)
    steps = [LoadStep("hard", supports=held(0.0)), LoadStep("soft", contacts=[soft])]
    hard, state = solve_steps(problem_of(scene), steps)
    fresh = solve_scene(replace(scene, contacts=[soft], supports=held(0.0)), MPI.COMM_SELF, tolerance=1e-9)
    np.testing.assert_allclose(state.contact.force, fresh.contact.force, atol=1e-6)
    assert on(state, 0)[2] < 0.9 * on(hard, 0)[2]
