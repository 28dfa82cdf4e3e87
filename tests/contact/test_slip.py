"""Slip is how far a slave node moved along its master in the last step, whether friction minds or not."""

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
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene.pairs import Discretisation
from fenics_contact.gallery import block
from tests.contact.gallery import SOFT, STIFF, crowned

WALL = RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def pushed(friction: Coulomb | None, discretisation: Discretisation = "node") -> Scene:
    """A crowned block pressed on another one and pushed along it, beside a wall without friction."""
    lower = block((0.0, 0.0, -0.7), (2.1, 1.1, 0.0), (7, 3, 2))
    upper = crowned(block((0.3, 0.0, 0.0), (1.8, 1.1, 0.9), (5, 3, 3)), 0.03)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0"), Support("upper", "z1", (0.02, 0.003, -0.04))],
        contacts=[
            ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation),
            ContactPair(Surface("upper", "y0"), WALL),
        ],
    )


def cut(scene: Scene) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, (2, 3, 1)) for name, body in scene.bodies.items()}


def moved_along(state: State) -> np.ndarray:
    """Return the relative displacement along the tangents, from the displacements of the bodies."""
    displacement = np.vstack([state.gather_displacement(name) for name in state.scene.bodies])
    points = state.contact.points
    return np.einsum("nad,nd->na", points.tangents, points.jump @ displacement)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("friction", [None, Coulomb(0.2)])
def test_slip_is_the_relative_displacement_with_and_without_friction(
    friction: Coulomb | None, discretisation: Discretisation
) -> None:
    scene = pushed(friction, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    contact, expected = state.contact, moved_along(state)
    size = np.abs(expected).max()
    assert size > 0.01
    for pair in (0, 1):
        mine = contact.on_pair(pair)
        assert {Status.OPEN, Status.SLIP} & set(contact.status[mine])
        assert np.abs(expected[mine]).max() > 0.1 * size
        np.testing.assert_allclose(contact.slip[mine], expected[mine], atol=1e-3 * size)
    np.testing.assert_array_equal(contact.slip_before, 0.0)
    assert not contact.friction_force[contact.on_pair(1)].any()


def test_slip_without_friction_counts_from_the_last_step() -> None:
    scene = pushed(None)
    base, way = scene.supports[0], [(0.02, 0.0), (0.05, 0.01), (0.01, -0.02)]
    steps = [LoadStep(f"{x}, {y}", supports=[base, Support("upper", "z1", (x, y, -0.04))]) for x, y in way]
    states = solve_steps(
        ContactProblem(replace(scene, supports=[base]), MPI.COMM_SELF, partitions=cut(scene), tolerance=1e-8),
        steps,
    )
    before = np.zeros_like(states[0].contact.slip)
    for state in states:
        contact, total = state.contact, moved_along(state)
        size = np.abs(total).max()
        np.testing.assert_allclose(contact.total_slip, total, atol=1e-6 * size)
        np.testing.assert_allclose(contact.slip, total - before, atol=1e-6 * size)
        before = total
        assert np.abs(contact.slip).max() > 0.01
    assert np.abs(states[2].contact.slip_before).max() > 0.01
