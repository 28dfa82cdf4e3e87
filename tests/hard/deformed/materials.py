"""Materials that hardly change their volume, that flow, and stiff ones beside soft ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import FinitePlasticity, Material, MooneyRivlin, NeoHooke, Ogden
from tests.hard.deformed.case import Case, States, case, displacement, reaction, ways

SOFT = NeoHooke(1.0, 0.3)


def rounded(material: Material, friction: float, cells: int = 10) -> Scene:
    """A block with a round underside on a plane."""
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (cells, cells))
    x, y = mesh.points.T
    rim = 0.2 * (x - 0.5) ** 2
    mesh = replace(mesh, points=np.column_stack([x, rim + y * (1.0 - rim)]))
    law = Coulomb(friction) if friction else None
    pair = ContactPair(Surface("block", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), law)
    return Scene({"block": Body(mesh, material)}, [Support("block", "y1")], contacts=[pair])


def top(way: float, depth: float) -> list[Support]:
    return [Support("block", "y1", (way, -depth))]


def keeps_volume(states: States) -> None:
    """The volume of all cells together, by the polygon of the deformed rim."""
    state = states[-1]
    mesh = state.scene.bodies["block"].mesh
    change = 0.0
    for points, sign in ((mesh.points + displacement(state), 1.0), (mesh.points, -1.0)):
        x, y = points[mesh.cells].transpose(2, 0, 1)
        change += sign * 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(1)).sum()
    assert abs(change) < 2e-3


@case
def rubber_of_poisson_ratio_4999_pressed_by_a_quarter() -> Case:
    scene = rounded(NeoHooke(1.0, 0.4999, mean_dilatation=True), 0.0)
    return Case(scene, ways(top(0.0, 0.1), top(0.0, 0.25)), checks=keeps_volume)


@case
def rubber_of_poisson_ratio_4999_dragged_with_friction() -> Case:
    scene = rounded(NeoHooke(1.0, 0.4999, mean_dilatation=True), 0.3)
    steps = ways(top(0.0, 0.1), top(0.1, 0.1), top(0.2, 0.1))
    return Case(scene, steps, checks=keeps_volume)


@case
def mooney_rivlin_rubber_that_keeps_its_volume_to_a_millionth() -> Case:
    scene = rounded(MooneyRivlin(0.12, 0.04, 1e5, mean_dilatation=True), 0.3)
    return Case(scene, ways(top(0.0, 0.1), top(0.1, 0.2)), checks=keeps_volume, agreement=1e-5)


@case
def ogden_rubber_pressed_to_half_its_height() -> Case:
    scene = rounded(Ogden((0.3, 0.01), (1.8, 5.0), 10.0), 0.3)
    return Case(scene, ways(top(0.0, 0.15), top(0.0, 0.3), top(0.0, 0.45)))


@case
def a_nearly_incompressible_block_in_space() -> Case:
    mesh = block((0, 0, 0), (1, 1, 1), (4, 4, 4))
    rubber = NeoHooke(1.0, 0.4999, mean_dilatation=True)
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, rubber)}, [Support("block", "z1")], contacts=[pair])

    def presses(states: States) -> None:
        assert reaction(states[-1], 0)[2] < -0.2

    steps = ways(*([Support("block", "z1", (0.0, 0.0, -d))] for d in (0.1, 0.2)))
    return Case(scene, steps, checks=presses)


@case
def layers_a_thousand_times_softer_than_the_others() -> Case:
    mesh = rectangle((0.0, 0.0), (2.0, 1.2), (12, 12))
    level = np.floor(mesh.points[mesh.cells][:, :, 1].mean(axis=1) / 0.3).astype(int) % 2
    mesh = replace(mesh, regions={"soft": np.flatnonzero(level == 0), "stiff": np.flatnonzero(level == 1)})
    body = Body(mesh, {"soft": SOFT, "stiff": NeoHooke(1000.0, 0.3)})
    held = Support("block", "y0")
    scene = Scene({"block": body}, [held, Support("block", "y1")])

    def shears(states: States) -> None:
        below, above = (reaction(states[-1], number) for number in (0, 1))
        assert np.abs(below + above).max() < 1e-7 * np.abs(above).max()

    steps = ways(*([held, Support("block", "y1", (d, -0.2 * d))] for d in (0.2, 0.5)))
    return Case(scene, steps, checks=shears, agreement=1e-5)


def pressed_twice(friction: float, apart: float) -> Case:
    """Metal that is pressed, lifted off and pressed again, with as much force but for a part of it."""
    scene = rounded(FinitePlasticity(200.0, 0.3, 1.0, isotropic_hardening=10.0), friction)

    def keeps(states: States) -> None:
        first, lifted, again = states
        assert lifted.contact.normal_force.max() == 0.0
        assert np.abs(displacement(lifted) - (0.0, 0.1)).max() > 0.02, "it has flowed"
        np.testing.assert_allclose(reaction(again, 0)[1], reaction(first, 0)[1], rtol=apart)

    steps = ways(top(0.0, 0.05), top(0.0, -0.1), top(0.0, 0.05))
    return Case(scene, steps, checks=keeps, remembers=True)


@case
def metal_pressed_lifted_off_and_pressed_again() -> Case:
    """What has flowed flows no more until the load is as large as it was."""
    return pressed_twice(0.0, 1e-7)


@case
def metal_pressed_lifted_off_and_pressed_again_with_friction() -> Case:
    """Nodes come down and stick elsewhere than they slid before: 4 % less force."""
    return pressed_twice(0.3, 0.1)


@case
def rubber_that_keeps_its_volume_drawn_over_the_same_rubber() -> Case:
    rubber = NeoHooke(1.0, 0.4999, mean_dilatation=True)
    low = rectangle((-0.5, -1.0), (2.0, 0.0), (14, 6))
    block_on = rounded(rubber, 0.3).bodies["block"]
    pair = ContactPair(Surface("block", "y0"), Surface("low", "y1"), Coulomb(0.3), discretisation="node")
    bodies = {"low": Body(low, rubber), "block": block_on}
    below = Support("low", "y0")
    scene = Scene(bodies, [below, *top(0.0, 0.0)], contacts=[pair])

    def carries(states: States) -> None:
        low, high = (reaction(states[-1], number) for number in (0, 1))
        assert np.abs(low + high).max() < 1e-7 * np.abs(high).max()

    return Case(scene, ways(*([below, *top(way, 0.15)] for way in (0.0, 0.1, 0.25))), checks=carries)
