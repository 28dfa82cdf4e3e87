"""Bars of metal drawn far beyond yield in one load step: tangents are a hundred times softer than elastic."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, DeformedState, Scene, Support, box_partition, solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import FinitePlasticity, NeoHookeanPlasticity

YOUNG, YIELD = 2.1e5, 235.0


@pytest.mark.parametrize("stretch", [1.1, 0.9])
@pytest.mark.parametrize("hardening", [1500.0, 0.0])
@pytest.mark.parametrize(("cells", "boxes"), [((1, 1, 1), 1), ((2, 1, 1), 1), ((4, 1, 1), 2)])
def test_a_bar_of_few_cells_is_drawn_in_one_step(
    cells: tuple[int, int, int], boxes: int, hardening: float, stretch: float
) -> None:
    """By Hencky's strain ε = τ / E + α with τ = σ_y + H α; more motions are soft than rows hold the bar."""
    state = drawn(FinitePlasticity(YOUNG, 0.3, YIELD, isotropic_hardening=hardening), cells, boxes, stretch)
    strain = np.log(stretch)
    exact = (np.sign(strain) * YIELD + hardening * strain) / (1.0 + hardening / YOUNG)
    assert state.reactions()["b x1"].force[0] == pytest.approx(exact / stretch, rel=1e-7)
    assert state.fractions == (1.0,)
    assert len(state.solution.history) < 8


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1)])
def test_a_bar_by_true_stresses_is_drawn_in_one_step(cells: tuple[int, int, int]) -> None:
    """As all cells are strained alike their number does not matter."""
    law = NeoHookeanPlasticity(YOUNG, 0.3, YIELD, isotropic_hardening=1500.0)
    state, finer = drawn(law, cells, 1, 1.1), drawn(law, (4, 2, 2), 2, 1.1)
    one, other = (each.reactions()["b x1"].force[0] for each in (state, finer))
    assert one == pytest.approx(other, rel=1e-7)
    assert state.fractions == (1.0,)


@pytest.mark.parametrize("law", [FinitePlasticity, NeoHookeanPlasticity])
@pytest.mark.parametrize("stretch", [1.1, 0.9])
def test_metal_beyond_yield_has_no_more_motions_that_stress_softens(law: type, stretch: float) -> None:
    """Its stiffness falls alike in all motions, by a hundred: none needs a column that holds it."""
    state = drawn(law(YOUNG, 0.3, YIELD, isotropic_hardening=1500.0), (8, 4, 4), 2, stretch)
    assert state.equilibrium.linearisation.system.softened == 0
    assert state.fractions == (1.0,)


def drawn(law: object, cells: tuple[int, int, int], boxes: int, stretch: float) -> DeformedState:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells)
    supports = [
        Support("b", "x0", (0.0, None, None)),
        Support("b", "y0", (None, 0.0, None)),
        Support("b", "z0", (None, None, 0.0)),
        Support("b", "x1", (2.0 * (stretch - 1.0), None, None)),
    ]
    partitions = {"b": box_partition(mesh, (boxes, 1, 1))}
    state = solve_scene(Scene({"b": Body(mesh, law)}, supports), MPI.COMM_SELF, partitions=partitions)
    assert isinstance(state, DeformedState)
    return state
