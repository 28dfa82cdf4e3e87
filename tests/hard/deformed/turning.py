"""Bodies that twist and turn."""

from __future__ import annotations

import numpy as np

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, RigidSurface, Scene, Support, Surface
from fenics_contact.gallery import block
from fenics_contact.materials import NeoHooke
from tests.hard.deformed.case import Case, States, case, displacement, ways

RUBBER = NeoHooke(1.0, 0.3)


def turned(name: str, angle: float, depth: float = 0.0) -> RigidSurface:
    """The upper side of a body, turned about the vertical axis through its centre, and sunk."""
    return RigidSurface(name, "z1", (0.5, 0.5, 0), (0, 0, -depth), (0, 0, angle))


@case
def a_bar_twisted_by_90_degrees() -> Case:
    mesh = block((0, 0, 0), (1, 1, 3), (3, 3, 6))
    scene = Scene({"bar": Body(mesh, RUBBER)}, [Support("bar", "z0"), Support("bar", "z1")])

    def twists(states: States) -> None:
        u = displacement(states[-1])
        quarter = np.column_stack([1.0 - mesh.points[:, 1], mesh.points[:, 0], mesh.points[:, 2]])
        order = np.array([np.abs(mesh.points - point).sum(axis=1).argmin() for point in quarter])
        quarter_turn = np.column_stack([-u[:, 1], u[:, 0], u[:, 2]])
        assert np.abs(u[order] - quarter_turn).max() < 1e-7, "as symmetric as the bar"
        middle = np.abs(mesh.points[:, 2] - 1.5) < 1e-9
        corner = middle & (np.abs(mesh.points[:, :2]).sum(axis=1) < 1e-9)
        place = (mesh.points + u)[corner][0, :2] - 0.5
        assert abs(np.degrees(np.arctan2(place[1], place[0])) - (-135.0 + 45.0)) < 1.0, "by 45 degrees"

    angles = np.radians([30.0, 60.0, 90.0])
    steps = ways(*([Support("bar", "z0"), turned("bar", angle)] for angle in angles))
    return Case(scene, steps, checks=twists)


@case
def a_block_turned_by_90_degrees_on_a_plate_with_friction() -> Case:
    """Once all of it slips, friction resists with its whole moment, and more turning changes nothing."""
    mesh = block((0, 0, 0), (1, 1, 1), (5, 5, 4))
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, RUBBER)}, [Support("block", "z1")], contacts=[pair])

    def gross(states: States) -> None:
        moments = [state.reactions()[0].moment[2] for state in states]
        assert states[-1].contact.count(2) > 20
        assert abs(moments[-1]) > 0.01
        np.testing.assert_allclose(moments[-1], moments[-2], rtol=0.02)

    angles = np.radians([0.0, 30.0, 60.0, 90.0])
    return Case(scene, ways(*([turned("block", angle, 0.15)] for angle in angles)), checks=gross)
