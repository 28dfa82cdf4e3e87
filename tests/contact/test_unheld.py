"""Motions that nothing holds and nothing loads: bodies stay where they are, in any position and unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    FixedPoint,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    Tresca,
    solve_scene,
)
from fenics_contact.errors import InfeasibleError
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import FaceNewton, Smalse
from tests.contact.stacks import RUBBER, TURN, cut, turned_stack


def cube_on_floor(n: int) -> Scene:
    """A cube on a floor without friction, held along x and pressed: nothing holds or loads it along y."""
    cube = Body(block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (n, n, n)), RUBBER)
    supports = [Support("cube", "x0", (0.0, None, None)), Support("cube", "z1", (None, None, -1e-3))]
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return Scene({"cube": cube}, supports, contacts=[ContactPair(Surface("cube", "z0"), floor)])


def left_of(state: State, body: str, motion: np.ndarray) -> float:
    """Return how far a body went along a motion of its nodes, relative to how far it went at all."""
    moved = state.gather_displacement(body)
    return float(abs((moved * motion).sum() / np.linalg.norm(motion)) / np.linalg.norm(moved))


@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 7, 9])
def test_a_pressed_cube_stays_where_nothing_holds_it(n: int) -> None:
    state = solve_scene(cube_on_floor(n), MPI.COMM_SELF)

    assert state.solution.products <= 25
    np.testing.assert_allclose(state.contact.normal_force.sum(), 100.0 * 1e-3, rtol=1e-3)  # uniaxial stress
    assert [str(motion) for motion in state.unheld] == ["'cube': translation (0, 1, 0)"]
    assert left_of(state, "cube", np.array([[0.0, 1.0, 0.0]])) < 1e-10


@pytest.mark.parametrize("solver", [FaceNewton(1e-6), Smalse(1e-6)])
@pytest.mark.parametrize("parts", [1, 4])
def test_partition_and_solver_do_not_move_it(parts: int, solver: FaceNewton | Smalse) -> None:
    scene = cube_on_floor(5)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, parts), solver=solver)

    exact = 1e-3 * np.array([0.3, 0.3, -1.0]) * (scene.bodies["cube"].mesh.points - [0.0, 0.5, 0.0])
    np.testing.assert_allclose(state.gather_displacement("cube"), exact, atol=1e-8)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("parts", [1, 3])
def test_a_turned_block_without_friction_is_pressed_and_stays(discretisation: str, parts: int) -> None:
    scene = turned_stack(None, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, parts))

    force = state.contact.force.sum(axis=0)
    np.testing.assert_allclose(force, TURN @ [0.0, 0.0, 0.01 * 1.0 * 0.9], atol=1e-5)
    assert len(state.unheld) == 3
    arm = scene.bodies["upper"].mesh.points - scene.bodies["upper"].mesh.points.mean(axis=0)
    for motion in (TURN[:, 0], TURN[:, 1], np.cross(TURN[:, 2], arm)):
        assert left_of(state, "upper", np.broadcast_to(motion, arm.shape)) < 1e-10


@pytest.mark.parametrize(
    ("friction", "solver"),
    [(Coulomb(0.3), None), (Coulomb(0.3), FixedPoint(FaceNewton())), (Tresca(0.01), None)],
)
def test_friction_holds_a_turned_block(friction: Coulomb | Tresca, solver: FixedPoint | None) -> None:
    state = solve_scene(turned_stack(friction), MPI.COMM_SELF, solver=solver)

    assert state.unheld == ()
    np.testing.assert_allclose(state.contact.force.sum(axis=0), TURN @ [0.0, 0.0, 0.009], atol=1e-5)


def test_friction_elsewhere_keeps_its_steps_beside_an_unheld_body() -> None:
    """The growth of friction with the normal force is in Newton's steps although one body is not held."""
    rubbed = turned_stack(Coulomb(0.3))
    push = Traction("upper", "z1", tuple(TURN @ [0.002, 0.0, -0.01]))
    rubbed = replace(rubbed, loads=[push])
    alone = solve_scene(rubbed, MPI.COMM_SELF, partitions=cut(rubbed, 2), tolerance=1e-8)

    other = cube_on_floor(3)
    beside = replace(
        rubbed,
        bodies={**rubbed.bodies, **other.bodies},
        supports=[*rubbed.supports, *other.supports],
        contacts=[*rubbed.contacts, *other.contacts],
    )
    both = solve_scene(beside, MPI.COMM_SELF, partitions=cut(beside, 2), tolerance=1e-8)

    assert [str(motion) for motion in both.unheld] == ["'cube': translation (0, 1, 0)"]
    count = alone.contact.points.count
    np.testing.assert_allclose(both.contact.force[:count], alone.contact.force, atol=1e-9)
    assert both.solution.iterations <= alone.solution.iterations + 3


def test_bodies_tied_together_stay_together() -> None:
    low = Body(rectangle((0.0, 0.0), (1.1, 0.7), (3, 2)), PlaneStrain(100.0, 0.3))
    top = Body(rectangle((0.2, 0.7), (0.9, 1.2), (2, 3)), PlaneStrain(100.0, 0.3))
    floor = RigidPlane((0.0, 0.0), (0.0, 1.0))
    scene = Scene(
        {"low": low, "top": top},
        [Support("top", "y1", (None, -1e-3))],
        contacts=[ContactPair(Surface("low", "y0"), floor)],
        ties=[Tie(Surface("top", "y0"), Surface("low", "y1"))],
    )
    state = solve_scene(scene, MPI.COMM_SELF)

    (motion,) = state.unheld
    np.testing.assert_allclose([motion.bodies[name] for name in ("low", "top")], 2 * [[1.0, 0.0, 0.0]])
    moved = np.concatenate([state.gather_displacement(name) for name in scene.bodies])
    assert abs(moved[:, 0].mean()) < 1e-10 * np.abs(moved).max()


def test_a_load_on_what_nothing_holds_is_refused_where_systems_are_built_by_hand() -> None:
    scene = replace(cube_on_floor(3), loads=[Traction("cube", "x1", (0.0, 1e-3, 0.0))])
    torn = build_torn_system(scene, decompose(scene, cut(scene, 2), MPI.COMM_SELF))

    with pytest.raises(InfeasibleError, match=r"works .* on a rigid motion that nothing resists"):
        DualSystem(torn)


def test_the_next_load_of_the_same_scene_is_checked_too() -> None:
    scene = cube_on_floor(3)
    decomposition = decompose(scene, cut(scene, 2), MPI.COMM_SELF)
    torn = build_torn_system(scene, decomposition)
    known = DualSystem(torn)
    pushed = replace(scene, loads=[Traction("cube", "x1", (0.0, 1e-3, 0.0))])

    with pytest.raises(InfeasibleError, match=r"works .* on a rigid motion that nothing resists"):
        DualSystem(build_torn_system(pushed, decomposition, previous=torn), previous=known)


def test_unheld_motions_are_the_same_on_any_number_of_ranks(mpirun) -> None:
    script = """
        import numpy as np
        from mpi4py import MPI
        from fenics_contact import solve_scene
        from benchmarks.graph_partition import graph_partition
        from tests.contact.stacks import cut, turned_stack
        scene = turned_stack()
        state = solve_scene(scene, MPI.COMM_WORLD, partitions=cut(scene, 4), tolerance=1e-9)
        words, moved = [str(motion) for motion in state.unheld], state.gather_displacement("upper")
        if MPI.COMM_WORLD.rank == 0:
            print(len(words), np.linalg.norm(moved).round(10), *moved[7].round(10))
    """
    assert mpirun(script, 1) == mpirun(script, 2)
