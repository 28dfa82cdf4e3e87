"""Gaps that users give, on one rank and on several."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface
from fenics_contact._pairing.points import ContactPoints
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.gallery import block, half_cylinder, rectangle
from fenics_contact.materials import PlaneStrain
from tests.conftest import run_on_ranks
from tests.feti.scenes import STEEL
from tests.pairing.given_gaps_on_ranks import collect

SHIFTED = 0.03


def plane_bodies(**pair: Any) -> Scene:
    lower = Body(rectangle((0, 0), (2, 1), (5, 2)), PlaneStrain(100.0, 0.3))
    upper = Body(rectangle((0.1, 1 + SHIFTED), (1.9, 2), (4, 2)), PlaneStrain(100.0, 0.3))
    master = Surface("lower", "y1")
    return Scene(
        {"lower": lower, "upper": upper}, contacts=[ContactPair(Surface("upper", "y0"), master, **pair)]
    )


def solid_bodies(cell: str = "hexahedron", **pair: Any) -> Scene:
    lower = Body(block((0, 0, 0), (2, 2, 1), (5, 5, 2), cell), STEEL)
    upper = Body(block((0.1, 0.1, 1 + SHIFTED), (1.9, 1.9, 2), (4, 4, 2), cell), STEEL)
    master = Surface("lower", "z1")
    return Scene(
        {"lower": lower, "upper": upper}, contacts=[ContactPair(Surface("upper", "z0"), master, **pair)]
    )


def on_floor(**pair: Any) -> Scene:
    mesh = block((0, 0, SHIFTED), (2, 2, 1), (4, 4, 2))
    floor = RigidPlane((0, 0, 0), (0, 0, 1))
    return Scene({"upper": Body(mesh, STEEL)}, contacts=[ContactPair(Surface("upper", "z0"), floor, **pair)])


def round_on_flat(**pair: Any) -> Scene:
    """A half cylinder over a plate: the gap grows away from the middle."""
    roller = half_cylinder(10.0, 2.0, 8)
    roller = roller.moved(roller.points + np.array([0.0, 0.0, SHIFTED]))
    plate = block((-4, -1, -2), (4, 3, 0), (9, 3, 2))
    return Scene(
        {"plate": Body(plate, STEEL), "roller": Body(roller, STEEL)},
        contacts=[ContactPair(Surface("plate", "z1"), Surface("roller", "contact"), **pair)],
    )


SCENES: dict[str, Any] = {
    "plane, node": plane_bodies,
    "plane, mortar": lambda **pair: plane_bodies(discretisation="mortar", **pair),
    "solid, node": solid_bodies,
    "solid, mortar": lambda **pair: solid_bodies(discretisation="mortar", **pair),
    "tetrahedra, node": lambda **pair: solid_bodies("tetrahedron", **pair),
    "tetrahedra, mortar": lambda **pair: solid_bodies("tetrahedron", discretisation="mortar", **pair),
    "obstacle": on_floor,
    "round, node": round_on_flat,
    "round, mortar": lambda **pair: round_on_flat(discretisation="mortar", **pair),
}


def found(scene: Scene) -> ContactPoints:
    return build_torn_system(scene, decompose(scene, scene.partition(), MPI.COMM_SELF)).points


def places(scene: Scene, points: ContactPoints) -> np.ndarray:
    return scene.points[points.slave]


@pytest.mark.parametrize("name", SCENES)
def test_a_given_gap_holds_at_every_point(name: str) -> None:
    measured = found(SCENES[name]())
    np.testing.assert_array_equal(measured.gap, measured.distance)
    if "round" not in name:
        np.testing.assert_allclose(measured.gap, SHIFTED, rtol=1e-12)
    assert not measured.given.any()
    for given, wanted in (({"gap": 0.5}, 0.5), ({"gap": 0.0}, 0.0), ({"interference": 0.25}, -0.25)):
        points = found(SCENES[name](**given))
        np.testing.assert_array_equal(points.gap, np.full(measured.count, wanted))
        np.testing.assert_array_equal(points.distance, measured.distance)
        assert points.given.all()
        for same in ("slave", "normal", "area", "tangents"):
            np.testing.assert_array_equal(getattr(points, same), getattr(measured, same))


@pytest.mark.parametrize("name", SCENES)
def test_a_gap_may_depend_on_the_place_of_the_slave_node(name: str) -> None:
    for given, sign in (("gap", 1.0), ("interference", -1.0)):
        scene = SCENES[name](**{given: lambda points: np.abs(points[:, 0])})
        points = found(scene)
        np.testing.assert_array_equal(points.gap, sign * np.abs(places(scene, points)[:, 0]))
        assert np.ptp(points.gap) > 0.5


@pytest.mark.parametrize("disc", ["node", "mortar"])
def test_points_within_adjust_touch_and_others_keep_their_gap(disc: str) -> None:
    measured = found(round_on_flat(discretisation=disc)).gap
    limit = float(np.sort(measured)[len(measured) // 2])
    near = measured <= limit
    assert 0 < near.sum() < len(near)
    points = found(round_on_flat(discretisation=disc, adjust=limit))
    np.testing.assert_array_equal(points.gap, np.where(near, 0.0, measured))
    np.testing.assert_array_equal(points.given, near)
    pressed = found(round_on_flat(discretisation=disc, adjust=limit, interference=0.2))
    np.testing.assert_array_equal(pressed.gap, np.where(near, -0.2, measured))


def test_adjust_takes_shallow_overlap_away_and_refuses_deep_overlap() -> None:
    def sunk(depth: float, **pair: Any) -> Scene:
        scene = on_floor(**pair)
        mesh = scene.bodies["upper"].mesh
        return scene.moved({"upper": mesh.points - np.array([0.0, 0.0, SHIFTED + depth])})

    np.testing.assert_array_equal(found(sunk(0.3, adjust=0.3)).gap, 0.0)
    with pytest.raises(InvalidInputError, match="bodies must not overlap at the start: 25 nodes"):
        found(sunk(0.3, adjust=0.2))
    np.testing.assert_allclose(found(sunk(0.3, interference="measured")).gap, -0.3, rtol=1e-12)
    np.testing.assert_array_equal(found(sunk(0.3, interference=0.1)).gap, -0.1)


def test_measured_interference_leaves_out_what_is_adjusted() -> None:
    scene = on_floor(interference="measured", adjust=0.1)
    mesh = scene.bodies["upper"].mesh
    tilted = mesh.points - np.column_stack([np.zeros((mesh.n_nodes, 2)), SHIFTED + 0.1 * mesh.points[:, 0]])
    scene = scene.moved({"upper": tilted})
    points = found(scene)
    depth = 0.1 * places(scene, points)[:, 0]
    np.testing.assert_allclose(points.gap, np.where(depth <= 0.1 + 1e-12, 0.0, -depth), atol=1e-14)
    assert points.given.all()


def test_an_adjust_that_reaches_nothing_is_told(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        found(on_floor(adjust=0.01))
    (told,) = [record.getMessage() for record in caplog.records]
    assert told.startswith(
        "no point of upper z0 on rigid plane lies within adjust=0.01 of the master, the nearest has a "
        "distance of 0.03: nothing is put in touch"
    )


def test_two_pairs_have_their_own_gaps() -> None:
    scene = on_floor(gap=0.1)
    wall = ContactPair(Surface("upper", "x1"), RigidPlane((2.5, 0, 0), (-1, 0, 0)), interference=0.2)
    points = found(replace(scene, contacts=[*scene.contacts, wall]))
    np.testing.assert_array_equal(points.gap, np.where(points.pair == 0, 0.1, -0.2))


def test_better_known_surfaces_do_not_change_a_given_gap() -> None:
    scene = round_on_flat(gap=0.1, geometry="faceted")
    torn = build_torn_system(scene, decompose(scene, scene.partition(), MPI.COMM_SELF))
    np.testing.assert_array_equal(torn.finer_gap(), 0.1)
    free = round_on_flat(geometry="faceted")
    torn = build_torn_system(free, decompose(free, free.partition(), MPI.COMM_SELF))
    assert np.abs(torn.finer_gap() - torn.points.gap).max() > 1e-3


def test_interference_between_surfaces_that_supports_hold_is_refused() -> None:
    def held(**pair: Any) -> Scene:
        scene = solid_bodies(**pair)
        supports = [Support("upper", "z0", (None, None, 0.0)), Support("lower", "z1", (None, None, 0.0))]
        return replace(scene, supports=supports)

    assert found(held(gap=0.01)).count == 25
    with pytest.raises(InvalidInputError, match=r"25 contact nodes are pressed up to 0\.001 into"):
        found(held(interference=0.001))


@pytest.mark.parametrize(
    ("function", "error", "match"),
    [
        (
            lambda x: x[:, 0] - 1.0,
            InvalidInputError,
            r"gap of upper z0 .* positive everywhere, got -1 at \(0,",
        ),
        (lambda x: x, InvalidInputError, r"rigid plane must return finite numbers of shape \(25,\)"),
        (lambda x: np.nan * x[:, 0], InvalidInputError, "something other than finite numbers"),
        (lambda x: x[:, 7], UserCodeError, r"the function given as gap of upper z0 on rigid plane"),
    ],
)
def test_functions_that_return_no_lengths_are_refused(function: Any, error: Any, match: str) -> None:
    with pytest.raises(error, match=match):
        found(on_floor(gap=function))


# Given gaps are the same on any number of ranks, and so are the errors.
SCRIPT = Path(__file__).with_name("given_gaps_on_ranks.py")


@cache
def alone() -> dict[str, Any]:
    return collect(MPI.COMM_SELF)


@cache
def answer(ranks: int) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(run_on_ranks(SCRIPT, ranks).splitlines()[-1])
    return answer


@pytest.mark.parametrize("ranks", [2, 4])
def test_gaps_and_forces_are_those_of_one_rank(ranks: int) -> None:
    for found in answer(ranks)["found"]:
        for name, (gap, other) in alone().items():
            assert np.ptp(gap) > 0.0 or name == "press fit"
            np.testing.assert_allclose(found[name][0], gap, rtol=0, atol=1e-15)
            bound = 1e-6 * np.abs(other).max()
            assert bound > 0.0
            np.testing.assert_allclose(found[name][1], other, rtol=0, atol=bound)


def test_functions_that_differ_or_fail_on_one_rank_are_refused_on_all() -> None:
    for differ, negative in answer(2)["messages"]:
        assert "all ranks must be given the same" in differ
        assert "the gap given between upper z0 on lower z1" in differ
        assert "gap of upper z0 on lower z1 must be zero or positive everywhere, got" in negative
