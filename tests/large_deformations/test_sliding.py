"""Ironing, and bodies that slide far."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.large_deformations.ironing import ironing as started_ironing
from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TangentNewton,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._large_deformations.loading import RigidStart
from fenics_contact.errors import InvalidInputError, LoadStepError
from fenics_contact.errors.kinds import FoldedFacetsError
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import HistoryMaterial, MaterialResponse, NeoHooke
from fenics_contact.mesh import quadratic
from tests.conftest import run_on_ranks
from tests.large_deformations.ironing import WAY, die, ironing
from tests.large_deformations.mortar_scenes import by_mortar, followed, pressed_and_pushed, stacked
from tests.large_deformations.scenes import RUBBER, pressed, rounded, tilted


@cache
def ironed(pieces: int, quarter: bool = False) -> Sequence[DeformedState]:
    """States with friction, until the die slides."""
    scenes = [ironing(0.3, way, quarter) for way in WAY[:3]]
    parts = {
        "block": box_partition(ironing(0.0, WAY[0]).bodies["block"].mesh, (2 * pieces, pieces)),
        "die": box_partition(ironing(0.0, WAY[0]).bodies["die"].mesh, (pieces, pieces)),
    }
    problem = ContactProblem(scenes[0], MPI.COMM_SELF, partitions=parts, tolerance=1e-10)
    steps = [LoadStep(str(number), supports=scene.supports) for number, scene in enumerate(scenes)]
    states = solve_steps(problem, steps)
    assert all(isinstance(state, DeformedState) for state in states)
    return states  # type: ignore[return-value]


def force(state: DeformedState) -> np.ndarray:
    return np.asarray(state.reactions()[1].force)


def test_ironing_is_the_same_however_bodies_are_cut() -> None:
    torn, whole = ironed(2), ironed(1)
    for one, other in zip(torn, whole, strict=True):
        assert np.abs(force(one) - force(other)).max() < 1e-7 * np.abs(force(other)).max()
        moved = other.gather_displacement("block")
        assert np.abs(one.gather_displacement("block") - moved).max() < 1e-7 * np.abs(moved).max()
        assert one.balance().imbalance < 1e-8
    last = torn[-1].contact
    assert last.count(2) > 3, "it slides"
    worst = [line.residuals.worst for line in torn[1].solution.history]
    far = max(number for number, size in enumerate(worst) if size > 1e-8)  # nearer, forcing is loose
    assert worst[far + 1] < 10 * worst[far] ** 1.5, "superlinear, with friction between two bodies"


def test_ironing_turned_in_the_plane_gives_the_turned_answer() -> None:
    upright, turn = ironed(1)[-1], ironed(1, quarter=True)[-1]
    x, y = force(upright)
    assert np.abs(force(turn) - [-y, x]).max() < 1e-8 * np.abs(y)
    normal = upright.contact.normal_force
    assert np.abs(turn.contact.normal_force - normal).max() < 1e-8 * normal.max()


@pytest.mark.parametrize("parts", [1, 4])
def test_slip_is_how_far_nodes_have_gone_over_the_plane(parts: int) -> None:
    """Also without friction, in however many parts a load step is done; that of earlier steps is added up."""
    mesh = rounded(3)
    way = [(0.0, 0.3), (0.4, 0.3), (0.7, 0.3)]
    steps = [
        LoadStep(str(x), supports=pressed(mesh, depth, pushed=x, friction=0.0).supports) for x, depth in way
    ]
    problem = ContactProblem(
        pressed(mesh, 0.3, friction=0.0), MPI.COMM_SELF, steps=AutomaticSteps(first=1.0 / parts)
    )
    states = solve_steps(problem, steps)
    places = [state.gather_displacement("block") for state in states]
    for last, state, before in zip(places[1:], states[1:], places[:-1], strict=True):
        contact = state.contact
        points = contact.points
        gone = np.einsum("nad,nd->na", points.tangents, (last - before)[points.slave])
        since = np.einsum("nad,nd->na", points.tangents, (before - places[0])[points.slave])
        assert np.abs(gone).max() > 0.2
        np.testing.assert_allclose(contact.slip, gone, atol=1e-8)
        np.testing.assert_allclose(contact.slip_before - states[0].contact.slip, since, atol=1e-8)


def test_a_rigid_disc_deep_in_rubber() -> None:
    """Forces turn with the disc's surface: without their stiffness convergence would be linear."""
    block = rectangle((0.0, 0.0), (4.0, 2.0), (20, 10))
    ball = MovingObstacle(RigidSphere((2.0, 2.0 + 0.5), 0.5), lambda time: (None, (0.0, -0.5 * time)))
    scene = Scene(
        {"block": Body(block, RUBBER)},
        [Support("block", "y0")],
        contacts=[ContactPair(Surface("block", "y1"), ball)],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    worst = [line.residuals.worst for line in state.solution.history]
    assert isinstance(state, DeformedState)
    assert len(state.fractions) > 1, "the disc moves by several facets"
    assert worst[-1] < max(100 * worst[-2] ** 2, 1e-10), "quadratic"
    depth = -state.gather_displacement("block")[:, 1].min()
    assert abs(depth - 0.5) < 1e-8, "the lowest point of the disc carries a node with it"
    assert state.balance().imbalance < 1e-9


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("slave", ["plate", "roller"])
def test_friction_does_not_act_across_a_plane_of_symmetry(discretisation: str, slave: str) -> None:
    """Half of a roller on a plate: friction of nodes that cannot slip would only load supports."""
    plate, roller = rectangle((0, -4), (6, 0), (12, 8)), half_disc(5.0, 4, grading=1.0)
    sides = {"plate": "y1", "roller": "contact"}
    (master,) = set(sides) - {slave}
    pair = ContactPair(
        Surface(slave, sides[slave]), Surface(master, sides[master]), Coulomb(0.2), discretisation
    )
    scene = Scene(
        {"plate": Body(plate, RUBBER), "roller": Body(roller, RUBBER)},
        [
            *[Support(name, "x0", (0.0, None)) for name in sides],
            Support("plate", "y0", (None, 0.0)),
            Support("roller", "top", (None, -0.05)),
        ],
        contacts=[pair],
    )
    state = solve_scene(scene, MPI.COMM_SELF)
    contact = state.contact
    (cut,) = np.flatnonzero(np.abs(scene.points[contact.points.slave, 0]) < 1e-12)
    assert contact.normal_force[cut] > 1e-3
    assert contact.slip[cut] == 0.0
    assert np.linalg.norm(contact.force[cut]) == pytest.approx(contact.normal_force[cut], rel=1e-12)
    assert state.balance().imbalance < 1e-8


@pytest.mark.parametrize(("end", "told"), [(2.02, True), (1.9, False)])
def test_a_path_that_ends_where_nodes_leave_the_end_of_a_master_says_so(end: float, told: bool) -> None:
    """A node beyond the end by a few percent of a facet presses still; where it is lost, its force ends."""
    bodies = {"bed": Body(rectangle((0, 0), (2, 1), (2, 1)), RUBBER)}
    bodies["slider"] = Body(rectangle((1.2, 1), (end, 1.5), (1, 1)), RUBBER)
    pair = ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), discretisation="node")
    held = [[Support("bed", "y0"), Support("slider", "y1", (0.0, -depth))] for depth in (0.02, 1.4)]
    steps = AutomaticSteps(TangentNewton(max_steps=8), smallest=1.0)
    problem = ContactProblem(Scene(bodies, held[0], contacts=[pair]), MPI.COMM_SELF, steps=steps)
    with pytest.raises(LoadStepError) as ended:
        solve_steps(problem, [LoadStep(str(n), supports=each) for n, each in enumerate(held)])
    words = r"; 1 node of surface 'y0' presses on 'y1' from beyond its end with \d\d\.\d% of the normal force"
    assert bool(re.search(words, str(ended.value))) == told, ended.value


