"""Load steps on meshes of their own: slip and histories of materials are carried from mesh to mesh."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AccurateResult,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    FluidPressure,
    Level,
    Limits,
    LoadStep,
    Preload,
    RigidSphere,
    Scene,
    Section,
    SlipTable,
    State,
    Support,
    Surface,
    TransferredState,
    gallery,
    quantity,
    solve_steps,
    solve_steps_to,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials import FinitePlasticity, J2Plasticity, NeoHooke
from fenics_contact.mesh import MeshTransfer, refined
from tests.adaptive.rolling import RADIUS, block, forces, pressed, rolled, upwards
from tests.equilibrium.nested_cases import SCENES, cut, outside, refined_near

SELF = MPI.COMM_SELF
STEEL = J2Plasticity(200.0, 0.3, 0.2, 2.0, 10.0)


@pytest.fixture(scope="module")
def rolling() -> tuple[AccurateResult, ...]:
    scene = block(8, 2)
    return solve_steps_to(scene, rolled(), upwards(scene), 0.02, SELF)


def test_small_cells_follow_a_roller_and_vanish_behind_it(rolling: Sequence[AccurateResult]) -> None:
    for result, step in zip(rolling, rolled(), strict=True):
        assert result.reached
        mesh = result.state.scene.bodies["block"].mesh
        sizes = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
        small = mesh.points[mesh.cells][sizes < 0.7].mean(axis=1)[:, 0]
        spot = -RADIUS * step.supports[0].rotation  # type: ignore[index, union-attr]
        assert len(small) > 30
        assert small.min() > spot - 7.5
        assert small.max() < spot + 7.5
    cells = [result.levels[-1].cells for result in rolling]
    assert max(cells) < 300, "not all that were ever needed"


def test_forces_are_those_of_steps_on_a_fine_mesh(rolling: Sequence[AccurateResult]) -> None:
    fine = solve_steps(ContactProblem(block(80, 16), SELF, tolerance=1e-6), rolled())
    found, expected = (np.array([forces(state) for state in s]) for s in ([r.state for r in rolling], fine))
    np.testing.assert_allclose(found[:, 1], expected[:, 1], rtol=0.02)
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=0.05)
    alone = ContactProblem(fine[-1].scene, SELF, tolerance=1e-6).solve()
    assert abs(forces(alone)[0] / expected[-1, 0] - 1.0) > 0.3, "without its history friction is another"


def test_every_level_of_every_step_is_shown_and_what_falls_short_is_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    scene, seen = block(8, 2), list[tuple[str, int]]()

    def show(step: LoadStep, level: Level) -> None:
        seen.append((step.name, level.cells))

    with caplog.at_level(logging.WARNING):
        steps = rolled()[:2]
        found = solve_steps_to(
            scene, steps, upwards(scene), 0.01, SELF, limits=Limits(levels=2), callback=show
        )
    assert [len(result.levels) for result in found] == [2, 2]
    assert seen == [(s.name, lev.cells) for s, r in zip(steps, found, strict=True) for lev in r.levels]
    told = [record.message for record in caplog.records if "was not reached" in record.message]
    assert [words.split(":")[0] for words in told] == [
        f"the accuracy asked for was not reached in load step {step.name!r}" for step in steps
    ]


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize(
    ("material", "size"), [(STEEL, 0.01), (FinitePlasticity(200.0, 0.3, 0.2, 2.0), 0.1)], ids=["j2", "finite"]
)
def test_uniform_plastic_strain_is_carried_exactly(material: J2Plasticity, size: float, cell: str) -> None:
    first = gallery.rectangle((0, 0), (4, 1), (5, 3), cell=cell)
    old = [refined(first, [0, 3, 4])]
    old.append(refined(old[0].mesh, [1, 5]))
    new = [refined(first, [9, 10])]

    def stretched(mesh: object, by: float) -> ContactProblem:
        ends = [Support("bar", "x0", (0.0, None)), Support("bar", "x1", (4.0 * by, None))]
        bar = Body(mesh, material)  # type: ignore[arg-type]
        scene = Scene({"bar": bar}, [*ends, Support("bar", "y0", (None, 0.0))])
        return ContactProblem(scene, SELF, tolerance=1e-13)

    before = stretched(old[-1].mesh, size).solve()
    carried = TransferredState(before, {"bar": MeshTransfer(old, new)})
    problem = stretched(new[-1].mesh, size)
    same = problem.solve(before=problem.solve())
    held = stretched(new[-1].mesh, size).solve(before=carried)
    stress = same.gather_stress("bar")
    # Constants are carried to rounding, see tests/mesh; what remains is rounding of the solutions.
    np.testing.assert_allclose(held.gather_stress("bar"), stress, rtol=0, atol=5e-10 * np.abs(stress).max())
    u, v = (state.gather_displacement("bar") for state in (same, held))
    np.testing.assert_allclose(v, u, rtol=0, atol=1e-11 * np.abs(u).max())
    released = stretched(new[-1].mesh, 0.5 * size)
    back = released.solve(before=carried).gather_stress("bar")
    expected = released.solve(before=same).gather_stress("bar")
    np.testing.assert_allclose(back, expected, rtol=0, atol=5e-10 * np.abs(expected).max())
    fresh = released.solve().gather_stress("bar")
    assert np.abs(fresh - expected).max() > np.abs(expected).max()


def half_as_much(scene: Scene) -> Scene:
    """The scene with half of its numbers of loads and supports, and preloads held."""
    supports = [
        replace(s, value=tuple(v if v is None else 0.5 * v for v in s.value)) if isinstance(s, Support) else s
        for s in scene.supports
    ]
    loads = [
        replace(each, **{name: tuple(0.5 * np.array(getattr(each, name)))})
        for each in scene.loads
        for name in ("value", "force")
        if hasattr(each, name)
    ]
    return LoadStep("half", supports=supports, loads=loads, preloads=[]).applied_to(scene)


@pytest.mark.parametrize(
    ("name", "plastic"),
    [
        ("nodes", False),
        ("laws", False),
        ("springs", False),
        ("preload", False),
        ("free", True),
        ("laws", True),
    ],
)
def test_on_the_same_meshes_nothing_changes(name: str, plastic: bool) -> None:
    scene = SCENES[name]()
    if plastic:
        limit = 2000.0 if "disc" in scene.bodies else 40.0
        steel = J2Plasticity(2.1e5, 0.3, limit, 2e4)
        scene = replace(scene, bodies={n: replace(b, material=steel) for n, b in scene.bodies.items()})
    reach = 0.3 * float(np.ptp(scene.points, axis=0).max())
    fine = refined_near(scene, tuple(scene.points.mean(axis=0)), reach)
    before = ContactProblem(fine.scene, SELF, partitions=cut(fine.scene, 3), tolerance=1e-9).solve()
    ways = {body: MeshTransfer([one], [replace(one)]) for body, one in fine.refinements.items()}
    after = half_as_much(fine.scene)
    one, other, fresh = (
        ContactProblem(after, SELF, partitions=cut(after, parts), tolerance=1e-9).solve(before=each)
        for each, parts in ((before, 3), (TransferredState(before, ways), 5), (None, 3))
    )
    for body in after.bodies:
        u, v = (state.gather_displacement(body) for state in (one, other))
        np.testing.assert_allclose(v, u, rtol=0, atol=1e-7 * np.abs(u).max())
    if (name, plastic) in (("nodes", False), ("springs", False), ("laws", True)):
        stress = [state.gather_stress(next(iter(after.bodies))) for state in (one, fresh)]
        assert np.abs(stress[0] - stress[1]).max() > 1e-3 * np.abs(stress[0]).max(), "history matters"


@pytest.fixture(scope="module")
def plastic() -> tuple[State, ...]:
    """The block on a fine mesh from the start."""
    scene, steps = pressed(16)
    return solve_steps(ContactProblem(scene, SELF), steps)


def test_a_plastic_block_is_refined_between_two_load_steps(plastic: Sequence[State]) -> None:
    scene, steps = pressed(8)
    before = ContactProblem(steps[0].applied_to(scene), SELF).solve()
    assert isinstance(before, DeformedState)
    mesh = scene.bodies["block"].mesh
    finer = refined(mesh, np.arange(mesh.n_cells))
    fine = replace(scene, bodies={"block": replace(scene.bodies["block"], mesh=finer.mesh)})
    carried = TransferredState(before, {"block": MeshTransfer(new=[finer])})
    after = ContactProblem(steps[1].applied_to(fine), SELF).solve(
        before=carried, step=replace(steps[1], time=2.0)
    )
    expected = plastic[-1]
    assert isinstance(after, DeformedState)
    assert isinstance(expected, DeformedState)
    assert forces(after)[1] == pytest.approx(forces(expected)[1], rel=0.01)
    largest = [state.history.values["block"][..., 6].max() for state in (before, after, expected)]
    assert largest[1] == pytest.approx(largest[2], rel=0.1)
    assert largest[0] < 0.6 * largest[2]
    alone = ContactProblem(steps[1].applied_to(fine), SELF).solve()
    assert abs(forces(alone)[0] / forces(expected)[0] - 1.0) > 0.05


def test_a_plastic_block_is_solved_to_an_accuracy_step_by_step(plastic: Sequence[State]) -> None:
    scene, steps = pressed(4)
    found = solve_steps_to(
        scene, steps, quantity("contact_force", steps[0].applied_to(scene), direction=(0, 1)), 0.3, SELF
    )
    for result, state in zip(found, plastic, strict=True):
        assert result.reached
        assert result.value == pytest.approx(forces(state)[1], rel=0.05)
    assert found[0].levels[-1].cells != found[1].levels[-1].cells


def test_means_of_finite_plastic_deformations_keep_the_volume() -> None:
    metal = FinitePlasticity(200.0, 0.3, 0.2, 2.0)
    stretched, sheared = np.diag([4.0, 1.0, 0.25]), np.diag([0.25, 1.0, 4.0])
    mean = 0.5 * (stretched + sheared) - np.eye(3)
    history = np.array([[*np.diag(mean), 0.0, 0.0, 0.0, 0.7]])
    kept = metal.admissible(history)
    assert np.linalg.det(np.diag(history[0, :3]) + np.eye(3)) > 4.0
    assert np.linalg.det(np.diag(kept[0, :3]) + np.eye(3)) == pytest.approx(1.0, rel=1e-14)
    assert kept[0, 6] == 0.7
    assert STEEL.admissible(history) is history


def test_histories_that_are_not_carried_are_refused() -> None:
    scene = block(4, 2)
    pair = scene.contacts[0]
    plate = Body(scene.bodies["block"].mesh, J2Plasticity(1.0, 0.3, 1.0))
    drawn = [Preload("block", Section((0.0, 1.9), (0.0, 1.0)), force=1.0)]
    cases = {
        "friction that depends on slip": replace(
            scene, contacts=[replace(pair, friction=Coulomb(SlipTable((0.0, 0.02), (0.3, 0.2))))]
        ),
        "fluid that enters contacts": replace(
            scene, contacts=[replace(pair, friction=None, fluid=FluidPressure(1.0, enters=outside))]
        ),
        "preloads in scenes with nonlinear materials": Scene({"block": plate}, preloads=drawn),
    }
    for what, each in cases.items():
        known = cast("State", SimpleNamespace(scene=each))
        with pytest.raises(InvalidInputError, match=f"carry histories, but not that of {what}"):
            TransferredState(known, {}).check(each)


def rubbed(mesh: BodyMesh, along: float, down: float) -> Scene:
    """Rubber on a roller that it slides along."""
    pair = ContactPair(Surface("pad", "y0"), RigidSphere((1.0, -2.0), 2.0), Coulomb(0.4))
    held = [Support("pad", "y1", (along, -down))]
    return Scene({"pad": Body(mesh, NeoHooke(1.0, 0.3))}, held, contacts=[pair])


def test_slip_of_bodies_that_deform_much_is_carried() -> None:
    """On the same meshes nothing is lost; on finer ones the force is that of a history on these."""
    coarse = gallery.rectangle((0, 0), (2, 1), (8, 4), cell="triangle")
    finer = refined(coarse, np.arange(coarse.n_cells))
    ways = [(0.0, 0.2), (0.3, 0.2), (0.1, 0.2)]

    def ended(mesh: BodyMesh, way: tuple[float, float], before: State | TransferredState | None) -> State:
        return ContactProblem(rubbed(mesh, *way), SELF, tolerance=1e-10).solve(before=before)

    first = ended(coarse, ways[1], ended(coarse, ways[0], None))
    whole, carried = (ended(coarse, ways[2], each) for each in (first, TransferredState(first, {})))
    np.testing.assert_allclose(carried.contact.force, whole.contact.force, atol=1e-8)
    np.testing.assert_allclose(carried.contact.total_slip, whole.contact.total_slip, atol=1e-8)
    assert np.abs(whole.contact.slip_before).max() > 0.1
    moved = ended(finer.mesh, ways[2], TransferredState(first, {"pad": MeshTransfer(new=[finer])}))
    fine = ended(finer.mesh, ways[2], ended(finer.mesh, ways[1], ended(finer.mesh, ways[0], None)))
    along = [each.contact.force.sum(axis=0)[0] for each in (whole, moved, fine)]
    assert abs(along[1] - along[2]) < 0.5 * abs(along[0] - along[2])
    pressing = (moved.contact.normal_force > 0.0) & (fine.contact.normal_force > 0.0)
    slips = [each.contact.total_slip[pressing].mean() for each in (moved, fine)]
    assert slips[0] == pytest.approx(slips[1], rel=0.1)
    assert slips[1] > 0.05


def test_transfers_lead_from_the_meshes_of_the_state_to_those_of_the_scene() -> None:
    scene = block(4, 2)
    finer = refined(scene.bodies["block"].mesh, [0])
    fine = replace(scene, bodies={"block": replace(scene.bodies["block"], mesh=finer.mesh)})
    first = rolled()[0]
    state = ContactProblem(first.applied_to(scene), SELF).solve()
    words = r"must lead from the meshes of the state to those of the scene, got others, of \[{}\]: give"
    for ways, named in (({}, ""), ({"block": MeshTransfer([finer])}, "'block'")):
        with pytest.raises(InvalidInputError, match=words.format(re.escape(named))):
            ContactProblem(first.applied_to(fine), SELF).solve(before=TransferredState(state, ways))


RANKS = """
import numpy as np
from dataclasses import replace
from mpi4py import MPI
from fenics_contact import TransferredState, ContactProblem, Limits, solve_steps_to
from fenics_contact.mesh import MeshTransfer, refined
from tests.adaptive.rolling import block, forces, pressed, rolled, upwards
comm = MPI.COMM_WORLD
scene, limits = block(8, 2), Limits(levels=2)
found = solve_steps_to(scene, rolled()[:2], upwards(scene), 0.05, comm, tolerance=1e-8, limits=limits)
values = [(r.levels[-1].cells, *forces(r.state)) for r in found]
metal, (down, along) = pressed(2)
before = ContactProblem(down.applied_to(metal), comm).solve()
finer = refined(metal.bodies["block"].mesh, [0, 3])
body = replace(metal.bodies["block"], mesh=finer.mesh)
carried = TransferredState(before, {"block": MeshTransfer(new=[finer])})
state = ContactProblem(along.applied_to(replace(metal, bodies={"block": body})), comm).solve(before=carried)
values.append((finer.mesh.n_cells, *forces(state)))
if comm.rank == 0:
    print(*np.ravel(values))
"""


def test_ranks_take_the_same_way(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(RANKS, count).split(), dtype=float).reshape(3, 3) for count in (1, 2))
    np.testing.assert_array_equal(two[:, 0], one[:, 0])
    np.testing.assert_allclose(two[:, 1:], one[:, 1:], rtol=0, atol=1e-5 * np.abs(one[:, 1:]).max())
