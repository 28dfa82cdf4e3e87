"""Contact that touches and carries nothing: bodies rest in one place, and `unheld` says so."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    ContactProblem,
    Coulomb,
    ExponentialClosure,
    LinearClosure,
    LoadStep,
    Preload,
    RigidSurface,
    Roller,
    Scene,
    Section,
    Support,
    Surface,
    Tie,
    TotalForce,
    solve_scene,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.results.deformed_state import AnyState
from tools.hard_cases.transform import renumbered_mesh

STEEL = PlaneStrain(1.0, 0.3)
#: Laws of closure with the distance at which pressure begins.
LAWS: list[tuple[ClosureLaw | None, float]] = [
    (None, 0.0), (LinearClosure(1.0), 0.0), (ExponentialClosure(0.01, 0.01), 0.01),
    (ClosureTable((-0.01, 0.0, 0.01), (0.0, 0.005, 0.02)), 0.01),
]  # fmt: skip


def guided(closure: ClosureLaw | None, force: float, rigid: bool, weight: float) -> Scene:
    """A block that may move up and down on another one, which may be heavy."""
    low, up = rectangle((0, 0), (2, 1), (4, 2)), rectangle((0.2, 1), (1.8, 2), (3, 2))
    bodies = {"low": Body(low, STEEL), "up": Body(up, STEEL)}
    pair = ContactPair(Surface("up", "y0"), Surface("low", "y1"), Coulomb(0.3), "node", closure=closure)
    supports: list[Support | Roller | RigidSurface] = [Support("low", "y0")]
    loads: list[BodyForce | TotalForce] = [BodyForce("low", (0.3 * weight, -weight))]
    if rigid:
        supports.append(RigidSurface("up", "y1", (1, 2), (0.0, None), 0.0, (0.0, force)))
    else:
        supports.append(Roller("up", "x0"))
        loads.append(TotalForce("up", "y1", (0.0, force)))
    return Scene(bodies, supports, loads, contacts=[pair])


@pytest.mark.parametrize("rigid", [False, True], ids=["by a force", "by a rigid top"])
@pytest.mark.parametrize(("closure", "reach"), LAWS)
def test_what_is_unloaded_lies_where_pressure_begins(
    closure: ClosureLaw | None, reach: float, rigid: bool
) -> None:
    for weight in (0.0, 0.01):
        pressed, idle = (guided(closure, force, rigid, weight) for force in (-0.01, 0.0))
        steps = [LoadStep(str(k), s.loads, supports=s.supports) for k, s in enumerate((pressed, idle))]
        found = []
        for parts in (None, pressed.partition(4)):
            problem = ContactProblem(pressed, MPI.COMM_SELF, partitions=parts, tolerance=1e-6)
            state = solve_steps(problem, steps)[-1]
            assert not state.contact.normal_force.any()
            assert state.contact.counts_in_words == "4 open, 0 stick, 0 slip"
            assert state.contact.gap.min() == pytest.approx(reach, abs=1e-9)
            assert [str(motion) for motion in state.unheld] == ["'up': translation (0, 1)"]
            found.append(state.gather_displacement("up"))
        assert np.ptp(found[0][:, 1]) < 1e-9
        np.testing.assert_allclose(found[1], found[0], atol=1e-8)


@pytest.mark.parametrize(("closure", "reach"), LAWS)
def test_unloaded_blocks_that_overlap_at_first_come_apart_to_one_place(
    closure: ClosureLaw | None, reach: float
) -> None:

    low, up = block((0, 0, 0), (2, 2, 1), (2, 2, 1)), block((0.4, 0.4, 1.0), (1.6, 1.6, 2), (2, 2, 1))
    pair = ContactPair(Surface("up", "z0"), Surface("low", "z1"), closure=closure, interference=0.02)
    along = [Support("up", "x0", (0.0, None, None)), Support("up", "y0", (None, 0.0, None))]
    held = [Support("low", "z0"), *along]
    places = []
    for seed in (None, 1):
        meshes = [mesh if seed is None else renumbered_mesh(mesh, seed)[0] for mesh in (low, up)]
        law = IsotropicElasticity(1.0, 0.3)
        bodies = {name: Body(mesh, law) for name, mesh in zip(("low", "up"), meshes, strict=True)}
        for parts in (1, 3):
            scene = Scene(bodies, held, contacts=[pair])
            cut = scene.partition(parts) if parts > 1 else None
            state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-6)
            assert not state.contact.normal_force.any()
            assert len(state.unheld) >= 1
            places.append(state.gather_displacement("up")[:, 2])
    for place in places:
        np.testing.assert_allclose(place, 0.02 + reach, rtol=1e-6)


@pytest.mark.parametrize("parts", [1, 3])
def test_a_joint_pulled_by_just_the_force_that_clamps_it_may_open(parts: int) -> None:
    bar, stiff = IsotropicElasticity(1000.0, 0.0), IsotropicElasticity(1e9, 0.0)
    bodies = {
        "bolt": Body(block((0, 0, 0), (1, 1, 4), (1, 1, 4)), bar),
        "sleeve": Body(block((2, 0, 0), (3.5, 1, 4), (3, 1, 4)), bar),
        "head": Body(block((0, 0, 4), (3.5, 1, 5), (7, 1, 1)), stiff),
    }
    along = [Support("head", side, (0.0, 0.0, None)) for side in ("x0", "x1")]
    held = [Support("bolt", "z0"), Support("sleeve", "z0"), *along]
    preload = Preload("bolt", Section((0.5, 0.5, 2.0), (0, 0, 1)), force=10.0)

    def state(pull: float) -> AnyState:
        scene = Scene(
            bodies, held, [TotalForce("head", "z1", (0.0, 0.0, pull))],
            [ContactPair(Surface("head", "z0"), Surface("sleeve", "z1"))],
            ties=[Tie(Surface("bolt", "z1"), Surface("head", "z0"))], preloads=[preload],
        )  # fmt: skip
        cut = scene.partition(parts) if parts > 1 else None
        return solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-8)

    clamped, just = state(9.0), state(10.0)
    assert clamped.unheld == ()
    assert clamped.contact.normal_force.sum() == pytest.approx(1.0)
    assert np.abs(just.contact.normal_force).max() < 1e-8
    (motion,) = map(str, just.unheld)
    assert motion == "'bolt': translation (0, 0, 0.5); 'head': translation (0, 0, 1)"
    (bolt,) = just.preloads().values()
    assert bolt.force == pytest.approx(10.0)
    assert bolt.shortening == pytest.approx(10.0 * 4.0 / 1000.0, rel=1e-4)  # the sleeve is as long as ever
