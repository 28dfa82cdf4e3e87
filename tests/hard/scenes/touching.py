"""Contact that is nowhere, everywhere, or only just."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
)
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from tests.hard.scenes.parts import FLOOR, UP
from tests.scenes import SOFT, block_on_plane, pressed_block
from tools.hard_cases.trial import Trial, bisected, cut_trial, failing_trial, ragged, trial

GROUP = "touching"


def all_open(state: State) -> None:
    """Require that no point carries a force."""
    assert state.contact.count(Status.OPEN) == state.contact.points.count > 0
    assert np.abs(state.contact.force).max() == 0.0


def all_closed(state: State) -> None:
    """Require that every point presses."""
    assert state.contact.count(Status.OPEN) == 0
    assert state.contact.normal_force.min() > 1e-4 * state.contact.normal_force.max() > 0.0


@trial(GROUP)
def a_cantilever_that_bends_away_from_its_floor() -> Trial:
    mesh = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (8, 2, 2))
    pair = ContactPair(Surface("beam", "z0"), FLOOR, Coulomb(0.3))
    scene = Scene(
        {"beam": Body(mesh, SOFT)}, [Support("beam", "x0")], [Traction("beam", "x1", (0.0, 0.0, 0.1))], [pair]
    )

    def away(state: State) -> None:
        """The clamped nodes are no contact points; all others leave the floor or, in theory, none presses."""
        assert np.abs(state.contact.force).max() < 1e-3
        assert state.contact.gap.max() > 0.01

    return cut_trial(scene, checks=away)


@trial(GROUP)
def a_cantilever_above_its_floor_that_does_not_reach_it() -> Trial:
    mesh = block((0.0, 0.0, 0.5), (4.0, 1.0, 1.5), (8, 2, 2))
    pair = ContactPair(Surface("beam", "z0"), FLOOR, Coulomb(0.3))
    load = Traction("beam", "x1", (0.0, 0.0, -0.1))
    return cut_trial(
        Scene({"beam": Body(mesh, SOFT)}, [Support("beam", "x0")], [load], [pair]), checks=all_open
    )


def pressed_flat(
    friction: Coulomb | None, gap: float = 0.0, down: float = 0.02, along: float = 0.01
) -> Scene:
    """A block whose flat lower face is pressed on a floor a gap below it and dragged along."""
    mesh = block((0.0, 0.0, gap), (2.0, 1.0, gap + 1.0), (6, 3, 3))
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    support = Support("block", "z1", (along, 0.0, -gap - down))
    return Scene({"block": Body(mesh, SOFT)}, [support], contacts=[pair])


for _words, _law in (("without friction", None), ("with friction", Coulomb(0.3))):
    trial(GROUP, f"a block pressed flat on its floor {_words}, all nodes closed")(
        lambda law=_law: cut_trial(pressed_flat(law, along=0.0), checks=all_closed)
    )


def grazing(friction: Coulomb | None) -> Trial:
    """A block drawn along the floor that it lies on, of a material that does not contract across."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    material = IsotropicElasticity(100.0, 0.0)
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    scene = Scene(
        {"block": Body(mesh, material)},
        [Support("block", "x0")],
        [Traction("block", "x1", (0.7, 0.0, 0.0))],
        [pair],
    )

    def grazed(state: State) -> None:
        assert np.abs(state.contact.force).max() < 1e-8
        assert np.abs(state.contact.gap).max() < 1e-9
        expected = 0.007 * mesh.points[:, 0]
        np.testing.assert_allclose(state.gather_displacement("block")[:, 0], expected, atol=1e-9)

    return cut_trial(scene, checks=grazed, force_scale=0.7)


for _words, _law in (("without friction", None), ("with friction", Coulomb(0.3))):
    trial(GROUP, f"a block that grazes its floor {_words}: zero gap and zero force everywhere")(
        partial(grazing, _law)
    )


@trial(GROUP, "a gap of 1e-9 that a large load closes")
def a_gap_closed_by_a_large_load() -> Trial:
    return cut_trial(pressed_flat(Coulomb(0.3), gap=1e-9), checks=all_closed)


@trial(GROUP, "a gap of 1e-9 closed by a motion of the same size")
def a_gap_closed_by_as_small_a_motion() -> Trial:
    return cut_trial(pressed_flat(Coulomb(0.3), gap=1e-9, down=1e-9, along=1e-9), checks=all_closed)


@trial(GROUP)
def a_gap_of_ten_lengths_closed_by_a_prescribed_displacement() -> Trial:
    return cut_trial(pressed_flat(Coulomb(0.3), gap=10.0), checks=all_closed)


