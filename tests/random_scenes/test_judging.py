"""Whoever judges random scenes notices wrong answers, wrong refusals, hangs and crashes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ClosureTable,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    ExponentialClosure,
    FrictionTable,
    LinearClosure,
    Pressure,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from tools.random_scenes import runner
from tools.random_scenes.generator import Sample, sample
from tools.random_scenes.judge import Outcome, Verdict
from tools.random_scenes.refusals import unjust
from tools.random_scenes.revolved import revolved
from tools.random_scenes.verifier import complaints

STEEL = IsotropicElasticity(1.0, 0.3)
ALONG, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def stacked(push: float = 0.001) -> Sample:
    """A block on another one of other cells, pressed and pushed; some points slip, some lift off."""
    scene = Scene(
        {
            "lower": Body(block((0, 0, 0), (2, 1.3, 0.7), (5, 3, 3)), STEEL),
            "upper": Body(block((0.3, 0.1, 0.7), (1.7, 1.1, 1.5), (3, 3, 3)), STEEL),
        },
        [Support("lower", "z0")],
        [Traction("upper", "z1", (push, 0.0, -0.003))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.5), discretisation="node")],
    )
    return Sample(-1, "stacked", scene, None, 1e-8)


@pytest.fixture(scope="module")
def state() -> State:
    made = stacked()
    return solve_scene(made.scene, MPI.COMM_SELF, partitions=made.cut, tolerance=made.tolerance)


def test_a_right_answer_has_nothing_wrong(state: State) -> None:
    assert not complaints(state, stacked())


@pytest.mark.parametrize(
    ("part", "factor", "complaint"),
    [
        ("normal_force", 1.001, "balance"),
        ("normal_force", -1.0, "tension"),
        ("friction_force", 1.5, "cone"),
        ("friction_force", -1.0, "friction"),
    ],
)
def test_wrong_forces_are_noticed(state: State, part: str, factor: float, complaint: str) -> None:
    contact = replace(state.contact, **{part: factor * getattr(state.contact, part)})
    assert any(complaint in found for found in complaints(replace(state, contact=contact), stacked()))


@pytest.mark.parametrize(
    ("body", "change", "complaint"),
    [
        ("upper", lambda u: 1.01 * u, "equilibrium"),
        ("upper", lambda u: 1.01 * u, "energy"),
        ("lower", lambda u: u + 0.01 * np.abs(u).max(), "supports"),
        ("upper", lambda u: u - 0.01 * np.abs(u).max() * UP, "penetration"),
        ("upper", lambda u: u - 0.01 * np.abs(u).max() * ALONG, "friction"),
        ("upper", lambda u: u + 0.01 * np.abs(u).max() * UP, "complementarity"),
    ],
)
def test_wrong_displacements_are_noticed(
    state: State, body: str, change, complaint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = State.gather_displacement

    def wrong(self: State, name: str) -> np.ndarray:
        u = right(self, name)
        return np.asarray(change(u)) if name == body else u

    monkeypatch.setattr(State, "gather_displacement", wrong)
    found = complaints(state, stacked())
    assert any(complaint in words for words in found), found


@pytest.mark.parametrize(
    ("part", "change", "complaint"),
    [
        ("gap", lambda gap: gap + 1e-3, "not a gap apart along the normal"),
        ("area", lambda area: 2.0 * area, "areas of points are off"),
        ("normal", lambda normal: normal[:, [2, 1, 0]], "not orthonormal"),
        ("slave", lambda slave: np.roll(slave, 1), "not a gap apart along the normal"),
    ],
)
def test_contact_points_in_the_wrong_place_are_noticed(state: State, part, change, complaint: str) -> None:
    points = replace(state.contact.points, **{part: change(getattr(state.contact.points, part))})
    found = complaints(replace(state, contact=replace(state.contact, points=points)), stacked())
    assert any(complaint in words for words in found), found


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"closure": LinearClosure(0.2)}, "complementarity"),
        ({"closure": ExponentialClosure(0.003, 0.01)}, "penetration"),
        ({"closure": ClosureTable((0.0, 0.01), (0.0, 0.003))}, "complementarity"),
        ({"friction": Coulomb(0.5, stick_stiffness=0.1)}, "friction"),
        ({"friction": Coulomb(FrictionTable((0.0, 0.01), (0.5, 0.3)))}, "cone"),
        ({"friction": Coulomb(0.5, shear_limit=0.002)}, "cone"),
    ],
)
def test_answers_to_another_law_of_surfaces_are_noticed(state: State, change, complaint: str) -> None:
    made = stacked()
    softer = replace(made.scene, contacts=[replace(made.scene.contacts[0], **change)])
    right = solve_scene(softer, MPI.COMM_SELF, tolerance=made.tolerance)
    assert not complaints(right, made)
    wrong = replace(state, torn=replace(state.torn, scene=softer))
    found = complaints(wrong, made)
    assert any(complaint in words for words in found), found


@pytest.mark.parametrize("axisymmetric", [False, True])
def test_springs_of_another_stiffness_are_noticed(axisymmetric: bool) -> None:
    material = STEEL if axisymmetric else PlaneStrain(1.0, 0.3)
    body = Body(rectangle((0, 0), (2, 1), (4, 3)), material, axisymmetric)
    springs = ElasticFoundation("body", "y0", 0.1)
    supports, loads = [Support("body", "x0", (0.0, None))], [Pressure("body", "y1", 0.01)]
    scene = Scene({"body": body}, supports, loads, foundations=[springs])
    made = Sample(-1, "on springs", scene, None, 1e-8)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    assert not complaints(state, made)
    stiffer = replace(scene, foundations=[replace(springs, stiffness=0.11)])
    found = complaints(replace(state, torn=replace(state.torn, scene=stiffer)), made)
    assert any("balance" in words for words in found), found


def test_gaps_to_the_facets_of_a_round_master_are_noticed() -> None:
    floor = block((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0), (5, 5, 2))
    scene = Scene(
        {"floor": Body(floor, STEEL), "ball": Body(hemisphere(2.0, 3), STEEL)},
        [Support("floor", "z0"), Support("ball", "top", (0.0, 0.0, -0.001))],
        contacts=[ContactPair(Surface("floor", "z1"), Surface("ball", "contact"), discretisation="node")],
    )
    for geometry, noticed in (("best", False), ("reconstructed", True), ("faceted", True)):
        pair = replace(scene.contacts[0], geometry=geometry)
        made = Sample(-1, "ball", replace(scene, contacts=[pair]), None, 1e-8)
        found = complaints(solve_scene(made.scene, MPI.COMM_SELF, tolerance=1e-8), made)
        assert any("a gap apart along the normal" in words for words in found) == noticed, (geometry, found)


def test_a_point_that_is_lost_is_noticed(state: State) -> None:
    points, kept = state.contact.points, np.arange(1, state.contact.points.count)
    fewer = points.part(kept)
    found = complaints(replace(state, contact=replace(state.contact, points=fewer)), stacked())
    assert any("above the master are no contact points" in words for words in found), found


def test_a_refusal_of_what_is_held_is_noticed() -> None:
    error = InfeasibleError("every body must be held by supports, contact or friction")
    assert "of the loads can be balanced" in unjust(error, stacked(push=0.001))
    assert not unjust(error, stacked(push=0.002))


def test_a_refusal_for_a_reason_that_does_not_hold_or_is_not_known_is_noticed() -> None:
    for message in ("supports must agree where they meet", "bodies must not overlap at the start"):
        assert "does not hold" in unjust(InvalidInputError(message), stacked())
    assert "no reason that is known" in unjust(InvalidInputError("it is Sunday"), stacked())


def test_a_scene_without_end_and_a_process_that_dies_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    (late,) = runner.judged([20_000], processes=1, limit=0.0)
    assert late.outcome is Outcome.HANG
    monkeypatch.setattr(runner.sys, "executable", "/bin/false")  # type: ignore[attr-defined]
    (dead,) = runner.judged([20_000], processes=1, limit=60.0)
    assert dead.outcome is Outcome.DIED
    told = runner.table(
        [
            late,
            dead,
            Verdict(1, Outcome.REFUSED, detail="a, got b"),
            Verdict(2, Outcome.REFUSED, detail="a, got c"),
        ]
    )
    assert "hang            1" in told
    assert "       2 a\n" in told


def test_a_seed_is_one_scene_and_seeds_meet_everything() -> None:
    first, again = sample(7), sample(7)
    assert first.words == again.words
    for name, body in first.scene.bodies.items():
        np.testing.assert_array_equal(body.mesh.points, again.scene.bodies[name].mesh.points)
    words = " ".join(sample(seed).words for seed in range(300))
    for part in (
        "plane", "space", "hexahedron ", "tetrahedron ", "triangle ", "quadrilateral ", "hexahedron27",
        "half a ball", "half a disc", "mortar", "node", "Coulomb", "Tresca", "frictionless", "tied",
        "but sliding", "rigid ball", "rigid bar", "and a wall", "no load", "pressure", "degrees warmer",
        "of position", "one facet", "guided", "free", "boxes", "graph", "bisected", "default partition",
        "turned by quarters", "shifted by 10000", "orthotropic", "nu=0.4999", "thin", "side by side",
        "on rollers", "on springs", "linear closure", "exponential closure", "table closure", "elastic slip",
        "by pressure", "with a shear limit",
    ):  # fmt: skip
        assert part in words, part
    words = " ".join(revolved(seed).words for seed in range(60))
    for part in ("of revolution", "bore 0,", "wound", "twisted", "on springs", "two", "side by side"):
        assert part in words, part
