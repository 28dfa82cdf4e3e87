"""Derivatives where pairs give their gaps: what a design moves is added to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, Scene, ShapeProblem
from fenics_contact.design import TotalPotential
from fenics_contact.errors import InvalidDesignError
from tests.design.blocks import block_on_block, block_on_floor, designs_of, problem
from tests.design.moved_blocks import DRAG, PUSH
from tests.design.objectives import objectives
from tests.design.quotients import Line, check_adjoint, check_statuses


def bowl(points: np.ndarray) -> np.ndarray:
    """A gap that is small in the middle."""
    return np.asarray(0.006 + 0.02 * ((points[:, 0] - 1.02) ** 2 + (points[:, 1] - 0.55) ** 2))


def given(scene: Scene, **gap: Any) -> Scene:
    (pair,) = scene.contacts
    return replace(scene, contacts=[replace(pair, **gap)])


def on_floor() -> Scene:
    return block_on_floor(Coulomb(0.3), load=PUSH)


def on_block() -> Scene:
    return block_on_block(Coulomb(0.38), load=DRAG)


def sunk() -> Scene:
    """The blocks overlap by a tenth of a facet and more in the middle."""
    scene = on_block()
    return scene.moved({"upper": scene.bodies["upper"].mesh.points - np.array([0.0, 0.0, 0.004])})


SCENES: dict[str, Callable[[], Scene]] = {
    "floor, gap": lambda: given(on_floor(), gap=bowl),
    "floor, adjusted": lambda: given(on_floor(), adjust=0.004),
    "blocks, gap": lambda: given(on_block(), gap=bowl),
    "blocks, adjusted": lambda: given(on_block(), adjust=0.01),
    "blocks, overlap": lambda: given(sunk(), interference="measured"),
    "blocks, interference where near": lambda: given(on_block(), interference=0.001, adjust=0.01),
}
OBJECTIVES = {scene: objectives("block" if scene.startswith("floor") else "upper") for scene in SCENES}


@cache
def line(name: str) -> Line:
    blocks = problem(SCENES[name]())
    alpha = 0.003 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(8).standard_normal(blocks.size), 1e-5)


@pytest.mark.parametrize("name", SCENES)
def test_the_gap_is_the_given_one_and_what_the_design_adds(name: str) -> None:
    here = line(name)
    (pair,) = here.problem.scene.contacts
    start, moved = (here.problem.state_of(a).contact.points for a in (0.0 * here.alpha, here.alpha))
    near = start.distance <= (np.inf if pair.adjust is None else pair.adjust)
    measured = pair.interference == "measured"
    assert near.any()
    np.testing.assert_array_equal(start.given, near)
    wanted = pair.gap_at(here.problem.scene.points[start.slave])
    wanted = 0.0 if wanted is None else wanted
    np.testing.assert_allclose(
        start.gap, np.where(near & (not measured), wanted, start.distance), rtol=0, atol=1e-15
    )
    change = moved.gap - start.gap
    assert np.abs(change).max() > 1e-3
    np.testing.assert_allclose(change, moved.distance - start.distance, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", SCENES)
def test_points_stick_slip_and_lift_off_all_along_the_line(name: str) -> None:
    check_statuses(line(name))


@pytest.mark.parametrize("objective", OBJECTIVES["floor, gap"])
@pytest.mark.parametrize("name", SCENES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    check_adjoint(line(name), OBJECTIVES[name][objective])


def test_default_settings_are_as_good() -> None:
    scene = SCENES["blocks, gap"]()
    blocks = ShapeProblem(ContactProblem(scene, MPI.COMM_SELF), designs_of(scene), TotalPotential())
    alpha, way = line("blocks, gap").alpha, line("blocks, gap").direction
    slope = blocks(alpha)[1] @ way
    quotient = (blocks.value_of(alpha + 1e-4 * way) - blocks.value_of(alpha - 1e-4 * way)) / 2e-4
    assert slope == pytest.approx(quotient, rel=1e-3)


def test_a_node_that_meets_the_master_only_in_a_design_is_refused() -> None:
    scene = on_block()
    apart = scene.bodies["upper"].mesh
    beside = scene.moved({"upper": apart.points + np.array([0.3, 0.0, 0.0])})  # some of it beyond the rim
    closer = given(beside, gap=0.0).reshaped({"upper": apart.points})
    with pytest.raises(InvalidDesignError, match=r"of 35 nodes do so only in this design: move the rim"):
        ContactProblem(closer, MPI.COMM_SELF).solve()