@trial(GROUP)
def a_gap_of_ten_lengths_under_a_body_that_floats() -> Trial:
    """Nothing holds the body before it has fallen: equilibrium is found all the same."""
    scene = block_on_plane(Coulomb(0.7))
    pair = replace(scene.contacts[0], master=RigidPlane((0.0, 0.0, -10.0), UP))
    return cut_trial(replace(scene, contacts=[pair]))


@trial(GROUP)
def a_ball_that_touches_its_floor_at_one_node_under_a_small_load() -> Trial:
    mesh = hemisphere(1.0, 3)
    symmetry = [Support("ball", "x0", (0.0, None, None)), Support("ball", "y0", (None, 0.0, None))]
    low = float(mesh.points[:, 2].min())
    pair = ContactPair(Surface("ball", "contact"), RigidPlane((0.0, 0.0, low), UP), None)
    scene = Scene(
        {"ball": Body(mesh, SOFT)}, symmetry, [TotalForce("ball", "top", (0.0, 0.0, -1e-3))], [pair]
    )

    def one(state: State) -> None:
        assert state.contact.points.count - state.contact.count(Status.OPEN) == 1

    return Trial(scene, cut=bisected(scene, 2), other=ragged(scene, 5), checks=one)


def ring(inner: float, outer: float, around: int, half: float) -> BodyMesh:
    """Return a ring segment of flat facets about the downward direction, inner face y0, outer face y1."""
    mesh = rectangle((-half, inner), (half, outer), (around, 3))
    angle, radius = mesh.points[:, 0], mesh.points[:, 1]
    return mesh.moved(np.column_stack([-radius * np.sin(angle), -radius * np.cos(angle)]))


def shaft_in_hub(inside: int, outside: int, friction: float) -> Scene:
    """A polygonal shaft in a polygonal bush of the same radius: corners of one lie inside the other."""
    shaft, hub = ring(0.4, 1.0, inside, 1.2), ring(1.0, 1.5, outside, 1.3)
    material = PlaneStrain(1000.0, 0.3)
    pair = ContactPair(Surface("shaft", "y1"), Surface("hub", "y0"), Coulomb(friction), "node", "faceted")
    return Scene(
        {"shaft": Body(shaft, material), "hub": Body(hub, material)},
        [Support("hub", "y1", (0.0, 0.0))],
        [Traction("shaft", "y0", (0.05, -2.0))],
        [pair],
    )


@trial(GROUP)
def a_polygonal_shaft_in_a_polygonal_bush_that_overlap_by_their_faceting() -> Trial:
    """The overlap is pressed apart: corners 0.8 % of a facet deep add their own pressure."""
    scene = shaft_in_hub(24, 31, 0.3)

    def overlapped(state: State) -> None:
        gaps = state.torn.points.gap
        assert gaps.min() < -1e-4
        assert state.contact.gap.min() > -1e-9

    return cut_trial(scene, checks=overlapped, ranks=(2, 4))


@trial(GROUP)
def a_crowned_block_whose_ends_only_just_come_down() -> Trial:
    """One row of nodes after the other meets the floor; the outermost by a hair."""
    return cut_trial(pressed_block(Coulomb(0.4)))


def almost_unloaded(scale: float) -> Trial:
    """A crowned brick under next to no load: it rolls on its crown by far more than it deforms."""
    load = Traction("block", "z1", (scale, 0.3 * scale, -2.0 * scale))
    scene = replace(block_on_plane(Coulomb(0.7)), loads=[load])
    if scale > 1e-5:
        return cut_trial(scene)
    return failing_trial(scene, "the brick rolls by a million times what it deforms, the residual stagnates")


for _scale in (1e-2, 1e-4, 1e-6, 1e-8):
    trial(GROUP, f"a crowned brick that rolls on its crown under a load of {_scale:g}")(
        partial(almost_unloaded, _scale)
    )


@trial(GROUP)
def a_plate_that_moves_by_a_millionth_of_a_millionth_of_its_gap() -> Trial:
    """The gap is a number of another size than all displacements; its rounding must not drown them."""
    mesh = block((0.0, 0.0, 1e-5), (8e-3, 4e-3, 2e-5), (8, 4, 1))
    pair = ContactPair(Surface("plate", "z0"), FLOOR, None)
    scene = Scene(
        {"plate": Body(mesh, IsotropicElasticity(1e5, 0.3))},
        [Support("plate", "x0")],
        [BodyForce("plate", (0.0, 0.0, 1e-9))],
        [pair],
    )
    return failing_trial(
        scene, "the gap's rounding in the recomputed residual, larger than the displacements"
    )
