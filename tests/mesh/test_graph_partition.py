"""Subdomains are connected through faces, also those of METIS; their number suits the mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.graph_partition import graph_partition, smoothed
from fenics_contact import BodyMesh, box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import (
    LinkShape,
    block,
    chain_link,
    half_disc,
    hemisphere,
    rectangle,
    two_links,
)
from fenics_contact.mesh import bisection_partition
from fenics_contact.mesh.bisection import default_partition, target_parts
from fenics_contact.mesh.partition import (
    cell_weights,
    check_face_connected,
    check_one_piece,
    face_areas,
    merge_pieces,
)
from tests.mesh.counts import torn_node_counts

SMALL = {
    "tetrahedron": block((0, 0, 0), (2, 2, 1), (2, 2, 1), "tetrahedron"),
    "hexahedron": block((0, 0, 0), (4, 3, 2), (4, 3, 2)),
    "triangle": rectangle((0, 0), (4, 3), (4, 3), "triangle"),
    "quadrilateral": rectangle((0, 0), (5, 4), (5, 4)),
}


@pytest.mark.parametrize("cell", SMALL)
@settings(max_examples=25)
@given(share=st.floats(0.0, 1.0))
def test_any_number_of_parts_is_full_and_connected(cell: str, share: float) -> None:
    mesh = SMALL[cell]
    parts = 1 + round(share * (mesh.n_cells - 1))
    partition = graph_partition(mesh, parts)
    check_face_connected(mesh, partition)
    assert np.unique(partition).tolist() == list(range(parts))


@pytest.mark.parametrize("cell", SMALL)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), parts=st.integers(1, 6))
def test_any_partition_is_mended_without_losing_a_subdomain(cell: str, seed: int, parts: int) -> None:
    mesh = SMALL[cell]
    scattered = np.random.default_rng(seed).permutation(np.arange(mesh.n_cells) % parts)
    mended = merge_pieces(mesh, scattered)
    check_face_connected(mesh, mended)
    assert np.unique(mended).tolist() == list(range(parts))


def test_parts_are_of_like_weight_and_touch_in_little_area() -> None:
    mesh = hemisphere(1.0, 10)
    partition = graph_partition(mesh, 6)
    weights = np.bincount(partition, cell_weights(mesh))
    assert weights.max() < 1.3 * weights.min()
    pairs, areas = face_areas(mesh)
    cut = partition[pairs[:, 0]] != partition[pairs[:, 1]]
    assert 0.0 < areas[cut].sum() < 0.1 * areas.sum()


def test_a_cell_that_sticks_out_goes_to_the_neighbour_and_none_that_is_alone() -> None:
    mesh = rectangle((0, 0), (4, 4), (4, 4))
    assert mesh.grid is not None
    even = (mesh.grid[:, 0] > 1).astype(np.int64)
    jagged = even.copy()
    jagged[np.flatnonzero((mesh.grid == (2, 1)).all(axis=1))] = 0
    assert np.array_equal(smoothed(jagged, *face_areas(mesh)), even)
    alone = np.arange(mesh.n_cells)
    assert np.array_equal(smoothed(alone, *face_areas(mesh)), alone)


def cells_sharing(mesh: BodyMesh, nodes: int) -> np.ndarray:
    """A pair of cells that share exactly so many nodes."""
    for first, vertices in enumerate(mesh.cells):
        common = np.isin(mesh.cells, vertices).sum(axis=1)
        if np.any(common == nodes):
            return np.array([first, np.flatnonzero(common == nodes)[0]])
    raise AssertionError("there is no such pair: nothing would be tested")


@pytest.mark.parametrize("nodes", [0, 1, 2])
def test_tetrahedra_that_share_an_edge_a_node_or_nothing_are_found_and_mended(nodes: int) -> None:
    mesh = block((0, 0, 0), (3, 3, 3), (3, 3, 3), "tetrahedron")
    partition = np.zeros(mesh.n_cells, dtype=np.int64)
    partition[cells_sharing(mesh, nodes)] = 1
    message = r"every subdomain of body 'lug' must .* 1 of 2 are not, first subdomain 1 in 2 pieces"
    with pytest.raises(InvalidInputError, match=message):
        check_face_connected(mesh, partition, "lug")
    mended = merge_pieces(mesh, partition)
    check_face_connected(mesh, mended)
    assert np.bincount(mended).tolist() == [mesh.n_cells - 1, 1]


@pytest.mark.parametrize("empty", [[2], [0, 1], [1, 2, 3]])
def test_parts_that_metis_leaves_empty_are_filled(empty: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = block((0, 0, 0), (4, 4, 2), (4, 4, 2), "tetrahedron")
    full = np.setdiff1d(np.arange(4), empty)

    def metis(graph: object, vertices: np.ndarray, parts: int) -> np.ndarray:
        return full[np.arange(mesh.n_cells) % full.size]

    monkeypatch.setattr("benchmarks.graph_partition.part_graph", metis)
    partition = graph_partition(mesh, 4)
    check_face_connected(mesh, partition)
    assert np.unique(partition).tolist() == [0, 1, 2, 3]


def test_a_count_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="parts must be an integer of at least 1, got 0"):
        bisection_partition(SMALL["quadrilateral"], 0)


def two_bricks() -> BodyMesh:
    """Two bricks that touch nowhere, of 4 and 2 cells."""
    one, other = block((0, 0, 0), (2, 2, 1), (2, 2, 1)), block((5, 0, 0), (7, 1, 1), (2, 1, 1))
    return BodyMesh(np.vstack([one.points, other.points]), np.vstack([one.cells, other.cells + one.n_nodes]))


def test_a_body_in_separate_parts_is_named() -> None:
    message = r"body 'rail' must be connected .* consists of 2 parts, the largest of 4 and 2 cells: join"
    with pytest.raises(InvalidInputError, match=message):
        default_partition(two_bricks(), body="rail")
    with pytest.raises(
        InvalidInputError, match="a mesh must be connected through faces to be cut, it consists"
    ):
        default_partition(two_bricks())


def test_a_body_that_hangs_by_an_edge_is_in_two_parts() -> None:
    mesh = rectangle((0, 0), (2, 2), (2, 2))
    used, cells = np.unique(mesh.cells[[0, 3]], return_inverse=True)
    with pytest.raises(InvalidInputError, match="consists of 2 parts, the largest of 1 and 1 cells"):
        check_one_piece(BodyMesh(mesh.points[used], cells.reshape(2, 4)))
    check_one_piece(mesh)


def test_all_ranks_get_the_same_subdomains(mpirun: Callable[..., str]) -> None:
    script = """
        import hashlib
        from mpi4py import MPI
        from fenics_contact.mesh import bisection_partition
        from fenics_contact.gallery import hemisphere
        partition = bisection_partition(hemisphere(1.0, 8), 11)
        hashes = MPI.COMM_WORLD.gather(hashlib.sha256(partition.tobytes()).hexdigest())
        if hashes:
            print(*hashes)
    """
    hashes = mpirun(script, 2).split()
    assert len(hashes) == 2
    assert len({*hashes, *mpirun(script, 1).split()}) == 1


TARGETS = {
    "block": (lambda: block((0, 0, 0), (1, 1, 1), (16, 16, 16)), 700),
    "tetrahedra": (lambda: block((0, 0, 0), (1, 1, 1), (14, 14, 14), "tetrahedron"), 700),
    "hemisphere": (lambda: hemisphere(1.0, 14), 700),
    "square": (lambda: rectangle((0, 0), (1, 1), (100, 100)), 1000),
    "triangles": (lambda: rectangle((0, 0), (1, 1), (80, 80), "triangle"), 1000),
    "disc": (lambda: half_disc(1.0, 40), 1000),
}
#: Bodies of graded cells: where cells are large, subdomains have fewer.
GRADED = ("hemisphere", "disc")


@pytest.mark.parametrize("name", TARGETS)
def test_subdomains_have_about_the_nodes_aimed_at(name: str) -> None:
    build, nodes = TARGETS[name]
    mesh = build()
    partition = default_partition(mesh)
    counts = torn_node_counts(mesh, partition)
    target = target_parts(mesh)
    assert target > 1
    # Equal boxes may be smaller than others.
    assert round(0.8 * target) <= counts.size <= round((1.25 if mesh.grid is None else 1.6) * target)
    least, most = (0.4, 2.0) if name in GRADED else (0.65, 1.3)
    assert least * nodes < counts.min()
    assert counts.max() < most * nodes


def test_a_structured_mesh_is_cut_into_equal_boxes_near_a_prime_target() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (32, 16, 16))
    assert target_parts(mesh) == 17
    assert np.array_equal(default_partition(mesh), box_partition(mesh, (4, 2, 2)))
    assert default_partition(mesh, 18).max() >= 17


def test_smaller_subdomains_are_more() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (12, 12, 12))
    assert target_parts(mesh, nodes=7**3) == 8
    assert target_parts(mesh, nodes=5**3) == 27
    assert target_parts(mesh, nodes=8) == mesh.n_cells
    assert target_parts(SMALL["hexahedron"]) == 1


@pytest.mark.parametrize("nodes", [7.9, np.nan, np.inf])
def test_subdomains_without_a_cell_are_refused(nodes: float) -> None:
    with pytest.raises(InvalidInputError, match=f"nodes must be at least 8, which one cell has, got {nodes}"):
        target_parts(SMALL["hexahedron"], nodes)
    assert target_parts(SMALL["quadrilateral"], 4) == 20


def test_every_rank_gets_a_subdomain_while_there_are_cells() -> None:
    mesh = SMALL["hexahedron"]
    assert default_partition(mesh, 5).max() == 4
    assert default_partition(mesh, 1000).max() == mesh.n_cells - 1
    assert not default_partition(mesh).any()
    with pytest.raises(InvalidInputError, match="ranks must be an integer of at least 1, got 0"):
        default_partition(mesh, 0)


def test_a_lean_cut_has_small_interfaces_also_where_cells_are_graded() -> None:
    """Dense matrices of subdomains have as many entries as the squares of their unknowns on interfaces."""
    mesh = two_links(LinkShape(n_around=54, n_a=9, n_b=24, grading=4.0)).first.mesh
    squares = []
    for lean in (False, True):
        partition = default_partition(mesh, lean=lean)
        check_face_connected(mesh, partition)
        key = np.unique(partition[:, None] * mesh.n_nodes + mesh.cells)
        torn = np.bincount(key % mesh.n_nodes) > 1
        squares.append(float((np.bincount(key // mesh.n_nodes, torn[key % mesh.n_nodes]) ** 2).sum()))
    assert squares[1] < 0.6 * squares[0]
    plane = rectangle((0, 0), (1, 1), (60, 60))
    assert np.array_equal(default_partition(plane, lean=True), default_partition(plane))


def test_a_bent_bar_is_cut_across_its_length() -> None:
    mesh = chain_link().mesh
    assert np.array_equal(default_partition(mesh), box_partition(mesh, (16, 1, 1)))


def test_a_cube_is_not_cut_into_slabs_where_its_layers_do_not_fit() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (12, 12, 12))
    partition = default_partition(mesh, 7)
    check_face_connected(mesh, partition)
    slabs = torn_node_counts(mesh, box_partition(mesh, (7, 1, 1))).sum()
    assert torn_node_counts(mesh, partition).sum() < slabs
    assert np.array_equal(default_partition(mesh, 8), box_partition(mesh, (2, 2, 2)))


def test_a_grid_with_a_hole_is_cut_all_the_same() -> None:
    mesh = rectangle((0, 0), (4, 4), (4, 4))
    assert mesh.grid is not None
    kept = ~np.all((mesh.grid > 0) & (mesh.grid < 3), axis=1)
    used, cells = np.unique(mesh.cells[kept], return_inverse=True)
    ring = BodyMesh(mesh.points[used], cells.reshape(-1, 4), grid=mesh.grid[kept])
    partition = default_partition(ring, 3)
    check_face_connected(ring, partition)
    assert np.unique(partition).tolist() == [0, 1, 2]
