"""Sections run through the middle of the contact, and say where they are."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidPlane, Scene, State, Support, Surface, solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.pictures import drawing as painting
from fenics_contact.pictures import plot_stress
from fenics_contact.pictures.canvas import Frame, face_on, oblique_view
from fenics_contact.pictures.section import (
    Section,
    Spot,
    contact_places,
    cut,
    drawn_bodies,
    moved,
    points_of,
    section_frame,
    sections_of,
    strongest_contact,
)
from tests.viz.states import touching_blocks

SOFT = IsotropicElasticity(100.0, 0.3)


@lru_cache(maxsize=4)
def cut_model(cuts: str, floor: bool = False) -> State:
    """A block pressed on another, or on a floor, cut at planes of symmetry: ``cuts`` is "y1" or "x0 y1"."""
    bodies = {"upper": Body(block((0, 0, 1), (1, 1, 2), (2, 2, 2)), SOFT)}
    if not floor:
        bodies["lower"] = Body(block((0, 0, 0), (1, 1, 1), (3, 3, 2)), SOFT)
    rollers = [
        Support(name, side, tuple(0.0 if axis == side[0] else None for axis in "xyz"))
        for name in bodies
        for side in cuts.split()
    ]
    held = [] if floor else [Support("lower", "z0")]
    master = RigidPlane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)) if floor else Surface("lower", "z1")
    push = Support("upper", "z1", (0.0, 0.0, -0.01))
    scene = Scene(bodies, [*rollers, *held, push], contacts=[ContactPair(Surface("upper", "z0"), master)])
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


def spot_of(state: State) -> Spot:
    return strongest_contact(state.contact, contact_places(state, moved(drawn_bodies(state), 1.0)))


def test_sections_cut_through_the_middle_of_the_contact_along_its_normal() -> None:
    state = touching_blocks()
    everything = state.scene.points
    spot = spot_of(state)
    np.testing.assert_allclose(spot.normal, [0, 0, 1], atol=0.1)
    assert 0.1 < spot.centre[0] < 1.9
    assert abs(spot.centre[2]) < 0.05
    sections = sections_of(spot, oblique_view(everything))
    assert abs(sections[0].view.towards @ sections[1].view.towards) < 1e-12
    for section in sections:
        view = section.view
        assert abs(view.towards @ spot.normal) < 1e-12
        assert view.up[2] > 0.9
        np.testing.assert_array_equal(section.origin, spot.centre)
        frame = section_frame(view, spot, everything)
        assert frame.holds(view.project(spot.centre[None]))[0]
        np.testing.assert_allclose(section_frame(view, spot, everything, 0.1).size, [0.28, 0.2])


@pytest.mark.parametrize(("cuts", "floor"), [("y1", False), ("x0 y1", False), ("x0 y1", True)])
def test_sections_of_parts_of_a_model_lie_in_its_planes_of_symmetry(cuts: str, floor: bool) -> None:
    state = cut_model(cuts, floor)
    bodies = moved(drawn_bodies(state), 1.0)
    spot = spot_of(state)
    assert spot.centre[1] == pytest.approx(1.0, abs=1e-12)
    assert spot.inside[1] == -1.0
    if "x0" in cuts:
        assert spot.centre[0] == pytest.approx(0.0, abs=1e-12)
    else:
        assert 0.2 < spot.centre[0] < 0.8
        assert spot.inside[0] == 0.0
    sections = sections_of(spot, oblique_view(points_of(bodies)))
    titles = {section.title(Frame(np.zeros(2), np.ones(2)), "mm"): section for section in sections}
    across = titles["section at y = 1 mm"]
    if "x0" in cuts:
        assert "section at x = 0 mm" in titles
    for face in cut(bodies, across).values():
        assert face.n_points > 3, "shifted out of the bodies"
        assert np.abs(face.points[:, 1] - 1.0).max() < 1e-4


def test_a_section_that_misses_all_bodies_is_shifted_to_the_other_side() -> None:
    bodies = drawn_bodies(touching_blocks())
    edge = max(float(body.points[:, 1].max()) for body in bodies.values())
    section = Section(face_on(np.array([0.0, 1.0, 0.0])), np.array([0, edge, 0]), np.array([0.0, 1.0, 0.0]))
    assert any(face.n_points for face in cut(bodies, section).values())


@pytest.mark.parametrize(
    ("normal", "place", "words"),
    [
        ((0, -1, 0), -1e-9, "section at y = 0 mm"),
        ((1, 0, 0), -12.34567, "section at x = −12.346 mm"),
        ((1, 1, 0), 3.0, "section"),
    ],
)
def test_a_section_says_where_it_is(normal: tuple[float, ...], place: float, words: str) -> None:
    axis = np.array(normal, dtype=float)
    section = Section(face_on(axis), np.full(3, place), axis)
    assert section.title(Frame(np.zeros(2), np.full(2, 5.0)), "mm") == words


def test_sections_have_axes_with_coordinates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[str, str, str]] = []
    draw = painting.label_axes  # type: ignore[attr-defined]

    def noted(axes: Any, view: Any, units: Any) -> None:
        draw(axes, view, units)
        assert axes.axison
        drawn.append((axes.get_title(), axes.get_xlabel(), axes.get_ylabel()))

    monkeypatch.setattr(painting, "label_axes", noted)
    plot_stress(cut_model("x0 y1"), tmp_path / "stress.png", width=320)
    # Which comes first is rounding: both have the same stress.
    first, second = sorted(drawn)
    assert first[0] == "section at x = 0 mm\ndisplacement × 1"
    assert first[1:] == ("y (mm), runs to the left: seen from −x", "z (mm)")
    assert second == ("section at y = 1 mm\ndisplacement × 1", "x (mm)", "z (mm)")
