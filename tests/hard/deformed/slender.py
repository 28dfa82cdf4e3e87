"""Strips, walls and folds: bodies that bend far, buckle, snap through and meet themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    AutomaticContact,
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.mesh import boundary_faces
from tests.hard.deformed.case import Case, States, case, last_of, reaction, times, ways

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

    With more Newton steps, or in larger load steps, some of them jump to the floor by themselves, and no snap
    is told. The floor is smooth: where nodes stuck on it would depend on the way they fell, to 2e-3.
    """
    mesh = strip(4.0, 0.1, (40, 2), 0.4)
    pair = ContactPair(Surface("strip", "y0"), RigidPlane((0.0, -0.3), (0.0, 1.0)))
    scene = Scene({"strip": Body(mesh, RUBBER)}, clamped(), contacts=[pair])

    def fallen(states: States) -> None:
        above, below = states[-2:]
        assert above.contact.normal_force.max() == 0.0
        assert not above.snaps
        assert below.snaps
        assert below.contact.normal_force.max() > 0.0
        up = sum(reaction(below, number)[1] for number in (0, 1)) + below.contact.force.sum(axis=0)[1]
        over = mesh.points[mesh.surfaces["y1"]]
        assert abs(up - loads[-1] * np.linalg.norm(over[:, 1] - over[:, 0], axis=1).sum()) < 1e-8 * up

    loads = 2e-5 * np.arange(1, 10)
    steps = [LoadStep(f"to {q}", loads=[Traction("strip", "y1", (0.0, -q))]) for q in loads]
    return Case(scene, steps, checks=fallen, remembers=True, snaps=True, most=8)


def slotted() -> BodyMesh:
    """A block with a slot from above, 0.4 wide; its sides are also one surface with its bottom."""
    whole = rectangle((0.0, 0.0), (4.0, 2.0), (20, 10))
    x, y = whole.points[whole.cells].mean(axis=1).T
    mesh = without(whole, (np.abs(x - 2.0) < 0.2) & (y > 0.8))
    facets, _ = boundary_faces(mesh.cells, 2)
    at = mesh.points[facets]
    inside = (np.abs(at[:, :, 0] - 2.0) < 0.2 + 1e-9) & (at[:, :, 1] > 0.8 - 1e-9)
    sides = {"slot": facets[inside.all(axis=1)]}
    for name, x_there in (("left", 1.8), ("right", 2.2)):
        sides[name] = facets[np.all(np.abs(at[:, :, 0] - x_there) < 1e-9, axis=1)]
    return replace(mesh, surfaces={**mesh.surfaces, **sides})


def without(whole: BodyMesh, removed: np.ndarray) -> BodyMesh:
    """A mesh without some of its cells, none of which is at its surfaces x0, x1, y0."""
    used, cells = np.unique(whole.cells[~removed], return_inverse=True)
    number = np.full(len(whole.points), -1)
    number[used] = np.arange(len(used))
    sides = {name: number[facets] for name, facets in whole.surfaces.items()}
    sides = {name: facets[(facets >= 0).all(axis=1)] for name, facets in sides.items()}
    return BodyMesh(whole.points[used], cells.reshape(-1, 4), sides)


def slot_closes(slave: str, master: str) -> Case:
    mesh = slotted()

    def pressed(depth: float) -> list[Support]:
        sides = [Support("block", "x0", (depth, None)), Support("block", "x1", (-depth, None))]
        return [*sides, Support("block", "y0", (None, 0.0))]

    def closed(states: States) -> None:
        assert states[0].contact.normal_force.max() == 0.0
        assert states[-1].contact.count(1) + states[-1].contact.count(2) > 3
        left, right = (reaction(states[-1], number) for number in (0, 1))
        assert abs(left[0] + right[0]) < 1e-8 * abs(left[0])

    pair = ContactPair(Surface("block", slave), Surface("block", master), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, RUBBER)}, pressed(0.0), contacts=[pair])
    return Case(scene, ways(*map(pressed, (0.1, 0.3, 0.5))), checks=closed)


@case
def a_slot_that_closes_on_itself() -> Case:
    return slot_closes("left", "right")


@case
def a_slot_whose_surface_is_its_own_master() -> Case:
    whole = slot_closes("slot", "slot")
    return replace(whole, twins={"two sides": last_of(a_slot_that_closes_on_itself)})


@case
def bellows_that_close_on_themselves() -> Case:
    # Slots 0.4 high from the right, the left and the right again; only the body is named. It is wider above,
    # so that no lips meet corner on corner.
    whole = rectangle((0.0, 0.0), (4.0, 6.0), (16, 30))
    x, y = whole.points[whole.cells].mean(axis=1).T
    right, left = (x > 1.0) & (np.abs(np.abs(y - 3.0) - 1.8) < 0.2), (x < 3.0) & (np.abs(y - 3.0) < 0.2)
    mesh = without(whole, right | left)
    x, y = mesh.points.T
    mesh = replace(mesh, points=np.column_stack([2.0 + (x - 2.0) * (1.0 + 0.05 * y), y]))

    def pressed(way: float) -> list[Support]:
        return [Support("bellows", "y0"), Support("bellows", "y1", (0.0, -way))]

    def closed(states: States) -> None:
        assert states[0].contact.normal_force.max() == 0.0
        force = [state.contact.normal_force for state in states]
        height = states[-1].scene.points[states[-1].contact.points.slave, 1]
        bearing = height[force[-1] > 0.0]
        assert [np.count_nonzero(np.abs(bearing - y) < 0.3) > 5 for y in (1.2, 3.0, 4.8)] == [True] * 3
        under, over = (reaction(states[-1], number) for number in (0, 1))
        assert abs(under[1] + over[1]) < 1e-8 * abs(under[1])

    scene = Scene(
        {"bellows": Body(mesh, RUBBER)},
        pressed(0.0),
        contacts=AutomaticContact(Coulomb(0.3), self_contact=("bellows",)),
    )
    return Case(scene, ways(*map(pressed, (0.2, 0.6, 1.0, 1.4))), checks=closed)
