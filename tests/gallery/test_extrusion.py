"""Solids swept from plane meshes."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.gallery.blocks import extrude
from fenics_contact.mesh.faces import vector_areas

HEIGHTS = [0.0, 0.5, 2.0]


def size(mesh: BodyMesh, name: str) -> np.ndarray:
    return vector_areas(mesh.points, mesh.surfaces[name]).sum(axis=0)


def test_a_swept_rectangle_is_a_block() -> None:
    swept = extrude(rectangle((0, 0), (3, 1), (3, 2)), HEIGHTS)
    like = block((0, 0, 0), (3, 1, 2), (3, 2, 2))
    assert (swept.n_nodes, swept.n_cells) == (like.n_nodes, like.n_cells)
    assert swept.volume == pytest.approx(6.0)
    assert set(swept.surfaces) == {"bottom", "top", "x0", "x1", "y0", "y1"}
    for ours, theirs in {"bottom": "z0", "top": "z1", "x0": "x0", "x1": "x1", "y0": "y0", "y1": "y1"}.items():
        assert size(swept, ours) == pytest.approx(size(like, theirs))


def test_cells_that_are_left_out_leave_steps() -> None:
    section = rectangle((0, 0), (2, 1), (2, 1))
    stair = extrude(section, HEIGHTS, present=[[True, True], [True, False]])
    assert stair.volume == pytest.approx(0.5 * 2 + 1.5)
    assert stair.n_nodes == 6 + 6 + 4
    assert size(stair, "top") == pytest.approx([0, 0, 2])
    assert set(np.unique(stair.points[stair.surfaces["top"]][..., 2])) == {0.5, 2.0}
    assert size(stair, "x1") == pytest.approx([0.5, 0, 0]), "the step is no part of the swept edge"


def test_regions_are_swept_and_empty_ones_dropped() -> None:
    plane = rectangle((0, 0), (2, 1), (2, 1))
    section = BodyMesh(plane.points, plane.cells, {}, None, {"left": [0], "right": [1]})
    both = extrude(section, HEIGHTS)
    assert {name: cells.tolist() for name, cells in both.regions.items()} == {"left": [0, 2], "right": [1, 3]}
    one = extrude(section, HEIGHTS, present=[[True, False]] * 2)
    assert {name: cells.tolist() for name, cells in one.regions.items()} == {"left": [0, 1]}


def test_a_section_of_triangles_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match="needs a section of quadrilaterals, got cells of type triang"
    ):
        extrude(rectangle((0, 0), (1, 1), (1, 1), "triangle"), HEIGHTS)


@pytest.mark.parametrize("heights", [[0.0], [0.0, 1.0, 1.0], [[0.0, 1.0]], [0.0, np.nan]])
def test_heights_that_do_not_ascend_are_refused(heights: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="heights must be at least two ascending numbers, got"):
        extrude(rectangle((0, 0), (1, 1), (1, 1)), heights)


@pytest.mark.parametrize("present", [[[True]], [[False, False]] * 2])
def test_presence_of_another_shape_or_of_nothing_is_refused(present: list[list[bool]]) -> None:
    with pytest.raises(InvalidInputError, match=r"present must have shape \(2, 2\), one row per layer"):
        extrude(rectangle((0, 0), (2, 1), (2, 1)), HEIGHTS, present=present)
