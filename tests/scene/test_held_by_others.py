"""Errors on bodies that are not held name the body without a support, and that no friction stops a tip."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    gallery,
    solve_scene,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.materials import IsotropicElasticity

STEEL = IsotropicElasticity(2.1e5, 0.3)


def test_a_body_that_goes_with_the_pushed_one_is_named() -> None:
    scene = Scene(
        bodies={
            "lower": Body(gallery.block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL),
            "upper": Body(gallery.block((0, 0, 1), (1, 1, 2), (1, 1, 1)), STEEL),
        },
        supports=[Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))],
        loads=[Traction("upper", "z1", (0.0, 0.0, -1.0))],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"))],
    )
    words = r"body 'upper' can move away .* With it goes 'lower', which has no support of its own"
    with pytest.raises(InfeasibleError, match=words):
        solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize("friction", [None, Coulomb(0.3)])
def test_a_flange_that_tips_over_its_edge_is_not_sent_for_friction(friction: Coulomb | None) -> None:
    """The load acts at x = 10, the base ends at x = 5."""
    scene = Scene(
        bodies={
            "base": Body(gallery.block((0, 0, -1), (5, 4, 0), (5, 1, 1)), STEEL),
            "flange": Body(gallery.block((0, 0, 0), (10, 4, 1), (10, 1, 1)), STEEL),
        },
        supports=[Support("base", "z0")],
        loads=[Traction("flange", "x1", (0.0, 0.0, -25.0))],
        contacts=[ContactPair(Surface("flange", "z0"), Surface("base", "z1"), friction)],
    )
    words = (
        r"It turns about the axis through \(5, 2, 0\) along \(0, 1, 0\), pressed by flange z0 on base z1, "
        r"and no friction would stop that"
    )
    with pytest.raises(InfeasibleError, match=words):
        solve_scene(scene, MPI.COMM_SELF)


def test_a_body_that_friction_would_hold_is_sent_for_it() -> None:
    scene = Scene(
        bodies={"block": Body(gallery.block((0, 0, 0), (4, 1, 1), (4, 1, 1)), STEEL)},
        loads=[Traction("block", "z1", (0.1, 0.0, -1.0))],
        contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    with pytest.raises(InfeasibleError, match=r"or give its contact friction$"):
        solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize("height", [0.0, -0.5])
def test_a_plane_whose_normal_is_reversed_is_named(height: float) -> None:
    scene = Scene(
        bodies={"block": Body(gallery.block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL)},
        supports=[Support("block", "z1")],
        contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, height), (0, 0, -1)))],
    )
    words = r"body 'block' lies inside the RigidPlane, whose normal points out of it .*: reverse it"
    with pytest.raises(InvalidInputError, match=words):
        solve_scene(scene, MPI.COMM_SELF)
