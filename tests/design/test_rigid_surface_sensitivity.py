"""Derivatives of blocks driven by rigid surfaces, the motion of which follows from a force and a moment."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, RigidSurface, Scene, State, Status, Support
from fenics_contact.design import FrictionWork, Partials, couplings
from tests.design.aims import aims
from tests.design.blocks import block_on_block, designs_of, problem
from tests.design.chains import SOLVER
from tests.design.objectives import objectives
from tests.design.quotients import Line, Patch, Remembering
from tests.scenes import partitions

OBJECTIVES = {**objectives("upper"), **aims("upper", "z0")}
#: Which body's surface is rigid, the other one being held.
RIGID = {
    "slave": (
        RigidSurface(
            "upper", "z1", (1.0, 0.5, 0.8), (None, None, None), (0.004, 0.0, None),
            force=(0.4, 0.1, -2.4), moment=(0.0, 0.0, 0.05),
        ),
        Support("lower", "z0"),
    ),
    "master": (
        RigidSurface(
            "lower", "z0", (1.0, 0.6, -1.0), (-0.02, None, None), (-0.004, None, None),
            force=(0.0, -0.3, 3.0), moment=(0.0, 0.1, 0.0),
        ),
        Support("upper", "z1"),
    ),
}  # fmt: skip


@cache
def line(name: str) -> Line:
    blocks = block_on_block(Coulomb(0.3), load=(0.0, 0.0, 0.0))
    shaped = problem(Scene(blocks.bodies, RIGID[name], [], blocks.contacts))
    alpha = 0.002 * np.random.default_rng(1).standard_normal(shaped.size)
    return Line(shaped, alpha, np.random.default_rng(14).standard_normal(shaped.size), 1e-5)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", RIGID)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    here, judge = line(name), OBJECTIVES[objective]
    assert all(here.counts()[status.name] > 0 for status in Status)
    assert here.is_smooth()
    assert here.steepness(judge) > 0.02
    assert here.miss(judge) < 1e-5
    assert here.taylor_rate(judge) > 1.9


@pytest.mark.parametrize("name", RIGID)
def test_the_work_of_the_load_at_the_point_counts(name: str, monkeypatch: Patch) -> None:
    judge = OBJECTIVES["energy"]
    here = Line(line(name).problem, line(name).alpha + 1e-7, line(name).direction, 1e-5)
    whole = couplings.solve_adjoint  # type: ignore[attr-defined]

    def without_points(state: State, partials: Partials, *more: Any, **named: Any) -> Any:
        return whole(state, replace(partials, by_motion=0.0), *more, **named)

    monkeypatch.setattr(couplings, "solve_adjoint", without_points)
    assert here.miss(judge) > 1e-3


def test_slip_on_a_surface_beside_a_rigid_one_follows_its_motion(monkeypatch: Patch) -> None:
    blocks = block_on_block(Coulomb(0.3), load=(0.5, 0.1, -2.0))
    beam = RigidSurface(
        "lower", "x1", (2.0, 0.6, -0.5), (None, None, None), (None, None, None), force=(2.0, 0.1, 0.2)
    )
    supports = (Support("lower", "x0"), beam)
    scene = Scene(blocks.bodies, supports, blocks.loads, blocks.contacts)
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=SOLVER)
    moving = Remembering(contact, designs_of(scene)[:1], OBJECTIVES["friction work"])
    alpha = 0.002 * np.random.default_rng(1).standard_normal(moving.size)
    here, judge = (
        Line(moving, alpha, np.random.default_rng(14).standard_normal(moving.size), 1e-5),
        FrictionWork(),
    )
    assert here.is_smooth()
    assert here.counts()["SLIP"] > 3
    assert np.abs(judge.partials(here.state(), moving.geometry.forms).by_motion).max() > 0.0
    assert here.miss(judge) < 1e-5
    whole = FrictionWork.partials
    monkeypatch.setattr(FrictionWork, "partials", lambda *given: replace(whole(*given), by_motion=0.0))
    assert Line(moving, alpha + 1e-7, here.direction, 1e-5).miss(judge) > 1e-3
