"""Bodies that pass through each other for want of a pair or of a larger surface are told of."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidSurface, Scene, Support, Surface, solve_scene
from fenics_contact._scene.pair_geometry import outline_of, unpaired
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke, PlaneStrain
from tests.contact.passing import pressed

TOUCHING = (
    "bodies 'upper' and 'lower' touch at 5 facets, without a pair or tie between them: add a ContactPair or"
)


def told(scene: Scene, caplog: pytest.LogCaptureFixture) -> list[str]:
    caplog.set_level(logging.WARNING, "fenics_contact")
    solve_scene(scene, MPI.COMM_SELF)
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (pressed(0.0, 0.0), TOUCHING),
        (pressed(0.01, 0.1), "'upper' and 'lower' pass into each other at 5 facets, without a pair or tie"),
        (pressed(-0.3, 0.0), "'upper' and 'lower' overlap unloaded at 13 facets, without a pair or tie"),
        (
            pressed(0.0, 0.1, pair="half"),
            "'upper' and 'lower' pass into each other at 2 facets, outside the surfaces",
        ),
    ],
    ids=["touching", "passing", "overlapping", "half a surface"],
)
def test_bodies_that_nothing_keeps_apart_are_told_of(
    scene: Scene, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    """By the plan before, which knows where supports move them, and in a warning after.

    How far a pair of too small surfaces lets them is known after alone.
    """
    (found,) = told(scene, caplog)
    assert words in found
    assert "add a ContactPair" in found or "name more of their facets" in found
    if "outside" in found:
        assert scene.plan().unpaired == ()
        return
    as_supports = words.replace("pass into each other", "pass into each other as their supports move them")
    (planned,) = scene.plan().unpaired
    assert as_supports in planned
    assert f"\nno pair         {planned}" in str(scene.plan())


@pytest.mark.parametrize(
    "scene",
    [pressed(0.0, 0.1, pair="whole"), pressed(0.0, 0.1, pair="tie"), pressed(0.2, 0.1)],
    ids=["pair", "tie", "apart"],
)
def test_bodies_that_keep_apart_are_not_told_of(scene: Scene, caplog: pytest.LogCaptureFixture) -> None:
    assert told(scene, caplog) == []
    assert scene.plan().unpaired == ()
    assert "no pair" not in str(scene.plan())


def plates(into: float, *, cells: tuple[int, int] = (4, 5), along: float = 0.0) -> Scene:
    """A flat plate that reaches into a block, or begins ``along`` behind its start, with a pair between."""
    flat = rectangle((0.0, into - 0.05), (2.0, into), cells)
    bodies = {"flat": flat, "high": rectangle((along, 0.0), (along + 2.0, 1.0), (1, 1))}
    pair = ContactPair(Surface("high", "y0"), Surface("flat", "y1"), discretisation="node")
    return Scene({name: Body(mesh, PlaneStrain(1.0, 0.3)) for name, mesh in bodies.items()}, contacts=[pair])


def entered(scene: Scene, way: tuple[float, float]) -> int:
    """Return how many facets outside of the pair pass into the other body as the plate moves."""
    moved = {name: np.zeros_like(body.mesh.points) for name, body in scene.bodies.items()}
    moved["flat"] += way
    outlines = {name: outline_of(body.mesh) for name, body in scene.bodies.items()}
    return unpaired(scene, ("flat", "high"), outlines, moved, float(np.abs(way).max())).counts[2]


def test_sides_that_follow_a_surface_of_a_pair_as_deep_as_it_passes_are_not_told_of() -> None:
    """By nodes a master passes between nodes of a coarse slave, here by more than its flat cells are high."""
    assert entered(plates(0.0), (0.0, 0.03)) == 0
    assert entered(replace(plates(0.0), contacts=[]), (0.0, 0.03)) == 4 + 6 + 1
    beside = plates(0.02, along=2.1)
    assert entered(beside, (0.2, 0.0)) == 2  # of its five cells are as high as the block: a true passing
    assert plates(0.03).plan().unpaired == ()  # as a press fit, before any load


def test_bodies_flatter_than_their_facets_are_long_do_not_overlap_where_they_touch() -> None:
    assert plates(0.0, cells=(1, 1)).plan().unpaired == ()


ON_RANKS = """
    import logging, sys
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.contact.passing import pressed

    logging.basicConfig(stream=sys.stdout, format="%(message)s", level=logging.WARNING)
    solve_scene(pressed(0.0, 0.0), MPI.COMM_WORLD)
"""


def test_ranks_share_the_facets_and_one_of_them_tells(mpirun: Callable[..., str]) -> None:
    (found,) = mpirun(ON_RANKS, 2).splitlines()
    assert found.startswith(TOUCHING)


def test_a_rigid_surface_that_turns_far_moves_rubber_on_an_arc_and_not_along_its_tangent() -> None:
    """A whole turn brings it back; linearised it would pass through all that is near."""
    meshes = {"wheel": rectangle((-1, -1), (1, 1), (2, 2)), "near": rectangle((3, -1), (4, 1), (1, 2))}
    turned = RigidSurface("wheel", "x1", at=(0.0, 0.0), displacement=(0.0, 0.0), rotation=2.0 * np.pi)
    bodies = {name: Body(mesh, NeoHooke(1.0, 0.3)) for name, mesh in meshes.items()}
    assert Scene(bodies, [turned, Support("near", "x1")]).plan().unpaired == ()
