"""Points between two statuses, one or several."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact._optimize.result import Reason, StepKind
from fenics_contact.design import AdaptiveTolerance, ContactForces, Kinked, Objective, WeakChoice
from fenics_contact.design.adjoint import linearise_face
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results import ContactResult
from tests.conftest import run_on_ranks
from tests.design.objectives import objectives
from tests.design.pressed import DESIGN, SWITCHES, Pressed, line
from tests.design.quotients import Line
from tests.design.several_weak import BOUND, collect, minimised, posed
from tests.scenes import Friction, partitions, two_blocks

#: Weak contacts, weak discs.
COUNTS = {"closing, frictionless": (1, 0), "closing with friction": (1, 0), "slipping": (0, 1)}
OBJECTIVES = objectives("block")
JUDGES = ("stress", "displacement", "normal forces")
CASES = [(switch, judge) for switch in SWITCHES for judge in JUDGES]


@cache
def lines(switch: str) -> dict[WeakChoice, Line]:
    return {choice: line(SWITCHES[switch](), choice) for choice in WeakChoice}


def sided_quotient(here: Line, objective: Objective, sign: float) -> float:
    """Second-order difference quotient from one side."""
    start, near, far = (here.value(objective, sign * m) for m in (0.0, 1.0, 2.0))
    return sign * (-3 * start + 4 * near - far) / (2 * here.step)


def held_side(switch: str) -> float:
    """Towards which side of the line, +1 or −1, the weak point closes or sticks."""
    here = lines(switch)[WeakChoice.HELD]
    ahead, behind = (here.state(sign).contact.status for sign in (1.0, -1.0))
    changed = np.flatnonzero(ahead != behind)
    assert len(changed) == 1
    point = int(changed[0])
    held = Status.STICK if switch == "slipping" else None
    is_held = [status[point] == held if held else status[point] != Status.OPEN for status in (ahead, behind)]
    assert sum(is_held) == 1
    return 1.0 if is_held[0] else -1.0


@pytest.mark.parametrize("choice", WeakChoice)
@pytest.mark.parametrize("switch", SWITCHES)
def test_weak_points_are_counted_and_their_branch_is_named(switch: str, choice: WeakChoice) -> None:
    weak = lines(switch)[choice].point(OBJECTIVES["energy"]).weak
    assert (weak.contacts, weak.discs) == COUNTS[switch]
    assert weak.choice is choice


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("switch", SWITCHES)
def test_weak_points_are_recognised_at_the_accuracy_of_the_state(switch: str, tolerance: float) -> None:
    exact = lines(switch)[WeakChoice.HELD].problem
    problem = ContactProblem(exact.scene, MPI.COMM_SELF, partitions=partitions(exact.scene))
    state = problem.solve(exact.scene_of(DESIGN), tolerance=tolerance, design=True)
    weak = linearise_face(state, WeakChoice.HELD).weak
    assert (weak.contacts > 0, weak.discs > 0) == tuple(count > 0 for count in COUNTS[switch])
    assert weak.count < 6, "a state tells most points apart"
    assert not linearise_face(state, WeakChoice.RELEASED).weak.may_be_invalid or weak.count > 1
    if tolerance <= 1e-6:
        assert (weak.contacts, weak.discs) == COUNTS[switch]


@pytest.mark.parametrize("judge", ["energy", "normal forces"])
@pytest.mark.parametrize("switch", SWITCHES)
def test_a_strict_state_very_near_to_the_switch_has_the_gradient_of_its_side(switch: str, judge: str) -> None:
    """Also at the products of any other: next to no force, a disc that slips is next to rigid across it."""
    here, objective, side = lines(switch)[WeakChoice.HELD], OBJECTIVES[judge], held_side(switch)
    for choice, sign in ((WeakChoice.HELD, side), (WeakChoice.RELEASED, -side)):
        point = here.problem.evaluate_by(objective, here.at(1e-4 * sign))
        assert (point.weak.contacts, point.weak.discs) == (0, 0)
        expected = lines(switch)[choice].point(objective).gradient
        assert np.linalg.norm(point.gradient - expected) < 1e-6 * np.linalg.norm(expected)
        assert point.adjoint_iterations < 30


@pytest.mark.parametrize("switch", SWITCHES)
def test_away_from_the_switch_no_point_is_weak(switch: str) -> None:
    here = lines(switch)[WeakChoice.HELD]
    for side in (1.0, -1.0):
        weak = here.problem.evaluate_by(OBJECTIVES["energy"], here.at(side)).weak
        assert (weak.contacts, weak.discs) == (0, 0)


@pytest.mark.parametrize(("switch", "judge"), CASES)
def test_each_choice_gives_the_slope_on_its_side(switch: str, judge: str) -> None:
    objective, side = OBJECTIVES[judge], held_side(switch)
    for choice, sign in ((WeakChoice.HELD, side), (WeakChoice.RELEASED, -side)):
        here = lines(switch)[choice]
        assert here.slope(objective) == pytest.approx(sided_quotient(here, objective, sign), rel=2e-6)


@pytest.mark.parametrize(("switch", "judge"), CASES)
def test_the_two_slopes_differ(switch: str, judge: str) -> None:
    held, released = (lines(switch)[choice].slope(OBJECTIVES[judge]) for choice in WeakChoice)
    assert abs(held - released) > 1e-4 * abs(held)


@pytest.mark.parametrize("switch", SWITCHES)
def test_beside_the_switch_the_choice_does_not_matter(switch: str) -> None:
    held, released = (
        here.problem.evaluate_by(OBJECTIVES["stress"], here.at(1.0)).gradient
        for here in lines(switch).values()
    )
    assert held == pytest.approx(released, rel=1e-7)


def test_without_friction_the_energy_itself_has_no_kink() -> None:
    slopes = [here.slope(OBJECTIVES["energy"]) for here in lines("closing, frictionless").values()]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-9)
    assert abs(slopes[0]) > 0.1


def resultant(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    count = len(contact.normal_force)
    return float(contact.normal_force.sum()), np.ones(count), np.zeros((count, 2))


@pytest.mark.parametrize("friction", [None, Coulomb(0.3)])
def test_where_nothing_is_loaded_every_touching_point_is_weak(friction: Coulomb | None) -> None:
    points = {}
    for choice in WeakChoice:
        unloaded = Pressed(friction, 0.0, 0.0).problem(choice)
        points[choice] = unloaded.evaluate_by(ContactForces(resultant), np.zeros(6))
    touching = np.count_nonzero(points[WeakChoice.HELD].state.contact.gap == 0.0)
    assert touching == 4
    assert [point.weak.contacts for point in points.values()] == [touching, touching]
    assert np.all(points[WeakChoice.RELEASED].gradient == 0.0)
    assert grown_by(friction, -1e-6) == 0.0
    # More material presses the block on the floor.
    assert points[WeakChoice.HELD].gradient.sum() == pytest.approx(grown_by(friction, 1e-6) / 1e-6, rel=1e-4)


def grown_by(friction: Coulomb | None, height: float) -> float:
    """Normal force on the unloaded block after all its control points moved by ``height``."""
    return Pressed(friction, 0.0, 0.0).problem().value_by(ContactForces(resultant), np.full(6, height))


def test_points_over_facet_edges_are_counted() -> None:
    """Equal lattices one above the other: every closed slave node lies over a corner of a master facet."""
    lower, upper = block((0, 0, 0), (1, 1, 0.5), (2, 2, 1)), block((0, 0, 0.5), (1, 1, 1), (2, 2, 1))
    shifted = block((0.1, 0.1, 0.5), (0.9, 0.9, 1), (1, 1, 1))
    edges = []
    for above in (upper, shifted):
        soft = IsotropicElasticity(1, 0.3)
        bodies = {"lower": Body(lower, soft), "upper": Body(above, soft)}
        scene = Scene(
            bodies,
            [Support("lower", "z0"), Support("upper", "z1", (0.0, 0.0, -0.01))],
            contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), discretisation="node")],
        )
        cuts = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in bodies.items()}
        state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance=1e-6)
        assert state.contact.count(Status.SLIP) > 0
        edges.append(linearise_face(state, WeakChoice.RELEASED).weak.edges)
    assert edges == [9, 0]


def distance_to_edges(places: np.ndarray, mesh: BodyMesh, surface: str) -> np.ndarray:
    """How far points lie from the edges of a level surface, seen from above, shape (n,)."""
    facets = mesh.surfaces[surface]
    edges = np.concatenate(
        [np.stack([facets[:, k - 1], facets[:, k]], axis=1) for k in range(facets.shape[1])]
    )
    start, along = mesh.points[edges[:, 0], :2], np.diff(mesh.points[edges, :2], axis=1)[:, 0]
    way = places[:, None, :2] - start
    share = np.clip(np.einsum("nek,ek->ne", way, along) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(way - share[..., None] * along, axis=2).min(axis=1))


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_points_on_edges_are_those_that_project_on_one(cell: str, discretisation: str) -> None:
    """Nodes project upright on the level face below; points of mortar contact stand for a mean of facets."""
    scene = two_blocks(Coulomb(0.38), cell)
    scene = replace(scene, contacts=[replace(scene.contacts[0], discretisation=discretisation)])
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene))
    state = problem.solve(design=True)
    places = state.contact_places[state.contact.normal_force > 0]
    on_edges = int(np.count_nonzero(distance_to_edges(places, scene.bodies["lower"].mesh, "z1") < 1e-9))
    assert 3 < on_edges < len(places) - 3
    expected = on_edges if discretisation == "node" else 0
    assert linearise_face(state, WeakChoice.RELEASED).weak.edges == expected


# Where several points lie on a switch, one branch for all of them may be that of no design nearby.
CHOICES = list(WeakChoice)
FRICTION = {"frictionless": None, "Coulomb": Coulomb(0.3)}


@cache
def at_rest(choice: WeakChoice, friction: str) -> ShapeProblem:
    problem = posed(MPI.COMM_SELF, choice=choice, friction=FRICTION[friction])
    problem.evaluate(np.zeros(1))
    return problem


def slopes(friction: Friction) -> list[float]:
    """Difference quotients to either side, of strict states."""
    strict, step = posed(MPI.COMM_SELF, friction=friction, tolerance=1e-11), 1e-5
    ahead, here, behind = (strict.value_of(np.array([at])) for at in (step, 0.0, -step))
    return [(ahead - here) / step, (here - behind) / step]


@pytest.mark.parametrize("friction", FRICTION)
def test_neither_choice_is_the_slope_and_the_point_beside_has_it(friction: str) -> None:
    after, before = slopes(FRICTION[friction])
    assert after == pytest.approx(before, rel=1e-3), "the objective has no kink"
    for choice in CHOICES:
        problem = at_rest(choice, friction)
        assert isinstance(problem, Kinked)
        point = problem.last
        assert point is not None
        assert (point.weak.contacts, point.weak.may_be_invalid) == (8, True)
        assert problem.may_be_invalid(np.zeros(1))
        assert not problem.may_be_invalid(np.ones(1)), "nothing was returned there"
        assert abs(point.gradient[0] - after) > 0.5 * after
        for end in (1e-4, -1e-4):
            assert problem.gradient_near(np.zeros(1), np.array([end]))[0] == pytest.approx(after, rel=2e-3)


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("choice", CHOICES)
def test_the_end_is_the_minimum(choice: WeakChoice, friction: str) -> None:
    """At default tolerances: the first design seems stationary where points are released."""
    problem = posed(MPI.COMM_SELF, choice=choice, friction=FRICTION[friction])
    result = minimised(problem)
    assert result.reason.success
    assert result.x == pytest.approx([-BOUND])
    assert result.value == pytest.approx(problem.value_of(np.array([-BOUND])), rel=1e-5)
    if choice is WeakChoice.RELEASED:
        assert result.history[1].kind is StepKind.REFINED


@pytest.mark.parametrize("choice", CHOICES)
def test_states_that_follow_the_optimiser_end_there_as_well(choice: WeakChoice) -> None:
    problem = posed(MPI.COMM_SELF, net=(2, 2), choice=choice, tolerance=AdaptiveTolerance())
    result = minimised(problem)
    exact = minimised(posed(MPI.COMM_SELF, net=(2, 2), tolerance=1e-10))
    assert result.reason.success
    assert result.value == pytest.approx(exact.value, abs=2e-4)
    assert result.value < -0.2


def test_without_the_question_the_first_design_is_called_stationary(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ShapeProblem, "may_be_invalid", lambda self, alpha: False)
    result = minimised(posed(MPI.COMM_SELF))
    assert (result.reason, result.evaluations) == (Reason.STATIONARY, 1)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Checkpoints of runs that were stopped before and after the first design was looked into."""
    folder = tmp_path_factory.mktemp("stopped")
    paths = {}
    for limit in (1, 2, 4):
        paths[limit] = folder / f"{limit}.npz"
        problem = posed(MPI.COMM_SELF, net=(2, 2))
        minimised(problem, Checkpoint(paths[limit]), max_evaluations=limit, raise_on_failure=False)
    return paths


@cache
def whole() -> dict[str, Any]:
    return collect(MPI.COMM_SELF)


def test_a_run_goes_on_to_the_last_bit(stopped: dict[int, Path], tmp_path: Path) -> None:
    assert "REFINED" in whole()["kinds"]
    for limit, path in stopped.items():
        copy = tmp_path / f"{limit}.npz"
        copy.write_bytes(path.read_bytes())
        assert collect(MPI.COMM_SELF, copy) == whole()


def test_two_ranks_look_beside_the_same_designs(stopped: dict[int, Path]) -> None:
    expected = whole()
    script = Path(__file__).with_name("several_weak_on_ranks.py")
    answers = json.loads(run_on_ranks(script, 2, stopped[2]))
    assert len(answers) == 2
    for found in answers:
        assert (found["ranks"], found["same"]) == (2, True)
        assert found["kinds"] == expected["kinds"]
        assert found["values"] == pytest.approx(expected["values"], rel=1e-5, abs=1e-7)
        assert found["x"] == pytest.approx(expected["x"], abs=1e-6 * BOUND)
