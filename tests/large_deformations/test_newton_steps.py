"""Newton's steps of large deformations, their parts and limits."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    NewtonSteps,
    Pressure,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TangentNewton,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._base.libraries import PETSc
from fenics_contact._base.requirements import factors
from fenics_contact._fem.mechanics import HyperelasticMechanics, MaterialStep
from fenics_contact._large_deformations import moving_contact as meeting
from fenics_contact._large_deformations import newton
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._large_deformations.tangent import (
    IndefiniteFactor,
    RefillableFactor,
    _softest,
    mostly_positive,
    with_inertia,
)
from fenics_contact._large_deformations.tangent_step import tangent_step
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError, LoadStepError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    Elasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    NeoHooke,
    PlaneStrain,
)
from fenics_contact.qp import FaceNewton, solve
from fenics_contact.results.deformed_state import AnyState
from tests.large_deformations.scenes import RUBBER as LIMIT_RUBBER
from tests.large_deformations.scenes import cut, pressed, rounded, tilted
from tests.large_deformations.scenes import cut as in_pieces
from tests.materials.deformed import patch_of
from tests.scenes import RigidObstacle

RUBBER = NeoHooke(1.0, 0.4999, mean_dilatation=True)


def of(material: NeoHooke, scene: Scene) -> Scene:
    return replace(scene, bodies={name: Body(body.mesh, material) for name, body in scene.bodies.items()})


@pytest.fixture(scope="module")
def dragged() -> list[list[AnyState]]:
    """A block pressed and dragged: of ordinary rubber and of such that hardly changes its volume."""
    mesh = rounded(4)
    found = []
    for material in (NeoHooke(1.0, 0.3), RUBBER):
        scenes = [of(material, pressed(mesh, depth, way)) for depth, way in ((0.1, 0.0), (0.1, 0.05))]
        sequence = LoadSequence(ContactProblem(scenes[0], MPI.COMM_SELF, partitions=in_pieces(mesh, 2)))
        found.append(
            [sequence.advance(LoadStep(str(n), supports=scene.supports)) for n, scene in enumerate(scenes)]
        )
    return found


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tolerance": 2.0}, "tolerance of TangentNewton must lie between 0 and 1, got 2.0: .* 1e-08"),
        ({"forcing": 0.0}, "forcing of TangentNewton must lie between 0 and 1, got 0.0"),
        ({"nested": 1.0}, "nested of TangentNewton must lie between 0 and 1, got 1.0: .* 0.01"),
        ({"max_steps": 0}, "max_steps of TangentNewton must be an integer of at least 1, got 0"),
        ({"max_products": 2.5}, r"TangentNewton.max_products must be an integer, got 2.5"),
    ],
)
def test_numbers_of_newtons_method_are_checked(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        TangentNewton(**given)


def test_settings_of_load_steps_are_checked() -> None:
    with pytest.raises(InvalidInputError, match=r"AutomaticSteps.snaps must be True or False, got 'no'"):
        AutomaticSteps(snaps="no")  # type: ignore[arg-type]


def test_nearly_incompressible_bodies_take_hardly_more_steps_than_others(
    dragged: list[list[AnyState]],
) -> None:
    """Tangents have the pressures that a step foresaw: those of its end would grow with its square."""
    counts = [[len(state.solution.history) for state in states] for states in dragged]
    steps = NewtonSteps.of(dragged[-1])
    assert [len(run) for run in steps.residuals] == counts[-1]
    assert steps.reduction.max() < 1e-2, "superlinear"
    assert max(counts[0]) <= 5
    assert max(counts[1]) <= 7


def test_preconditioners_leave_the_stiffness_of_modes_to_multipliers(
    dragged: list[list[AnyState]],
) -> None:
    """With that stiffness they took 75 and 548 products."""
    ordinary, incompressible = (sum(state.solution.products for state in states) for states in dragged)
    assert 0 < ordinary <= 58
    assert 0 < incompressible <= 160


def test_the_ends_of_load_steps_are_told_in_a_line() -> None:
    steps = NewtonSteps(((1e-16,), (0.5, 0.1, 1e-3, 1e-8, 2e-9), (0.1, 0.01), (0.2, 1e-2, 1e-4, 1e-7)))
    assert steps.reduction == pytest.approx([1e-5, 0.1, 1e-3])
    assert str(steps) == (
        "Newton's method: 3.0 steps a load step, at most 5; residuals at the end of a median one "
        "2e-01, 1e-02, 1e-04, 1e-07; its best step leaves 1e-03 of them, of the worst load step 1e-01"
    )
    assert str(NewtonSteps.of([])) == "Newton's method: no load step with several steps"


def test_tangents_of_mean_dilatations_have_the_pressures_that_a_step_foresaw() -> None:
    """The tangent after a step is that of the same forces with their pressures extrapolated along it."""
    patch = patch_of(Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), RUBBER))
    mechanics = patch.mechanics
    step = 0.03 * np.random.default_rng(1).standard_normal(patch.mesh.size)
    plain, foreseen = (
        mechanics.at(step, MaterialStep(origin=origin)).stiffness for origin in (None, 0.0 * step)
    )
    again = mechanics.at(step, MaterialStep(origin=step)).stiffness
    assert abs(again - plain).max() < 1e-12 * abs(plain).max()
    assert abs(foreseen - plain).max() > 1e-3 * abs(plain).max()


def test_strains_near_rounding_are_solved() -> None:
    depth, mesh = 1e-10, block((0, 0, 0), (1, 1, 1), (3, 3, 3))
    state = solve_scene(pressed(mesh, depth), MPI.COMM_SELF, partitions=in_pieces(mesh, 2))
    assert len(state.solution.history) <= 5
    reference = solve_scene(pressed(mesh, 1e-5), MPI.COMM_SELF, partitions=in_pieces(mesh, 2))
    force, expected = state.contact.force / depth, reference.contact.force / 1e-5
    assert np.abs(force - expected).max() < 1e-4 * np.abs(expected).max()


def test_tangents_are_assembled_only_where_they_are_factored(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    assemble = HyperelasticMechanics._stiffness
    monkeypatch.setattr(
        HyperelasticMechanics, "_stiffness", lambda *given: (asked.append(1), assemble(*given))[1]
    )
    mesh = rounded(3)
    scenes = [pressed(mesh, depth) for depth in (0.05, 0.1)]
    sequence = LoadSequence(ContactProblem(scenes[0], MPI.COMM_SELF, partitions=in_pieces(mesh, 1)))
    for scene in scenes:
        asked.clear()
        state = sequence.advance(LoadStep("press", supports=scene.supports))
    assert 0 < len(asked) == len(state.solution.history)


def test_contact_is_solved_as_a_whole_on_the_way_without_asking_why_it_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A failure there cuts the load step, whatever its reason, and with a limit of products."""
    solvers = list[FaceNewton]()

    def noted(problem: Any, bound: Any, solver: FaceNewton, *more: Any, **named: Any) -> Any:
        solvers.append(solver)
        return solve(problem, bound, solver, *more, **named)

    monkeypatch.setattr("fenics_contact._large_deformations.tangent_step.solve", noted)
    calls = itertools.count()

    def lost(*given: Any, **named: Any) -> Any:
        return tangent_step(*given, **named) if next(calls) else None  # as if no rows held tangents at first

    monkeypatch.setattr(newton, "tangent_step", lost)
    mesh = rounded(3)
    solve_scene(
        of(NeoHooke(1.0, 0.3), pressed(mesh, 0.05, 0.0)), MPI.COMM_SELF, partitions=in_pieces(mesh, 2)
    )
    at_rest, later = solvers
    assert at_rest == FaceNewton(at_rest.tolerance)
    given = TangentNewton()
    limits = {"max_products": given.max_products, "max_rescues": given.rescues}
    assert later == replace(at_rest, doubts=False, **limits)


