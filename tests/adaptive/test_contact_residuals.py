"""What contact misses between nodes, and what supports determine, is as theory says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LinearState,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
    goal_error,
)
from fenics_contact._adaptive import boundary_errors, goal_errors
from fenics_contact._adaptive.contact_residuals import between_nodes
from fenics_contact._adaptive.resultants import SupportForce, _of_joints
from fenics_contact._surfaces.facets import faceted_surface
from fenics_contact._surfaces.true_surface import by_shape
from fenics_contact.design import Movement, Objective, TotalPotential
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.shapes import Cylinder

STEEL = IsotropicElasticity(1000.0, 0.3)
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))


def pressed(load: float, **pair: Any) -> LinearState:
    """A plate that is 0.03 above a floor, held at its top and heavy."""
    plate = Body(rectangle((0.0, 0.03), (2.0, 1.03), (4, 2)), PlaneStrain(1000.0, 0.3))
    supports = [Support("plate", "x0", (0.0, None))]
    contact = ContactPair(Surface("plate", "y0"), FLOOR, **pair)
    scene = Scene({"plate": plate}, supports, [Traction("plate", "y1", (0.0, -load))], [contact])
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10).solve(adjoint=True)
    assert isinstance(state, LinearState)
    return state


@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_gaps_that_are_given_are_missed_nowhere_between_nodes(gap: float) -> None:
    """The plate comes down by the given gap, not by the measured one: all contacts are closed exactly."""
    state = pressed(5.0, gap=gap)
    assert state.contact.normal_force.min() > 0.0
    assert state.gather_displacement("plate")[:, 1].max() == pytest.approx(-gap, abs=0.01)
    missed = between_nodes(state, state.solution.multiplier, 0.0)
    assert abs(missed) < 1e-8 * 0.03 * state.contact.normal_force.sum()


@pytest.mark.parametrize(
    ("objective", "opening"), [(TotalPotential(), 0.0), (Movement("plate", "y1", (0.0, -1.0)), 0.5)]
)
def test_forces_of_adjoints_work_on_half_of_the_gaps_but_those_of_energies_on_none(
    objective: Objective, opening: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of energies are multiples of the pressure, zero where nodes are open."""
    asked: list[float] = []

    def watched(state: LinearState, multiplier: np.ndarray, share: float, *others: Any) -> float:
        asked.append(share)
        return between_nodes(state, multiplier, share, *others)

    monkeypatch.setattr(goal_errors, "between_nodes", watched)
    goal_error(pressed(5.0), objective)
    assert asked == [opening]


def test_rows_that_supports_determine_carry_no_force_of_a_tie() -> None:
    """Along the normal both sides of a sliding tie are held: whatever the multipliers are, no force acts."""
    bodies = {
        "lower": Body(block((0, 0, 0), (2, 1, 1), (2, 2, 1)), STEEL),
        "upper": Body(block((0, 0, 1), (2, 1, 2), (2, 2, 1)), STEEL),
    }
    flat = [Support("lower", "z1", (None, None, 0.0)), Support("upper", "z0", (None, None, 0.0))]
    guides = [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
    tie = Tie(Surface("upper", "z0"), Surface("lower", "z1"), sliding=True)
    loads = [Traction("upper", "z1", (0.0, 0.0, -1.0))]
    scene = Scene(bodies, [Support("lower", "z0"), *flat, *guides], loads, ties=[tie])
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9).solve()
    assert isinstance(state, LinearState)
    torn = state.torn
    (_, slides), fixed = torn.tie_rows, torn.decomposition.fixed
    rows = torn.groups.rows_of(slides)
    assert slides.count
    assert slides.held(fixed).all()
    forced = state.solution.multiplier.copy()
    forced[torn.numbering.owned_index(rows)] = 1.0
    assert np.abs(slides.forces(torn.gathered(forced, slides), fixed)).max() == 0.0
    held = SupportForce("upper", "z0", (0.0, 0.0, 1.0))._held(state)
    assert np.abs(torn.ties.relative(held)).max() == pytest.approx(1.0)
    assert np.abs(_of_joints(torn, held)).max() == 0.0


def test_chords_of_a_cylinder_move_until_they_enclose_its_area_at_rims_too() -> None:
    """A parabola over a chord encloses two thirds of its height times the chord."""
    angle, z = np.linspace(0.0, 1.6, 9), np.linspace(0.0, 1.0, 4)
    a, b = (each.ravel() for each in np.meshgrid(angle, z, indexing="ij"))
    number = np.arange(len(a)).reshape(9, 4)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    facets = np.stack(corners, axis=-1).reshape(-1, 4)
    points = np.column_stack([3.0 * np.cos(a), 3.0 * np.sin(a), b])
    round_one = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3.0)
    surface = by_shape(faceted_surface(points, facets), round_one)
    moved = points + boundary_errors._way_outwards(len(points), [surface])
    rim = number[1:-1, 0]

    def sector(nodes: np.ndarray) -> float:
        x, y = nodes[rim, 0], nodes[rim, 1]
        return 0.5 * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))

    true = 4.5 * (angle[-2] - angle[1])
    assert abs(true - sector(moved)) < 0.02 * (true - sector(points))
