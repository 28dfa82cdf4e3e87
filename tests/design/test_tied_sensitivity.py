"""Derivatives of tied surfaces that move: bonded and sliding, in the plane and in space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact.design import contact_derivatives as tied_derivative
from tests.design.quotients import Patch, check_adjoint, check_default_settings, check_statuses, miss_without
from tests.design.tied_blocks import OBJECTIVES, SCENES, line

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]


def without(term: str) -> Callable[[Patch], None]:
    """Drop a derivative of the tied points' geometry: by the weights of the master, or by normals."""

    def drop(patch: Patch) -> None:
        for name, weight in (("projection_pulled_back", "weight"), ("mortar_by_shape", "pulled")):
            patch.setattr(tied_derivative, name, part_of(name, weight if term == "weight" else term))

    def part_of(name: str, field: str) -> Any:
        whole: Any = getattr(tied_derivative, name)

        def pulled_back(*given: Any) -> Any:
            *before, by = given
            return whole(*before, replace(by, **{field: np.zeros_like(getattr(by, field))}))

        return pulled_back

    return drop


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))
    assert line(name).state().torn.ties.count > 5


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[objective])


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "stress"):
        assert line(name).taylor_rate(OBJECTIVES[objective]) > 1.9


@pytest.mark.parametrize("name", SCENES)
def test_the_weights_of_the_master_count(name: str) -> None:
    assert miss_without(without("weight"), line(name), OBJECTIVES["stress"]) > 2e-4


@pytest.mark.parametrize("name", [name for name in SCENES if "sliding" in name])
def test_the_normals_of_sliding_ties_count(name: str) -> None:
    assert miss_without(without("normal"), line(name), OBJECTIVES["stress"]) > 1e-3


@pytest.mark.parametrize("name", ["plane", "sliding"])
def test_default_settings_give_the_same_gradient(name: str) -> None:
    check_default_settings(line(name), OBJECTIVES["energy"])
