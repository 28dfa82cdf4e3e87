"""Derivatives of pressures, stress, movement and work of friction, where points stick, slip and lift off."""

from __future__ import annotations

from functools import cache

import pytest

from fenics_contact.design import Objective
from tests.design import chains, mortar_lines, moved_blocks, quadratic_blocks
from tests.design.aims import aims
from tests.design.quotients import Line, check_adjoint

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

AIMS = {
    "floor": aims("block", "z0"),
    "floor, Tresca": aims("block", "z1"),
    "blocks, tetrahedra": aims("upper", "z0"),
    "chain": aims("link1", "contact"),
    "mortar": aims("upper", "z0"),
    "quadratic tetrahedra": aims("block", "z0"),
    "quadratic hexahedra": aims("block", "z0"),
    "quadratic triangles": aims("block", "y0", 2),
}
LINES = {
    "chain": lambda: chains.line("mixed"),
    "mortar": lambda: mortar_lines.line("hexahedra"),
    "quadratic tetrahedra": lambda: quadratic_blocks.line("blocks, tetrahedra"),
    "quadratic hexahedra": lambda: quadratic_blocks.line("blocks"),
    "quadratic triangles": lambda: quadratic_blocks.line("plane blocks, triangles"),
}
CASES = [(scene, aim) for scene in AIMS for aim in AIMS[scene]]


@cache
def line(scene: str) -> Line:
    return LINES[scene]() if scene in LINES else moved_blocks.line(scene)


def judged(scene: str, aim: str) -> tuple[Line, Objective]:
    return line(scene), AIMS[scene][aim]


@pytest.mark.parametrize("scene", AIMS)
def test_points_stick_slip_and_lift_off_all_along_the_line(scene: str) -> None:
    assert min(line(scene).counts().values()) > 0
    assert line(scene).is_smooth()


@pytest.mark.parametrize(("scene", "aim"), CASES)
def test_the_adjoint_agrees_with_central_differences(scene: str, aim: str) -> None:
    check_adjoint(*judged(scene, aim), 0.002)


@pytest.mark.parametrize(("scene", "aim"), CASES)
def test_taylor_remainders_are_quadratic(scene: str, aim: str) -> None:
    here, judge = judged(scene, aim)
    assert here.taylor_rate(judge) > 1.9
