"""Contact rows measure gap and slip, and leave gluing rows and each other alone."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.feti import TornSystem, build_torn_system, decompose
from tests.feti.scenes import touching_blocks


@pytest.fixture(scope="module")
def torn() -> TornSystem:
    scene, partitions = touching_blocks()
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))


def in_space(torn: TornSystem, field: np.ndarray) -> np.ndarray:
    """Give every copy of a node the displacement of the node, shape (n_nodes, 3) -> (torn_size,)."""
    blocks = np.empty((torn.B.shape[1] // 3, 3))
    blocks[torn.decomposition.copy_block] = field[torn.decomposition.tearing.copy_node]
    return blocks.ravel()


def measured(torn: TornSystem, field: np.ndarray) -> np.ndarray:
    """Return what all rows measure of a nodal displacement, with the share of prescribed components."""
    found = torn.B @ in_space(torn, field)
    prescribed = np.where(torn.decomposition.fixed, field, np.nan)
    found[torn.n_gluing :] += np.concatenate([part.of_supports(prescribed) for part in torn.relations])
    return found


def all_points(torn: TornSystem) -> np.ndarray:
    return np.vstack([body.mesh.points for body in torn.scene.bodies.values()])


def test_the_scene_has_points_of_every_pair_and_shared_nodes_on_both_sides(torn: TornSystem) -> None:
    assert np.bincount(torn.points.pair).tolist() == [24, 9, 9]
    copies = torn.decomposition.tearing.multiplicity
    touching = torn.points.pair != 1
    assert copies[torn.points.slave].max() > 2
    assert copies[torn.points.master[touching].indices].max() > 2
    assert len(torn.frictional) == 24 + 9


def free_points(torn: TornSystem) -> np.ndarray:
    """Return which points have no node with a prescribed component."""
    return np.abs(torn.points.jump) @ torn.decomposition.fixed.any(axis=1) == 0.0


def test_contact_rows_are_orthogonal_to_gluing_and_support_rows(torn: TornSystem) -> None:
    equality, contact = torn.B[: torn.n_equality], torn.B[torn.n_equality :]
    assert 20 < free_points(torn).sum() < torn.points.count
    assert abs(equality @ contact.T).max() < 1e-15


def test_normal_and_tangents_of_a_free_point_are_orthogonal_and_equally_long(torn: TornSystem) -> None:
    gram = (torn.B @ torn.B.T).tocsr()
    free = free_points(torn)[torn.frictional]
    normal = torn.normal_rows[torn.frictional]
    rows = np.column_stack([normal, torn.tangential_rows])[free]
    assert len(rows) > 20
    for triple in rows:
        block = gram[triple][:, triple].toarray()
        np.testing.assert_allclose(block, block[0, 0] * np.eye(3), atol=1e-14)
        assert block[0, 0] > 0.1


def test_frames_are_right_handed_and_orthonormal(torn: TornSystem) -> None:
    frame = np.concatenate([torn.points.tangents, torn.points.normal[:, None]], axis=1)
    np.testing.assert_allclose(
        frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (len(frame), 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, rtol=1e-13)


def test_rows_measure_what_a_motion_of_the_slave_does(torn: TornSystem) -> None:
    motion = np.array([0.3, -0.7, 1.1])
    nodes = np.zeros((len(all_points(torn)), 3))
    tearing = torn.decomposition.tearing
    nodes[tearing.node_offset[1] :] = motion  # everything but the lower block
    moved = measured(torn, nodes)
    np.testing.assert_allclose(moved[torn.normal_rows], -torn.points.normal @ motion, atol=1e-14)
    slip = torn.points.tangents[torn.frictional] @ motion
    np.testing.assert_allclose(moved[torn.tangential_rows], slip, atol=1e-14)


def test_rigid_motions_of_both_bodies_together_change_no_gap_between_them(torn: TornSystem) -> None:
    moved = measured(torn, np.tile([0.3, -0.7, 1.1], (len(all_points(torn)), 1)))
    between = torn.points.pair != 1
    assert abs(moved[torn.normal_rows[between]]).max() < 1e-14
    assert abs(moved[torn.normal_rows[~between]]).min() > 0.1, "the floor does not move along"


def test_closing_every_gap_meets_the_right_side_of_the_normal_rows(torn: TornSystem) -> None:
    points = torn.points
    assert points.gap[points.pair == 2] == pytest.approx(0.2)
    target = points.master @ all_points(torn)
    onto = np.where((points.pair == 1)[:, None], 0.0, target + points.gap[:, None] * points.normal)
    slave = all_points(torn)[points.slave]
    between = points.pair != 1
    np.testing.assert_allclose(onto[between], slave[between], atol=1e-12)
    right = torn.right + torn.supported
    np.testing.assert_array_equal(right[torn.normal_rows], points.gap)
    np.testing.assert_array_equal(right[torn.tangential_rows], 0.0)
    assert np.abs(torn.supported[torn.tangential_rows]).max() == pytest.approx(0.05), (
        "a support moves a slave"
    )


def test_a_frictionless_scene_has_no_tangential_rows(torn: TornSystem) -> None:
    frictionless = np.setdiff1d(np.arange(torn.points.count), torn.frictional)
    assert (torn.points.pair[frictionless] == 2).all()
    assert torn.numbering.total == torn.n_equality + torn.points.count + 2 * len(torn.frictional)
    assert isinstance(torn.B, sp.csr_matrix)


def test_slip_bounds_belong_to_their_laws(torn: TornSystem) -> None:
    pair = torn.points.pair[torn.frictional]
    np.testing.assert_array_equal(torn.friction_coefficient, np.where(pair == 0, 0.3, 0.0))
    area = torn.points.area[torn.frictional]
    np.testing.assert_allclose(torn.tresca_bound, np.where(pair == 1, 0.4 * area, 0.0))
    assert area[pair == 1].sum() == pytest.approx(0.8), "nodal areas add up to the surface"
    assert area[pair == 0].sum() == pytest.approx(1.6**2)
