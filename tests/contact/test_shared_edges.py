"""Edges between two contact pairs, or two ties: their nodes are points of one of them alone."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    solve_scene,
)
from fenics_contact._scene.pairs import Discretisation
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from tests.contact.half_tied import FREE, MATERIAL, TIED, TOP, half_tied, solved

PARTS = ((1, 1), (2, 3), (6, 5))


def two_pairs(discretisation: Discretisation = "node", first: float = 0.4, columns: int = 5) -> Scene:
    """A block that is pressed on a strip, dragged, and rubs otherwise on its left half."""
    scene = half_tied(columns, discretisation, sliding=False)
    drag = RigidSurface("up", "y1", (0.7, 1.5), force=(2.1e-3, -1e-2), moment=-4e-4)
    pairs = [
        ContactPair(FREE, TOP, Coulomb(first), discretisation),
        ContactPair(TIED, TOP, Coulomb(0.1), discretisation),
    ]
    return replace(scene, ties=[], contacts=pairs, supports=[scene.supports[0], drag])


def of_rubber(discretisation: Discretisation = "node") -> Scene:
    scene = two_pairs(discretisation)
    bodies = {name: replace(body, material=NeoHooke(1.0, 0.3)) for name, body in scene.bodies.items()}
    held = [Support("low", "y0"), Support("up", "y1", (0.02, -0.02))]
    return replace(scene, bodies=bodies, supports=held)


@pytest.mark.parametrize("scene", [two_pairs(), two_pairs("mortar"), of_rubber(), of_rubber("mortar")])
def test_an_edge_between_two_contacts_has_one_answer_for_every_partition(scene: Scene) -> None:
    first, *others = (solved(scene, parts) for parts in (PARTS[:2] if scene.is_nonlinear else PARTS))
    expected, force = first.gather_displacement("up"), first.contact.force
    # Moving means over the facets of either side differ: both pairs keep theirs.
    both = scene.is_nonlinear and scene.contacts[0].by_mortar
    assert first.contact.points.count == 7 + both
    assert first.contact.points.area.sum() == pytest.approx(2.0)
    for other in others:
        found = other.gather_displacement("up")
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
        np.testing.assert_allclose(other.contact.force, force, rtol=0.0, atol=1e-6 * np.abs(force).max())


def on_edge(state: State) -> int:
    (edge,) = np.flatnonzero(np.isclose(state.contact_places[:, 0], 1.0, atol=0.05))
    return int(edge)


def test_the_edge_rubs_as_the_pair_named_first_and_its_pressure_fits_those_beside() -> None:
    scene = two_pairs()
    for pairs, friction in ((scene.contacts, 0.4), (scene.contacts[::-1], 0.1)):
        contact = (state := solved(replace(scene, contacts=pairs), (1, 1))).contact
        edge = on_edge(state)
        assert contact.slip_bound[edge] == pytest.approx(friction * contact.normal_force[edge])
        assert contact.points.pair[edge] == 0
        order = np.argsort(state.contact_places[:, 0])
        left, middle, right = contact.pressure[order[2:5]]
        assert middle == pytest.approx(0.5 * (left + right), rel=0.05)


def test_nodes_of_two_contacts_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "fenics_contact"):
        solved(two_pairs(), (1, 1))
    words = "of low tied on up y0 leaves out 1 node, where force and friction are those of low free on up y0"
    assert words in caplog.text


@pytest.mark.parametrize(("turn", "depth", "count"), [(0.0, 1e-9, 7), (0.6, 0.0, 8), (0.0, 1e-3, 8)])
def test_a_corner_and_a_lower_obstacle_keep_their_points(turn: float, depth: float, count: int) -> None:
    """Two floors meet under the block: one plane, a roof of 34°, or one lower than the other."""
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (6, 3))
    base = mesh.surfaces["y0"]
    left = mesh.points[base].mean(axis=1)[:, 0] < 1.0
    mesh = replace(mesh, surfaces={**mesh.surfaces, "left": base[left], "right": base[~left]})
    planes = RigidPlane((1.0, 0.0), (0.0, 1.0)), RigidPlane((1.0, -depth), (np.sin(turn), np.cos(turn)))
    names = ("left", "right")
    pairs = [ContactPair(Surface("up", n), p) for n, p in zip(names, planes, strict=True)]
    scene = Scene({"up": Body(mesh, MATERIAL)}, [Support("up", "y1", (0.0, -0.01))], contacts=pairs)
    assert solve_scene(scene, MPI.COMM_SELF).contact.points.count == count


def test_the_same_surfaces_under_two_names_are_one_contact() -> None:
    scene = two_pairs()
    low = scene.bodies["low"]
    surfaces = {**low.mesh.surfaces, "again": low.mesh.surfaces["free"]}
    bodies = {**scene.bodies, "low": replace(low, mesh=replace(low.mesh, surfaces=surfaces))}
    turned = ContactPair(Surface("low", "again"), TOP, Coulomb(0.4), "node")
    points = solved(replace(scene, bodies=bodies, contacts=[*scene.contacts, turned]), (1, 1)).contact.points
    assert list(np.bincount(points.pair, minlength=3)) == [4, 3, 0]
    assert points.area.sum() == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("sliding", "kept"),
    [((False, False), [4, 3]), ((True, True), [4, 3]), ((True, False), [3, 4]), ((False, True), [4, 3])],
)
def test_an_edge_between_two_ties_is_tied_once(sliding: tuple[bool, bool], kept: list[int]) -> None:
    scene = two_pairs()
    ties = [
        Tie(s, TOP, sliding=slides, discretisation="node")
        for s, slides in zip((FREE, TIED), sliding, strict=True)
    ]
    held = [Support("low", "y0"), Support("up", "y1", (1e-3, 2e-3))]
    tied = [solved(replace(scene, contacts=[], ties=ties, supports=held), parts) for parts in PARTS]
    expected = tied[0].gather_displacement("up")
    for state in tied:
        assert list(np.bincount(state.torn.ties.pair, minlength=2)) == kept
        np.testing.assert_allclose(
            state.gather_displacement("up"), expected, rtol=0.0, atol=1e-8 * np.abs(expected).max()
        )
