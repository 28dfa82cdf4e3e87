"""Pictures of plane scenes show what the state holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Body, Scene, Status
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.pictures import plot_contact_pressure, plot_decomposition, plot_stress
from fenics_contact.pictures.curves import contact_trace, walk
from fenics_contact.pictures.section import refined
from tests.viz.plane_states import hung_block, pin_in_ring, plane_block
from tests.viz.states import contains, painted, pixels

SMALL = 640


def test_an_open_line_is_walked_from_its_beginning() -> None:
    order, starts = walk(np.array([[7, 2], [9, 7], [2, 4]]))
    assert order.tolist() == [9, 7, 2, 4]
    assert starts.tolist() == [0]


def test_a_closed_line_is_walked_once_and_pieces_one_after_the_other() -> None:
    order, starts = walk(np.array([[0, 1], [1, 2], [2, 0], [5, 4]]))
    assert order[:3].tolist() in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
    assert order[3:].tolist() == [5, 4]
    assert starts.tolist() == [0, 3]


def test_the_trace_of_a_flat_surface_runs_over_x_and_holds_the_forces() -> None:
    state = plane_block()
    trace, contact = contact_trace(state, 0), state.contact
    assert trace.axis == "x"
    assert np.all(np.diff(trace.places) > 0)
    points = state.scene.bodies["block"].mesh.points[contact.points.slave]
    np.testing.assert_allclose(trace.places[trace.points], points[:, 0])
    np.testing.assert_allclose(trace.pressure[trace.points], contact.pressure)
    np.testing.assert_array_equal(trace.status, contact.status)
    assert trace.force == pytest.approx(contact.normal_force.sum())
    # The floor holds the block back: what it feels points against x.
    dragged = np.abs(contact.friction_force[:, 0]) > 0.1 * np.abs(contact.friction_force).max()
    assert np.count_nonzero(dragged) > 3
    flat = -contact.friction_force[:, 0] * contact.points.tangents[:, 0, 0]
    np.testing.assert_allclose(trace.traction[trace.points] * contact.points.area, flat, atol=1e-12)
    assert trace.shear == pytest.approx(flat.sum())
    assert trace.shear < 0
    assert np.all(np.abs(trace.traction) <= trace.bound + 1e-6 * trace.bound.max())
    # Points that slip move on the floor against the traction that they feel.
    slips = trace.status == Status.SLIP
    assert np.count_nonzero(slips) > 0
    assert np.all(trace.slip[slips] * trace.traction[trace.points[slips]] < 0)
    assert np.abs(trace.slip[slips]).max() == pytest.approx(np.abs(contact.slip[slips]).max())


def test_the_window_of_a_trace_holds_what_is_closed() -> None:
    trace = contact_trace(plane_block(), 0)
    low, high = trace.window(None)
    closed = trace.places[trace.pressure > 0]
    assert trace.places[0] <= low < closed.min() + 1e-12
    assert closed.max() - 1e-12 < high <= trace.places[-1]
    low, high = trace.window(0.1)
    assert high - low == pytest.approx(0.2)


def test_the_window_of_a_small_contact_holds_the_open_nodes_beside_it() -> None:
    """So that curves end at zero, not in the air."""
    trace = contact_trace(plane_block(), 0)
    small = replace(trace, pressure=np.where(np.isin(np.arange(25), (10, 11, 12)), 1.0, 0.0))
    assert small.window(None) == (trace.places[9], trace.places[13])


def test_the_trace_of_a_ring_runs_along_it() -> None:
    trace = contact_trace(pin_in_ring(), 0)
    assert trace.axis == "along the surface"
    assert len(trace.places) == len(trace.points) == 24
    np.testing.assert_allclose(np.diff(trace.places), 2 * np.sin(np.pi / 24))
    np.testing.assert_allclose(trace.pressure, trace.pressure.mean(), rtol=1e-3)


def test_a_surface_that_runs_against_x_is_shown_forwards() -> None:
    """The upper edge of a body runs against x: the body lies on its left."""
    state = hung_block()
    trace = contact_trace(state, 0)
    assert trace.axis == "x"
    assert np.all(np.diff(trace.places) > 0)
    points = state.scene.bodies["block"].mesh.points[state.contact.points.slave]
    np.testing.assert_allclose(trace.places[trace.points], points[:, 0])


def test_small_triangles_keep_the_integral() -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (3, 2))
    values = mesh.points[:, 0] * mesh.points[:, 1]
    cut, shown = refined(mesh.points, mesh.cells, values)
    corners = np.column_stack([cut.x, cut.y])[cut.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.min() > 0
    assert area @ shown[cut.triangles].mean(axis=1) == pytest.approx(1.0, rel=0.003)


def test_plane_stress_pictures_show_bodies_and_floor(tmp_path: Path) -> None:
    state = plane_block("triangle")
    smooth = pixels(plot_stress(state, tmp_path / "smooth.png", width=SMALL))
    cells = pixels(plot_stress(state, tmp_path / "cells.png", width=SMALL, smooth=False))
    assert smooth.shape[1] == SMALL
    assert painted(smooth) > 0.25
    assert contains(smooth, "#e3e6e8"), "the floor is shaded"
    assert np.abs(smooth - cells).max() > 0.1


def test_a_small_contact_is_shown_at_a_larger_scale_beside_the_bodies(tmp_path: Path) -> None:
    state = plane_block()
    alone = pixels(plot_stress(state, tmp_path / "alone.png", width=SMALL, sections=False))
    both = pixels(plot_stress(state, tmp_path / "both.png", width=SMALL, reach=0.2))
    assert both.shape != alone.shape
    assert painted(both) > 0.2


def test_contact_pictures_show_pressure_and_with_friction_its_traction(tmp_path: Path) -> None:
    image = pixels(plot_contact_pressure(plane_block(), tmp_path / "rubs.png", width=1200))
    smooth = pixels(plot_contact_pressure(plane_block(friction=0.0), tmp_path / "smooth.png", width=1200))
    assert image.shape[0] > 1.4 * smooth.shape[0], "a second diagram for the traction"
    for colour in ("#0072b2", "#d55e00"):
        assert contains(image, colour)
    assert contains(image, "#e3e6e8"), "between the slip bounds"
    assert not contains(smooth, "#e3e6e8", 0.01)


def test_plane_subdomains_have_colours_of_their_own(tmp_path: Path) -> None:
    first, second = rectangle((0, 0), (2, 1), (4, 2)), rectangle((2.2, 0), (4, 1), (4, 2))
    material = PlaneStrain(1.0, 0.3)
    scene = Scene({"first": Body(first, material), "second": Body(second, material)})
    halves = {"first": np.repeat([0, 1], 4), "second": np.zeros(8, dtype=int)}
    whole = pixels(plot_decomposition(scene, halves, tmp_path / "parts.png", width=SMALL))
    exploded = pixels(plot_decomposition(scene, halves, tmp_path / "exploded.png", width=SMALL, explode=0.3))
    for colour in ("#1f77b4", "#aec7e8", "#ff7f0e"):
        assert contains(whole, colour)
    assert painted(exploded) < painted(whole) - 0.05
