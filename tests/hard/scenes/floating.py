"""Bodies that only contact and friction hold, some of them not enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Tresca,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block
from tests.hard.scenes.parts import SOFT, STIFF, clamped, cubes, force
from tests.scenes import block_on_plane, cornered_block, stack, two_blocks
from tools.hard_cases.trial import Trial, cut_trial, trial

GROUP = "floating"


def mixed(state: State) -> None:
    """Require points that are open, that stick and that slip."""
    assert all(state.contact.count(status) > 0 for status in Status)


@trial(GROUP)
def a_block_held_by_friction_alone() -> Trial:
    return cut_trial(block_on_plane(Coulomb(0.6)), checks=mixed, ranks=(2, 4))


@trial(GROUP)
def a_block_held_by_given_friction_alone() -> Trial:
    return cut_trial(block_on_plane(Tresca(1.6)), checks=mixed)


@trial(GROUP)
def a_block_pushed_into_a_corner_whose_edge_touches_both_walls() -> Trial:
    """Six multipliers for the three displacements of a node on the edge: forces are not unique there."""
    return cut_trial(cornered_block(Coulomb(0.3)), forces=False)


@trial(GROUP)
def two_blocks_in_a_stack_with_a_friction_law_each_that_float() -> Trial:
    return cut_trial(stack(Coulomb(0.4), Tresca(1.2)), checks=mixed, ranks=(2, 4))


@trial(GROUP)
def two_blocks_by_mortar_of_which_the_upper_one_floats() -> Trial:
    scene = two_blocks(Coulomb(0.38))
    return cut_trial(
        replace(scene, contacts=[replace(scene.contacts[0], discretisation="mortar")]), checks=mixed
    )


@trial(GROUP)
def a_tower_of_ten_cubes_leaning_on_friction() -> Trial:
    scene = cubes(10, friction=Coulomb(0.4))
    weights = [BodyForce(name, (0.0, 0.0, -0.1)) for name in scene.bodies]
    push = TotalForce("cube 9", "z1", (0.02, 0.0, -1.0))

    def borne(state: State) -> None:
        floor = state.contact.on_pair(0)
        weight = 1.0 + 0.1 * sum(body.mesh.volume for body in state.scene.bodies.values())
        np.testing.assert_allclose(state.contact.force[floor].sum(axis=0), (-0.02, 0.0, weight), atol=1e-7)

    return cut_trial(replace(scene, loads=[*weights, push]), checks=borne)


def jaws(pull: float, squeeze: float = 0.01, friction: float = 0.3) -> Scene:
    """A block that floats between two jaws, one drawn towards the other, and is pulled out upwards."""
    left, right = (
        block((-1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (2, 2, 2)),
        block((1.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 2, 2)),
    )
    grip = block((0.0, 0.05, 0.05), (1.0, 0.95, 0.95), (4, 3, 3))
    law = Coulomb(friction)
    return Scene(
        {"left": Body(left, STIFF), "right": Body(right, STIFF), "block": Body(grip, SOFT)},
        [Support("left", "x0"), Support("right", "x1", (-squeeze, 0.0, 0.0))],
        [force(0.0, 0.0, pull)],
        [
            ContactPair(Surface("block", "x0"), Surface("left", "x1"), law, discretisation="node"),
            ContactPair(Surface("block", "x1"), Surface("right", "x0"), law, discretisation="node"),
        ],
    )


@trial(GROUP)
def a_block_gripped_by_jaws_and_pulled_almost_out() -> Trial:
    def gripped(state: State) -> None:
        np.testing.assert_allclose(state.contact.force.sum(axis=0), (0.0, 0.0, -0.2), atol=1e-7)
        assert state.contact.count(Status.SLIP) > 0
        assert state.contact.count(Status.STICK) > 0

    return cut_trial(jaws(0.2), checks=gripped)


@trial(GROUP)
def a_block_gripped_by_jaws_and_pulled_harder_than_they_can_hold() -> Trial:
    """Rigid bodies could be gripped with any force; how hard these jaws press only the solver finds out."""
    told = r"makes slide 'block' by translation \(0, 0, 1\), and friction carries only"
    return cut_trial(jaws(0.8), error=InfeasibleError, match=told)


@trial(GROUP)
def a_block_on_a_floor_pulled_off_it() -> Trial:
    lifted = replace(block_on_plane(Coulomb(0.5)), loads=[force(0.0, 0.0, 1.0)])
    return cut_trial(
        lifted, error=InfeasibleError, match=r"body 'block' can move away .*: translation \(0, 0, 1\)"
    )


@trial(GROUP)
def a_block_pushed_harder_than_friction_holds() -> Trial:
    return cut_trial(
        block_on_plane(Coulomb(0.3)), error=InfeasibleError, match="body 'block' can move away under the load"
    )


@trial(GROUP)
def a_block_pushed_over_its_edge() -> Trial:
    tipped = replace(block_on_plane(Coulomb(5.0)), loads=[force(1.1, 0.0, -1.0)])
    return cut_trial(
        tipped, error=InfeasibleError, match=r"body 'block' can move away .* rotation \(0, 1, 0\)"
    )


@trial(GROUP)
def the_third_cube_of_a_tower_pushed_out() -> Trial:
    scene = cubes(5, friction=Coulomb(0.2))
    loads = [TotalForce("cube 4", "z1", (0.0, 0.0, -1.0)), TotalForce("cube 2", "x0", (0.5, 0.0, 0.0))]
    return cut_trial(replace(scene, loads=loads), error=InfeasibleError, match="body 'cube 2' can move away")


@trial(GROUP)
def a_block_that_touches_nothing_and_is_pushed() -> Trial:
    """A pair that no slave node meets is an error of its own: the name of a surface is often wrong."""
    scene = two_blocks(None)
    beside = scene.bodies["upper"].mesh
    scene = replace(
        scene,
        bodies={**scene.bodies, "upper": Body(beside.moved(beside.points + np.array([5.0, 0, 0])), SOFT)},
    )
    return cut_trial(scene, error=InvalidInputError, match="needs slave nodes that face the master")


@trial(GROUP)
def two_blocks_without_supports_or_load_stay_where_they_are() -> Trial:
    def at_rest(state: State) -> None:
        assert np.abs(state.contact.force).max() == 0.0
        assert max(np.abs(state.gather_displacement(name)).max() for name in state.scene.bodies) < 1e-12

    return cut_trial(replace(stack(Coulomb(0.4), Coulomb(0.4)), loads=[]), checks=at_rest)


@trial(GROUP)
def a_block_hung_on_a_thin_strap_that_lifts_off_entirely() -> Trial:
    """A strap, a thousand times softer, holds the block when no node touches the floor any more."""
    scene = hung(upwards=0.5)

    def lifted(state: State) -> None:
        assert state.contact.count(Status.OPEN) == state.contact.points.count
        assert state.contact.gap.min() > 0.05

    return cut_trial(scene, checks=lifted)


def hung(upwards: float) -> Scene:
    """A block on a floor with a soft strap glued in at its top, the strap's end clamped."""
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), (4, 4, 8))
    above = mesh.points[mesh.cells].mean(axis=1)[:, 2] > 1.0
    mesh = replace(mesh, regions={"block": np.flatnonzero(~above), "strap": np.flatnonzero(above)})
    soft = replace(SOFT, young_modulus=0.001 * SOFT.young_modulus)
    pair = ContactPair(Surface("hung", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Coulomb(0.3))
    body = Body(mesh, {"block": SOFT, "strap": soft})
    scene = Scene({"hung": body}, loads=[BodyForce("hung", (0.0, 0.0, 0.1 * upwards))], contacts=[pair])
    return clamped(scene, "hung", "z1")
