"""Bodies of small strain that turn far beside others are told of."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, RigidSurface, Scene, Support, solve_scene
from fenics_contact._equilibrium.warnings import rotation_of
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke


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


def test_a_linear_body_alone_is_told_of_once(caplog: pytest.LogCaptureFixture) -> None:
    """In a scene without any large deformations, in one piece and cut."""
    beam = block((0, 0, 0), (6, 1, 1), (6, 1, 1))

    def scene(angle: float) -> Scene:
        turn = RigidSurface("beam", "x1", (6.0, 0.5, 0.5), (0, 0, 0), (0.0, 0.0, angle))
        return Scene({"beam": Body(beam, IsotropicElasticity(100.0, 0.3))}, [Support("beam", "x0"), turn])

    for partition in ({"beam": np.zeros(6, dtype=int)}, {"beam": np.arange(6) // 3}):
        caplog.clear()
        problem = ContactProblem(scene(0.7), MPI.COMM_SELF, partitions=partition)
        with caplog.at_level(logging.WARNING, logger="fenics_contact"):
            for angle in (0.01, 0.7, 0.8):
                problem.solve(scene(angle))
        (words,) = [record.getMessage() for record in caplog.records]
        assert words.startswith("body 'beam' has turned by ")
        assert words.endswith("give it a material for large deformations, such as StVenantKirchhoff")


@pytest.mark.parametrize("dim", [2, 3])
def test_the_rotation_of_a_body_is_that_of_its_rigid_motion(dim: int) -> None:
    mesh = rectangle((100, 0), (101, 2), (3, 2)) if dim == 2 else block((100, 0, 0), (101, 2, 3), (2, 2, 1))
    spin = np.zeros((3, 3))
    spin[0, 1], spin[2, 0], spin[1, 2] = (0.03, 0.0, 0.0) if dim == 2 else (0.03, 0.1, -0.2)
    moved = mesh.points @ (spin - spin.T)[:dim, :dim] + 5.0
    assert rotation_of(mesh, moved) == pytest.approx(np.linalg.norm(spin), rel=1e-10)
    assert rotation_of(mesh, 0.1 * mesh.points) == pytest.approx(0.0, abs=1e-12)
