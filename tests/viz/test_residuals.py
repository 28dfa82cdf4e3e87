"""The history of a solve as a diagram: every residual, every outer step, every method."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact.accuracy import BalancedTolerance
from fenics_contact.contact import FixedPoint, solve_scene
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import FaceNewton, Smalse, SolverStep
from fenics_contact.scene import Coulomb
from fenics_contact.viz import plot_residuals
from fenics_contact.viz.colours import BLUE, GREEN, ORANGE
from tests.contact.gallery import partitions, two_blocks
from tests.viz.states import contains, painted, pixels, pulled, touching_blocks

WIDTH = 600


def fixed_point() -> tuple[SolverStep, ...]:
    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=FixedPoint(Smalse(tolerance=1e-3))
    )
    return state.dual_solution.history


def test_the_history_of_a_fixed_point_counts_its_tresca_problems() -> None:
    outer = [step.outer for step in fixed_point()]
    assert outer[0] == 0
    assert outer[-1] >= 1
    assert len(outer) > outer[-1] + 1, "every Tresca problem took one step: nothing was tested"
    assert all(b - a in (0, 1) for a, b in pairwise(outer))
    assert {step.outer for step in touching_blocks().dual_solution.history} == {0}


def test_the_history_of_a_balanced_solve_counts_its_rounds() -> None:
    scene = two_blocks(Coulomb(0.4))
    tight = BalancedTolerance(share=1e-4)
    steps = solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=tight
    ).dual_solution.history
    outer = [step.outer for step in steps]
    assert sorted(set(outer)) == list(range(outer[-1] + 1))
    assert outer[-1] >= 1, "one round was enough: nothing was tested"


def test_all_residuals_are_drawn_with_the_tolerance_and_the_outer_steps(tmp_path: Path) -> None:
    steps = fixed_point()
    image = pixels(plot_residuals(steps, tmp_path / "residuals.png", tolerance=1e-3, width=WIDTH))
    assert image.shape[1] == WIDTH
    for colour in (BLUE, ORANGE, GREEN):
        assert contains(image, colour, 0.06)
    single = pixels(plot_residuals([replace(step, outer=0) for step in steps], tolerance=1e-3, width=WIDTH))
    assert painted(image) > painted(single) + 0.05, "stripes tell the Tresca problems apart"


def test_a_change_of_method_is_named(tmp_path: Path) -> None:
    steps = touching_blocks().dual_solution.history
    rescued = [*steps[:2], *(replace(step, method="SMALSE") for step in steps[2:])]
    one, two = pixels(plot_residuals(steps, width=WIDTH)), pixels(plot_residuals(rescued, width=WIDTH))
    assert painted(two) > painted(one)


def test_the_history_of_a_failure_is_drawn() -> None:
    scene = two_blocks(Coulomb(0.4))
    with pytest.raises(ConvergenceError) as failure:
        solve_scene(
            scene,
            MPI.COMM_SELF,
            partitions=partitions(scene),
            solver=FaceNewton(tolerance=1e-10, max_products=8),
        )
    assert failure.value.history
    assert plot_residuals(failure.value.history, width=WIDTH).png is not None


def test_what_is_no_history_of_a_solve_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"steps, got none: .* checkpoint have no history"):
        plot_residuals(pulled("triangle6").solution.history)
    with pytest.raises(InvalidInputError, match=r"needs steps of a dual solver, got float: pass state"):
        plot_residuals([1.0, 2.0])  # type: ignore[list-item]
    with pytest.raises(InvalidInputError, match=r"tolerance must be positive, got 0"):
        plot_residuals(touching_blocks().dual_solution.history, tolerance=0.0)
