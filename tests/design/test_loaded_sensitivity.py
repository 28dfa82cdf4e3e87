"""Derivatives where loaded surfaces move and loads vary in space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact import Pressure, ShapeProblem
from fenics_contact.design import (
    load_derivatives as resultant_derivative,
)
from fenics_contact.design import (
    load_derivatives as work_derivative,
)
from fenics_contact.design import (
    motion as volume_integral,
)
from fenics_contact.errors import InvalidInputError
from tests.design.loaded_blocks import OBJECTIVES, PLANE_PUSH, SCENES, line, loaded
from tests.design.plane_blocks import plane_problem
from tests.design.quotients import Patch, check_adjoint, check_default_settings, check_statuses, miss_without

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]


def without_loads(patch: Patch) -> None:
    patch.setattr(work_derivative, "moving_loads", lambda torn, moving: [])


def without_fields(module: Any) -> Callable[[Patch], None]:
    """Let the nodal values of fields stay what they are while nodes move."""

    def drop(patch: Patch) -> None:
        whole = module.field_by_places
        patch.setattr(module, "field_by_places", lambda *given: np.zeros_like(whole(*given)))

    return drop


def without_moments(coefficient: str) -> Callable[[Patch], None]:
    """Let a moment of the surface over which a force is spread stay what it is."""

    def drop(patch: Patch) -> None:
        whole: Any = resultant_derivative._spread

        def spread(*given: Any) -> Any:
            found = whole(*given)
            return replace(found, **{coefficient: 0.0 * getattr(found, coefficient)})

        patch.setattr(resultant_derivative, "_spread", spread)

    return drop


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[objective])


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "stress"):
        assert line(name).taylor_rate(OBJECTIVES[objective]) > 1.9


@pytest.mark.parametrize("name", SCENES)
def test_loads_count(name: str) -> None:
    assert miss_without(without_loads, line(name), OBJECTIVES["stress"]) > 1e-3


@pytest.mark.parametrize("name", ["plane, measured pressure", "tractions of position", "volume"])
def test_the_gradients_of_fields_count(name: str) -> None:
    assert miss_without(without_fields(work_derivative), line(name), OBJECTIVES["stress"]) > 1e-3


def test_the_gradient_of_a_temperature_counts_in_stresses() -> None:
    assert miss_without(without_fields(volume_integral), line("volume"), OBJECTIVES["stress"]) > 1e-3


@pytest.mark.parametrize("coefficient", ["constant", "linear", "square"])
@pytest.mark.parametrize("name", ["plane, force and moment", "force and moment"])
def test_area_centroid_and_second_moment_of_the_surface_count(name: str, coefficient: str) -> None:
    assert miss_without(without_moments(coefficient), line(name), OBJECTIVES["stress"]) > 1e-3


def test_default_settings_give_the_same_gradient() -> None:
    check_default_settings(line("tractions of position"), OBJECTIVES["energy"])


def test_a_field_that_is_not_known_beside_the_surface_is_refused() -> None:
    def edge(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 0.0, np.nan, 2.0)

    scene = loaded("quadrilateral", [Pressure("block", "y1", edge), PLANE_PUSH])
    top = line("plane, pressure").problem.designs[1]
    problem = ShapeProblem(plane_problem(scene).contact, top, OBJECTIVES["energy"])
    with pytest.raises(
        InvalidInputError, match=r"Pressure on body 'block', asked .* beside the nodes for its g"
    ):
        problem.evaluate(np.zeros(problem.size))
