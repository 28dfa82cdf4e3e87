"""Bodies that come loose where others yield: nothing holds them, and they stay until they are met again."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    Preload,
    RigidPlane,
    Scene,
    Section,
    Support,
    Surface,
    TotalForce,
    solve_scene,
    solve_steps,
)
from fenics_contact._equilibrium.static_admissibility import unresisted_motions
from fenics_contact.gallery import block
from fenics_contact.materials import J2Plasticity

STEEL = J2Plasticity(2.1e5, 0.3, 640.0, isotropic_hardening=2e3)
RUBS = Coulomb(0.15)


def jaws(way: float) -> Scene:
    """A block between jaws, one of which moves, and another one that is pressed and sheared all the time."""

    def box(low: tuple[float, float, float], cells: int) -> Body:
        x, y, z = low
        return Body(block(low, (x + 1, y + 1, z + 1), (cells, cells, cells)), STEEL)

    bodies = {"left": box((0, 0, 0), 2), "held": box((1, 0, 0), 3), "right": box((2, 0, 0), 2)}
    bodies |= {"under": box((0, 2, 0), 2), "over": box((0, 2, 1), 3)}
    supports = [Support("left", "x0"), Support("right", "x1", (way, 0.0, 0.0)), Support("under", "z0")]
    contacts = [
        ContactPair(Surface("held", "x0"), Surface("left", "x1"), RUBS),
        ContactPair(Surface("held", "x1"), Surface("right", "x0"), RUBS),
        ContactPair(Surface("over", "z0"), Surface("under", "z1"), RUBS),
    ]
    return Scene(bodies, supports, [TotalForce("over", "z1", (10.0, 0.0, -100.0))], contacts)


def test_a_block_comes_loose_and_is_gripped_again_in_whole_steps() -> None:
    """What is left of contact, solved as a whole, must be as accurate as the residuals of the others."""
    steps = [LoadStep(f"{way}", supports=jaws(way).supports) for way in (-1e-3, 1e-3, -1e-3)]
    states = solve_steps(ContactProblem(jaws(-1e-3), MPI.COMM_SELF), steps)
    gripped = [float(state.contact.normal_force[state.contact.on_pair(0)].sum()) for state in states]
    assert gripped[0] > 50.0
    assert gripped == pytest.approx([gripped[0], 0.0, gripped[0]], rel=1e-6, abs=1e-6)
    for state in states:
        assert isinstance(state, DeformedState)
        assert state.fractions == (1.0,)
        assert len(state.solution.history) < 7


def test_friction_holds_both_parts_of_a_bar_that_is_drawn_at_a_section() -> None:
    """Each of its ends rubs on a wall, and the section lets one part move along the other."""
    bar = Body(block((0, 0, 0), (1, 1, 4), (1, 1, 4)), STEEL)
    walls = [RigidPlane((0, 0, 0), (0, 0, 1)), RigidPlane((0, 0, 4), (0, 0, -1))]
    contacts = [ContactPair(Surface("bar", f"z{end}"), wall, RUBS) for end, wall in enumerate(walls)]
    pushed = Preload("bar", Section((0.5, 0.5, 2), (0, 0, 1)), force=-50.0)
    scene = Scene({"bar": bar}, [Support("bar", "x0", (0.0, None, None))], [], contacts, preloads=[pushed])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert unresisted_motions(state.torn, ()) == ()
    assert state.contact.normal_force.sum() == pytest.approx(100.0)
