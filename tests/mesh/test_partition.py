"""Partitions are balanced, and every subdomain hangs together through faces."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh, box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.mesh import bisection_partition, refined
from fenics_contact.mesh.bisection import default_partition, target_parts
from fenics_contact.mesh.partition import check_face_connected, merge_pieces
from tests.mesh.counts import torn_node_counts

CELLS = ["hexahedron", "tetrahedron"]


@pytest.fixture
def brick() -> BodyMesh:
    """4 x 6 x 2 cells."""
    return block((0, 0, 0), (4, 6, 2), (4, 6, 2))


@pytest.mark.parametrize("cell", CELLS)
def test_boxes_hold_equal_numbers_of_cells_and_are_connected(cell: str) -> None:
    mesh = block((0, 0, 0), (4, 6, 2), (4, 6, 2), cell)
    partition = box_partition(mesh, (2, 3, 1))
    assert np.bincount(partition).tolist() == 6 * [mesh.n_cells // 6]
    check_face_connected(mesh, partition)
    assert torn_node_counts(mesh, partition).tolist() == 6 * [27]


def test_consecutive_subdomains_follow_the_last_direction(brick: BodyMesh) -> None:
    centres = brick.points[brick.cells].mean(axis=1)
    partition = box_partition(brick, (2, 3, 2))
    assert [np.ptp(centres[partition // 6 == part, 0]) for part in (0, 1)] == [1.0, 1.0]
    assert centres[partition % 2 == 0, 2].max() < centres[partition % 2 == 1, 2].min()


def test_a_count_that_does_not_divide_gives_layers_that_differ_by_one(brick: BodyMesh) -> None:
    assert sorted(np.bincount(box_partition(brick, (1, 4, 1)))) == [8, 8, 16, 16]


def test_one_box_is_the_whole_body(brick: BodyMesh) -> None:
    assert not box_partition(brick, (1, 1, 1)).any()
    assert torn_node_counts(brick, box_partition(brick, (1, 1, 1))).tolist() == [brick.n_nodes]


def test_more_boxes_than_layers_are_refused(brick: BodyMesh) -> None:
    with pytest.raises(InvalidInputError, match=r"boxes\[2\] must be at most the 2 layers .*, got 3"):
        box_partition(brick, (1, 1, 3))


@pytest.mark.parametrize("boxes", [(0, 1, 1), (1.0, 1, 1)])
def test_boxes_that_cannot_be_counted_are_refused(brick: BodyMesh, boxes: tuple[int, int, int]) -> None:
    with pytest.raises(InvalidInputError, match=r"boxes\[0\] must be an integer of at least 1"):
        box_partition(brick, boxes)


def test_two_numbers_are_no_box(brick: BodyMesh) -> None:
    with pytest.raises(InvalidInputError, match=r"boxes must be three integers, .*got \(2, 2\)"):
        box_partition(brick, (2, 2))  # type: ignore[arg-type]


def test_boxes_of_an_unstructured_mesh_are_refused() -> None:
    with pytest.raises(
        InvalidInputError, match="needs a structured mesh, this one has grid None: use `bisection"
    ):
        box_partition(hemisphere(1.0, 2), (1, 1, 1))


@pytest.mark.parametrize("parts", [1, 2, 5, 8])
@pytest.mark.parametrize("cell", CELLS)
def test_bisection_gives_connected_parts_of_like_size(cell: str, parts: int) -> None:
    mesh = block((0, 0, 0), (4, 6, 2), (4, 6, 2), cell)
    partition = bisection_partition(mesh, parts)
    check_face_connected(mesh, partition)
    sizes = np.bincount(partition)
    assert sizes.size == parts
    assert sizes.max() <= 1.5 * sizes.min()


def test_bisection_cuts_an_unstructured_body() -> None:
    mesh = hemisphere(1.0, 6)
    partition = bisection_partition(mesh, 7)
    check_face_connected(mesh, partition)
    assert np.unique(partition).tolist() == list(range(7))


def test_where_cells_are_small_subdomains_are_cut_again() -> None:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4), "triangle")
    for level in range(8):
        centres = mesh.points[mesh.cells].mean(axis=1)
        mesh = refined(mesh, np.linalg.norm(centres, axis=1) < 0.6**level).mesh
    usual = mesh.n_cells / target_parts(mesh, nodes=40.0)
    of_like_weight = bisection_partition(mesh, target_parts(mesh, nodes=40.0))
    assert np.bincount(of_like_weight).max() > 4.0 * usual
    partition = default_partition(mesh, nodes=40.0)
    check_face_connected(mesh, partition)
    assert np.bincount(partition).max() < 3.2 * usual


def test_more_parts_than_cells_are_refused(brick: BodyMesh) -> None:
    with pytest.raises(InvalidInputError, match="parts must be at most the 48 cells, got 49"):
        bisection_partition(brick, 49)


def diagonal_pieces(mesh: BodyMesh) -> np.ndarray:
    """Four columns coloured as a chess board: each colour hangs together by an edge only."""
    assert mesh.grid is not None
    return (mesh.grid[:, 0] // 2 + mesh.grid[:, 1] // 3) % 2


def test_a_subdomain_that_hangs_by_an_edge_is_named(brick: BodyMesh) -> None:
    partition = 1 + diagonal_pieces(brick)
    partition[::2] = 0  # the lower layer of cells
    with pytest.raises(
        InvalidInputError, match="2 of 3 are not, first subdomain 1 in 2 pieces: cut differently"
    ):
        check_face_connected(brick, partition)


def test_pieces_are_merged_into_their_neighbours(brick: BodyMesh) -> None:
    partition = diagonal_pieces(brick)
    partition[0] = 1 - partition[0]  # now one piece of each colour is the smaller one
    with pytest.raises(InvalidInputError, match="2 of 2 are not"):
        check_face_connected(brick, partition)
    merged = merge_pieces(brick, partition)
    check_face_connected(brick, merged)
    assert np.unique(merged).tolist() == [0, 1]
    assert np.count_nonzero(merged == partition) >= 24, "the large pieces stay"


def test_a_connected_partition_is_left_as_it_is(brick: BodyMesh) -> None:
    partition = box_partition(brick, (2, 2, 2))
    assert np.array_equal(merge_pieces(brick, partition), partition)


def test_a_body_in_two_parts_cannot_be_one_subdomain() -> None:
    one = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    apart = BodyMesh(np.vstack([one.points, one.points + 2.0]), np.vstack([one.cells, one.cells + 8]))
    with pytest.raises(InvalidInputError, match="1 pieces of it have no neighbour"):
        merge_pieces(apart, np.zeros(2, dtype=int))
    check_face_connected(apart, np.array([0, 1]))


@pytest.mark.parametrize(
    ("partition", "message"),
    [
        (np.zeros(47, dtype=int), r"integers of shape \(48,\), got int64 of shape \(47,\)"),
        (np.zeros(48), r"integers of shape \(48,\), got float64"),
        (np.full(48, -1), "must start at 0, got -1"),
        (np.full(48, 1), "without holes, 0 of 2 is empty"),
    ],
)
def test_an_array_that_is_no_partition_is_refused(
    brick: BodyMesh, partition: np.ndarray, message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_face_connected(brick, partition)
