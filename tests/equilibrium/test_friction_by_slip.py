"""Friction coefficients that depend on the slip: closed forms of a rigid block, steps, and states that are
none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LinearClosure,
    LoadStep,
    Scene,
    SlipTable,
    State,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact._equilibrium import slip_dependence
from fenics_contact._equilibrium.passes import Passes
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.design import LoadPath, couplings
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from tests.design import moved_blocks
from tests.design.blocks import problem
from tests.design.quotients import check_adjoint
from tests.equilibrium.law_cases import FLOOR, dragged_block, solved

TABLE = SlipTable(slip=(0.0, 0.1, 0.2), coefficient=(0.4, 0.2, 0.3))
PRESSURE, AREA = 10.0, 2.0


def test_a_rigid_block_has_the_friction_of_its_slip_over_load_steps() -> None:
    mesh, stiff = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 1, 1)), IsotropicElasticity(1e9, 0.0)
    pair = ContactPair(Surface("block", "z0"), FLOOR, Coulomb(TABLE), closure=LinearClosure(1e6))
    down = -PRESSURE / 1e6
    flat, ways = Support("block", "z0", (None, None, down)), (0.05, 0.15, 0.3, 0.12)
    tops = [Support("block", "z1", (0.6 * x, 0.8 * x, down)) for x in ways]
    steps = [LoadStep(f"{x}", supports=[flat, top]) for x, top in zip(ways, tops, strict=True)]
    scene = Scene({"block": Body(mesh, stiff)}, contacts=[pair])
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps)
    for x, sign, state in zip(ways, (1, 1, 1, -1), states, strict=True):
        force = -state.contact.force.sum(axis=0)[:2] @ (0.6, 0.8)
        expected = sign * float(TABLE.at(np.array([x]))[0]) * PRESSURE * AREA
        assert force == pytest.approx(expected, rel=1e-5)
    notes = [step.note for step in states[0].solution.history if "slip pass" in step.note]
    assert 2 <= len(notes) <= 6


def test_the_slope_at_a_corner_of_a_table_is_that_beyond_it() -> None:
    slopes = TABLE.growth(np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.3]))
    np.testing.assert_allclose(slopes, [-2.0, -2.0, 1.0, 1.0, 0.0, 0.0])


def test_bodies_that_give_way_agree_with_their_slips_point_by_point() -> None:
    table = SlipTable((0.0, 0.004), (0.4, 0.3))
    contact = solved(dragged_block(Coulomb(table), 6.0, shift=0.005)).contact
    slip = np.linalg.norm(contact.total_slip, axis=1)
    assert slip.max() > 2.0 * slip.min()
    np.testing.assert_allclose(contact.slip_bound, table.at(slip) * contact.normal_force, rtol=1e-6)
    constant = solved(dragged_block(Coulomb(SlipTable((0.0, 1.0), (0.3, 0.3))), 6.0, shift=0.005))
    plain = solved(dragged_block(Coulomb(0.3), 6.0, shift=0.005), tolerance=1e-10)
    np.testing.assert_allclose(constant.contact.friction_force, plain.contact.friction_force, atol=1e-8)
    assert constant.solution.products == plain.solution.products


@pytest.mark.parametrize(
    ("table", "most"),
    [
        (SlipTable((0.0, 0.002), (0.1, 0.6)), 16),  # changes of coefficients alternate
        (SlipTable((0.0, 0.004), (0.4, 0.1)), 6),  # they get smaller slowly
        (SlipTable((0.0, 0.0008), (0.4, 0.1)), 13),  # they grow until friction is kinetic
    ],
)
def test_passes_agree_where_friction_is_steep(table: SlipTable, most: int) -> None:
    state = solved(dragged_block(Coulomb(table), 6.0, shift=0.005), tolerance=1e-5)
    contact, slip = state.contact, np.linalg.norm(state.contact.total_slip, axis=1)
    np.testing.assert_allclose(contact.slip_bound, table.at(slip) * contact.normal_force, rtol=1e-3)
    assert slip.max() > slip.min() + 1e-4
    assert sum("slip pass" in step.note for step in state.solution.history) <= most
    if table.slip[1] < 0.001:
        np.testing.assert_allclose(contact.slip_bound, 0.1 * contact.normal_force, rtol=1e-9)


def test_a_stored_state_keeps_its_coefficients() -> None:
    scene = dragged_block(Coulomb(SlipTable((0.0, 0.004), (0.4, 0.3))), 6.0, shift=0.005)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
    state = problem.solve()
    found = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9).restore(stored_state(state))
    np.testing.assert_allclose(found.contact.slip_bound, state.contact.slip_bound, rtol=1e-9)
    assert found.solution.residuals.within(1e-7)  # type: ignore[union-attr]


def test_coefficients_that_do_not_agree_are_an_error_with_their_history() -> None:
    state: State = solved(dragged_block(Coulomb(SlipTable((0.0, 0.1), (0.4, 0.1))), 6.0))
    slips = [0.0, 0.1]

    def solve(torn: Any, last: Any, tolerance: Any) -> Any:
        slips.reverse()
        slip = np.full_like(state.contact.slip, slips[0])
        return replace(state, contact=replace(state.contact, slip=slip, slip_before=0.0 * slip))

    with pytest.raises(
        ConvergenceError, match=r"must agree with the slips, .* as in stick-slip; take"
    ) as error:
        slip_dependence.FrictionBySlip().solve(Passes(solve, None), state.torn, None, 1e-6)
    assert "slip pass 3" in error.value.history[-1].note or len(error.value.history) > 3


@pytest.mark.parametrize("name", ["floor, friction by slip", "blocks, friction by slip"])
def test_derivatives_by_the_shape_follow_the_slip(name: str) -> None:
    check_adjoint(moved_blocks.line(name), moved_blocks.OBJECTIVES[name]["friction forces"])


ON_RANKS = """
import numpy as np
from mpi4py import MPI
from fenics_contact import ContactProblem, ShapeProblem
from tests.design.blocks import designs_of
from tests.design.moved_blocks import OBJECTIVES, SCENES

