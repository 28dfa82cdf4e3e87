"""Rigid obstacles in pictures, and maps of the status."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import BinaryIO

import numpy as np
import pytest
from matplotlib.figure import Figure

from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import plot_contact_status, plot_stress
from fenics_contact.pictures import states as status
from fenics_contact.pictures.canvas import Frame, oblique_view, sheet
from fenics_contact.pictures.drawing import obstacle_layers, obstacles_of, outline, shade_obstacles
from fenics_contact.pictures.section import strongest_contact
from fenics_contact.pictures.unrolled import contact_patches
from fenics_contact.shapes import Plane, Sphere
from tests.viz.moving_states import block_among_movers, pressed_by_a_lid
from tests.viz.plane_states import caged_block, plane_block
from tests.viz.states import contains, painted, pixels, touching_blocks


def test_obstacles_in_space_are_drawn_where_they_are() -> None:
    state = caged_block()
    points, obstacles = state.scene.bodies["block"].mesh.points, obstacles_of(state)
    view = oblique_view(points)
    layers, corners = obstacle_layers(obstacles, points, view)
    assert [type(obstacle).__name__ for obstacle in obstacles] == [
        "RigidPlane", "RigidSphere", "RigidCylinder", "DistanceObstacle", "RigidPlane"
    ]  # fmt: skip
    # The floor as sheet and edge; ball and bar by circles and lines; of the front wall, which would hide all
    # as it lies between the viewer and the block, the edge.
    assert view.towards[1] < 0
    assert len(layers) == 2 + 3 + 6 + 1
    assert corners.shape == (10, 3)
    shown = [0] * 2 + [1] * 3 + [2] * 6 + [4]
    for number, layer in zip(shown, layers, strict=True):
        np.testing.assert_allclose(obstacles[number].distance(np.asarray(layer.mesh.points)), 0.0, atol=1e-6)


def test_outlines_in_the_plane_are_an_edge_and_a_circle() -> None:
    points = np.array([[0.0, 0.0], [2.0, 1.0]])
    disc = Sphere((1.0, 3.0), 0.5)
    (edge,), (circle,) = outline(Plane((0.0, 0.0), (0.0, 1.0)), points), outline(disc, points)
    np.testing.assert_allclose(np.sort(edge[:, 0]), [-0.12, 2.12])
    np.testing.assert_allclose(disc.distance(circle), 0.0, atol=1e-12)


def test_obstacles_that_move_are_drawn_where_they_are_in_each_state() -> None:
    for state, time in zip(block_among_movers(), (0.0, 0.5, 1.0), strict=True):
        points = state.scene.bodies["block"].mesh.points
        there = [pair.master.at(time) for pair in state.scene.contacts]  # type: ignore[union-attr]
        layers, corners = obstacle_layers(obstacles_of(state), points, oblique_view(points))
        assert corners.shape == (5, 3)
        for number, layer in zip([0] * 2 + [1] * 3 + [2] * 6, layers, strict=True):
            np.testing.assert_allclose(there[number].distance(np.asarray(layer.mesh.points)), 0.0, atol=1e-6)
        assert np.ptp(corners[:, 2]) == pytest.approx(np.sin(0.05 * time) * np.ptp(corners[:, 0]), rel=2e-3)


def test_a_picture_in_the_plane_shades_an_obstacle_where_it_has_moved(tmp_path: Path) -> None:
    state, axes = pressed_by_a_lid(), Figure().add_subplot()
    shade_obstacles(axes, obstacles_of(state), Frame(np.array([0.0, 0.0]), np.array([2.0, 2.0])))
    *_, line = axes.collections
    (edge,) = line.get_paths()
    np.testing.assert_allclose(edge.vertices[:, 1], 0.9, atol=1e-9)
    assert contains(pixels(plot_stress(state, tmp_path / "lid.png", width=640)), "#e3e6e8"), "the lid"


def test_a_scene_with_obstacles_is_drawn(tmp_path: Path) -> None:
    image = pixels(plot_stress(caged_block(), tmp_path / "caged.png", width=640))
    assert painted(image) > 0.3
    assert contains(image, "#e3e6e8"), "the floor"


def test_bodies_on_obstacles_are_drawn_in_true_scale(tmp_path: Path) -> None:
    left, true, large = (
        pixels(plot_stress(plane_block(), tmp_path / f"{k}.png", width=640, **options))
        for k, options in enumerate([{}, {"scale": 1.0}, {"scale": 10.0}])
    )
    np.testing.assert_array_equal(left, true)
    assert large.shape != true.shape or np.abs(large - true).max() > 0.1


def test_where_normals_cancel_the_strongest_point_gives_the_direction() -> None:
    angle = 2 * np.pi * np.arange(12) / 12
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    mirrors = np.zeros((12, 3), dtype=bool)
    points = SimpleNamespace(pair=np.zeros(12, dtype=int), normal=normal, area=np.ones(12), symmetric=mirrors)
    force = np.where(np.arange(12) == 3, 1.0 + 1e-6, 1.0)
    spot = strongest_contact(SimpleNamespace(normal_force=force, points=points), normal)
    np.testing.assert_allclose(spot.normal, normal[3], atol=1e-12)


def test_of_a_quarter_of_a_bore_the_sections_are_those_of_the_whole() -> None:
    angle = np.pi / 2 * np.linspace(0, 1, 5)
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(5)])
    mirrors = np.abs(normal) < 1e-12
    mirrors[:, 2] = False
    points = SimpleNamespace(pair=np.zeros(5, dtype=int), normal=normal, area=np.ones(5), symmetric=mirrors)
    force = np.array([1.0, 2.0, 3.0, 2.0, 1.5])
    places = normal + np.array([0, 0, 7])
    spot = strongest_contact(SimpleNamespace(normal_force=force, points=points), places)
    np.testing.assert_allclose(spot.centre, [0, 0, 7], atol=1e-12)
    np.testing.assert_allclose(spot.normal, [0, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(spot.inside, [1, 1, 0])


def test_status_maps_show_stick_and_slip_of_each_state(tmp_path: Path) -> None:
    state = touching_blocks()
    one = pixels(plot_contact_status({"a": state}, tmp_path / "one.png", width=1200))
    four = pixels(plot_contact_status(dict.fromkeys("abcd", state), tmp_path / "four.png", width=1200))
    for colour in ("#0072b2", "#d55e00"):
        assert contains(one, colour)
        assert contains(four, colour)


def test_points_without_friction_have_no_arrows() -> None:
    patch = contact_patches([touching_blocks()], 0, None)[0]
    assert 0 < np.count_nonzero(patch.slips) < len(patch.status)
    assert patch.largest_slip > 0.0
    assert replace(patch, rubs=False).largest_slip == 0.0


def test_status_maps_refuse_what_they_cannot_show(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"maps of the status need a state, got none"):
        plot_contact_status({}, tmp_path / "maps.png")
    with pytest.raises(InvalidInputError, match=r"pair 1, got 'a' in 3 dimensions, number of pairs 1"):
        plot_contact_status({"a": touching_blocks()}, tmp_path / "maps.png", pair=1)
    with pytest.raises(InvalidInputError, match=r"got 'flat' in 2 dimensions, number of pairs 1"):
        plot_contact_status({"flat": plane_block()}, tmp_path / "maps.png")
    assert not list(tmp_path.iterdir())


def test_a_map_of_one_state_says_its_title_once(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    state = touching_blocks()

    @contextmanager
    def kept(paper: BinaryIO, size: tuple[int, int], title: str) -> Iterator[Figure]:
        with sheet(paper, size, title) as figure:
            yield figure
            texts.extend([title, *(axes.get_title() for axes in figure.axes)])

    monkeypatch.setattr(status, "sheet", kept)
    plot_contact_status({"Pressed": state}, title="Pressed")
    assert sum(text.count("Pressed") for text in texts) == 1
    texts.clear()
    plot_contact_status({"first": state, "second": state}, title="Pressed")
    assert [text.splitlines()[0] for text in texts] == ["Pressed", "first", "second"]
