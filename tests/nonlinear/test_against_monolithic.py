"""Torn bodies under large deformation deform as whole ones do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, DeformedState, LoadSequence, LoadStep, Scene, Support
from fenics_contact.gallery import block
from tests.nonlinear.monolithic import Monolithic
from tests.nonlinear.scenes import RUBBER, cut, pressed, rounded


def histories(scenes: Sequence[Scene], pieces: int) -> tuple[list[DeformedState], Monolithic]:
    """Follow the scenes in both ways."""
    mesh = scenes[0].bodies["block"].mesh
    problem = ContactProblem(scenes[-1], MPI.COMM_SELF, partitions=cut(mesh, pieces), tolerance=1e-10)
    sequence, reference = LoadSequence(problem), Monolithic(scenes[0])
    states: list[DeformedState] = []
    for number, scene in enumerate(scenes):
        state = sequence.advance(LoadStep(str(number), supports=scene.supports))
        assert isinstance(state, DeformedState)
        states.append(state)
        reference.advance(scene)
    return states, reference


def error(state: DeformedState, reference: Monolithic) -> float:
    moved = reference.displacement
    return float(np.abs(state.gather_displacement("block") - moved).max() / np.abs(moved).max())


def test_a_compressed_cube() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (6, 6, 6))
    scenes = [
        Scene({"block": Body(mesh, RUBBER)}, [Support("block", "z0"), Support("block", "z1", (0, 0, -depth))])
        for depth in (0.1, 0.2, 0.3, 0.4)
    ]
    states, reference = histories(scenes, 2)
    assert error(states[-1], reference) < 1e-8
    assert [len(state.solution.history) for state in states] <= [5, 5, 5, 5]
    assert states[-1].equilibrium.linearisation.system.softened > 0, "subdomains buckle at 40 %"
    worst = [line.residuals.worst for line in states[-1].solution.history]
    assert worst[2] < 10 * worst[1] ** 2 / worst[0], "quadratic"


def test_a_pressed_and_dragged_block() -> None:
    mesh = rounded(6)
    scenes = [pressed(mesh, 0.1), *(pressed(mesh, 0.1, 0.08 * k) for k in range(1, 8))]
    states, reference = histories(scenes, 2)
    assert error(states[-1], reference) < 1e-8
    last = states[-1]
    n = last.contact.points.count
    contact = reference.multiplier[-3 * n :]
    assert np.abs(last.contact.normal_force - contact[:n]).max() < 1e-8 * contact.max()
    assert np.abs(last.contact.friction_force.ravel() - contact[n:]).max() < 1e-8 * contact.max()
    assert max(len(state.solution.history) for state in states) <= 7
    assert any(state.contact.count(1) and state.contact.count(2) for state in states), "stick and slip"
