"""Derivatives of scenes of blocks: rigid floors, Tresca friction, weight, tetrahedra, loads left in place."""

from __future__ import annotations

import pytest

from fenics_contact.contact import Status
from tests.shape.moved_blocks import OBJECTIVES, SCENES, line


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    contact = line(name).state().contact
    assert all(contact.count(status) > 0 for status in Status)
    assert line(name).is_smooth()


@pytest.mark.parametrize("objective", OBJECTIVES["floor"])
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    here, judge = line(name), OBJECTIVES[name][objective]
    assert here.steepness(judge) > 0.02
    assert here.miss(judge) < 1e-5


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "normal forces"):
        assert line(name).taylor_rate(OBJECTIVES[name][objective]) > 1.9
