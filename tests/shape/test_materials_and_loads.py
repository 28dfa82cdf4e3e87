"""Derivatives of a block of two materials that is heated and drawn by a force that varies in space."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Pressure,
    Scene,
    Surface,
    ThermalStrain,
    TotalForce,
    Tresca,
    Ufl,
)
from fenics_contact.design import Objective
from fenics_contact.design import load_derivatives as work_derivative
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, OrthotropicElasticity
from tests.contact.gallery import FLOOR, crowned
from tests.shape.aims import aims
from tests.shape.blocks import problem
from tests.shape.objectives import objectives
from tests.shape.quotients import Line, miss_without

WOOD = OrthotropicElasticity(
    (90.0, 60.0, 80.0), (0.2, 0.3, 0.25), (30.0, 35.0, 25.0), thermal_expansion=(1e-3, 2e-3, 0.0)
)
JUDGES = objectives("block") | {
    name: aims("block", "z0")[name] for name in ("largest stress", "friction work")
}


def two_materials() -> Scene:
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), 0.02)
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.7
    mesh = replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})
    materials = {"left": IsotropicElasticity(120.0, 0.3, 1e-3), "right": WOOD}
    return Scene(
        {"block": Body(mesh, materials)},
        loads=[
            Pressure("block", "z1", lambda points: 2.0 + 0.2 * points[:, 0]),
            TotalForce("block", "z1", (0.02, 0.0, -0.1), moment=(0.01, 0.02, 0.05), at=(0.9, 0.6, 1.5)),
            BodyForce("block", Ufl(lambda x: [0.3 * x[2], 0.1, -0.2 * x[0]])),
            ThermalStrain("block", 5.0),
            ThermalStrain("block", Ufl(lambda x: 3.0 * x[2] * x[0])),
        ],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, Tresca(0.6))],
    )


@cache
def line() -> Line:
    blocks = problem(two_materials())
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(6).standard_normal(blocks.size), 1e-5)


@pytest.mark.parametrize("objective", JUDGES)
def test_the_adjoint_agrees_with_central_differences(objective: str) -> None:
    assert line().is_smooth()
    assert line().steepness(JUDGES[objective]) > 0.02
    assert line().miss(JUDGES[objective]) < 1e-5


def test_heat_and_the_force_count() -> None:
    """Without their derivatives the adjoint misses."""

    def left_out(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(work_derivative, "moving_loads", lambda torn, moving: [])

    judge: Objective = JUDGES["energy"]
    assert miss_without(left_out, line(), judge) > 1e-3
