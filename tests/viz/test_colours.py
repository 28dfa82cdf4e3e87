"""Neighbouring subdomains differ, also to colour-blind eyes."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import Colormap, to_rgb

from fenics_contact import box_partition
from fenics_contact.gallery import block
from fenics_contact.pictures.canvas import (
    BLUE,
    ERROR_MAP,
    FAMILIES,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PRESSURE_MAP,
    SIGNED_MAP,
    STRESS_MAP,
    colour_subdomains,
    neighbours,
)
from fenics_contact.pictures.curves import LOOKS

#: Linear RGB as seen without the medium, the long and the short cones (Machado, Oliveira, Fernandes, 2009).
DEFICIENCIES = {
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.01182, 0.04294, 0.968881),
    ),
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "tritanopia": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}
#: Colours that must be told apart in one picture.
PURPOSES = {
    "cool subdomains": FAMILIES[0],
    "warm subdomains": FAMILIES[1],
    "subdomains of two bodies": [*FAMILIES[0], *FAMILIES[1]],
    "status on its ground": (BLUE, ORANGE, GREY, PALE),
    "residuals": (BLUE, ORANGE, GREEN, INK),
    "before and after": (GREY, ORANGE, BLUE, "#ffffff"),
    "curves": (*(colour for colour, _ in LOOKS), INK),
}


def linear(colour: str) -> np.ndarray:
    """Undo the gamma of a screen."""
    value = np.array(to_rgb(colour))
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """Turn linear RGB into CIELAB, in which equal distances look equally large."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(rgb, 0, 1) / to_xyz.sum(axis=1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("deficiency", sorted(DEFICIENCIES))
@pytest.mark.parametrize("colours", PURPOSES.values(), ids=PURPOSES.keys())
def test_colours_of_one_purpose_stay_apart_for_colour_blind_eyes(
    deficiency: str, colours: tuple[str, ...]
) -> None:
    seen = [lab(np.array(DEFICIENCIES[deficiency]) @ linear(colour)) for colour in colours]
    distances = [np.linalg.norm(a - b) for i, a in enumerate(seen) for b in seen[:i]]
    assert len(distances) >= 3
    assert min(distances) > 10


def test_red_and_green_of_equal_lightness_would_be_found_too_close() -> None:
    seen = [lab(np.array(DEFICIENCIES["deuteranopia"]) @ linear(colour)) for colour in ("#b08000", "#8a9000")]
    assert np.linalg.norm(seen[0] - seen[1]) < 10


SIGHTS = {"full": np.eye(3), **DEFICIENCIES}


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize(
    "colours", [STRESS_MAP, PRESSURE_MAP, ERROR_MAP], ids=["stress", "pressure", "error"]
)
def test_more_is_always_darker_to_all_eyes(colours: Colormap, sight: str) -> None:
    matrix = np.array(SIGHTS[sight])
    lightness = [lab(matrix @ linear(colours(value)))[0] for value in np.linspace(0, 1, 60)]
    assert np.all(np.diff(lightness) < 0)
    assert lightness[0] - lightness[-1] > 60


@pytest.mark.parametrize("sight", SIGHTS)
def test_movements_outwards_and_inwards_are_dark_and_differ_to_all_eyes(sight: str) -> None:
    matrix = np.array(SIGHTS[sight])
    seen = np.array([lab(matrix @ linear(SIGNED_MAP(value))) for value in np.linspace(0, 1, 61)])
    assert np.all(np.diff(seen[:31, 0]) > 0)
    assert np.all(np.diff(seen[31:, 0]) < 0)
    assert np.linalg.norm(seen[5] - seen[-6]) > 20


def test_neighbours_counts_shared_nodes() -> None:
    mesh = block((0, 0, 0), (3, 1, 1), (3, 1, 1))
    shared = neighbours(mesh.cells, np.array([0, 1, 2]))
    assert shared.tolist() == [[0, 4, 0], [4, 0, 4], [0, 4, 0]]


@pytest.mark.parametrize("boxes", [(8, 1, 2), (2, 2, 2), (4, 2, 1)])
def test_neighbouring_subdomains_have_different_colours(boxes: tuple[int, int, int]) -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (8, 2, 2))
    shared = neighbours(mesh.cells, box_partition(mesh, boxes))
    colours = np.array(colour_subdomains(shared, 0))
    touching = np.argwhere(shared > 0)
    assert len(touching) > 0
    assert np.all(colours[touching[:, 0]] != colours[touching[:, 1]])


def test_two_bodies_in_touch_share_no_colour() -> None:
    shared = neighbours(block((0, 0, 0), (1, 1, 1), (8, 1, 2)).cells, np.arange(16))
    first, second = (set(colour_subdomains(shared, family)) for family in (0, 1))
    assert first <= set(FAMILIES[0])
    assert second <= set(FAMILIES[1])


def test_with_more_neighbours_than_colours_the_least_of_them_is_repeated() -> None:
    shared = np.full((10, 10), 9)
    shared[3, 9] = shared[9, 3] = 1
    np.fill_diagonal(shared, 0)
    colours = colour_subdomains(shared, 0)
    assert len(set(colours)) == 9
    assert colours[3] == colours[9]
