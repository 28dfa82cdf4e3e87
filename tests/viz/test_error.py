"""Pictures of the discretisation error show where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import plot_error
from fenics_contact.pictures.canvas import ERROR_MAP
from tests.viz.moving_states import pressed_by_a_lid
from tests.viz.plane_states import flat_pad, plane_block
from tests.viz.states import contains, painted, pixels

SMALL = 320


def as_hex(place: float) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in ERROR_MAP(place)[:3])


def test_cells_of_plane_bodies_have_the_colour_of_their_part(tmp_path: Path) -> None:
    state = plane_block()
    mesh = state.scene.bodies["block"].mesh
    right = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0
    given = {"block": np.where(right, 1e-2, 1e-4)}
    # No edges are drawn over cells that are seen this small.
    image = pixels(plot_error(state, tmp_path / "error.png", given, clim=(1e-5, 1e-1), width=2 * SMALL))
    left_half, right_half = image[:, : SMALL - 60], image[:, SMALL - 40 : -140]
    low, high = as_hex(0.25), as_hex(0.75)
    assert contains(left_half, low, 0.06)
    assert contains(right_half, high, 0.06)
    assert not contains(left_half, high, 0.06)


def test_the_label_of_the_colours_fits_beside_a_flat_picture(tmp_path: Path) -> None:
    image = pixels(plot_error(flat_pad(), tmp_path / "error.png", width=1600))
    assert image.shape[0] < 0.45 * image.shape[1]
    edges = (image[:3], image[-3:], image[:, :3], image[:, -3:])
    assert [bool((edge > 0.99).all()) for edge in edges] == [True] * 4


def test_a_body_at_rest_is_drawn_too(tmp_path: Path) -> None:
    state = plane_block()
    nothing = {"block": np.zeros(state.scene.bodies["block"].mesh.n_cells)}
    assert painted(pixels(plot_error(state, tmp_path / "rest.png", nothing, width=SMALL))) > 0.1


@pytest.mark.parametrize(
    ("by_cell", "options", "message"),
    [
        ({}, {}, r"by_cell\['block'\] must hold 192 numbers, one per cell, .* got none: give the by_cell"),
        ({"block": np.ones(3)}, {}, r"must hold 192 numbers, .* got shape \(3,\), the smallest 1.0"),
        ({"block": np.full(192, -1.0)}, {}, r"finite and not negative, got shape \(192,\), the smallest -1"),
        (None, {"clim": (0.0, 1.0)}, r"clim of a logarithmic scale must be positive, got \(0.0, 1.0\)"),
        (None, {"clim": (1.0, 0.1)}, r"clim must be a finite range"),
        (None, {"reach": 0.0}, r"reach must be positive"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    by_cell: dict[str, np.ndarray] | None, options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_error(plane_block(), tmp_path / "error.png", by_cell, **options)
    assert not list(tmp_path.iterdir())


def test_nonlinear_materials_need_parts_that_are_given(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="errors need small strains and linear materials"):
        plot_error(pressed_by_a_lid(), tmp_path / "error.png")
