"""Derivatives where friction is a function of position: it changes as a design moves the slave's nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, SampledField, Scene, ShapeProblem, Tresca
from fenics_contact._scene.fields import gradients_of
from fenics_contact.design import Objective
from fenics_contact.design import contact_derivatives as contact_derivative
from fenics_contact.errors import InvalidInputError
from tests.design.blocks import block_on_block, block_on_floor, designs_of, problem
from tests.design.objectives import objectives
from tests.design.plane_blocks import line_of, on_block, on_obstacle, plane_problem
from tests.design.quotients import Line, Patch, check_statuses, miss_without


def rough(points: np.ndarray) -> np.ndarray:
    """A friction coefficient that grows upwards and towards one end."""
    return np.asarray(0.25 + 0.1 * points[:, 0] * (1.0 + 20.0 * points[:, -1]))


def dry(points: np.ndarray) -> np.ndarray:
    """A largest tangential traction."""
    return np.asarray(0.6 * np.exp(6.0 * points[:, -1]) * (1.0 + 0.1 * np.sin(points[:, 0])))


def measured() -> SampledField:
    """The coefficient at some points around the contact."""
    x, y = np.meshgrid(np.linspace(-0.21, 2.23, 9), np.linspace(-0.105, 0.13, 3), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    return SampledField(places, rough(places), reach=0.5)


def by_mortar(scene: Scene) -> Scene:
    return replace(scene, contacts=[replace(pair, discretisation="mortar") for pair in scene.contacts])


SCENES: dict[str, Callable[[], Scene]] = {
    "plane floor": lambda: on_obstacle(Coulomb(rough), "quadrilateral"),
    "plane blocks, measured": lambda: on_block(Coulomb(measured()), "quadrilateral"),
    "plane blocks, Tresca": lambda: on_block(Tresca(lambda points: 1.4 * dry(points)), "triangle"),
    "plane, quadratic": lambda: on_block(Coulomb(rough), "triangle", 2),
    "floor, Tresca": lambda: block_on_floor(Tresca(dry), load=(0.35, 0.1, -2.0)),
    "blocks": lambda: block_on_block(Coulomb(rough), load=(0.5, 0.12, -2.0)),
    "blocks by mortar": lambda: by_mortar(block_on_block(Coulomb(rough), load=(0.5, 0.12, -2.0))),
}
BODY = {"blocks": "upper", "blocks by mortar": "upper"}
OBJECTIVES = tuple(objectives("block"))


@cache
def line(name: str) -> Line:
    scene = SCENES[name]()
    if scene.dim == 2:
        return line_of(scene)
    blocks = problem(scene)
    assert len(designs_of(scene)) == len(blocks.designs)
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(6).standard_normal(blocks.size), 1e-5)


@cache
def judge(name: str, objective: str) -> Objective:
    return objectives(BODY.get(name, "block"))[objective]


def without_gradients(patch: Patch) -> None:
    """Let friction stay what it is while nodes move."""
    whole: Any = contact_derivative.bounds_by_place  # type: ignore[attr-defined]
    patch.setattr(contact_derivative, "bounds_by_place", lambda *given: np.zeros_like(whole(*given)))


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    here = line(name)
    assert here.steepness(judge(name, objective)) > 0.015
    assert here.miss(judge(name, objective)) < 1e-5


@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_are_quadratic(name: str) -> None:
    for objective in ("energy", "friction forces"):
        assert line(name).taylor_rate(judge(name, objective)) > 1.9


@pytest.mark.parametrize("name", SCENES)
def test_the_gradient_of_friction_counts(name: str) -> None:
    assert miss_without(without_gradients, line(name), judge(name, "friction forces")) > 1e-3


def test_default_settings_give_the_same_gradient() -> None:
    here, energy = line("plane blocks, measured"), judge("plane blocks, measured", "energy")
    contact = ContactProblem(here.problem.scene, MPI.COMM_SELF)
    slope = float(ShapeProblem(contact, here.problem.designs, energy)(here.alpha)[1] @ here.direction)
    assert slope == pytest.approx(here.quotient(energy), rel=1e-3)


def test_gradients_of_smooth_functions_are_exact_to_ten_digits() -> None:
    points = np.random.default_rng(1).uniform(3.0, 5.0, (20, 3))
    found = gradients_of("a field", lambda x: np.sin(x[:, :1]) * x, points, (3,))
    x = points[:, 0]
    exact = (
        np.sin(x)[:, None, None] * np.eye(3) + np.cos(x)[:, None, None] * points[:, :, None] * np.eye(3)[0]
    )
    assert found.shape == (20, 3, 3)
    np.testing.assert_allclose(found, exact, atol=1e-8)


def test_a_field_that_is_not_known_beside_the_nodes_is_refused() -> None:
    def edge(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 0.0, np.nan, 0.3)

    message = r"given as friction of block y0 on rigid plane, asked .* beside the nodes .* finite numbers"
    scene = on_obstacle(Coulomb(edge), "quadrilateral")
    with pytest.raises(InvalidInputError, match=message):
        plane_problem(scene).evaluate(np.zeros(5))
