"""Contact of single nodes of a slave."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, LinearClosure, Scene, Support, Surface, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke

STIFFNESS, DOWN = 1e5, 1e-3
SLAVE, MASTER = Surface("upper", "z0"), Surface("lower", "z1")


def table(large: bool = False, **pair: Any) -> Scene:
    """A block of nine nodes below stands on its four corners; meshes do not match."""
    upper = block((0.5, 0.5, 1), (2.5, 2.5, 2), (2, 2, 1))
    low = upper.points[:, 2] == 1.0
    rim = (np.abs(upper.points[:, :2] - 1.5) == 1.0).all(axis=1)
    upper = replace(upper, node_sets={"feet": np.flatnonzero(low & rim), "top": np.flatnonzero(~low)})
    material = (NeoHooke if large else IsotropicElasticity)(1000.0, 0.3)
    bodies = {"lower": Body(block((0, 0, 0), (3, 3, 1), (5, 5, 2)), material), "upper": Body(upper, material)}
    supports = [Support("lower", "z0"), Support("upper", "z1", (0.0, 0.0, -DOWN))]
    given = {"closure": LinearClosure(STIFFNESS), "nodes": "feet", "geometry": "faceted"} | pair
    return Scene(bodies, supports, contacts=[ContactPair(**({"slave": SLAVE, "master": MASTER} | given))])


@pytest.mark.parametrize("large", [False, True])
def test_only_the_nodes_of_the_set_touch_by_their_law(large: bool) -> None:
    scene = table(large)
    (pair,) = scene.contacts
    assert pair.reason == "node, as the nodes of 'feet' touch"
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    contact = state.contact
    assert contact.points.count == 4
    force, area = contact.normal_force, 0.25
    np.testing.assert_allclose(force, force.mean(), rtol=1e-6)
    np.testing.assert_allclose(contact.gap, -force / (STIFFNESS * area), rtol=1e-6)
    np.testing.assert_allclose(4 * force.mean(), -state.reactions()["upper z1"].force[2], rtol=1e-6)
    middle = np.flatnonzero((scene.bodies["upper"].mesh.points == (1.5, 1.5, 1.0)).all(axis=1))
    there = np.flatnonzero(np.abs(scene.bodies["lower"].mesh.points - (1.8, 1.8, 1.0)).max(axis=1) < 1e-9)
    deep = state.gather_displacement("lower")[there, 2] - state.gather_displacement("upper")[middle, 2]
    assert deep[0] > 0.2 * DOWN  # nothing keeps the middle out


def test_small_and_large_displacements_agree() -> None:
    small, large = (solve_scene(table(much), MPI.COMM_SELF, tolerance=1e-11) for much in (False, True))
    np.testing.assert_allclose(large.contact.normal_force, small.contact.normal_force, rtol=3e-3)


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ({"nodes": "hands"}, r"node set 'hands' of body 'upper', which has \['feet', 'top'\]"),
        ({"nodes": "top"}, r"9 of 9 of 'top' do not: name a slave surface that has them all"),
        ({"discretisation": "mortar"}, r"is by nodes and between two bodies, got discretisation='mortar'"),
        ({"master": SLAVE}, r"by nodes and between two bodies, got a body that meets itself"),
    ],
)
def test_nodes_that_cannot_touch_are_refused(pair: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        table(**pair)


def test_other_nodes_of_the_same_surfaces_may_touch_by_another_law() -> None:
    scene = table()
    (first,) = scene.contacts
    second = replace(first, nodes=None)
    assert len(replace(scene, contacts=[first, second]).contacts) == 2
