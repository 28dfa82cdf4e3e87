"""A scene in which a body can move away is refused before anything is factored, with the motion's name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import Status, check_held, solve_scene
from fenics_contact.errors import InfeasibleError
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.scene import Coulomb, Scene, Support, TotalForce, Tresca
from tests.contact.gallery import block_on_plane, guided, partitions, pressed_block, stack, two_blocks

DOWN, ALONG = -4.0, 2.0  # the load of the block on the plane, with its push of 1
NUMBERS = r"\(([^)]*)\)"


def check(scene: Scene) -> None:
    check_held(build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF)))


def refused(scene: Scene) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the body named in the refusal, its translation and its rotation."""
    with pytest.raises(InfeasibleError, match=r"every body must be held .* can move away under") as caught:
        check(scene)
    message = str(caught.value)
    body = re.search(r"body '(\w+)'", message)
    assert body is not None
    motion = []
    for kind in ("translation", "rotation"):
        part = re.search(kind + " " + NUMBERS, message)
        motion.append(np.array([float(x) for x in part[1].split(",")]) if part else np.zeros(3))
    return body[1], motion[0], motion[1]


def pulled(scene: Scene, body: str, force: tuple[float, float, float]) -> Scene:
    return replace(scene, loads=[TotalForce(body, "z1", force)])


def test_a_body_pulled_off_its_floor_is_named_with_the_way_it_goes() -> None:
    body, translation, rotation = refused(pulled(block_on_plane(Coulomb(0.5)), "block", (0.0, 0.0, 1.0)))
    assert body == "block"
    assert translation == pytest.approx([0, 0, 1], abs=1e-3)
    assert np.abs(rotation).max() < 0.1


@pytest.mark.parametrize("direction", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.6, -0.8)])
def test_a_body_pushed_harder_than_friction_holds_slides_where_it_is_pushed(direction) -> None:
    x, y = direction
    body, translation, _ = refused(pulled(block_on_plane(Coulomb(0.3)), "block", (0.31 * x, 0.31 * y, -1.0)))
    assert body == "block"
    assert translation[:2] / np.linalg.norm(translation[:2]) == pytest.approx(direction, abs=0.02)
    assert translation[2] > 0  # dilation: along the normal of the friction cone


@pytest.mark.parametrize("friction", [Coulomb(0.3), Tresca(0.15)])
def test_friction_holds_just_as_much_as_it_can(friction: Coulomb | Tresca) -> None:
    limit = 0.3  # of a body pressed with 1: by Coulomb's law, and by Tresca's on an area just above 2
    scene = block_on_plane(friction)
    check(pulled(scene, "block", (0.998 * limit, 0.0, -1.0)))
    refused(pulled(scene, "block", (1.002 * limit, 0.0, -1.0)))


def test_a_body_without_friction_slides_at_the_slightest_push() -> None:
    check(pulled(block_on_plane(None), "block", (0.0, 0.0, -1.0)))
    body, translation, _ = refused(pulled(block_on_plane(None), "block", (0.001, 0.0, -1.0)))
    assert body == "block"
    assert translation == pytest.approx([1, 0, 0], abs=1e-2)


def test_a_body_tips_when_the_push_passes_over_its_edge() -> None:
    scene = block_on_plane(Coulomb(5.0))
    limit = 1.0 / 0.98  # of a block 2 long, with its lower edge 0.02 above the floor and 0.98 below the push
    check(pulled(scene, "block", (0.998 * limit, 0.0, -1.0)))
    body, translation, rotation = refused(pulled(scene, "block", (1.002 * limit, 0.0, -1.0)))
    assert body == "block"
    assert rotation[1] > 0.3  # about +y: the top goes along +x
    assert translation[2] > 0.1  # and the middle rises


def test_of_two_bodies_the_one_that_is_not_held_is_named() -> None:
    check(two_blocks(Coulomb(0.4)))
    assert refused(two_blocks(Coulomb(0.2)))[0] == "upper"
    assert refused(pulled(two_blocks(Coulomb(0.4)), "upper", (0.0, 0.0, 0.1)))[0] == "upper"


def test_the_load_works_along_the_motion_of_a_whole_stack() -> None:
    check(stack(Coulomb(0.4), Coulomb(0.4)))
    _, translation, _ = refused(stack(Coulomb(2.0), Coulomb(0.2)))
    assert translation[0] > 0.5  # the push is along +x, and a little along +y
    assert translation[1] > 0


def test_supports_hold_what_contact_does_not() -> None:
    free = pulled(block_on_plane(None), "block", (0.5, 0.2, -1.0))
    refused(free)
    check(guided(free, "block"))
    lifted = pulled(guided(block_on_plane(None), "block"), "block", (0.0, 0.0, 1.0))
    assert refused(lifted)[1] == pytest.approx([0, 0, 1], abs=1e-2)
    check(replace(lifted, supports=[*lifted.supports, Support("block", "z1", (None, None, 0.0))]))


def test_a_scene_that_is_moved_without_any_load_needs_no_holding() -> None:
    check(pressed_block(None))


def test_a_body_that_is_just_held_is_solved() -> None:
    limit = np.hypot(1.0, 0.3) / 2.0  # push over weight
    scene = block_on_plane(Coulomb(1.0002 * limit))
    state = solve_scene(scene, partitions(scene), MPI.COMM_SELF, tolerance=1e-6)
    assert state.contact.count(Status.STICK) == 0
    assert state.contact.count(Status.SLIP) > 0
    friction = np.linalg.norm(state.contact.force[:, :2].sum(axis=0))
    assert friction == pytest.approx(limit * state.contact.normal_force.sum(), rel=1e-5)


def test_solving_refuses_what_is_not_held() -> None:
    scene = block_on_plane(Coulomb(0.3))
    with pytest.raises(InfeasibleError, match="body 'block' can move away"):
        solve_scene(scene, partitions(scene), MPI.COMM_SELF)
