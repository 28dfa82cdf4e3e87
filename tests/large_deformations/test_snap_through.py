"""A shallow arch snaps through: followed by a prescribed displacement, or through a viscous medium."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    DeformedState,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidSphere,
    Roller,
    Scene,
    State,
    Support,
    Surface,
    TangentNewton,
    TotalForce,
    box_partition,
    solve_steps,
)
from fenics_contact._large_deformations.load_steps import Stages
from fenics_contact.errors import LoadStepError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.mesh import quadratic

#: Pressures a little below the largest one before the arch snaps, and beyond it.
LARGEST, BEYOND = 0.0073, 0.0075
#: With so few Newton steps its method does not find the far side by itself.
SNAPPING = AutomaticSteps(TangentNewton(max_steps=6), snaps=True)


def arch() -> Body:
    """Half of a clamped arch, its crown at x = 10 in a plane of symmetry."""
    mesh = quadratic(rectangle((0, 0), (10, 0.5), (8, 1)))
    x, y = mesh.points.T
    return Body(
        replace(mesh, points=np.column_stack([x, y + 1.5 * np.sin(np.pi * x / 20)])), NeoHooke(100.0, 0.3)
    )


def crown(sunk: float | None) -> list[Support]:
    return [Support("arch", "x0"), Support("arch", "x1", (0.0, None if sunk is None else -sunk))]


def test_a_prescribed_displacement_goes_through_the_snap() -> None:
    body = arch()
    problem = ContactProblem(Scene({"arch": body}, crown(0.0)), MPI.COMM_SELF)
    sunk = (0.3, 0.6, 1.0, 1.5, 2.0, 2.6, 3.2)
    states = solve_steps(problem, [LoadStep(f"{d}", supports=crown(d)) for d in sunk])
    force = np.array([-state.reactions()[1].force[1] for state in states])
    assert force[1] > force[0] > 0.0
    assert np.all(np.diff(force[1:5]) < 0.0), "the load falls while the arch sinks"
    assert force[-1] > 2.0 * force[1], "turned over it is stiff again"
    assert all(len(state.solution.history) <= 6 for state in states)
    # Under a load control a load beyond the largest one is met far away: the arch has snapped.
    pushed = [TotalForce("arch", "x1", (0.0, -1.05 * float(force[-1])))]
    loaded = ContactProblem(Scene({"arch": body}, crown(None)), MPI.COMM_SELF)
    (snapped,) = solve_steps(loaded, [LoadStep("push", loads=pushed)])
    assert isinstance(snapped, DeformedState)
    assert snapped.gather_displacement("arch")[:, 1].min() < -3.2


def pressed(pressure: float) -> LoadStep:
    return LoadStep(f"{pressure}", [Pressure("arch", "y1", pressure, dead=True)])


def followed(
    steps: AutomaticSteps, pressures: Sequence[float], checkpoint: Checkpoint | None = None
) -> Sequence[State]:
    scene, parts = Scene({"arch": arch()}, crown(None)), {"arch": box_partition(arch().mesh, (2, 1))}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=parts, steps=steps)
    return solve_steps(problem, [pressed(p) for p in pressures], checkpoint=checkpoint)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Checkpoint:
    return Checkpoint(tmp_path_factory.mktemp("arch") / "arch.npz")


@pytest.fixture(scope="module")
def at_rest(file: Checkpoint) -> Sequence[State]:
    return followed(SNAPPING, (LARGEST, BEYOND), file)


def test_an_arch_that_snaps_rests_where_a_finger_pushes_it(at_rest: Sequence[State]) -> None:
    """Held by a finger there is no snap: it is pushed through, loaded, and released."""
    before, after = at_rest
    assert isinstance(before, DeformedState)
    assert isinstance(after, DeformedState)
    (snap,) = after.snaps
    assert not before.snaps
    assert 0.0 < snap.fraction <= 1.0
    assert snap.stages > 3
    products = [line.products for line in after.solution.history]
    assert min(np.diff(products)) >= 0
    assert products[-1] == after.counts["f_products"]
    assert after.since >= snap.fraction, "histories begin anew where bodies snapped"
    finger = MovingObstacle(RigidSphere((10.0, 4.0), 2.0), lambda time: (None, (0.0, -time)))
    touched = Scene({"arch": arch()}, crown(None), contacts=[ContactPair(Surface("arch", "y1"), finger)])
    load = pressed(BEYOND).loads
    pushed = [LoadStep(f"push {time}", time=time) for time in (0.5, 1.0, 2.0, 3.0)]
    released = [LoadStep(f"release {time}", load, time=time) for time in (3.0, 2.0, 0.0)]
    reference = solve_steps(ContactProblem(touched, MPI.COMM_SELF), pushed + released)[-1]
    assert not reference.contact.normal_force.any()
    there, here = (state.gather_displacement("arch") for state in (reference, after))
    assert there[:, 1].min() < -2.5
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-7)
    # What the load does and the arch does not keep, the medium takes: by stages that are no small ones.
    start, end = before.energies, after.energies
    lost = end.load * (1.0 + LARGEST / BEYOND) / 2 - start.load - (end.strain - start.strain)
    assert 0.7 * lost < snap.dissipated < lost


def test_without_leave_to_snap_the_path_ends() -> None:
    with pytest.raises(LoadStepError, match=r"^load step '.+': the load can .* let bodies snap") as caught:
        followed(replace(SNAPPING, snaps=False, smallest=1.0 / 8), (LARGEST, BEYOND))
    assert caught.value.history


def test_bodies_that_find_no_rest_end_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """A block that is drawn apart along both axes, normal to sides whose area grows as much as its stress.

    At the stretch λ its true stress is μ (1 − 1/λ²) + 2 (Λ / λ²) ln λ, with Lamé's constants Λ and μ.
    """
    monkeypatch.setattr("fenics_contact._large_deformations.load_steps.Snapping.by", Stages(most=6))
    stretch, drawn = np.geomspace(1.0, 1e3, 1000), 3.0
    true_stress = (1.0 - stretch**-2) / 2.6 + 2.0 * (0.3 / 0.52) * np.log(stretch) / stretch**2
    assert true_stress.max() == pytest.approx(0.493, abs=1e-3)  # less than even the first quarter of the load
    block = Body(rectangle((0.0, 0.0), (2.0, 1.0), (2, 1)), NeoHooke(1.0, 0.3))
    halves = [Roller("block", "x0"), Roller("block", "y0")]
    scene = Scene({"block": block}, halves, [Pressure("block", side, -drawn) for side in ("x1", "y1")])
    steps = AutomaticSteps(smallest=1.0 / 4, snaps=True)
    with pytest.raises(LoadStepError, match="come to rest") as caught:
        ContactProblem(scene, MPI.COMM_SELF, steps=steps).solve()
    assert len(caught.value.history) > 10


def test_a_checkpoint_keeps_where_bodies_snapped(at_rest: Sequence[State], file: Checkpoint) -> None:
    first, read = at_rest[-1], followed(SNAPPING, (LARGEST, BEYOND), file)[-1]
    assert read.solution.reason == "read from a checkpoint"
    assert isinstance(first, DeformedState)
    assert isinstance(read, DeformedState)
    assert read.snaps == first.snaps
    assert len(read.snaps) == 1
