"""What states of moved bodies report: balance beside bodies of small strain, slip of bodies that turn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TangentNewton,
    solve_scene,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import J2Plasticity, PlaneStrain
from tests.nonlinear.scenes import RUBBER

LINEAR, METAL = PlaneStrain(3.0, 0.3), J2Plasticity(3.0, 0.3, 0.1, isotropic_hardening=0.3)


@pytest.mark.parametrize(
    ("low", "high"), [(LINEAR, RUBBER), (RUBBER, LINEAR), (RUBBER, METAL)], ids=["under", "over", "metal"]
)
def test_forces_and_moments_balance_beside_bodies_of_small_strain(low: object, high: object) -> None:
    """These are in balance about undeformed places, rubber about deformed ones."""
    bodies = {
        "low": Body(rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), low),  # type: ignore[arg-type]
        "high": Body(rectangle((0.6, 1.0), (2.2, 1.8), (4, 2)), high),  # type: ignore[arg-type]
    }
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), Coulomb(0.3), "node")
    supports = [Support("low", "y0"), Support("high", "y1", (0.05, -0.15))]
    balance = solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF).balance()
    assert balance.imbalance < 1e-8
    across = np.abs(balance.gaps.moment) / balance.moment_scale
    assert across > 1e-3, "forces of a pair have a moment between deformed and undeformed places"


def test_slip_of_earlier_steps_turns_about_the_normal() -> None:
    """Two blocks slide on each other, and then turn together by 120 degrees."""
    low, high = block((-1, -1, 0), (1, 1, 0.5), (2, 2, 1)), block((-0.5, -0.5, 0.5), (0.5, 0.5, 1), (2, 2, 1))

    def supports(way: float, angle: float) -> list[RigidSurface]:
        c, s = np.cos(angle), np.sin(angle)
        moved = (way * c, way * s, -0.05)
        return [
            RigidSurface("low", "z0", (0, 0, 0), displacement=(0, 0, 0), rotation=(0, 0, angle)),
            RigidSurface("high", "z1", (0, 0, 1), displacement=moved, rotation=(0, 0, angle)),
        ]

    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), discretisation="node")
    bodies = {"low": Body(low, RUBBER), "high": Body(high, RUBBER)}
    problem = ContactProblem(Scene(bodies, supports(0.0, 0.0), contacts=[pair]), MPI.COMM_SELF)
    angle = 2.0 * np.pi / 3.0
    steps = [LoadStep(str(turn), supports=supports(0.2, turn)) for turn in (0.0, angle)]
    slid, turned = (state.contact for state in solve_steps(problem, steps))
    before, after = (
        np.einsum("na,nad->nd", each.total_slip, each.points.tangents) for each in (slid, turned)
    )
    c, s = np.cos(angle), np.sin(angle)
    assert np.abs(turned.slip).max() < 1e-6
    assert np.linalg.norm(before, axis=1).min() > 0.1
    np.testing.assert_allclose(after, before @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T, atol=1e-6)


def test_friction_to_and_fro_within_a_load_step_is_the_sum_over_parts_with_histories_of_their_own() -> None:
    """As one step of the law it counts by where slip ends."""
    bodies = {
        "low": Body(rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), RUBBER),
        "high": Body(rectangle((1.0, 1.0), (2.0, 1.6), (2, 1)), RUBBER),
    }
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), Coulomb(0.1), "node")

    def supports(time: float) -> list[Support]:
        down, along = min(4.0 * time, 1.0), max(4.0 * time - 1.0, 0.0) / 3.0
        return [Support("low", "y0"), Support("high", "y1", (0.3 * along * (1.0 - along), -0.05 * down))]

    def followed(times: Sequence[float], **how: Any) -> list[DeformedState]:
        steps = AutomaticSteps(TangentNewton(tolerance=1e-10), **how)
        problem = ContactProblem(Scene(bodies, supports(0.0), contacts=[pair]), MPI.COMM_SELF, steps=steps)
        found = solve_steps(problem, [LoadStep(str(t), supports=supports, time=t) for t in times])
        return [state for state in found if isinstance(state, DeformedState)]

    (by_parts,) = followed([1.0], first=0.125, finer_history=True)
    assert 4 <= len(by_parts.fractions) <= 8
    singly = followed(by_parts.fractions)
    dissipated = sum(state.energies.friction for state in singly)
    assert dissipated > 1e-4
    assert by_parts.energies.friction == pytest.approx(dissipated, rel=1e-6)
    (at_once,) = followed([1.0], first=0.125)
    assert at_once.energies.friction < 0.5 * dissipated
    slip = np.linalg.norm(at_once.contact.slip, axis=1)
    assert at_once.energies.friction == pytest.approx(at_once.contact.slip_bound @ slip, rel=1e-6)