# Where Newton's method starts in a load step of bodies that touch.

#: Of the die: down, then along.
SHORT_WAY = [(0.0, -0.8), (0.25, -0.8), (0.5, -0.8), (0.75, -0.8)]


def drawn(columns: int, cells: int, count: int) -> list[State]:
    """A die that is pressed into a block and drawn along it, without friction."""
    bodies = {
        "block": Body(rectangle((0.0, 0.0), (6.0, 4.0), (columns, columns // 2)), NeoHooke(1.0, 0.32)),
        "die": Body(die(cells), NeoHooke(10.0, 0.32)),
    }
    held = [[Support("block", "y0"), Support("die", "y1", at)] for at in SHORT_WAY]
    pair = ContactPair(Surface("die", "y0"), Surface("block", "y1"), discretisation="mortar")
    steps = [LoadStep(f"{at}", supports=supports) for at, supports in zip(SHORT_WAY, held, strict=True)]
    scene = Scene(bodies, held[0], contacts=[pair])
    return list(solve_steps(ContactProblem(scene, MPI.COMM_SELF), steps[:count]))


def without_moving_first(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(RigidStart, "moved", lambda *given: None)


def begun_again(states: list[State]) -> list[bool]:
    return ["begun again" in state.solution.history[0].note for state in states]


def require_the_same(found: list[State], other: list[State]) -> None:
    for one, two in zip(found, other, strict=True):
        force = two.contact.force
        assert np.abs(force).max() > 0.0
        np.testing.assert_allclose(one.contact.force, force, atol=1e-6 * np.abs(force).max())


def test_a_die_that_slides_starts_where_its_support_takes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(16, 6, 4)
    without_moving_first(monkeypatch)
    other = drawn(16, 6, 4)
    require_the_same(found, other)
    assert not any(begun_again(found))
    taken, usual = (sum(len(s.solution.history) for s in states[1:]) for states in (found, other))
    assert taken <= 0.8 * usual, f"{taken} Newton steps where {usual} are usual"


def test_a_start_whose_first_step_fails_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    found = drawn(12, 5, 2)
    without_moving_first(monkeypatch)
    other = drawn(12, 5, 2)
    require_the_same(found, other)
    assert begun_again(found) == [False, True]
    assert not any(begun_again(other))
    taken, usual = (len(states[-1].solution.history) for states in (found, other))
    assert taken == usual + 1, "the step that failed, and no other"


@pytest.mark.slow
@pytest.mark.claim
def test_ironing_by_five_millimetres_takes_the_newton_steps_of_the_study() -> None:
    sequence = LoadSequence(ContactProblem(started_ironing(48, "mortar"), MPI.COMM_SELF))
    places = [(0.0, 0.25 * k) for k in range(1, 5)] + [(0.25 * k, 1.0) for k in range(1, 21)]
    taken = []
    for across, down in places:
        supports = [Support("bed", "y0"), Support("die", "y1", (across, -down))]
        state = sequence.advance(LoadStep(f"{across} {down}", supports=supports))
        taken.append(len(state.solution.history))
    assert sum(taken) == pytest.approx(147, abs=6)
    assert max(taken[8:]) <= 8, "one more where a corner leaves its facet"


@pytest.mark.parametrize("parts", [1, 2])
def test_a_tool_that_meets_nothing_at_first_presses_later(parts: int) -> None:
    """By then no force acts anywhere, with which what is to act could be compared."""

    def pressed(*times: float) -> State:
        tool = MovingObstacle(RigidSphere((1.0, 2.25), 1.0), lambda time: (None, (0.0, -0.2 * time)))
        pad = Body(rectangle((0.0, 0.0), (2.0, 1.0), (7, 3)), NeoHooke(1.0, 0.3))
        pair = ContactPair(Surface("pad", "y1"), tool)
        scene = Scene({"pad": pad}, [Support("pad", "y0")], contacts=[pair])
        problem = ContactProblem(scene, MPI.COMM_SELF, partitions={"pad": np.arange(21) * parts // 21})
        return list(solve_steps(problem, [LoadStep(str(time), time=time) for time in times]))[-1]

    assert pressed(1.0).contact.normal_force.sum() == 0.0
    at_once, later = pressed(2.0), pressed(0.5, 1.0, 2.0)
    assert at_once.contact.normal_force.sum() > 0.1
    require_the_same([later], [at_once])
    assert later.contact.gap.min() > -1e-8


# Rubber that meets rubber by mortar where both lie now.
@pytest.mark.parametrize(
    ("cells", "held", "friction"),
    [
        ("quadrilateral", True, 0.0),
        ("triangle", False, 0.0),
        ("hexahedron", False, 0.3),
        ("tetrahedron", True, 0.0),
    ],
)
def test_patch_of_half_the_height(cells: str, held: bool, friction: float) -> None:
    """At 50 % the state is homogeneous, however the meshes meet."""
    scene = stacked(cells, 1.0, held=held, friction=friction)
    (state,) = followed([scene], MPI.COMM_SELF)
    stress = np.concatenate([state.gather_stress(body) for body in scene.bodies])
    assert np.abs(stress[0]).max() > 0.5
    assert np.abs(stress - stress[0]).max() < 1e-8 * np.abs(stress).max()
    contact, across = state.contact, scene.dim - 1
    grown = (1.0 + state.gather_displacement("high").max()) ** across
    assert held or grown > 1.2
    np.testing.assert_allclose(contact.pressure, -stress[0, across, across], rtol=1e-7)
    np.testing.assert_allclose(contact.nominal_pressure, contact.pressure * grown, rtol=1e-7)
    assert contact.area.sum() == pytest.approx(grown, rel=1e-7)


@pytest.mark.parametrize(
    ("cells", "held", "friction"), [("triangle", False, 0.3), ("quadrilateral", True, 0.0)]
)
def test_patch_of_pressed_quadratic_cells(cells: str, held: bool, friction: float) -> None:
    """Free sides wrinkle at about 46 % (Biot): beyond, the homogeneous state is one of several."""
    scene = stacked(cells, 0.8, held=held, friction=friction)
    bodies = {name: replace(body, mesh=quadratic(body.mesh)) for name, body in scene.bodies.items()}
    (state,) = followed([replace(scene, bodies=bodies)], MPI.COMM_SELF)
    worst = [line.residuals.worst for line in state.solution.history]
    assert worst[-1] < max(10 * worst[-2] ** 1.8, 1e-10), "quadratic down to rounding"
    stress = np.concatenate([state.gather_stress(body) for body in scene.bodies])
    assert np.abs(stress[0]).max() > 0.5
    assert np.abs(stress - stress[0]).max() < 1e-8 * np.abs(stress).max()
    np.testing.assert_allclose(state.contact.pressure, -stress[0, 1, 1], rtol=1e-7)


def test_ironing_converges_quadratically() -> None:
    states = followed([by_mortar(ironing(0.3, way)) for way in WAY[:3]], MPI.COMM_SELF)
    assert states[1].contact.count(Status.STICK) > 3
    assert states[-1].contact.count(Status.SLIP) > 3
    for state in states:
        worst = [line.residuals.worst for line in state.solution.history]
        assert worst[-1] < max(10 * worst[-2] ** 1.8, 1e-10), "quadratic down to rounding"
        assert any(new < 10 * old**1.8 < 1e-5 for old, new in pairwise(worst))


def test_a_newton_step_that_folds_facets_cuts_the_load_step(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = 0

    def folded_once(*_: object) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise FoldedFacetsError("1 are folded")

    monkeypatch.setattr("fenics_contact._pairing.mortar.coupling.check_convex", folded_once)
    (state,) = followed([stacked("hexahedron", 0.3, held=True, friction=0.0)], MPI.COMM_SELF)
    assert calls > 3
    assert state.fractions == (0.5, 1.0)


def test_two_blocks_turned_in_space_give_the_turned_answer() -> None:
    rotation = tilted(1.1)
    upright, turned = (
        followed(pressed_and_pushed(each), MPI.COMM_SELF, 1e-11)[-1] for each in (np.eye(3), rotation)
    )
    assert turned.contact.count(Status.SLIP) > 3
    forces = upright.contact.force @ rotation.T
    assert np.abs(turned.contact.force - forces).max() < 1e-9 * np.abs(forces).max()
    for name in ("low", "high"):
        moved = upright.gather_displacement(name) @ rotation.T
        assert np.abs(turned.gather_displacement(name) - moved).max() < 1e-9 * np.abs(moved).max()


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.claim)])
def test_ranks_find_the_same(ranks: int, tmp_path: Path) -> None:
    script = Path(__file__).with_name("mortar_on_ranks.py")
    run_on_ranks(script, ranks, tmp_path / "state.npz")
    (serial,) = followed(pressed_and_pushed(np.eye(3))[1:], MPI.COMM_SELF)
    with np.load(tmp_path / "state.npz") as found:
        for name, values in found.items():
            inside = name in ("low", "high")
            expected = serial.gather_displacement(name) if inside else getattr(serial.contact, name)
            assert np.abs(values - expected).max() < 1e-7 * np.abs(expected).max(), name


# Materials that relax: load steps have a duration.
UNIT = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
SYMMETRIC = 0.5 * (UNIT + UNIT.swapaxes(2, 3))
SPRING, DAMPED, TIME = 2.0, 3.0, 0.7


@dataclass(frozen=True)
class StandardSolid(HistoryMaterial):
    """A spring beside a spring with a damper, by backward Euler; the history is strain and damped stress."""

    spring: float
    damped: float
    relaxation_time: float
    history_size = 18

    def respond(self, gradient: Any, history: Any, duration: Any) -> MaterialResponse:
        n = len(gradient)
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        before, stress = history.reshape(n, 2, 3, 3).swapaxes(0, 1)
        decay = 1.0 / (1.0 + duration / self.relaxation_time)
        damped = decay * (stress + self.damped * (strain - before))
        tangent = np.broadcast_to((self.spring + decay * self.damped) * SYMMETRIC, (n, 3, 3, 3, 3))
        after = np.concatenate([strain.reshape(n, 9), damped.reshape(n, 9)], axis=1)
        return MaterialResponse(self.spring * strain + damped, tangent, after)


def solid() -> Scene:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), StandardSolid(SPRING, DAMPED, TIME))
    return Scene({"body": body}, [Support("body", "x0"), Support("body", "x1", (0.0, 0.0, 0.0))])


def held(stretch: float) -> list[Support]:
    return [Support("body", "x0"), Support("body", "x1", (stretch, 0.0, 0.0))]


def pull(state: State) -> float:
    return float(state.reactions()[1].force[0])


def relaxed(count: int, steps: AutomaticSteps | None = None) -> float:
    """The force after stretching at once and holding for one unit of time, in some steps."""
    problem = ContactProblem(solid(), MPI.COMM_SELF, tolerance=1e-11, steps=steps)
    times = [0.0, *(np.arange(1, count + 1) / count)]
    states = solve_steps(problem, [LoadStep(f"{t}", supports=held(0.01), time=t) for t in times])
    # Without Poisson's effect the stress is even; a step of no duration is elastic.
    assert pull(states[0]) == pytest.approx((SPRING + DAMPED) * 0.01)
    return pull(states[-1])


def test_relaxation_follows_the_closed_form_in_the_first_order() -> None:
    exact = (SPRING + DAMPED * np.exp(-1.0 / TIME)) * 0.01
    coarse, fine = (relaxed(count) / exact - 1.0 for count in (10, 20))
    assert 0.0 < fine < 0.02
    assert coarse / fine == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("finer", [False, True])
def test_a_load_step_has_its_duration_whole_and_in_parts_if_asked_for(finer: bool) -> None:
    parts = (0.25, 0.375, 0.375) if finer else (1.0,)  # an easy part is followed by longer ones
    decay = 1.0 / np.prod([1.0 + part / TIME for part in parts])
    force = relaxed(1, AutomaticSteps(first=0.25, finer_history=finer))
    assert force == pytest.approx((SPRING + DAMPED * decay) * 0.01, rel=1e-9)


def test_time_must_not_run_backwards() -> None:
    sequence = LoadSequence(ContactProblem(solid(), MPI.COMM_SELF))
    sequence.advance(LoadStep("later", supports=held(0.01), time=2.0))
    with pytest.raises(InvalidInputError, match=r"time must not decrease, got 1 after 2: give"):
        sequence.advance(LoadStep("earlier", supports=held(0.01), time=1.0))
