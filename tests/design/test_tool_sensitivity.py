"""Derivatives of blocks under rigid tools that forces and springs move: arms change with the shape."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
    ToolMotion,
)
from fenics_contact.gallery import block
from tests.design.blocks import RUBBER, problem
from tests.design.objectives import objectives
from tests.design.quotients import Line, check_adjoint, check_statuses
from tests.scenes import crowned

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

TOOL = RigidTool("ball", RigidSphere((0.9, 0.55, -4.0), 4.0), at=(0.4, 0.3, -1.0))
MOTIONS = {
    "free": ToolMotion("ball", (None, None, None), (0, 0, 0), force=(0.25, 0.1, 3.0)),
    "tilting": ToolMotion("ball", (0, 0, None), (None, None, 0), force=(0, 0, 3.0), moment=(0.2, 0.1, 0)),
    "sprung": ToolMotion(
        "ball", (None, 0, None), (None, None, None), (0.3, 0, 3.0), stiffness=(9.0, 0, 20.0),
        rotational_stiffness=(5.0, 5.0, 5.0),
    ),
    "prescribed": ToolMotion("ball", (0.004, 0.002, 0.02), (0.001, -0.002, 0.003)),
}  # fmt: skip
#: Where 0.3 lets all points slip.
FRICTION = {"tilting": 1.0, "sprung": 1.0}
OBJECTIVES = objectives("block")


@cache
def line(name: str) -> Line:
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), -0.06)
    lowest = TOOL.distance(mesh.points[np.unique(mesh.surfaces["z0"])]).min()
    mesh = mesh.moved(mesh.points - (0.0, 0.0, lowest))
    blocks = problem(
        Scene(
            {"block": Body(mesh, RUBBER)},
            [Support("block", "z1"), MOTIONS[name]],
            contacts=[ContactPair(Surface("block", "z0"), TOOL, Coulomb(FRICTION.get(name, 0.3)))],
        )
    )
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(27).standard_normal(blocks.size), 1e-5)


@pytest.mark.parametrize("name", MOTIONS)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", MOTIONS)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[objective])
