"""Bodies that pass through each other for want of a pair or of a larger surface are told of."""

from __future__ import annotations

import logging

import pytest
from mpi4py import MPI

from fenics_contact.contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene import Body, ContactPair, IsotropicElasticity, Scene, Support, Surface, Tie

STEEL = IsotropicElasticity(1000.0, 0.3)


def pressed(gap: float, force: float, *, pair: str = "none", side: float = 0.0) -> Scene:
    """A block over a wider plate, pressed down, and a post beside them that is in nobody's way."""
    cells = (2, 2, 2)
    upper = block((side, 0, 1 + gap), (side + 1, 1, 2 + gap), cells)
    half = upper.surfaces["z0"][upper.points[upper.surfaces["z0"]][..., 0].max(axis=1) < side + 0.6]
    upper = BodyMesh(upper.points, upper.cells, {**upper.surfaces, "half": half})
    bodies = {
        "upper": Body(upper, STEEL),
        "lower": Body(block((-0.5, -0.5, 0), (1.5, 1.5, 1), (3, 3, 2)), STEEL),
        "post": Body(block((4, 4, 0), (5, 5, 1), (1, 1, 1)), STEEL),
    }
    supports = [Support("upper", "z1", (0.0, 0.0, -force)), Support("lower", "z0"), Support("post", "z0")]
    sides = Surface("upper", "half" if pair == "half" else "z0"), Surface("lower", "z1")
    contacts = [ContactPair(*sides, discretisation="node")] if pair in ("whole", "half") else []
    return Scene(bodies, supports, [], contacts, ties=[Tie(*sides)] if pair == "tie" else [])


def told(scene: Scene, caplog: pytest.LogCaptureFixture) -> list[str]:
    caplog.set_level(logging.WARNING, "fenics_contact")
    solve_scene(scene, MPI.COMM_SELF)
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (pressed(0.0, 0.0), "facets of bodies 'upper' and 'lower' touch, without a pair or tie between them"),
        (pressed(0.01, 0.1), "'upper' and 'lower' pass into each other, without a pair or tie"),
        (pressed(-0.3, 0.0), "'upper' and 'lower' overlap unloaded, without a pair or tie"),
        (pressed(0.0, 0.1, pair="half"), "'upper' and 'lower' pass into each other, outside the surfaces"),
    ],
    ids=["touching", "passing", "overlapping", "half a surface"],
)
def test_bodies_that_nothing_keeps_apart_are_told_of(
    scene: Scene, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    (found,) = told(scene, caplog)
    assert words in found
    assert "add a ContactPair" in found or "name more of their facets" in found


@pytest.mark.parametrize(
    "scene",
    [pressed(0.0, 0.1, pair="whole"), pressed(0.0, 0.1, pair="tie"), pressed(0.2, 0.1)],
    ids=["pair", "tie", "apart"],
)
def test_bodies_that_keep_apart_are_not_told_of(scene: Scene, caplog: pytest.LogCaptureFixture) -> None:
    assert told(scene, caplog) == []
