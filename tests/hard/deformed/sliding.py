"""Bodies that slide over edges, corners and each other, and obstacles that move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    MovingObstacle,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import NeoHooke
from tests.hard.deformed.case import Case, States, case, displacement, reaction, times, ways

SOFT, HARD = NeoHooke(1.0, 0.3), NeoHooke(10.0, 0.3)


def slider(cells: int) -> BodyMesh:
    """A block whose underside is an arc, 1.2 wide, over the left end of the bed."""
    mesh = rectangle((1.0, 2.0), (2.2, 3.0), (cells, cells))
    x, y = mesh.points.T
    rim = 2.0 + 0.3 * (x - 1.6) ** 2
    return replace(mesh, points=np.column_stack([x, rim + (3.0 - rim) * (y - 2.0)]))


def held(way: float, depth: float) -> list[Support]:
    return [Support("bed", "y0"), Support("slider", "y1", (way, -depth))]


def on_bed(
    friction: float, cells: tuple[int, int] = (16, 6), bed: tuple[int, int] = (20, 8), ratio: float = 10.0
) -> Scene:
    law = Coulomb(friction) if friction else None
    return Scene(
        {
            "bed": Body(rectangle((0.0, 0.0), (4.0, 2.0), bed), SOFT),
            "slider": Body(slider(cells[1]), NeoHooke(ratio, 0.3)),
        },
        held(0.0, 0.0),
        contacts=[ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), law, discretisation="node")],
    )


def slides(states: States) -> None:
    last = states[-1].contact
    assert last.count(2) > 0, "something slips"
    assert np.abs(last.friction_force).max() > 0.0


@case
def a_fine_slider_on_a_coarse_bed() -> Case:
    scene = on_bed(0.3, cells=(16, 16), bed=(6, 4))
    return Case(scene, ways(held(0.0, 0.2), held(0.3, 0.2)), checks=slides)


@case
def a_slider_a_thousand_times_stiffer_than_its_bed() -> Case:
    scene = on_bed(0.3, ratio=1e3)
    return Case(scene, ways(held(0.0, 0.2), held(0.3, 0.2)), checks=slides)


@case
def a_corner_pressed_into_a_bed() -> Case:
    """A square on its tip: symmetric about the vertical through it."""
    mesh = rectangle((-0.6, -0.6), (0.6, 0.6), (6, 6))
    c = np.sqrt(0.5)
    turned = mesh.points @ [[c, c], [-c, c]]
    rims = np.concatenate([mesh.surfaces["x0"], mesh.surfaces["y0"]])
    mesh = replace(
        mesh, points=np.add(turned, (0.0, 2.0 + 1.2 * c)), surfaces={**mesh.surfaces, "rim": rims,
        "top": np.concatenate([mesh.surfaces["x1"], mesh.surfaces["y1"]])},
    )  # fmt: skip
    bed = rectangle((-2.0, 0.0), (2.0, 2.0), (21, 10))
    scene = Scene(
        {"bed": Body(bed, SOFT), "square": Body(mesh, HARD)},
        [Support("bed", "y0"), Support("square", "top")],
        contacts=[ContactPair(Surface("square", "rim"), Surface("bed", "y1"), discretisation="node")],
    )

    def symmetric(states: States) -> None:
        force = reaction(states[-1], 1)
        assert force[1] < 0.0
        assert abs(force[0]) < 1e-7 * abs(force[1])

    steps = ways(*([Support("bed", "y0"), Support("square", "top", (0.0, -d))] for d in (0.1, 0.25)))
    return Case(scene, steps, checks=symmetric)


@case
def a_block_pushed_into_the_corner_of_two_planes() -> Case:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (8, 8))
    floor, wall = RigidPlane((0.0, 0.0), (0.0, 1.0)), RigidPlane((0.0, 0.0), (1.0, 0.0))
    pairs = [ContactPair(Surface("block", "y0"), floor), ContactPair(Surface("block", "x0"), wall)]
    ends = [Support("block", "x1", (-0.2, None)), Support("block", "y1", (None, -0.2))]

    def uniform(states: States) -> None:
        """Without friction the strain is uniform: u is linear."""
        assert np.abs(displacement(states[-1]) + 0.2 * mesh.points).max() < 1e-8

    scene = Scene({"block": Body(mesh, SOFT)}, ends, contacts=pairs)
    return Case(scene, ways(ends), checks=uniform)


def over_rubber(path: object, friction: float, radius: float = 0.6) -> Scene:
    bed = rectangle((0.0, 0.0), (4.0, 1.5), (24, 8))
    disc = MovingObstacle(RigidSphere((1.0, 1.5 + radius), radius), path)  # type: ignore[arg-type]
    law = Coulomb(friction) if friction else None
    return Scene(
        {"bed": Body(bed, SOFT)},
        [Support("bed", "y0")],
        contacts=[ContactPair(Surface("bed", "y1"), disc, law)],
    )


@case
def a_rigid_disc_that_ploughs_through_rubber_with_friction() -> Case:
    scene = over_rubber(lambda time: (None, (max(time - 1.0, 0.0), -0.3 * min(time, 1.0))), 0.3)

    def drags(states: States) -> None:
        force = states[-1].contact.force.sum(axis=0)
        assert abs(force[0]) > 0.2 * abs(force[1])

    return Case(scene, times(1.0, 1.5, 2.0, 2.5), checks=drags)


@case
def a_rigid_disc_that_turns_on_the_spot() -> Case:
    """The surface is drawn along until everything slides: then more turning changes nothing."""

    def path(time: float) -> tuple[np.ndarray, np.ndarray]:
        angle, centre = 0.6 * max(time - 1.0, 0.0), np.array([2.0, 2.1])
        c, s = np.cos(angle), np.sin(angle)
        R = np.array([[c, -s], [s, c]])
        return R, centre - R @ centre + (0.0, -0.3 * min(time, 1.0))

    bed = rectangle((0.0, 0.0), (4.0, 1.5), (24, 8))
    disc = MovingObstacle(RigidSphere((2.0, 2.1), 0.6), path)
    pair = ContactPair(Surface("bed", "y1"), disc, Coulomb(0.3))
    scene = Scene({"bed": Body(bed, SOFT)}, [Support("bed", "y0")], contacts=[pair])

    def gross(states: States) -> None:
        pulled = [abs(reaction(state, 0)[0]) for state in states]
        assert abs(pulled[0]) < 1e-6 * pulled[-1]
        assert abs(pulled[-1] - pulled[-2]) < 1e-3 * pulled[-1]

    return Case(scene, times(1.0, 1.5, 2.0, 2.5), checks=gross)


@case
def a_stack_of_three_that_is_sheared() -> Case:
    widths = {"low": (0.0, 3.0, 9), "middle": (0.4, 2.6, 7), "high": (0.8, 2.2, 5)}
    bodies = {
        name: Body(rectangle((a, level), (b, level + 1.0), (n, 3)), SOFT)
        for level, (name, (a, b, n)) in enumerate(widths.items())
    }
    pairs = [
        ContactPair(Surface("middle", "y0"), Surface("low", "y1"), Coulomb(0.3), discretisation="node"),
        ContactPair(Surface("high", "y0"), Surface("middle", "y1"), Coulomb(0.3), discretisation="node"),
    ]

    def top(way: float, depth: float) -> list[Support]:
        return [Support("low", "y0"), Support("high", "y1", (way, -depth))]

    def carries(states: States) -> None:
        low, high = (reaction(states[-1], number) for number in (0, 1))
        assert np.abs(low + high).max() < 1e-7 * np.abs(high).max()

    scene = Scene(bodies, top(0.0, 0.0), contacts=pairs)
    return Case(scene, ways(top(0.0, 0.3), top(0.2, 0.3)), checks=carries, pieces=3, other=2)


@case
def a_ball_shaped_block_dragged_over_a_plane_in_space() -> Case:
    mesh = block((0, 0, 0), (1, 1, 1), (5, 5, 4))
    x, y, z = mesh.points.T
    rim = 0.15 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
    mesh = replace(mesh, points=np.column_stack([x, y, rim + z * (1 - rim)]))
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))

    def top(way: float) -> list[Support]:
        return [Support("block", "z1", (way, 0.5 * way, -0.15))]

    def along(states: States) -> None:
        force = reaction(states[-1], 0)
        assert states[-1].contact.count(2) > 5
        assert abs(force[1] / force[0] - 0.5) < 0.05

    scene = Scene({"block": Body(mesh, SOFT)}, top(0.0), contacts=[pair])
    return Case(scene, ways(*map(top, (0.0, 0.1, 0.3))), checks=along)


@case
def a_slider_ten_thousand_times_stiffer_than_its_bed() -> Case:
    scene = on_bed(0.3, ratio=1e4)
    return Case(scene, ways(held(0.0, 0.2), held(0.3, 0.2)), checks=slides, agreement=1e-5)


@case
def a_slider_drawn_over_the_rim_of_its_bed() -> Case:
    """Nodes leave the surface's edge, and the bed's last node carries more and more."""
    scene = on_bed(0.2)
    scene = replace(
        scene, bodies={**scene.bodies, "bed": Body(rectangle((0.0, 0.0), (2.0, 2.0), (12, 8)), SOFT)}
    )

    def falls(states: States) -> None:
        carried = [abs(reaction(state, 1)[1]) for state in states]
        assert carried[-1] < 0.8 * carried[0]

    steps = ways(held(0.0, 0.2), held(0.2, 0.2), held(0.4, 0.2), held(0.6, 0.2))
    return Case(scene, steps, checks=falls)


@case
def a_slider_rubbed_to_and_fro() -> Case:
    """From the second stroke on, strokes repeat the one before the last."""

    def repeats(states: States) -> None:
        along = [reaction(state, 1)[0] for state in states[1:]]
        assert along[0] * along[1] < 0.0
        np.testing.assert_allclose(along[2:], along[:-2], rtol=0.05)

    strokes = (0.0, 0.3, -0.3, 0.3, -0.3)
    return Case(on_bed(0.3), ways(*(held(way, 0.2) for way in strokes)), checks=repeats)


@case
def a_fine_slider_on_a_coarse_bed_by_mortar() -> Case:
    scene = on_bed(0.3, cells=(16, 16), bed=(6, 4))
    scene = replace(scene, contacts=[replace(pair, discretisation="mortar") for pair in scene.contacts])
    return Case(scene, ways(held(0.0, 0.2), held(0.3, 0.2)), checks=slides)
