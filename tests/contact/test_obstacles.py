"""Bodies pressed on rigid obstacles: one answer, however the obstacle is described."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
    LoadStep,
    MovingObstacle,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    box_partition,
    solve_scene,
)
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, Material, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from tests.contact.checks import assert_solved

RUBBER = IsotropicElasticity(100.0, 0.3)
TOLERANCE = 1e-9
BUMP = 3.0
#: Obstacles that touch the block from below at (1, 0.5, 0), in the plane at (1, 0).
BELOW: dict[str, RigidObstacle] = {
    "ball": RigidSphere((1.0, 0.5, -BUMP), BUMP),
    "bar": RigidCylinder((1.0, 0.5, -BUMP), (0.0, 1.0, 0.0), BUMP),
    "plane": RigidPlane((1.0, 0.5, 0.0), (0.0, 0.0, 1.0)),
    "disc": RigidSphere((1.0, -BUMP), BUMP),
    "line": RigidPlane((1.0, 0.0), (0.0, 1.0)),
}


def pressed(obstacle: RigidObstacle, dim: int, push: float = 0.02) -> State:
    """Press a block by a twentieth of its height and drag it along x."""
    if dim == 2:
        mesh, top, law = rectangle((0, 0), (2, 1), (12, 6)), "y1", PlaneStrain(100.0, 0.3)
        body, way, base = Body(mesh, law), (push, -0.05), Surface("block", "y0")
    else:
        mesh, top = block((0, 0, 0), (2, 1, 1), (8, 4, 3)), "z1"
        body, way, base = Body(mesh, RUBBER), (push, 0.1 * push, -0.05), Surface("block", "z0")
    scene = Scene(
        {"block": body}, [Support("block", top, way)], contacts=[ContactPair(base, obstacle, Coulomb(0.3))]
    )
    return solved(scene, (2, 1, 1)[:dim])


def solved(scene: Scene, boxes: tuple[int, ...]) -> State:
    cut = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))


@pytest.mark.parametrize("with_gradient", [True, False])
@pytest.mark.parametrize("name", BELOW)
def test_a_distance_function_holds_up_a_block_as_the_shape_itself_does(
    name: str, with_gradient: bool
) -> None:
    shape, dim = BELOW[name], 2 if name in ("disc", "line") else 3
    given = pressed(shape, dim)
    other = pressed(DistanceObstacle(shape.distance, shape.normals if with_gradient else None), dim)
    assert_solved(given, TOLERANCE)
    contact = given.contact
    assert contact.count(Status.STICK) > 0
    assert contact.count(Status.SLIP) > 0
    assert contact.count(Status.OPEN) > 0 or name in ("plane", "line")
    np.testing.assert_array_equal(other.contact.status, contact.status)
    size = np.abs(contact.force).max()
    np.testing.assert_allclose(other.contact.force, contact.force, atol=1e-6 * size)
    u = given.gather_displacement("block")
    np.testing.assert_allclose(other.gather_displacement("block"), u, atol=1e-7 * np.abs(u).max())


@pytest.mark.parametrize("name", ["ball", "bar", "disc"])
def test_nodes_lie_outside_of_the_round_obstacle_after_pressing(name: str) -> None:
    """Gaps are those of the tangent planes: nodes that slide leave them by the square of their slip only."""
    shape, dim = BELOW[name], 2 if name == "disc" else 3
    state = pressed(shape, dim)
    slaves = state.contact.points.slave
    moved = state.scene.bodies["block"].mesh.points[slaves] + state.gather_displacement("block")[slaves]
    slip = np.linalg.norm(state.gather_displacement("block")[slaves], axis=1)
    assert (shape.distance(moved) > -1e-9).all()
    np.testing.assert_allclose(shape.distance(moved), state.contact.gap, atol=slip.max() ** 2 / BUMP)
    closed = state.contact.normal_force > 0
    assert 3 < closed.sum() < len(closed)


def test_a_long_block_on_a_bar_is_a_plane_block_on_a_disc() -> None:
    """Walls keep the ends from moving along the bar: plane strain, force by force."""
    depth = 0.7
    mesh = block((0, 0, 0), (2, depth, 1), (12, 2, 6))
    walls = [Support("block", side, (None, 0.0, None)) for side in ("y0", "y1")]
    top = Support("block", "z1", (0.02, 0.0, -0.05))
    pair = ContactPair(Surface("block", "z0"), BELOW["bar"], Coulomb(0.3))
    space = solved(Scene({"block": Body(mesh, RUBBER)}, [*walls, top], contacts=[pair]), (2, 1, 1))
    plane = pressed(BELOW["disc"], 2)
    flat = plane.scene.bodies["block"].mesh
    forces = np.zeros((flat.n_nodes, 3))
    place = np.rint(12 * mesh.points[space.contact.points.slave, 0] / 2).astype(int)
    along = np.rint(12 * flat.points[plane.contact.points.slave, 0] / 2).astype(int)
    np.add.at(forces, place, space.contact.force)
    size = np.abs(plane.contact.force).max()
    np.testing.assert_allclose(
        forces[along][:, [0, 2]], depth * plane.contact.force, atol=1e-6 * depth * size
    )
    assert plane.contact.count(Status.SLIP) > 0
    assert plane.contact.count(Status.STICK) > 0
    sides = mesh.points[:, 1] == 0.0
    order = np.lexsort(mesh.points[sides][:, [2, 0]].T), np.lexsort(flat.points[:, [1, 0]].T)
    u, v = space.gather_displacement("block")[sides][order[0]], plane.gather_displacement("block")[order[1]]
    np.testing.assert_allclose(u[:, [0, 2]], v, atol=1e-7 * np.abs(v).max())


def ball_on(obstacle: RigidObstacle) -> Scene:
    """The lower half of a ball of radius 1, pressed down and aside on an obstacle with little friction."""
    load = TotalForce("ball", "top", (0.4, 0.2, -1.0))
    pair = ContactPair(Surface("ball", "contact"), obstacle, Coulomb(0.1))
    return Scene({"ball": Body(hemisphere(1.0, 4, symmetry="", grading=0.0), RUBBER)}, [], [load], [pair])


def test_a_socket_holds_a_ball_that_rolls_off_a_floor() -> None:
    radius = 1.02
    scene = ball_on(RigidSphere((0.0, 0.0, radius), radius, hollow=True))
    cut = {"ball": bisection_partition(scene.bodies["ball"].mesh, 4)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-8))
    contact = state.contact
    np.testing.assert_allclose(contact.force.sum(axis=0), (-0.4, -0.2, 1.0), atol=1e-6)
    closed = contact.normal_force > 1e-6
    assert 3 < closed.sum() < len(closed)
    lean = contact.normal_force @ contact.points.normal
    assert lean[0] / lean[2] == pytest.approx(-0.4, rel=0.15), "walls, not friction, bear the push"
    floor = replace(scene, contacts=ball_on(BELOW["plane"]).contacts)
    with pytest.raises(InfeasibleError, match="body 'ball' can move away under the load"):
        solve_scene(floor, MPI.COMM_SELF, partitions=cut)


@pytest.mark.parametrize("material", [RUBBER, J2Plasticity(100.0, 0.3, 1.0)], ids=["linear", "metal"])
def test_with_small_displacements_an_obstacle_must_not_move(material: Material) -> None:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), material)

    def pressing(depth: float) -> ContactProblem:
        floor = MovingObstacle(RigidPlane((0, 0, 0), (0, 0, 1)), lambda time: (None, (0, 0, depth * time)))
        pair = ContactPair(Surface("block", "z0"), floor)
        return ContactProblem(
            Scene({"block": body}, [Support("block", "z1")], contacts=[pair]), MPI.COMM_SELF
        )

    with pytest.raises(InvalidInputError, match=r"has moved by time 0\.5: move the bodies against"):
        pressing(0.1).solve(step=LoadStep("push", time=0.5))
    assert pressing(0.1).solve(step=LoadStep("push", time=0.0)).contact.count(Status.OPEN) == 9
    assert pressing(0.0).solve(step=LoadStep("push", time=0.5)).contact.count(Status.OPEN) == 9
