"""Friction from none to ten, different on every pair, exactly at its limit, remembered and reversed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
)
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.hard.scenes.parts import FLOOR, cubes, force
from tests.scenes import SOFT, Friction, block_on_plane, pressed_block, stack
from tools.hard_cases.invariants import violations
from tools.hard_cases.transform import turned
from tools.hard_cases.trial import Answer, Trial, cut_trial, failing_trial, trial

GROUP = "friction"


def dragged(coefficient: float) -> Trial:
    """A crowned block pressed down and dragged along by its top."""

    def friction_is_there(state: State) -> None:
        pulled = np.abs(state.contact.friction_force).sum()
        assert (pulled > 0.0) == (coefficient > 0.0)
        closed = state.contact.points.count - state.contact.count(Status.OPEN)
        assert closed > 10
        if coefficient <= 1e-3:
            assert state.contact.count(Status.SLIP) == closed
        if coefficient >= 10.0:
            assert state.contact.count(Status.STICK) > closed // 2

    return cut_trial(pressed_block(Coulomb(coefficient)), checks=friction_is_there)


for _value in (0.0, 1e-6, 1e-3, 0.3, 1.0, 10.0):
    trial(GROUP, f"a block dragged over its floor, friction coefficient {_value:g}")(partial(dragged, _value))


@trial(GROUP)
def a_block_that_floats_on_friction_10() -> Trial:
    """A coefficient far beyond where the equilibrium is known to be unique; the push tips the block."""
    scene = replace(block_on_plane(Coulomb(10.0)), loads=[force(3.9, 1.0, -4.0)])

    def another(state: State) -> str:
        """Solve it cut otherwise, require all that must hold of that answer, too, and compare the two."""
        trial_ = cut_trial(scene)
        other = trial_.solve(cut=trial_.other)
        found = violations(other)
        assert max(found.natural, found.balance, found.nodal, found.cone, found.law) < 1e-8
        difference = Answer.of(state).difference(Answer.of(other), trial_)
        if difference < 1e-6:
            return "the same in another partition"
        return f"another partition finds another equilibrium, {difference:.0e} away: forces are not unique"

    return cut_trial(scene, other=None, remark=another)


@trial(GROUP, "a block with friction 0, 0.3 and 10 on its three sides")
def a_block_with_three_laws() -> Trial:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    sides: list[tuple[str, RigidPlane, Friction]] = [
        ("z0", FLOOR, Coulomb(0.3)),
        ("y0", RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)), Coulomb(10.0)),
        ("x1", RigidPlane((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), Coulomb(0.0)),
    ]
    pairs = [ContactPair(Surface("block", side), wall, law) for side, wall, law in sides]
    top = Support("block", "z1", (0.012, -0.008, -0.02))

    def all_pairs_press(state: State) -> None:
        contact = state.contact
        for pair in range(3):
            own = contact.on_pair(pair)
            assert contact.normal_force[own].max() > 0.01
            assert (np.abs(contact.friction_force[own]).max() > 0.0) == (pair < 2)

    # Edges that two walls hold have more multipliers than displacements: forces are not unique there.
    scene = Scene({"block": Body(mesh, SOFT)}, [top], contacts=pairs)
    return cut_trial(scene, forces=False, checks=all_pairs_press)


@trial(GROUP)
def a_stack_whose_upper_pair_slides_without_friction_between_guides() -> Trial:
    scene = stack(None, Tresca(1.5))
    guides = [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
    return cut_trial(replace(scene, supports=guides))


def tilted(coefficient: float, slope: float) -> Scene:
    """A tower of bricks on a slope, under its weight."""
    angle = np.arctan(slope)
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    scene = turned(cubes(4, friction=Coulomb(coefficient)), turn)
    return replace(scene, loads=[BodyForce(name, (0.0, 0.0, -1.0)) for name in scene.bodies])


@trial(GROUP, "a tower of bricks on a slope of 0.0009 with friction 0.001")
def a_tower_that_stands_on_a_slope() -> Trial:
    cause = "the residual stagnates while all points slip"
    return failing_trial(tilted(1e-3, 0.9e-3), cause, checks=partial(stands, slope=0.9e-3))


@trial(GROUP, "a tower of bricks on a slope of 0.0011 with friction 0.001")
def a_tower_that_slides_down_a_slope() -> Trial:
    return cut_trial(tilted(1e-3, 1.1e-3), error=InfeasibleError, match=r"can move away under .* translation")


def stands(state: State, slope: float) -> None:
    """Require the weight on the floor and friction below its limit."""
    floor = state.contact.on_pair(0)
    total = state.contact.force[floor].sum(axis=0)
    weight = sum(body.mesh.volume for body in state.scene.bodies.values())
    np.testing.assert_allclose(total, (0.0, 0.0, weight), atol=1e-6 * weight)
    assert np.abs(state.contact.friction_force[floor]).sum() > 0.99 * slope / np.hypot(1, slope) * weight


SHEAR, PRESS, STIFFNESS = 0.3, 1.0, 100.0


def sheared_at_the_limit(factor: float, *, held: bool) -> Scene:
    """A block in uniform shear: the tangential traction on its floor is ``factor`` times friction everywhere.

    Poisson's ratio is zero, so that u = (γ z, 0, −p z / E), γ = 2 τ / E solves the problem if nothing slips.
    """
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    tau = factor * SHEAR * PRESS
    pair = ContactPair(Surface("block", "z0"), FLOOR, Coulomb(SHEAR))
    body = Body(mesh, IsotropicElasticity(STIFFNESS, 0.0))
    sides = [Traction("block", "x1", (0.0, 0.0, tau)), Traction("block", "x0", (0.0, 0.0, -tau))]
    if held:
        top = Support("block", "z1", (2.0 * tau / STIFFNESS, 0.0, -PRESS / STIFFNESS))
        return Scene({"block": body}, [top], sides, [pair])
    return Scene({"block": body}, [], [*sides, Traction("block", "z1", (tau, 0.0, -PRESS))], [pair])


def at_the_limit(state: State) -> None:
    """Require uniform stress, no slip, and friction equal to its bound at every node."""
    contact, mesh = state.contact, state.scene.bodies["block"].mesh
    np.testing.assert_allclose(contact.pressure, PRESS, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(contact.friction_force, axis=1), contact.slip_bound, rtol=1e-6)
    u = state.gather_displacement("block")
    expected = np.column_stack(
        [2 * SHEAR / STIFFNESS * mesh.points[:, 2], 0 * u[:, 1], -mesh.points[:, 2] / STIFFNESS]
    )
    np.testing.assert_allclose(u, expected, atol=1e-7 * np.abs(expected).max())


@trial(GROUP)
def every_node_exactly_at_the_stick_slip_limit_held_at_the_top() -> Trial:
    """Weakly active everywhere: whether a node sticks or slips by nothing is rounding, the answer is not."""
    return cut_trial(sheared_at_the_limit(1.0, held=True), checks=at_the_limit, ranks=(2, 4))


@trial(GROUP)
def a_floating_block_exactly_at_the_stick_slip_limit() -> Trial:
    """Forces exist, but any slide is an answer: refused, as how far it slides would be left to rounding."""
    return cut_trial(
        sheared_at_the_limit(1.0, held=False), error=InfeasibleError,
        match=r"body 'block' is held only just: the load uses up all friction against translation \(1",
    )  # fmt: skip


for _factor, _words in ((1 - 1e-5, "a hundred-thousandth below"), (1 - 1e-3, "a thousandth below")):
    trial(GROUP, f"a floating block {_words} the stick-slip limit")(
        lambda factor=_factor: cut_trial(sheared_at_the_limit(factor, held=False))
    )
trial(GROUP, "a floating block a thousandth above the stick-slip limit")(
    lambda: cut_trial(
        sheared_at_the_limit(1.001, held=False),
        error=InfeasibleError,
        match=r"can move away under .* translation \(1",
    )
)


@trial(GROUP)
def a_block_pushed_to_and_fro_that_remembers_its_slip() -> Trial:
    scene = pressed_block(Coulomb(0.3))
    ways = (0.0, 0.012, -0.012, 0.003, 0.003)
    steps = tuple(
        LoadStep(f"{number}", supports=[Support("block", "z1", (way, 0.0, -0.025))])
        for number, way in enumerate(ways)
    )

    def remembered(state: State) -> None:
        assert np.abs(state.contact.slip_before).max() > 1e-3
        assert np.abs(state.contact.slip).max() < 1e-9  # the last step changes nothing
        assert np.abs(state.contact.friction_force).sum() > 0.1

    return cut_trial(scene, steps=steps, checks=remembered)
