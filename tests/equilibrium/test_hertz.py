"""Contacts of Hertz and of Cattaneo and Mindlin: of one body and two, on coarse meshes and finer ones."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import half_cylinder, hemisphere, rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from fenics_contact.results.area import stick_area
from fenics_contact.study import Parameters
from fenics_contact.study.scenes.cattaneo_mindlin import FRICTION, build, stick_half_width, theory, tractions
from fenics_contact.study.study import Outcome
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.hertz import LENGTH, PLANE_STRAIN, Hertz, cylinder, edge, errors, pressed
from tests.equilibrium.round_bodies import CELL
from tests.equilibrium.round_bodies import pressed as pressed_bodies
from tests.scenes import partitions, two_blocks


def ball(radius: float) -> Hertz:
    force = 4 * PLANE_STRAIN * radius**3 / 3
    return Hertz(radius, 3 * force / (2 * np.pi * radius**2), force)


def ball_errors(n: int, *, grading: float) -> tuple[float, float]:
    theory = ball(edge(grading))
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    state = pressed(hemisphere(1.0, n, grading=grading), guides, theory.force / 4)
    assert state.contact.normal_force.sum() == pytest.approx(theory.force / 4, rel=1e-9)
    return errors(state, theory, (0, 1), 2 / 5)


def cylinder_errors(n: int, *, grading: float) -> tuple[float, float]:
    theory = cylinder(edge(grading))
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "y1": (None, 0.0, None)}
    state = pressed(half_cylinder(1.0, LENGTH, n, grading=grading), guides, theory.force * LENGTH / 2)
    assert state.contact.normal_force.sum() == pytest.approx(theory.force * LENGTH / 2, rel=1e-9)
    return errors(state, theory, (0,), 1 / 4)


def table(name: str, sizes: Sequence[int], found: np.ndarray) -> np.ndarray:
    """Print errors and rates of peak and radius; return the rates, (n − 1, 2)."""
    refinement = np.log(np.array(sizes[1:]) / np.array(sizes[:-1]))
    rates = np.log(np.abs(found[:-1] / found[1:])) / refinement[:, None]
    print(f"\n{name}: cells to the edge | error of peak pressure, rate | error of contact radius, rate")
    for n, error, rate in zip(sizes, found, np.vstack([[np.nan] * 2, rates]), strict=True):
        print(f"  {n:3d} | {error[0]:+.5f} {rate[0]:5.2f} | {error[1]:+.5f} {rate[1]:5.2f}")
    return rates


def assert_falling(found: np.ndarray) -> None:
    assert np.all(np.abs(found[1:]) < np.abs(found[:-1]))


def test_a_cylinder_converges_to_the_pressure_of_hertz() -> None:
    sizes = (4, 8, 16, 32)
    found = np.array([cylinder_errors(n, grading=5.0) for n in sizes])
    rates = table("cylinder", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.005
    assert np.all(rates[:, 1] > 1.5)  # the radius, by second moment, converges at second order
    assert np.abs(found[0]).min() > 0.05, "the coarsest mesh is too good to show convergence"


def test_a_ball_converges_to_the_pressure_of_hertz() -> None:
    sizes = (4, 8, 12)
    found = np.array([ball_errors(n, grading=3.0) for n in sizes])
    rates = table("ball", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.015
    assert rates.min() > 1.0
    assert np.abs(found[0]).min() > 0.05, "the coarsest mesh is too good to show convergence"


@pytest.mark.slow
def test_a_ball_converges_further_on_a_fine_mesh() -> None:
    sizes = (4, 8, 16)
    found = np.array([ball_errors(n, grading=4.0) for n in sizes])
    rates = table("ball, fine", sizes, found)
    assert_falling(found)
    assert np.abs(found[-1]).max() < 0.01
    assert rates.min() > 1.0


# Hertz by the default: two round bodies whose meshes do not match, with eight cells across the contact.
def check_peak(dim: int, ratio: float) -> None:
    scene, peak = pressed_bodies(dim, 4, ratio)
    state = solve_scene(scene, MPI.COMM_SELF)
    pressure, away = state.contact.pressure, np.linalg.norm(state.contact_places[:, :-1], axis=1)
    assert away.min() < 1e-9
    assert np.count_nonzero(away <= 4 * CELL + 1e-9) == {2: 9, 3: 17}[dim]
    assert pressure[np.argmin(away)] == pytest.approx(peak, rel=0.01)
    assert pressure.max() == pytest.approx(peak, rel=0.01)


@pytest.mark.parametrize(
    ("dim", "ratio"), [*((2, ratio) for ratio in (0.55, 0.65, 0.8, 1.25, 1.4)), (3, 1.33)]
)
def test_the_peak_is_that_of_hertz_to_a_percent(dim: int, ratio: float) -> None:
    check_peak(dim, ratio)


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("ratio", [0.55, 0.7, 0.8, 0.9, 1.25])
def test_the_peak_of_balls_is_that_of_hertz_to_a_percent(ratio: float) -> None:
    check_peak(3, ratio)


# Cattaneo and Mindlin: two equal cylinders pressed, then sheared until the edges of the contact slip.
TOLERANCE = 1e-6
SIZES = (8, 16, 32)


def sheared(n: int) -> Outcome:
    """Return the states after pressing and after shearing."""
    parameters = Parameters(n, cell="quadrilateral")
    problem = build(parameters)
    states = solve_steps(
        ContactProblem(problem.scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=TOLERANCE)), problem.steps
    )
    for state in states:
        assert_solved(state, TOLERANCE)
    return Outcome(problem, states, parameters)


@dataclass(frozen=True)
class Errors:
    """Relative errors of the stick half width, of q in L² and in L¹, and of the pressure at the middle."""

    stick: float
    traction: float
    misplaced: float
    peak: float


def friction_errors(outcome: Outcome) -> Errors:
    """Compare with theory for the measured forces."""
    contact, known = outcome.state.contact, theory(outcome.state)
    (x, traction), area = tractions(outcome), contact.points.area
    assert known.half_width == pytest.approx(1.0, abs=2e-3)
    assert known.stick == pytest.approx(0.625, abs=2e-3)
    assert contact.count(Status.STICK) >= 9
    assert contact.count(Status.SLIP) >= 6
    exact = known.traction(x)
    error = traction - exact
    return Errors(
        float(stick_half_width(outcome) / known.stick - 1),
        float(np.sqrt(area @ error**2 / (area @ exact**2))),
        float(area @ np.abs(error) / np.abs(contact.friction_force.sum())),
        float(contact.pressure[np.argmin(np.abs(x))] / known.peak - 1),
    )


def test_stick_width_and_traction_converge_to_those_of_cattaneo_and_mindlin(
    record_property: Callable[[str, object], None],
) -> None:
    found = [friction_errors(sheared(n)) for n in SIZES]
    table = np.array([[abs(e.stick), e.traction, e.misplaced] for e in found])
    rates = np.log2(table[:-1] / table[1:])
    print("\ncells on a | error of c, rate | of q in L2, rate | of q in L1, rate | of p(0)")
    for n, row, rate, e in zip(SIZES, table, np.vstack([[np.nan] * 3, rates]), found, strict=True):
        parts = " | ".join(f"{value:.5f} {r:5.2f}" for value, r in zip(row, rate, strict=True))
        print(f"  {n:3d} | {parts} | {e.peak:+.5f}")
    for name, column in zip(("stick half width", "traction L2", "traction L1"), range(3), strict=True):
        record_property(f"{name}, errors", table[:, column].tolist())
        record_property(f"{name}, rates", rates[:, column].tolist())
    assert np.all(rates > 0.8)
    assert np.all(rates[:, 2] > 1.3)
    assert table[-1, 0] < 0.003
    assert table[-1, 1] < 0.02
    assert abs(found[-1].peak) < 0.001, "the bodies are too small for a half plane"
    assert np.all(table[0] > 0.01), "the coarsest mesh is too good to show convergence"


def test_shear_changes_no_pressure_and_leaves_the_stick_width_of_theory() -> None:
    states = sheared(8).states
    pressed, pushed = (state.contact for state in states)
    assert stick_area(states[-1]) == pytest.approx(2.0 * theory(states[-1]).stick, rel=5e-3)
    largest = pressed.pressure.max()
    tangential = np.abs(pressed.friction_force[:, 0]) / pressed.points.area
    assert np.abs(pushed.friction_force).sum() > 0.5 * FRICTION * pushed.normal_force.sum()
    np.testing.assert_allclose(pushed.pressure, pressed.pressure, rtol=0, atol=2e-3 * largest)
    assert tangential.max() < 5e-3 * FRICTION * largest


# Contact of round bodies that is only a few points wide is told, with the error of its largest pressure.
PLATE, FLOOR = PlaneStrain(1000.0, 0.3), RigidPlane((0.0, 0.0), (0.0, 1.0))


def told(caplog: pytest.LogCaptureFixture, scene: Scene) -> tuple[list[str], float]:
    """Return what is told of the size of contacts, and the largest pressure; a tenth is a remark alone."""
    caplog.clear()
    with caplog.at_level(logging.INFO):
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    records = [each for each in caplog.records if " is too small for its cells" in each.getMessage()]
    for record in records:
        assert (record.levelno == logging.WARNING) == ("by a half or more" in record.getMessage())
    return [record.getMessage() for record in records], float(state.contact.pressure.max())


@pytest.mark.parametrize("axis", [0.0, 0.5])
@pytest.mark.parametrize("ratio", [None, 1.25])
def test_what_is_told_is_the_error_of_the_peak(
    ratio: float | None, axis: float, caplog: pytest.LogCaptureFixture
) -> None:
    said = list[str]()
    for cells in (0.6, 1.5, 3.0):
        scene, peak = pressed_bodies(2, cells, ratio, axis * CELL)
        words, largest = told(caplog, scene)
        said += words or [""]
        off = 0.61 if "by a half or more" in said[-1] else 0.1 if "by a tenth" in said[-1] else 0.03
        assert abs(largest / peak - 1.0) < off
    assert "by a half or more" in said[0]
    assert f": {'2 points press' if axis else '1 point presses'}, and it ends within 1 cell" in said[0]
    assert said[1]
    assert said[2] == ""


def test_balls_are_told_likewise(caplog: pytest.LogCaptureFixture) -> None:
    (words,), _ = told(caplog, pressed_bodies(3, 1.5)[0])
    assert words == (
        "the contact of upper z0 on rigid plane is too small for its cells: 4 points press, and it ends "
        "within 2 cells of the largest pressure, which may be off by a tenth; four cells on the half width "
        "of a contact have it to about a percent: refine the meshes there, as solve_to(scene, "
        "'peak_pressure', 0.02, comm) does"
    )


@pytest.mark.parametrize(("cells", "points", "off"), [(6, 2, 0.5), (12, 3, 0.1)])
def test_plates_that_lift_off_a_floor_are_told_where_two_points_press(
    cells: int, points: int, off: float, caplog: pytest.LogCaptureFixture
) -> None:
    """With 48 and 96 cells the peak is 10.26 and 10.39."""
    mesh = rectangle((0.0, 0.0), (4.0, 0.5), (cells, cells // 3))
    middle = Traction("plate", "y1", lambda x: np.where(x[:, :1] < 0.5, 1.0, 0.0) * (0.0, -10.0))
    scene = Scene(
        {"plate": Body(mesh, PLATE)},
        [Support("plate", "x0", (0.0, None))],
        [middle],
        [ContactPair(Surface("plate", "y0"), FLOOR)],
    )
    words, largest = told(caplog, scene)
    assert [f"{points} points press, and it ends within 1 cell" in each for each in words] == [True] * (
        points <= 2
    )
    assert abs(largest / 10.4 - 1.0) == pytest.approx(off, rel=0.4)


def test_blocks_on_their_edge_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (8, 4))
    leaning = mesh.moved(mesh.points + [0.0, 0.02] * mesh.points[:, ::-1])
    scene = Scene(
        {"block": Body(leaning, PLATE)},
        [Support("block", "x1", (0.0, None))],
        [Traction("block", "y1", (0.0, -1.0))],
        [ContactPair(Surface("block", "y0"), FLOOR, Coulomb(1.0))],
    )
    words, largest = told(caplog, scene)
    assert words == []
    assert largest > 5.0


@pytest.mark.parametrize("slave", ["punch", "plate"])
def test_punches_are_not_told(slave: str, caplog: pytest.LogCaptureFixture) -> None:
    meshes = {
        "punch": rectangle((-0.5, 1.0), (0.5, 2.0), (2, 2)),
        "plate": rectangle((-2.0, 0.0), (2.0, 1.0), (13, 3)),
    }
    sides = [Surface("punch", "y0"), Surface("plate", "y1")]
    scene = Scene(
        {name: Body(mesh, PLATE) for name, mesh in meshes.items()},
        [Support("plate", "y0"), Support("punch", "y1", (0.0, -0.01))],
        contacts=[ContactPair(*(sides if slave == "punch" else sides[::-1]))],
    )
    assert told(caplog, scene)[0] == []


# A state is never returned that is not one: no convergence is an error that carries its history.
HASTY: dict[str, tuple[DualSolver, Coulomb | Tresca]] = {
    "face Newton": (FaceNewton(tolerance=1e-9, max_steps=1), Coulomb(0.38)),
    "SMALSE": (Smalse(tolerance=1e-9, max_products=15), Tresca(1.0)),
    "fixed point": (FixedPoint(Smalse(tolerance=1e-9), max_steps=1), Coulomb(0.38)),
    "SMALSE in a fixed point": (FixedPoint(Smalse(tolerance=1e-9, max_products=15)), Coulomb(0.38)),
}


@pytest.mark.parametrize("name", HASTY)
def test_a_solver_stopped_too_early_raises_with_its_history(name: str) -> None:
    solver, friction = HASTY[name]
    scene = two_blocks(friction)
    message = r"needs (a natural residual|residuals) below \S+e-(09|10)\b"
    with pytest.raises(ConvergenceError, match=message) as caught:
        solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver)
    assert len(caught.value.history) > 0
    assert all(step.products > 0 for step in caught.value.history)
