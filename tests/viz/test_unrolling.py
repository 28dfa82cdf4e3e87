"""Surfaces around an axis are unrolled where parts that carry force face away, and nothing is lost."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, State, Status, Support, Surface, solve_scene
from fenics_contact.gallery.blocks import extrude
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.pictures import Units, plot_contact_pressure, plot_contact_status
from fenics_contact.pictures.unrolled import Unrolling, contact_patches, unrolling_of
from tests.viz.plane_states import ring
from tests.viz.states import painted, pixels

AROUND, LAYERS = 16, 2
#: Fraction of a turn of a cell, by which the bore's nodes lie beside the seam for some states.
CELL = 2 * np.pi / AROUND


@lru_cache(maxsize=2)
def fitted(shift: float = 0.0) -> State:
    """A hub squeezed onto a shaft along z, also pushed along x by ``shift`` and turned a little."""
    material = IsotropicElasticity(100.0, 0.3)
    bodies = {
        "shaft": Body(extrude(ring(0.5, 1.0, AROUND), np.linspace(0, 0.5, LAYERS + 1)), material),
        "hub": Body(extrude(ring(1.0, 2.0, AROUND), np.linspace(0, 0.5, LAYERS + 1)), material),
    }
    squeeze = (
        lambda x: shift - 0.01 * x[:, 0] - 0.02 * x[:, 1],
        lambda x: 0.02 * x[:, 0] - 0.01 * x[:, 1],
        0.0,
    )
    scene = Scene(
        bodies,
        [Support("shaft", "inner", (0.0, 0.0, 0.0)), Support("hub", "outer", squeeze)],
        contacts=[ContactPair(Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.1))],
    )
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


def test_a_bore_with_pressure_all_around_shows_all_points() -> None:
    state = fitted()
    (patch,) = contact_patches([state], 0, None)
    unrolling = patch.unrolling
    assert unrolling is not None
    assert patch.hidden == 0
    assert patch.behind == ""
    assert len(patch.points) == len(np.unique(patch.points)) == AROUND * (LAYERS + 1)
    np.testing.assert_array_equal(patch.status, state.contact.status)
    np.testing.assert_allclose(patch.pressure[patch.points], state.contact.pressure)
    assert unrolling.radius == pytest.approx(1.0)
    np.testing.assert_allclose(unrolling.frame, np.eye(3), atol=1e-12)
    assert np.ptp(patch.places[:, 0]) == pytest.approx(2 * np.pi)
    assert np.ptp(patch.places[:, 1]) == pytest.approx(0.5)
    assert len(patch.facets) == AROUND * LAYERS
    widths = np.ptp(patch.places[patch.facets][..., 0], axis=1)
    np.testing.assert_allclose(widths, CELL, err_msg="a facet is torn by the cut")
    angles = patch.places[patch.points, 0]
    places = state.scene.bodies["hub"].mesh.points[state.contact.points.slave - shaft_nodes(state)]
    np.testing.assert_allclose(np.column_stack([np.cos(angles), np.sin(angles)]), places[:, :2], atol=1e-12)
    assert unrolling.labels(Units()) == ("around z (mm), 0 towards x", "z (mm)")


def shaft_nodes(state: State) -> int:
    return state.scene.bodies["shaft"].mesh.n_nodes


def test_slip_around_the_axis_runs_to_the_right() -> None:
    state = fitted()
    (patch,) = contact_patches([state], 0, None)
    assert patch.unrolling is not None
    slips = state.contact.status == Status.SLIP
    assert np.count_nonzero(slips) > AROUND
    sizes = np.linalg.norm(state.contact.slip_in_space[slips], axis=1)
    np.testing.assert_allclose(np.linalg.norm(patch.slip[slips], axis=1), sizes, rtol=1e-6)
    assert np.all(patch.slip[slips, 0] > 0.5 * sizes), "the hub turns from x to y on the shaft"


def test_the_cut_is_opposite_of_the_largest_force() -> None:
    (patch,) = contact_patches([fitted(-0.01)], 0, None)
    assert patch.unrolling is not None
    assert abs(patch.unrolling.middle) < 0.3, "pushed along −x, the hub presses where x is positive"
    assert patch.places[:, 0].max() < np.pi + CELL
    peak = patch.places[np.argmax(patch.pressure), 0]
    assert abs(peak) < 1.0


def test_states_in_one_picture_are_unrolled_alike() -> None:
    patches = contact_patches([fitted(), fitted(-0.01)], 0, None)
    assert patches[0].unrolling is patches[1].unrolling is not None
    np.testing.assert_array_equal(patches[0].places, patches[1].places)


def test_points_that_face_away_on_other_surfaces_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fenics_contact.pictures.unrolled.unrolling_of", lambda *_: None)
    (patch,) = contact_patches([fitted()], 0, None)
    assert patch.unrolling is None
    total = AROUND * (LAYERS + 1)
    assert 0.3 * total < patch.hidden < 0.6 * total
    assert patch.hidden + len(patch.points) == total
    assert patch.behind == f"; {patch.hidden} of {total} closed points face away"


def square(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """The four sides of a square bar along y, nodes and facets."""
    angles = turn + np.pi / 2 * np.arange(4)
    corner = np.column_stack([np.cos(angles), 0 * angles, np.sin(angles)])
    low = np.arange(4)
    ahead = np.roll(low, -1)
    return np.concatenate([corner, corner + np.eye(3)[1]]), np.column_stack([low, ahead, ahead + 4, low + 4])


def test_only_what_runs_around_an_axis_is_unrolled() -> None:
    points, facets = square(0.0)
    force = np.ones(len(points))
    found = unrolling_of(points, facets, points, force)
    assert found is not None, "corners of a square lie on a circle"
    assert found.labels(Units("m")) == ("around y (m), 0 towards z", "y (m)")
    long = points * [1.0, 1.0, 2.0]
    assert unrolling_of(long, facets, long, force) is None, "not round"
    cube = np.concatenate([facets, [[0, 1, 2, 3], [4, 5, 6, 7]]])
    assert unrolling_of(points, cube, points, force) is None, "with its ends"
    slanted = Unrolling(np.zeros(3), np.array([[0.6, 0.8, 0], [0, 0, 1], [0.8, -0.6, 0]]), 1.0, 0.0)
    assert slanted.labels(Units()) == ("around the axis (mm)", "along the axis (mm)")


def test_unrolled_surfaces_are_drawn(tmp_path: Path) -> None:
    state = fitted()
    image = pixels(plot_contact_pressure(state, tmp_path / "pressure.png", width=800))
    assert image.shape[1] == 800
    assert painted(image[:, :600]) > 0.15
    assert painted(pixels(plot_contact_status({"a": state}, tmp_path / "status.png", width=800))) > 0.05
