"""Gaps whose error by flat facets is not small beside what moves are told, once; others are not."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Pressure,
    Scene,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact.gallery import half_disc, rectangle
from fenics_contact.materials import J2Plasticity, PlaneStrain
from tests.contact.gallery import block_on_plane, two_blocks
from tests.contact.press_fits import Disc, press_fit

CLAMPED = "gaps of hub inner on shaft outer are uncertain: "
DISCS: list[Disc] = ["node", "mortar"]


def clamp(pressure: float, around: int = 24, **pair: Any) -> Scene:
    """A quarter of a hub that is pressed onto a shaft of the same radius, on meshes that do not match."""
    scene = press_fit(around, 6, outside=around * 4 // 3, part=0.25, **pair)
    return replace(scene, loads=[Pressure("hub", "outer", pressure)])


def told(caplog: pytest.LogCaptureFixture, scene: Scene) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    return [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize("disc", DISCS)
def test_facets_of_a_clamped_hub_are_told(disc: Disc, caplog: pytest.LogCaptureFixture) -> None:
    (words,) = told(caplog, clamp(20.0, geometry="faceted", discretisation=disc))
    assert words.startswith(f"{CLAMPED}flat facets miss the true surfaces by up to 0.")
    assert (
        "against each other: take geometry='best', give the meshes their shapes (BodyMesh.shapes, " in words
    )
    assert "ContactPair(gap=...) or interference=..., or by adjust=..." in words


@pytest.mark.parametrize("disc", DISCS)
def test_nothing_is_told_where_the_gap_is_known(disc: Disc, caplog: pytest.LogCaptureFixture) -> None:
    assert told(caplog, clamp(20.0, discretisation=disc)) == []
    for given in ({"gap": 0.0}, {"interference": 0.01}, {"adjust": 0.5}):
        unknown = {"shapes": False, "geometry": "faceted", "discretisation": disc, **given}
        assert told(caplog, clamp(20.0, **unknown)) == []


def test_facets_of_surfaces_that_stay_far_apart_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    assert told(caplog, clamp(20.0, geometry="faceted", overlap=-1.0)) == []


def test_reconstructed_surfaces_are_told_where_little_moves(caplog: pytest.LogCaptureFixture) -> None:
    (words,) = told(caplog, clamp(2.0, shapes=False))
    assert words.startswith(f"{CLAMPED}surfaces reconstructed from the nodes miss the true surfaces by up to")
    assert "geometry='best'" not in words
    assert told(caplog, clamp(20.0, 96, shapes=False)) == []


@pytest.mark.parametrize("geometry", ["reconstructed", "faceted"])
def test_a_roller_is_told_of_by_facets_alone(
    geometry: Literal["reconstructed", "faceted"], caplog: pytest.LogCaptureFixture
) -> None:
    plate, disc = rectangle((0, -5), (6, 0), (48, 24)), half_disc(10.0, 8, grading=1.0)
    meshes, steel = {"plate": plate, "roller": disc}, PlaneStrain(2.1e5, 0.3)
    guides = [Support(name, "x0", (0.0, None)) for name in meshes]
    pair = ContactPair(Surface("plate", "y1"), Surface("roller", "contact"), geometry=geometry)
    scene = Scene(
        {name: Body(mesh, steel) for name, mesh in meshes.items()},
        [Support("plate", "y0", (None, 0.0)), *guides],
        [TotalForce("roller", "top", (0.0, -2000.0))],
        [pair],
    )
    assert len(told(caplog, scene)) == (geometry == "faceted")
    # Slave nodes lie on their surface, and the plate is flat.
    turned = replace(pair, slave=pair.master, master=pair.slave)
    # Nor is the roller's mesh fine enough for its contact.
    assert all(
        " is too small for its cells" in words for words in told(caplog, replace(scene, contacts=[turned]))
    )


def test_flat_surfaces_need_no_second_search(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from fenics_contact.feti import TornSystem

    def refuse(self: TornSystem) -> np.ndarray:
        raise AssertionError

    monkeypatch.setattr(TornSystem, "finer_gap", refuse)
    for scene in (two_blocks(None, push=0.0), block_on_plane(None, push=0.0), clamp(20.0)):
        assert told(caplog, scene) == []
    with pytest.raises(AssertionError):
        solve_scene(clamp(20.0, shapes=False), MPI.COMM_SELF, tolerance=1e-6)


def test_a_pair_is_told_of_once(caplog: pytest.LogCaptureFixture) -> None:
    scene = clamp(20.0, geometry="faceted")
    problem, counts = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-6), []
    with caplog.at_level(logging.WARNING):
        for pressure in (1e5, 20.0, 10.0):
            problem.solve(replace(scene, loads=[Pressure("hub", "outer", pressure)]))
            counts.append(len(caplog.records))
    assert counts == [0, 1, 1]


def test_a_shaft_that_turns_away_is_told(caplog: pytest.LogCaptureFixture) -> None:
    scene = press_fit(24, 8, interference=0.05, discretisation="mortar")
    hub = scene.bodies["hub"]
    turn = 0.4 * 2 * np.pi / 24
    way = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = replace(hub, mesh=hub.mesh.placed(way, np.zeros(2)))
    free = replace(scene, bodies={**scene.bodies, "hub": turned})
    # Weighted means over facets that are turned against each other do not face their nodes exactly, and
    # nothing else keeps the shaft from turning.
    words, further = told(caplog, free)
    assert further.startswith("body 'shaft' has turned by ")
    assert words.startswith("surfaces of hub inner on shaft outer slide by up to ")
    assert words.endswith("what only the facets keep from turning or shifting, or move it in the mesh")
    (pair,) = free.contacts
    assert told(caplog, replace(free, contacts=[replace(pair, discretisation="node")])) == []


def test_surfaces_that_press_and_slide_by_a_facet_of_the_master_are_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Where contact points do not follow: with small strains, also of metal."""
    low, high = rectangle((0, 0), (8, 1), (8, 2)), rectangle((1, 1), (3, 2), (3, 1))
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation="node")
    for material in (PlaneStrain(1e3, 0.3), J2Plasticity(1e3, 0.3, 1e3)):
        for way, facets in ((0.9, 0), (1.5, 1)):
            bodies = {"low": Body(low, material), "high": Body(high, material)}
            supports = [Support("low", "y0"), Support("high", "y1", (way, -1e-3))]
            words = told(caplog, Scene(bodies, supports, contacts=[pair]))
            assert len(words) == facets
            if facets:
                slid = "that press slide by up to 1.5 along each other, 1.5 facets of the master"
                assert words[0].startswith(f"surfaces of high y0 on low y1 {slid}")
                assert "a material for large deformations, such as StVenantKirchhoff" in words[0]
