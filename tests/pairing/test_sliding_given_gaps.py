"""Gaps that pairs give in place of measured ones, between bodies that move far."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact import Body, ContactPair, Scene, Surface
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from tests.pairing.sliding_scenes import free, on_arch, sliding

DISCRETISATIONS = ("node", "mortar")


def with_pair(scene: Scene, **given: Any) -> Scene:
    (pair,) = scene.contacts
    return replace(scene, contacts=[replace(pair, **given)])


def from_beside(**given: Any) -> tuple[SlidingContact, np.ndarray]:
    """A slider that overhangs the end of its bed, and coordinates that bring all of it onto the bed."""
    bed, slider = rectangle((0, 0), (4, 1), (16, 4)), rectangle((-1, 1), (0.6, 1.6), (8, 3))
    scene = Scene(
        {"bed": Body(bed, NeoHooke(1.0, 0.3)), "slider": Body(slider, NeoHooke(1.0, 0.3))},
        contacts=[ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), **given)],
    )
    moved = scene.points.copy()
    moved[bed.n_nodes :, 0] += 1.5
    return sliding(scene), moved


@pytest.mark.parametrize("discretisation", DISCRETISATIONS)
@pytest.mark.parametrize("kind", ["hexahedron", "quadrilateral"])
def test_the_given_gap_is_that_of_the_undeformed_bodies(kind: str, discretisation: str) -> None:
    """Also where distances are means over facets, which differ from those of the true surfaces."""
    scene = with_pair(on_arch(kind), discretisation=discretisation)
    measured = sliding(scene).at(scene.points).points
    assert np.ptp(measured.gap) > (1e-3 if discretisation == "mortar" else 1e-10), "not even by itself"
    for given, wanted in (({"gap": 0.02}, 0.02), ({"interference": 0.01, "adjust": 0.1}, -0.01)):
        points = sliding(with_pair(scene, **given)).at(scene.points).points
        assert points.gap == pytest.approx(np.full(measured.count, wanted), abs=1e-15)
        assert np.array_equal(points.distance, measured.distance)
        assert points.given.all()
    apart = sliding(with_pair(scene, gap=0.02, adjust=0.01)).at(scene.points).points
    assert np.array_equal(apart.gap, measured.gap), "no node lies within adjust"
    assert not apart.given.any()


@pytest.mark.parametrize("discretisation", DISCRETISATIONS)
def test_nodes_that_meet_their_master_later_have_the_gap_of_those_beside_them(discretisation: str) -> None:
    for given, wanted in (({"interference": 0.02}, -0.02), ({"gap": 0.03}, 0.03), ({"adjust": 0.01}, 0.0)):
        contact, moved = from_beside(discretisation=discretisation, **given)
        now, then = contact.at(contact.scene.points), contact.at(moved)
        assert now.points.count < then.points.count == 9
        assert then.points.gap == pytest.approx(np.full(9, wanted), abs=1e-13)
        declared = True if "adjust" not in given else np.isin(then.key, now.key)
        assert np.array_equal(then.points.given, np.full(9, True) & declared)
    contact, moved = from_beside(discretisation=discretisation, gap=lambda x: 0.01 * (2.0 + x[:, 0]))
    points = contact.at(moved).points
    assert points.gap == pytest.approx(0.01 * (2.0 + contact.scene.points[points.slave, 0]), abs=1e-13)


def test_what_a_design_moves_is_added_to_the_given_gap() -> None:
    scene = with_pair(on_arch("quadrilateral"), gap=0.02, discretisation="mortar")
    mesh = scene.bodies["high"].mesh
    moved = scene.reshaped({"high": mesh.points + 0.01 * np.sin(3.0 * mesh.points[:, :1])})
    before, after = (SlidingContact.of(each, free(each)).at(each.points).points for each in (scene, moved))
    change = after.distance - before.distance
    assert np.abs(change).max() > 1e-3
    assert after.gap - before.gap == pytest.approx(change, abs=1e-14)