scene = SCENES["floor, friction by slip"]()
contact = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-9)
objective = OBJECTIVES["floor, friction by slip"]["friction forces"]
value, gradient = ShapeProblem(contact, designs_of(scene), objective)(np.zeros(6))
if MPI.COMM_WORLD.rank == 0:
    print(value, *gradient)
"""


def test_derivatives_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    np.testing.assert_allclose(two, one, rtol=1e-5, atol=1e-6 * np.abs(one).max())


def test_derivatives_of_several_load_steps_and_of_too_steep_friction_are_refused() -> None:
    blocks = problem(moved_blocks.SCENES["floor, friction by slip"]())
    path = LoadPath(blocks, [LoadStep("press"), LoadStep("again")])
    with pytest.raises(InvalidInputError, match="with friction by slip need one load step"):
        path(np.zeros(path.size))
    with pytest.raises(ConvergenceError, match="of friction or wear by slip needs a relative residual below"):
        couplings._smallest_residual(lambda y: np.roll(y, 1), np.eye(5)[0], 1e-9, 3)
    turned = couplings._smallest_residual(lambda y: np.roll(y, 1), np.eye(5)[0], 1e-9, 5)
    np.testing.assert_allclose(turned, np.eye(5)[4], atol=1e-12)


def test_bad_tables_and_scenes_are_refused() -> None:
    with pytest.raises(
        InvalidInputError, match="SlipTable needs two or more slips of at least zero in ascending"
    ):
        SlipTable((0.1, 0.0), (0.1, 0.2))
    scene = dragged_block(Coulomb(TABLE), 1.0)
    with pytest.raises(InvalidInputError, match=r"the SlipTable of .* needs linear materials in all"):
        replace(scene, bodies={"block": Body(scene.bodies["block"].mesh, NeoHooke(1.0, 0.3))})
