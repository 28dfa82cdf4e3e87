"""Derivatives of scenes of blocks: rigid floors, Tresca friction, weight, tetrahedra, loads left in place."""

from __future__ import annotations

import pytest

from tests.design.moved_blocks import OBJECTIVES, SCENES, line
from tests.design.quotients import check_adjoint, check_statuses

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES["floor"])
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[name][objective])


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "normal forces"):
        assert line(name).taylor_rate(OBJECTIVES[name][objective]) > 1.9
