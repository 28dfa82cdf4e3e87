"""Shape derivatives of rubber that is pressed far, beside difference quotients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import scipy.sparse as sp

from fenics_contact import (
    AutomaticSteps,
    ClosureLaw,
    ClosureTable,
    Coulomb,
    DeformedState,
    LinearClosure,
    LoadStep,
    MovingObstacle,
    Scene,
    ShapeProblem,
    Status,
    Surface,
    SurfaceDesign,
)
from fenics_contact._pairing.sliding import points as sliding_points
from fenics_contact.design import (
    LargestPressure,
    LoadPath,
    Movement,
    PressureNorm,
    StrainEnergy,
)
from fenics_contact.design import (
    sensitivity as area_derivative,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials import Material, PlaneStrain
from tests.design.deformed_blocks import HARDER, PRESSURES, design_problem, miss, pressed

Patch = pytest.MonkeyPatch
LeaveOut = Callable[[Patch], None]
slowly = partial(pytest.param, marks=[pytest.mark.slow, pytest.mark.claim])


@cache
def plane_problems(master: str, friction: float, pushed: float) -> tuple[ShapeProblem, ShapeProblem]:
    """A problem by default settings, and one of accurate states; each solves a design once."""
    scene = pressed(master, friction, pushed)
    return design_problem(scene, PRESSURES), design_problem(scene, PRESSURES, tolerance=1e-12)


@pytest.mark.parametrize(
    ("master", "friction", "pushed", "statuses"),
    [
        ("plane", 0.0, 0.0, {Status.SLIP}),
        ("plane", 0.6, 0.05, {Status.STICK}),
        ("disc", 0.2, 0.1, {Status.OPEN, Status.SLIP}),
        ("disc", 0.6, 0.03, {Status.OPEN, Status.STICK, Status.SLIP}),
        ("block", 0.0, 0.1, {Status.SLIP}),
        ("block", 0.3, 0.1, {Status.STICK, Status.SLIP}),
    ],
)
def test_plane_blocks(master: str, friction: float, pushed: float, statuses: set[Status]) -> None:
    """By default settings, against quotients of accurate states."""
    problem, exact = plane_problems(master, friction, pushed)
    for objective in (PRESSURES, Movement("block", "x1", (1.0, 0.3))):
        assert miss(problem, exact, objective) < 1e-5, objective
    assert {Status(each) for each in problem.last.state.contact.status} == statuses  # type: ignore[union-attr]
    assert problem.last.adjoint_iterations > 0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("master", "friction", "pushed"),
    [
        ("block", 0.0, 0.1),
        ("disc", 0.15, 0.1),
        slowly("block", 0.9, 0.02),
        slowly("block", 0.15, 0.1),
    ],
)
def test_blocks_in_space(master: str, friction: float, pushed: float) -> None:
    """With friction all stick, or all slip in turning directions."""
    scene, objective = pressed(master, friction, pushed, dim=3), PRESSURES
    problem = design_problem(scene, objective)
    assert miss(problem, design_problem(scene, objective, tolerance=1e-12)) < 1e-5


def by_mortar(friction: float, pushed: float, dim: int = 2, **more: object) -> Scene:
    """A block on another one, which meets it in weighted means."""
    scene = pressed("block", friction, pushed, dim)
    pair = replace(scene.contacts[0], discretisation="mortar", **more)  # type: ignore[arg-type]
    return replace(scene, contacts=[pair])


BOTH = SurfaceDesign("block", "y0", net=3), SurfaceDesign("lower", "y1", net=3)


@cache
def mortar_problems(friction: float, pushed: float, gap: float) -> tuple[ShapeProblem, ShapeProblem]:
    """A problem of two designs by default settings, and one of accurate states."""
    scene, objective = by_mortar(friction, pushed, gap=gap or None), PressureNorm()
    exact = design_problem(scene, objective, tolerance=1e-12, designs=BOTH)
    return design_problem(scene, objective, designs=BOTH), exact


@pytest.mark.parametrize(
    ("friction", "pushed", "gap", "statuses"),
    [
        (0.3, 0.1, 0.01, {Status.STICK, Status.SLIP}),
        slowly(0.0, 0.1, 0.0, {Status.SLIP}),
        slowly(0.9, 0.02, 0.0, {Status.STICK}),
        slowly(0.15, 0.1, 0.0, {Status.STICK, Status.SLIP}),
    ],
)
def test_plane_blocks_that_meet_by_mortar(
    friction: float, pushed: float, gap: float, statuses: set[Status]
) -> None:
    problem, exact = mortar_problems(friction, pushed, gap)
    assert miss(problem, exact) < 1e-5
    assert {Status(each) for each in problem.last.state.contact.status} == statuses  # type: ignore[union-attr]


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize(("friction", "pushed"), [(0.0, 0.1), (0.3, 0.1)])
def test_blocks_in_space_that_meet_by_mortar(friction: float, pushed: float) -> None:
    scene, objective = by_mortar(friction, pushed, dim=3), Movement("block", "x1", (1.0, 0.3, 0.3))
    problem = design_problem(scene, objective)
    assert miss(problem, design_problem(scene, objective, tolerance=1e-12)) < 1e-5


def with_wide_slave(material: Material) -> Scene:
    """The rim of the master moves over facets of the slave, of which a part faces it."""
    scene = by_mortar(0.0, 0.05)
    (pair,) = scene.contacts
    assert isinstance(pair.master, Surface)
    bodies = {**scene.bodies, "lower": replace(scene.bodies["lower"], material=material)}
    return replace(scene, bodies=bodies, contacts=[replace(pair, slave=pair.master, master=pair.slave)])


@pytest.mark.parametrize("material", [HARDER, PlaneStrain(2.0, 0.3)])
def test_pressures_on_a_slave_that_is_wider_than_its_master(material: Material, monkeypatch: Patch) -> None:
    """Where its strains are small its areas are those of the undeformed body."""
    scene = with_wide_slave(material)
    problem = design_problem(scene, PRESSURES, designs=BOTH)
    exact = design_problem(scene, PRESSURES, tolerance=1e-12, designs=BOTH)
    assert miss(problem, exact) < 1e-5
    without_the_rim_of_the_master(monkeypatch)
    assert miss(problem, exact) > 1e-4


def test_an_obstacle_that_turns() -> None:
    """A rolling disc: slip counts from where nodes stood on it before it turned."""
    still = pressed("disc", 0.4, 0.0)
    pair = still.contacts[0]
    centre = np.array([1.1, -2.0])

    def motion(time: float) -> tuple[np.ndarray, np.ndarray]:
        c, s = np.cos(0.05 * time), np.sin(0.05 * time)
        rotation = np.array([[c, -s], [s, c]])
        return rotation, centre - rotation @ centre

    rolling = MovingObstacle(pair.master, motion)  # type: ignore[arg-type]
    scene = replace(still, contacts=[replace(pair, master=rolling)])
    objective = Movement("block", "x1", (1.0, 0.0))
    problem = design_problem(scene, objective)
    exact = design_problem(scene, objective, tolerance=1e-12)
    assert miss(problem, exact) < 1e-5
    assert problem.last.state.contact.count(Status.STICK) > 1  # type: ignore[union-attr]


def test_a_load_step_that_is_followed_in_parts() -> None:
    scene, objective = pressed("block", 0.3, 0.1), PressureNorm()
    problem = design_problem(scene, objective, steps=AutomaticSteps(first=0.6))
    assert miss(problem, design_problem(scene, objective, tolerance=1e-12)) < 1e-5
    state = problem.last.state  # type: ignore[union-attr]
    assert isinstance(state, DeformedState)
    assert len(state.fractions) > 1
    assert state.contact.count(Status.SLIP) > 0


def without_the_start_of_slip(patch: Patch) -> None:
    def none(points: sliding_points.SlidingPoints, start: sliding_points.SlidingPoints) -> sp.csr_matrix:
        return 0.0 * points.slip_rows(start.material_points())

    patch.setattr(sliding_points.SlidingPoints, "slip_by_start", none)


def without_turning_friction(patch: Patch) -> None:
    whole = sliding_points.friction_stiffness  # type: ignore[attr-defined]

    def none(*given: object) -> object:
        found = whole(*given)  # type: ignore[arg-type]
        return type(found)(0.0 * found.left, found.right, found.point)

    patch.setattr(sliding_points, "friction_stiffness", none)


def without_the_start_of_means(patch: Patch) -> None:
    whole = sliding_points.slip_by_start_of_means  # type: ignore[attr-defined]
    patch.setattr(sliding_points, "slip_by_start_of_means", lambda *given: 0.0 * whole(*given))


def without_growth_of_areas(patch: Patch) -> None:
    """Areas of the deformed slave as if the shape alone moved its nodes."""
    whole = area_derivative.nodal_mean_transposed  # type: ignore[attr-defined]
    patch.setattr(area_derivative, "nodal_mean_transposed", lambda *given: 0.0 * whole(*given))


def without_the_rim_of_the_master(patch: Patch) -> None:
    patch.setattr(
        sliding_points.SlidingPoints, "met_areas_pulled_back", lambda points, _: 0.0 * points.coordinates
    )


def without_moving_means(patch: Patch) -> None:
    patch.setattr(sliding_points.SlidingPoints, "means_pulled_back", lambda *_: 0.0)


@pytest.mark.parametrize(
    ("problems", "terms"),
    [
        (
            partial(plane_problems, "block", 0.3, 0.1),
            (without_the_start_of_slip, without_turning_friction, without_growth_of_areas),
        ),
        (partial(mortar_problems, 0.3, 0.1, 0.01), (without_the_start_of_means, without_moving_means)),
    ],
    ids=["node", "mortar"],
)
def test_a_term_left_out_is_missed(
    problems: Callable[[], tuple[ShapeProblem, ShapeProblem]], terms: tuple[LeaveOut, ...], monkeypatch: Patch
) -> None:
    problem, exact = problems()
    for leave_out in terms:
        with monkeypatch.context() as patch:
            leave_out(patch)
            assert miss(problem, exact, PressureNorm()) > 1e-4, leave_out.__name__


def test_a_design_makes_rubber_press_more_evenly() -> None:
    """A few steps down the gradient, as an optimiser takes them."""
    problem = design_problem(pressed("disc", 0.2, 0.05), LargestPressure())
    first = problem.evaluate(np.zeros(problem.size))
    down = -0.005 * first.gradient / np.abs(first.gradient).max()
    assert problem.value_of(down) < first.value + 0.8 * first.gradient @ down


def test_what_has_no_derivative_is_named() -> None:
    with pytest.raises(InvalidInputError, match="StrainEnergy needs linear materials"):
        design_problem(pressed("plane", 0.0, 0.0), StrainEnergy()).evaluate(np.zeros(4))
    finer = AutomaticSteps(first=0.5, finer_history=True)
    far = design_problem(pressed("block", 0.3, 0.1), PressureNorm(), steps=finer)
    with pytest.raises(InvalidInputError, match=r"since the start of the load step, .* begins at 0\.5 of it"):
        far.evaluate(np.zeros(far.size))
    problem = design_problem(pressed("plane", 0.0, 0.0), PressureNorm())
    with pytest.raises(InvalidInputError, match="checkpoints of designs need linear materials"):
        problem.memory()
    path = LoadPath(problem, [LoadStep("press"), LoadStep("again")])
    with pytest.raises(InvalidInputError, match="have one load step"):
        path(np.zeros(path.size))


@pytest.mark.parametrize(
    ("master", "law", "friction"),
    [
        ("disc", ClosureTable((-0.02, 0.03, 0.06), (0.0, 0.1, 0.4)), Coulomb(0.2)),
        ("block", LinearClosure(3.0), Coulomb(0.3, shear_limit=0.04)),
        ("block", LinearClosure(3.0), Coulomb(0.3, stick_stiffness=2.0)),
    ],
)
def test_blocks_whose_surfaces_give_way(master: str, law: ClosureLaw, friction: Coulomb) -> None:
    scene = pressed(master, 0.2, 0.1)
    pair = replace(scene.contacts[0], closure=law, friction=friction)
    problem, exact = (
        design_problem(replace(scene, contacts=[pair]), PRESSURES, tolerance=tolerance)
        for tolerance in (None, 1e-12)
    )
    assert miss(problem, exact) < 1e-5
    contact = problem.last.state.contact  # type: ignore[union-attr]
    assert contact.gap.min() < -0.01
