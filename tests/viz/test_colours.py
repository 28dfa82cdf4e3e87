"""Neighbouring subdomains have different colours."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import box_partition
from fenics_contact.gallery import block
from fenics_contact.pictures.canvas import FAMILIES, colour_subdomains, neighbours


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
