"""Strips, walls and folds: bodies that bend far, buckle, snap through and meet themselves."""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery import rectangle
from fenics_contact.mesh import BodyMesh, boundary_faces
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    LoadStep,
    MovingObstacle,
    NeoHooke,
    Pressure,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
)
from tests.hard.deformed.case import Case, States, case, reaction, times, ways

RUBBER = NeoHooke(1.0, 0.3)


def strip(length: float, thickness: float, cells: tuple[int, int], rise: float) -> BodyMesh:
    """A flat strip whose middle lies higher than its ends."""
    mesh = rectangle((0.0, 0.0), (length, thickness), cells)
    x, y = mesh.points.T
    return BodyMesh(
        np.column_stack([x, y + rise * np.sin(np.pi * x / length)]), mesh.cells, dict(mesh.surfaces)
    )


def clamped(shortening: float = 0.0) -> list[Support]:
    return [Support("strip", "x0"), Support("strip", "x1", (-shortening, 0.0))]


def leans(states: States) -> None:
    """Both ends carry half of what the wall, which is smooth, holds back."""
    left, right = (reaction(states[-1], number) for number in (0, 1))
    held = states[-1].contact.force.sum(axis=0)
    assert abs(held[1]) > 1e-5
    assert abs(left[1] - right[1]) < 1e-6 * abs(left[1])
    assert abs(left[0] + right[0]) < 1e-6 * abs(left[0])


@case
def a_strip_that_buckles_against_a_wall() -> Case:
    mesh = strip(6.0, 0.3, (48, 3), 0.03)
    wall = RigidPlane((0.0, 0.7), (0.0, -1.0))
    pair = ContactPair(Surface("strip", "y1"), wall)
    scene = Scene({"strip": Body(mesh, RUBBER)}, clamped(), contacts=[pair])
    return Case(scene, ways(*map(clamped, (0.05, 0.2, 0.4))), checks=leans)


@case
def a_wall_of_forty_to_one_that_a_disc_pushes_in() -> Case:
    mesh = strip(4.0, 0.1, (60, 2), 0.0)
    disc = MovingObstacle(RigidSphere((2.0, 0.6), 0.5), lambda time: (None, (0.0, -0.5 * time)))
    pair = ContactPair(Surface("strip", "y1"), disc, Coulomb(0.3))
    scene = Scene({"strip": Body(mesh, RUBBER)}, clamped(), contacts=[pair])
    return Case(scene, times(0.5, 1.0, 1.5), checks=leans)


@case
def a_strip_blown_against_a_ceiling() -> Case:
    """Pressure that follows pushes up by pressure × span, whatever the shape between the ends."""
    mesh = strip(4.0, 0.2, (40, 2), 0.0)
    pair = ContactPair(Surface("strip", "y1"), RigidPlane((0.0, 0.6), (0.0, -1.0)), Coulomb(0.3))
    scene = Scene({"strip": Body(mesh, RUBBER)}, clamped(), contacts=[pair])

    def carried(states: States) -> None:
        for state, pressure in zip(states, pressures, strict=True):
            up = sum(reaction(state, number)[1] for number in (0, 1)) + state.contact.force.sum(axis=0)[1]
            assert abs(up + 4.0 * pressure) < 1e-8 * pressure
        assert states[-1].contact.count(1) + states[-1].contact.count(2) > 10

    pressures = (0.005, 0.02, 0.06)
    steps = [LoadStep(f"to {p}", loads=[Pressure("strip", "y0", p)]) for p in pressures]
    return Case(scene, steps, checks=carried, remembers=True)


@case
def an_arch_that_snaps_onto_a_floor() -> Case:
    """The floor carries what the arch cannot, once it has snapped.

    In larger load steps Newton's method jumps to the floor by itself, and no snap is told. Where nodes stick
    on the floor depends on the way they fell.
    """
    mesh = strip(4.0, 0.1, (40, 2), 0.4)
    pair = ContactPair(Surface("strip", "y0"), RigidPlane((0.0, -0.3), (0.0, 1.0)), Coulomb(0.3))
    scene = Scene({"strip": Body(mesh, RUBBER)}, clamped(), contacts=[pair])

    def fallen(states: States) -> None:
        above, below = states[-2:]
        assert above.contact.normal_force.max() == 0.0
        assert not above.snaps
        assert below.snaps
        assert below.contact.count(1) + below.contact.count(2) > 0
        up = sum(reaction(below, number)[1] for number in (0, 1)) + below.contact.force.sum(axis=0)[1]
        over = mesh.points[mesh.surfaces["y1"]]
        assert abs(up - loads[-1] * np.linalg.norm(over[:, 1] - over[:, 0], axis=1).sum()) < 1e-8 * up

    loads = 2e-5 * np.arange(1, 10)
    steps = [LoadStep(f"to {q}", loads=[Traction("strip", "y1", (0.0, -q))]) for q in loads]
    return Case(scene, steps, checks=fallen, agreement=1e-3, remembers=True, snaps=True)


def slotted() -> BodyMesh:
    """A block with a slot from above, 0.4 wide."""
    whole = rectangle((0.0, 0.0), (4.0, 2.0), (20, 10))
    x, y = whole.points[whole.cells].mean(axis=1).T
    cells = whole.cells[(np.abs(x - 2.0) > 0.2) | (y < 0.8)]
    used, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, 4)
    points = whole.points[used]
    facets, _ = boundary_faces(cells, 2)
    at = points[facets]
    sides = {
        name: facets[np.all(np.abs(at[:, :, axis] - value) < 1e-9, axis=1)]
        for name, axis, value in (
            ("x0", 0, 0.0), ("x1", 0, 4.0), ("y0", 1, 0.0), ("left", 0, 1.8), ("right", 0, 2.2)
        )
    }  # fmt: skip
    return BodyMesh(points, cells, sides)


@case
def a_slot_that_closes_on_itself() -> Case:
    mesh = slotted()

    def pressed(depth: float) -> list[Support]:
        sides = [Support("block", "x0", (depth, None)), Support("block", "x1", (-depth, None))]
        return [*sides, Support("block", "y0", (None, 0.0))]

    def closed(states: States) -> None:
        assert states[0].contact.normal_force.max() == 0.0
        assert states[-1].contact.count(1) + states[-1].contact.count(2) > 3
        left, right = (reaction(states[-1], number) for number in (0, 1))
        assert abs(left[0] + right[0]) < 1e-8 * abs(left[0])

    pair = ContactPair(Surface("block", "left"), Surface("block", "right"), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, RUBBER)}, pressed(0.0), contacts=[pair])
    return Case(scene, ways(*map(pressed, (0.1, 0.3, 0.5))), checks=closed)