def test_a_step_from_the_same_state_is_the_same_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a step tries and gives up leaves nothing behind: no start of slip, no care and no products."""
    take, compared = newton._Run.step, list[Any]()

    def twice(run: Any, state: Any) -> Any:
        before = state.evaluation.at.displacement.copy()
        once, again = take(run, state), take(run, state)
        assert np.array_equal(once.evaluation.at.displacement, again.evaluation.at.displacement)
        assert np.array_equal(once.evaluation.constraint_residual, again.evaluation.constraint_residual)
        assert (once.pace, once.effort) == (again.pace, again.effort)
        assert np.array_equal(state.evaluation.at.displacement, before)
        assert not np.array_equal(once.evaluation.at.displacement, before)
        compared.append(once)
        return again

    monkeypatch.setattr(newton._Run, "step", twice)
    mesh = rounded(3)
    scene = of(NeoHooke(1.0, 0.3), pressed(mesh, 0.1, 0.1))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=in_pieces(mesh, 2))
    assert len(compared) >= len(state.solution.history) > 3


# Load steps that are followed in parts: one step of every history, however they are cut.
SIZE = (2.0, 1.0)
SOFT_RUBBER, METAL = NeoHooke(1000.0, 0.3), J2Plasticity(1000.0, 0.3, 4.0, 50.0)


def dragged_in_parts(
    material: NeoHooke | J2Plasticity, obstacle: RigidObstacle, way: tuple[float, float]
) -> Scene:
    """A block on which an obstacle is pressed until time 1, and drawn along, a little back, until time 2."""
    across, down = way

    def path(time: float) -> tuple[None, tuple[float, float]]:
        along = max(time - 1.0, 0.0)
        return None, (across * along * (4.0 - 3.0 * along), -down * min(time, 1.0))

    moving = MovingObstacle(obstacle, path)
    low = Body(rectangle((0.0, 0.0), SIZE, (8, 4)), material)
    pair = ContactPair(Surface("low", "y1"), moving, Coulomb(0.3))
    return Scene({"low": low}, [Support("low", "y0")], contacts=[pair])


def pressed_by_supports(material: NeoHooke | J2Plasticity) -> tuple[Scene, list[LoadStep]]:
    """The same on a plane that stands still, for bodies that do not move far."""
    low = Body(rectangle((0.0, 0.0), SIZE, (8, 4)), material)
    pair = ContactPair(Surface("low", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), Coulomb(0.3))
    at = [[Support("low", "y1", place)] for place in ((0.0, 0.0), (0.0, -0.02), (0.008, -0.02))]
    scene = Scene({"low": low}, at[0], contacts=[pair])
    return scene, [LoadStep(f"{k}", supports=at[k], time=float(k)) for k in (1, 2)]


def followed(scene: Scene, how: AutomaticSteps, steps: list[LoadStep] | None = None) -> list[DeformedState]:
    steps = steps or [LoadStep("down", time=1.0), LoadStep("along", time=2.0)]
    found = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10, steps=how), steps)
    states = [state for state in found if isinstance(state, DeformedState)]
    assert len(states) == 2
    return states


def difference(found: State, other: State) -> float:
    force = found.contact.force
    return float(np.abs(force - other.contact.force).max() / np.abs(force).max())


def plane() -> tuple[Scene, None]:
    return dragged_in_parts(SOFT_RUBBER, RigidPlane((0.0, 1.0), (0.0, -1.0)), (0.12, 0.1)), None


def metal() -> tuple[Scene, list[LoadStep]]:
    return pressed_by_supports(METAL)


@pytest.mark.parametrize("posed", [plane, metal])
def test_friction_and_plastic_flow_do_not_depend_on_how_a_load_step_is_cut(
    posed: Callable[[], tuple[Scene, list[LoadStep] | None]],
) -> None:
    """On a plane with large deformations, and with plastic flow and small ones."""
    scene, steps = posed()
    in_parts = AutomaticSteps(first=0.3)
    each_a_step = replace(in_parts, finer_history=True)
    whole, parts, finer = (followed(scene, how, steps) for how in (AutomaticSteps(), in_parts, each_a_step))
    for one, parted, history in zip(whole, parts, finer, strict=True):
        assert one.fractions == (1.0,)
        assert len(parted.fractions) == len(history.fractions) > 1
        products = [line.products for line in parted.solution.history]
        assert min(np.diff(products)) > 0, "they are counted on from part to part"
        assert products[-1] == parted.counts["f_products"]
        assert one.contact.slip_bound @ np.abs(one.contact.slip) > 0.0, "something slips"
        np.testing.assert_allclose(parted.contact.slip, one.contact.slip, atol=1e-8)
        assert difference(one, parted) < 1e-7
        assert one.history.values.keys() == parted.history.values.keys()
        for name, values in one.history.values.items():
            np.testing.assert_allclose(parted.history.values[name], values, atol=1e-8)
        assert parted.since == one.since == 0.0
        assert history.since == history.fractions[-2]
        assert f"histories begin anew at {history.since:.3g}" in str(history)
    apart = [difference(one, history) for one, history in zip(whole, finer, strict=True)]
    assert max(apart) > 1e-3, f"the way to the same place matters: {apart}"


def test_a_bar_that_a_pressure_pulls_stays_straight_in_few_steps() -> None:
    """The pressure turns with the end: but for rounding nothing resists its tilting."""
    mesh = block((0, 0, 0), (1, 1, 8), (2, 2, 8))
    corners = {f"corner{n}": np.flatnonzero((mesh.points == (n, 0, 0)).all(axis=1)) for n in (0, 1)}
    supports = [Support("bar", "z0", (None, None, 0)), Support("bar", "corner0", (0, 0, None))]
    scene = Scene(
        {"bar": Body(replace(mesh, node_sets=corners), LIMIT_RUBBER)},
        [*supports, Support("bar", "corner1", (None, 0, None))],
        [Pressure("bar", "z1", -0.2)],
    )
    state = solve_scene(scene, MPI.COMM_SELF)
    assert isinstance(state, DeformedState)
    assert state.fractions == (1.0,)
    assert len(state.solution.history) <= 6
    strain = state.gather_displacement("bar") / np.maximum(mesh.points, 1e-12)
    np.testing.assert_allclose(strain[mesh.points[:, 2] == 8.0, 2], strain[-1, 2], rtol=1e-6)
    np.testing.assert_allclose(strain[mesh.points[:, 0] == 1.0, 0], strain[-1, 0], rtol=1e-3)


def test_parts_that_the_search_needs_have_the_friction_of_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = dragged_in_parts(SOFT_RUBBER, RigidSphere((0.6, 1.5), 0.5), (0.6, 0.1))
    cut = followed(scene, AutomaticSteps())
    assert len(cut[-1].fractions) > 1, "the disc passes several facets"
    monkeypatch.setattr(meeting, "FACETS", 100.0)
    whole = followed(scene, AutomaticSteps())
    assert whole[-1].fractions == (1.0,)
    assert difference(whole[-1], cut[-1]) < 1e-7


def test_a_plane_that_passes_many_facets_needs_no_parts() -> None:
    scene = dragged_in_parts(SOFT_RUBBER, RigidPlane((0.0, 1.0), (0.0, -1.0)), (20.0, 0.1))
    assert followed(scene, AutomaticSteps())[-1].fractions == (1.0,)


def blown(first: Callable[[float], float] | float, last: Callable[[float], float] | float) -> list[Loading]:
    """What acts after two load steps of a cube, with pressures that follow, the times being 1 and 2."""
    scene = Scene(
        {"cube": Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), SOFT_RUBBER)}, [Support("cube", "z0")]
    )

    def gas(value: Callable[[float], float] | float) -> object:
        if callable(value):
            return lambda time: [Pressure("cube", "z1", value(time))]
        return [Pressure("cube", "z1", value)]

    steps = [LoadStep(f"{k}", loads=gas(value), time=k) for k, value in ((1.0, first), (2.0, last))]  # type: ignore[arg-type]
    return [state.load for state in followed(scene, AutomaticSteps(), steps)]


def lift(load: Loading) -> float:
    """The force of the pressures on the cube stretched by two across them, where they follow."""
    torn = load.torn
    stretched = np.concatenate(
        [mesh.space.tabulate_dof_coordinates() * [1.0, 0.0, 0.0] for mesh in torn.decomposition.meshes]
    )
    return float(load.at(stretched.ravel())[0].reshape(-1, 3)[:, 2].sum())


def test_on_the_way_to_another_pressure_the_old_one_goes_as_the_new_one_comes() -> None:
    before, after = blown(10.0, 30.0)
    assert lift(after) == pytest.approx(-2.0 * 30.0)
    assert lift(after.between(before, 0.25)) == pytest.approx(-2.0 * 15.0)


def test_a_pressure_that_is_a_function_of_time_has_its_value_at_every_part() -> None:
    before, after = blown(10.0, lambda time: 30.0 * (time - 1.0) ** 2)
    assert lift(after) == pytest.approx(-2.0 * 30.0)
    assert lift(after.between(before, 0.5)) == pytest.approx(-2.0 * 7.5)


# Limits of large deformations: small loads have the answers of small strains, turned bodies no stress.
SMALL = 1e-7


def lightly_pressed(mesh: BodyMesh, material: Elasticity) -> Scene:
    """A block whose underside is hardly round, pressed on a plane with friction and dragged very little."""
    dim, points = mesh.points.shape[1], mesh.points.copy()
    points[:, -1] += 2.0 * SMALL * ((points[:, :-1] - 0.5) ** 2).sum(axis=1) * (1.0 - points[:, -1])
    push = (0.3 * SMALL,) + (0.0,) * (dim - 2) + (-SMALL,)
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    floor = RigidPlane((0.0,) * dim, (0.0,) * (dim - 1) + (1.0,))
    body = Body(replace(mesh, points=points), material)
    return Scene(
        {"block": body},
        [Support("block", high, push)],
        contacts=[ContactPair(Surface("block", low), floor, Coulomb(0.3))],
    )


@pytest.mark.parametrize(
    ("mesh", "linear"),
    [
        (block((0, 0, 0), (1, 1, 1), (6, 6, 6)), IsotropicElasticity(1.0, 0.3)),
        (rectangle((0, 0), (1, 1), (16, 16)), PlaneStrain(1.0, 0.3)),
    ],
    ids=["space", "plane"],
)
def test_contact_at_small_load_is_that_of_small_strains(mesh: BodyMesh, linear: Elasticity) -> None:
    given = {"block": box_partition(mesh, (2,) * mesh.points.shape[1])}
    state, small = (
        solve_scene(lightly_pressed(mesh, material), MPI.COMM_SELF, partitions=given, tolerance=1e-8)
        for material in (NeoHooke(1.0, 0.3), linear)
    )
    assert isinstance(state, DeformedState)
    assert all(small.contact.count(status) > 0 for status in Status), "open, sticking and slipping"
    assert [state.contact.count(s) for s in Status] == [small.contact.count(s) for s in Status]
    force, moved = small.contact.force, small.gather_displacement("block")
    assert np.abs(state.contact.force - force).max() < 1e-6 * np.abs(force).max()
    assert np.abs(state.gather_displacement("block") - moved).max() < 1e-6 * np.abs(moved).max()
    assert len(state.solution.history) <= 5, "nothing is nonlinear but contact"


def test_rounding_alone_hides_nothing_of_a_small_load() -> None:
    """Forces of 1e-12 of stiffness times cell are a thousand times what positions are rounded by."""
    mesh, load = rectangle((0, 0), (1, 1), (4, 4)), [Traction("block", "x1", (3e-12, 1e-11))]
    found, small = (
        solve_scene(Scene({"block": Body(mesh, material)}, [Support("block", "x0")], load), MPI.COMM_SELF)
        for material in (NeoHooke(1.0, 0.3), PlaneStrain(1.0, 0.3))
    )
    moved = small.gather_displacement("block")
    assert np.abs(found.gather_displacement("block") - moved).max() < 1e-3 * np.abs(moved).max()


def test_a_small_load_on_a_body_that_is_moved_far_is_balanced() -> None:
    """Forces are compared with a small part alone of what would strain the body by its displacement."""
    mesh, load = rectangle((0, 0), (1, 1), (4, 4)), [Traction("block", "x1", (3e-10, 1e-9))]
    held = [Support("block", "x0", (3.0, -2.0))]
    found, small = (
        solve_scene(Scene({"block": Body(mesh, material)}, held, load), MPI.COMM_SELF)
        for material in (NeoHooke(1.0, 0.3), PlaneStrain(1.0, 0.3))
    )
    moved = small.gather_displacement("block")
    off = found.gather_displacement("block") - moved
    assert np.abs(off).max() < 1e-3 * np.abs(moved - (3.0, -2.0)).max()


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Displacement of points that turn about an axis through the centre of the unit cube."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((points - 0.5) @ [[c, 0, -s], [0, 1, 0], [s, 0, c]] + 0.5 - points)


def turning(angle: float, component: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda points: turned(points, angle)[:, component]


@pytest.mark.parametrize("count", [1, 4], ids=["at once", "in four steps"])
def test_a_body_that_turns_with_its_support_has_no_stress(count: int) -> None:
    """Supports reach their places along chords: on the way the block is squeezed, at the end it is not."""
    mesh = block((0, 0, 0), (1, 1, 1), (4, 4, 4))
    steps = []
    for number in range(1, count + 1):
        angle = 0.5 * np.pi * number / count
        support = Support("block", "z0", tuple(turning(angle, component) for component in range(3)))
        steps.append(LoadStep(str(number), supports=[support]))
    scene = Scene({"block": Body(mesh, LIMIT_RUBBER)}, steps[0].supports or ())
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(mesh, 2), tolerance=1e-9)
    states = solve_steps(problem, steps)
    last = states[-1]
    assert isinstance(last, DeformedState)
    exact = turned(mesh.points, 0.5 * np.pi)
    assert np.abs(last.gather_displacement("block") - exact).max() < 1e-9
    assert np.abs(last.stress["block"].x.array).max() < 1e-8
    assert max(len(state.solution.history) for state in states) <= (12 if count == 1 else 8)


def two_blocks(rotation: np.ndarray, push: tuple[float, float, float]) -> Scene:
    """A small stiff block with a round underside on a large soft one."""
    low = block((0, 0, 0), (2, 2, 1), (4, 4, 2))
    high = block((0.53, 0.57, 1), (1.53, 1.57, 1.6), (3, 3, 2))
    x, y, z = high.points.T
    bulge = 0.2 * ((x - 1.03) ** 2 + (y - 1.07) ** 2) * (1.6 - z) / 0.6
    high = replace(high, points=np.column_stack([x, y, z + bulge]))
    low, high = (replace(mesh, points=mesh.points @ rotation.T) for mesh in (low, high))
    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.3))
    return Scene(
        {"low": Body(low, NeoHooke(1.0, 0.3)), "high": Body(high, NeoHooke(5.0, 0.3))},
        [Support("low", "z0"), Support("high", "z1", tuple(rotation @ push))],
        contacts=[pair],
    )


def test_two_blocks_turned_in_space_give_the_turned_answer() -> None:
    answers = []
    for rotation in (np.eye(3), tilted(1.1)):
        scenes = [two_blocks(rotation, push) for push in ((0.0, 0.0, -0.15), (0.12, 0.05, -0.15))]
        steps = [LoadStep(str(number), supports=scene.supports) for number, scene in enumerate(scenes)]
        problem = ContactProblem(scenes[0], MPI.COMM_SELF, tolerance=1e-11)
        answers.append(solve_steps(problem, steps)[-1])
    upright, turn = answers
    assert turn.contact.count(Status.SLIP) > 3
    force = upright.contact.force @ tilted(1.1).T
    assert np.abs(turn.contact.force - force).max() < 1e-9 * np.abs(force).max()
    for name in ("low", "high"):
        moved = upright.gather_displacement(name) @ tilted(1.1).T
        assert np.abs(turn.gather_displacement(name) - moved).max() < 1e-9 * np.abs(moved).max()


def test_a_deformed_state_says_what_it_has_and_refuses_no_attribute() -> None:
    state = solve_scene(pressed(rounded(2), 0.05), MPI.COMM_SELF)
    words = str(state)
    assert "out of balance" in words
    assert "compare two meshes" in words
    assert "call state.estimate_errors()" not in words
    names = [name for name in dir(type(state)) if not name.startswith("_")]
    assert len([getattr(state, name) for name in names]) > 20
    assert not {"dual", "system", "estimate_errors"} & set(names)
    assert state.tolerance == TangentNewton().tolerance


@pytest.mark.parametrize("friction", [None, Coulomb(0.3)])
def test_a_body_that_may_slide_freely_is_told_to_be_held(friction: Coulomb | None) -> None:
    """A dead load holds no body on a plane without friction; smaller load steps would not either."""
    pair = ContactPair(Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), friction)
    loads = [Traction("block", "y1", (0.0, -0.05))]
    scene = Scene({"block": Body(rectangle((0, 0), (1, 1), (4, 4)), LIMIT_RUBBER)}, [], loads, [pair])
    steps = AutomaticSteps(TangentNewton(max_steps=12), smallest=1.0)
    if friction is not None:
        assert solve_scene(scene, MPI.COMM_SELF, steps=steps).balance().imbalance < 1e-8
        return
    with pytest.raises(InfeasibleError, match=r"translation \(1, 0\): support it .* or give its contacts"):
        solve_scene(scene, MPI.COMM_SELF, steps=steps)


@pytest.mark.parametrize(
    ("material", "way", "told"),
    [
        (LIMIT_RUBBER, "node", True),
        (LIMIT_RUBBER, "mortar", False),
        (J2Plasticity(1.0, 0.3, 0.01), "node", False),
    ],
)
def test_a_path_by_nodes_of_bodies_that_slide_is_told_of_mortar(
    material: Material, way: str, told: bool
) -> None:
    bodies = {"low": Body(rectangle((0, 0), (1, 1), (3, 3)), material)}
    bodies["high"] = Body(rectangle((0, 1), (1, 2), (4, 4)), material)
    supports = [Support("low", "y0"), Support("high", "y1", (0.0, -0.3))]
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation=way)
    steps = AutomaticSteps(TangentNewton(max_steps=1), smallest=1.0)
    with pytest.raises(LoadStepError) as ended:
        solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF, steps=steps)
    assert ("discretisation='mortar'" in str(ended.value)) == told


# Factors of tangents: they take over analyses, and find out where a matrix is not positive definite.
def stiffness(shift: float) -> sp.csr_matrix:
    """Return the Laplacian of a square of 20 by 20 points less a shift; its least eigenvalue is 0.0447."""
    line = sp.diags([-np.ones(19), np.full(20, 2.0), -np.ones(19)], [-1, 0, 1])
    whole = sp.kron(line, sp.identity(20)) + sp.kron(sp.identity(20), line)
    return (whole - shift * sp.identity(400)).tocsr()


@pytest.mark.parametrize("factored", [with_inertia, mostly_positive])
@pytest.mark.parametrize("shift", [0.0, 0.03, 1.0])
def test_spent_factors_solve_with_another_matrix(factored, shift):
    spent = factored(stiffness(0.01), None)
    matrix, right = stiffness(shift), np.linspace(1.0, 2.0, 400)
    factor = factored(matrix, spent)
    factor.solve(right, solution := np.empty(400))
    assert np.abs(solution).max() > 0.1
    np.testing.assert_allclose(matrix @ solution, right, rtol=1e-9)


def test_refilled_factors_count_negative_eigenvalues_anew():
    spent = with_inertia(stiffness(0.0), None)
    assert spent.negative == 0
    factor = with_inertia(matrix := stiffness(1.0), spent)
    assert factor is spent
    assert factor.negative == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0.0) > 0


def test_factors_of_another_pattern_are_not_refilled():
    spent = with_inertia(stiffness(0.0), None)
    matrix = sp.identity(400, format="csr") * 2.0
    factor = with_inertia(matrix, spent)
    assert factor is not spent
    factor.solve(np.ones(400), solution := np.empty(400))
    np.testing.assert_allclose(solution, 0.5)


def test_cholesky_factors_that_do_not_fit_are_replaced(monkeypatch):
    monkeypatch.setattr(RefillableFactor, "accuracy", 0.0)
    assert isinstance(mostly_positive(stiffness(0.0), None), IndefiniteFactor)


def test_a_matrix_that_is_not_positive_definite_is_told_by_an_error_alone(capfd):
    line = sp.diags([-np.ones(11), np.full(12, 2.0), -np.ones(11)], [-1, 0, 1])
    one = sp.identity(12)
    orders = ((line, one, one), (one, line, one), (one, one, line))
    whole = sum(sp.kron(sp.kron(a, b), c) for a, b, c in orders)
    matrix = (whole - 0.5 * sp.identity(12**3)).tocsr()
    factor = mostly_positive(matrix, None)
    assert factor.fits(matrix)
    if factors(PETSc, "cholmod"):  # MUMPS has signs of pivots, too, and goes on
        assert isinstance(factor, IndefiniteFactor)
        with pytest.raises(ConvergenceError, match=r"must have factors, but .* not positive definite"):
            RefillableFactor(matrix)
    assert capfd.readouterr() == ("", "")


def test_factors_for_which_mumps_takes_too_little_memory_are_made_with_more(monkeypatch):
    line = sp.diags([-np.ones(29), np.full(30, 2.0), -np.ones(29)], [-1, 0, 1])
    one = sp.identity(30)
    orders = ((line, one, one), (one, line, one), (one, one, line))
    matrix = sum(sp.kron(sp.kron(a, b), c) for a, b, c in orders).tocsr() - sp.identity(30**3, format="csr")
    monkeypatch.setattr(IndefiniteFactor, "_memory", (-90,))
    with pytest.raises(ConvergenceError, match=r"MUMPS ends with INFOG\(1\) = -9"):
        with_inertia(matrix, None)
    monkeypatch.setattr(IndefiniteFactor, "_memory", (-90, 100))
    factor, right = with_inertia(matrix, None), np.linspace(1.0, 2.0, 30**3)
    factor.solve(right, solution := np.empty(30**3))
    np.testing.assert_allclose(matrix @ solution, right, rtol=1e-9)
    assert factor.negative > 10


def test_factors_that_mumps_cannot_complete_are_refused():
    matrix = stiffness(0.0)
    matrix.data[:] = np.nan
    with pytest.raises(ConvergenceError, match=r"must have factors, but MUMPS ends with INFOG\(1\) = -"):
        with_inertia(matrix, None)


def test_negative_motions_are_found_next_to_zero_and_far_below_it():
    """The inverse has the latter amid a cluster: some cells have lost their strength, a body buckles."""
    values = np.concatenate([[-1e9, -3e8, -2e7, -0.02, -0.01], np.geomspace(0.05, 1e7, 395)])
    mixing = np.linalg.qr(np.random.default_rng(1).standard_normal((20, 20)))[0]
    turned = sp.kron(sp.identity(20), mixing).tocsr()[:, np.random.default_rng(2).permutation(400)]
    matrix = (turned @ sp.diags(values) @ turned.T).tocsr()
    factor = with_inertia(matrix, None)
    assert factor.negative == 5
    probes = np.random.default_rng(0).standard_normal((400, 4))
    found, vectors = _softest(matrix, factor, probes, 2)
    negative = vectors[:, found < 0.0]
    assert negative.shape[1] == 5
    held = matrix + 2e9 * negative @ negative.T
    assert np.linalg.eigvalsh(held).min() > 0.0
