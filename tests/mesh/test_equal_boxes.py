"""Structured bodies of equal cells are cut into compact boxes, of which many are alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import BodyMesh, box_partition, solve_scene
from fenics_contact.gallery import LinkShape, block, rectangle, two_links
from fenics_contact.gallery.blocks import box_lattice
from fenics_contact.mesh import bisection_partition
from fenics_contact.mesh.bisection import default_partition, target_parts
from fenics_contact.mesh.equal_boxes import equal_boxes
from fenics_contact.mesh.partition import check_face_connected


def extents(mesh: BodyMesh, partition: np.ndarray) -> set[tuple[int, ...]]:
    """Return the numbers of layers of all subdomains, ascending."""
    grid = mesh.grid
    assert grid is not None
    return {tuple(np.sort(np.ptp(grid[partition == s], axis=0) + 1)) for s in range(partition.max() + 1)}


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_cells_that_divide_by_three_give_cubes(cell: str) -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (18, 9, 9), cell)
    partition = default_partition(mesh, nodes=4.0**3)
    assert np.array_equal(partition, box_partition(mesh, (6, 3, 3)))
    check_face_connected(mesh, partition)


def test_cells_that_do_not_divide_give_boxes_of_few_sizes() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (11, 11, 11))
    partition = default_partition(mesh, nodes=4.0**3)
    assert partition.max() + 1 == 48
    assert extents(mesh, partition) == {(2, 2, 3), (2, 2, 4), (2, 3, 3), (2, 3, 4), (3, 3, 3), (3, 3, 4)}


def test_no_slender_boxes_are_taken_for_the_sake_of_equality() -> None:
    mesh = rectangle((0, 0), (4, 1), (47, 11))
    partition = equal_boxes(mesh, 35, 1)
    assert partition is not None
    assert extents(mesh, partition) <= {(3, 3), (3, 4), (4, 4)}
    row = block((0, 0, 0), (13, 1, 1), (13, 1, 1))
    assert equal_boxes(row, 13, 1) is not None  # cubes
    assert equal_boxes(block((0, 0, 0), (13, 0.1, 1), (13, 1, 1)), 13, 1) is None


def test_a_closed_ring_of_equal_cells_is_cut_into_equal_arcs() -> None:
    link = two_links(LinkShape(n_around=36, n_a=2, n_b=2, grading=0.0)).first.mesh
    partition = equal_boxes(link, 12, 1, members=3)  # four shapes, as the link is oval
    assert partition is not None
    check_face_connected(link, partition)
    assert np.bincount(partition).tolist() == 12 * [12]


def test_what_is_not_alike_is_left_to_bisection() -> None:
    graded = box_lattice(3 * [np.linspace(0, 1, 9) ** 2.5])
    assert equal_boxes(graded, 8, 1) is None
    assert equal_boxes(graded, 8, 1, members=1, slender=2.0) is None  # some are too long
    assert equal_boxes(graded, 8, 1, members=1, slender=2.0, longest=9.0) is not None
    assert np.array_equal(default_partition(graded, nodes=5.0**3), bisection_partition(graded, 8))
    mesh = block((0, 0, 0), (2, 1, 1), (18, 9, 9))
    assert equal_boxes(mesh, 54, 1) is not None
    assert equal_boxes(replace(mesh, grid=None), 54, 1) is None
    assert equal_boxes(mesh_without_corner(), 54, 1) is None


def mesh_without_corner() -> BodyMesh:
    """Return 18 x 9 x 9 cells, a third of which at one corner are missing."""
    section = block((0, 0, 0), (2, 1, 1), (18, 9, 9))
    assert section.grid is not None
    kept = section.grid.max(axis=1) > 2
    nodes, cells = np.unique(section.cells[kept], return_inverse=True)
    return BodyMesh(section.points[nodes], cells.reshape(-1, 8), {}, section.grid[kept])


def test_every_rank_has_a_box() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (12, 12, 12))
    partition = equal_boxes(mesh, 27, 30)
    assert partition is not None
    assert partition.max() + 1 >= 30
    assert equal_boxes(mesh, 27, 60) is None  # more than suit the size: they are left to bisection


@pytest.mark.slow
def test_boxes_need_fewer_kinds_and_products_than_halves() -> None:
    mesh = block_mesh((23, 12, 12))
    scene = block_on_plane(mesh, 0.3)
    target = target_parts(mesh, nodes=5.0**3)
    boxes, halves = (
        solve_scene(scene, MPI.COMM_SELF, partitions={"block": cut}).counts
        for cut in (equal_boxes(mesh, target, 1), bisection_partition(mesh, target))
    )
    assert boxes["kinds"] <= 0.5 * halves["kinds"]
    assert boxes["f_products"] <= 0.9 * halves["f_products"]
