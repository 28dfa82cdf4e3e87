"""Bodies of small strain that turn far beside others are told of."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import solve_scene
from fenics_contact.contact.turned_bodies import mean_rotation
from fenics_contact.gallery import block
from fenics_contact.scene import Body, IsotropicElasticity, NeoHooke, RigidSurface, Scene, Support


def turned(angle: float) -> Scene:
    """A linear block whose lower side is turned, and a block of rubber that stays."""
    bodies = {
        "soft": Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), NeoHooke(1.0, 0.3)),
        "hard": Body(block((2, 0, 0), (3, 1, 1), (2, 2, 2)), IsotropicElasticity(100.0, 0.3)),
    }
    turn = RigidSurface("hard", "z0", (2.5, 0.5, 0.0), (0, 0, 0), (0.6 * angle, 0.0, 0.8 * angle))
    return Scene(bodies, [Support("soft", "z0"), turn])


@pytest.mark.parametrize(("angle", "told"), [(0.01, False), (0.2, True)])
def test_a_linear_body_that_turns_far_is_told_of(
    angle: float, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        solve_scene(turned(angle), MPI.COMM_SELF)
    assert ("body 'hard' has turned by 0.2 rad; its material is for small rotations" in caplog.text) is told
    assert "soft" not in caplog.text


@pytest.mark.parametrize("dim", [2, 3])
def test_the_mean_rotation_is_that_of_a_rigid_motion(dim: int) -> None:
    points = np.random.default_rng(3).standard_normal((20, dim)) * np.arange(1, dim + 1) + 100.0
    spin = np.zeros((3, 3))
    spin[0, 1], spin[2, 0], spin[1, 2] = (0.03, 0.0, 0.0) if dim == 2 else (0.03, 0.1, -0.2)
    moved = points @ (spin - spin.T)[:dim, :dim] + 5.0
    assert mean_rotation(points, moved) == pytest.approx(np.linalg.norm(spin), rel=1e-10)
    assert mean_rotation(points, 0.1 * points) == pytest.approx(0.0, abs=1e-12)
