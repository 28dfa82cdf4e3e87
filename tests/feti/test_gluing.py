"""Gluing, copies, contact rows and rows that contradict one another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, box_partition
from fenics_contact._fem.forms import FormLibrary, cell_stiffness
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import DualSystem, Rows, TornSystem, build_torn_system, decompose
from fenics_contact.feti.decomposition import (
    Tearing,
    gluing_rows,
    prescribed_displacements,
    tear,
    weighted_helmert,
)
from fenics_contact.gallery import block
from fenics_contact.qp import DualProblem, FacePreconditioner
from fenics_contact.qp.problem import RowsOfFace, Scaling
from tests.feti.corner_cases import corner
from tests.feti.scenes import CELLS, STEEL, Cut, lone_block, ragged_block, touching_blocks

ROLLERS = (Support("block", "z0", (None, None, 0.1)), Support("block", "x0", (0.2, None, 0.1)))


def torn(cut: Cut, contrast: float = 0.0) -> Tearing:
    """Tear a scene, the stiffness of its cells spread over so many powers of ten."""
    scene, partitions = cut
    rng = np.random.default_rng(5)
    cells = {name: body.mesh.n_cells for name, body in scene.bodies.items()}
    alone = np.zeros(sum(part.max() + 1 for part in partitions.values()), dtype=int)
    return tear(
        scene, partitions, alone, {n: 10.0 ** (contrast * rng.random(count)) for n, count in cells.items()}
    )


def glued(cut: Cut, contrast: float = 0.0) -> tuple[Tearing, Rows, sp.csr_matrix]:
    tearing = torn(cut, contrast)
    prescribed = prescribed_displacements(cut[0], tearing)
    gluing = gluing_rows(tearing, ~np.isnan(prescribed))
    rows = replace(gluing.rows, right=gluing.right_side(prescribed))
    shape = (rows.count, 3 * len(tearing.copy_node))
    return tearing, rows, sp.csr_matrix((rows.value, (rows.row, 3 * rows.copy + rows.component)), shape=shape)


CUTS = {
    "two boxes": lambda **more: lone_block("hexahedron", (2, 1, 1), **more),
    "four boxes": lambda **more: lone_block("tetrahedron", (2, 2, 1), **more),
    "eight boxes": lambda **more: lone_block("hexahedron", (2, 2, 2), **more),
    "ragged hexahedra": lambda **more: ragged_block("hexahedron", 7, **more),
    "ragged tetrahedra": lambda **more: ragged_block("tetrahedron", 6, **more),
}


@pytest.mark.parametrize("supports", [(), ROLLERS], ids=["free", "supported"])
@pytest.mark.parametrize("name", CUTS)
def test_rows_are_orthonormal_where_the_stiffness_is_even(name: str, supports: Any) -> None:
    _, rows, B = glued(CUTS[name](supports=supports))
    assert rows.count > 20
    assert abs(B @ B.T - sp.identity(rows.count)).max() < 1e-14


def test_each_rank_has_the_entries_on_its_copies() -> None:
    scene, partitions = CUTS["ragged hexahedra"](supports=ROLLERS)
    tearing = replace(torn((scene, partitions)), subdomain_rank=np.array([0, 0, 1, 1, 1, 2, 2]))
    fixed = ~np.isnan(prescribed_displacements(scene, tearing))
    every, parts = gluing_rows(tearing, fixed), [gluing_rows(tearing, fixed, rank=k) for k in range(3)]
    for number, part in enumerate(parts):
        assert 0 < len(part.rows.row) < 0.7 * len(every.rows.row)
        assert (tearing.subdomain_rank[tearing.copy_subdomain[part.rows.copy]] == number).all()
        for name in ("owner", "right"):
            np.testing.assert_array_equal(getattr(part.rows, name), getattr(every.rows, name))
        np.testing.assert_array_equal(part.dof, every.dof)

    def listed(each: Rows) -> set[tuple[float, ...]]:
        return set(zip(each.row, each.copy, each.component, each.value, strict=True))

    assert set.union(*(listed(part.rows) for part in parts)) == listed(every.rows)
    assert sum(len(part.rows.row) for part in parts) == len(every.rows.row)


@pytest.mark.parametrize("supports", [(), ROLLERS], ids=["free", "supported"])
@pytest.mark.parametrize("name", CUTS)
def test_rows_are_orthogonal_weighted_by_uneven_stiffness(name: str, supports: Any) -> None:
    tearing, _, B = glued(CUTS[name](supports=supports), contrast=3.0)
    assert tearing.copy_stiffness.min() < 0.05
    assert tearing.copy_stiffness.max() == 1.0
    assert abs((B.multiply(B)).sum(axis=1) - 1.0).max() < 1e-14
    gram = B @ sp.diags(np.repeat(1.0 / tearing.copy_stiffness, 3)) @ B.T
    assert abs(gram - sp.diags(gram.diagonal())).max() < 1e-12 * gram.diagonal().max()


@pytest.mark.parametrize("contrast", [0.0, 3.0])
@pytest.mark.parametrize("name", CUTS)
def test_there_are_as_many_rows_as_surplus_copies_and_all_vanish_on_fitting_displacements(
    name: str, contrast: float
) -> None:
    tearing, rows, B = glued(CUTS[name](), contrast)
    copies, nodes = len(tearing.copy_node), len(tearing.multiplicity)
    assert rows.count == 3 * (copies - nodes)
    fitting = np.random.default_rng(2).standard_normal((nodes, 3))[tearing.copy_node]
    assert abs(B @ fitting.ravel()).max() < 1e-14
    assert not rows.right.any()


@pytest.mark.parametrize("name", CUTS)
def test_prescribed_components_are_met_by_every_copy(name: str) -> None:
    scene, partitions = CUTS[name](supports=ROLLERS)
    tearing, rows, B = glued((scene, partitions))
    value = prescribed_displacements(scene, tearing)
    fixed = ~np.isnan(value)
    free = np.random.default_rng(2).standard_normal(fixed.shape)
    fitting = np.where(fixed, value, free)[tearing.copy_node]
    assert abs(B @ fitting.ravel() - rows.right).max() < 1e-14
    surplus = np.where(fixed, tearing.multiplicity[:, None], tearing.multiplicity[:, None] - 1)
    assert rows.count == surplus.sum()
    assert set(np.unique(rows.right)) == {0.0, 0.1, 0.2}


def test_corners_of_two_four_and_eight_boxes_have_as_many_copies() -> None:
    tearing, _, _ = glued(lone_block("hexahedron", (2, 2, 2)))
    assert set(tearing.multiplicity) == {1, 2, 4, 8}


@pytest.mark.parametrize("copies", [2, 3, 4, 8, 13])
def test_helmert_rows_are_orthonormal_and_vanish_on_equal_copies(copies: int) -> None:
    (rows,) = weighted_helmert(np.full((1, copies), 0.3))
    np.testing.assert_allclose(rows @ rows.T, np.eye(copies - 1), atol=1e-14)
    np.testing.assert_allclose(rows.sum(axis=1), 0.0, atol=1e-14)


def test_supports_may_change_their_values_but_not_what_they_hold() -> None:
    cut = lone_block("hexahedron", supports=ROLLERS)
    tearing, _, _ = glued(cut)
    prescribed = prescribed_displacements(cut[0], tearing)
    gluing = gluing_rows(tearing, ~np.isnan(prescribed))
    np.testing.assert_allclose(gluing.right_side(2.0 * prescribed), 2.0 * gluing.right_side(prescribed))
    prescribed[np.flatnonzero(np.isnan(prescribed[:, 0]))[0]] = 0.0
    with pytest.raises(InvalidInputError, match="may change values alone, they hold other"):
        gluing.right_side(prescribed)


@pytest.mark.parametrize("cell", CELLS)
def test_supports_may_meet_where_they_agree(cell: str) -> None:
    clamps = (Support("block", "z0", (0.0, 0.0, 0.5)), Support("block", "x0", (0.0, None, 0.5)))
    scene, partitions = lone_block(cell, supports=clamps)
    value = prescribed_displacements(scene, torn((scene, partitions)))
    fixed = ~np.isnan(value)
    sides = scene.bodies["block"].mesh.surfaces
    both = np.intersect1d(sides["z0"], sides["x0"])
    assert fixed[both].all()
    assert (value[both] == [0.0, 0.0, 0.5]).all()
    only = np.setdiff1d(sides["x0"], sides["z0"])
    assert (fixed[only] == [True, False, True]).all()


def test_supports_that_disagree_where_they_meet_are_refused() -> None:
    clamps = (Support("block", "z0"), Support("block", "x0", (None, 0.1, None)))
    scene, partitions = lone_block("hexahedron", supports=clamps)
    message = "component 1 of surface 'x0' of body 'block' has another value than 0.1: leave"
    with pytest.raises(InvalidInputError, match=message):
        prescribed_displacements(scene, torn((scene, partitions)))


def test_supports_of_one_body_leave_the_nodes_of_others_alone() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    scene = Scene({"a": Body(mesh, STEEL), "b": Body(mesh, STEEL)}, [Support("b", "z0")])
    whole = {name: np.zeros(8, int) for name in "ab"}
    fixed = ~np.isnan(prescribed_displacements(scene, torn((scene, whole))))
    assert not fixed[: mesh.n_nodes].any()
    assert fixed[mesh.n_nodes :].all(axis=1).sum() == 9


def test_nodes_and_subdomains_of_all_bodies_are_numbered_through() -> None:
    scene, partitions = touching_blocks()
    forms = FormLibrary(MPI.COMM_SELF)
    forms.prepare(scene)
    tearing = tear(scene, partitions, np.arange(9) % 3, cell_stiffness(scene, forms))
    assert tearing.body_names == ("lower", "upper", "third")
    assert tearing.subdomain_offset.tolist() == [0, 4, 7, 9]
    assert tearing.n_subdomains == 9
    for index, name in enumerate(tearing.body_names):
        mesh = scene.bodies[name].mesh
        for cell in range(mesh.n_cells):
            nodes = tearing.global_nodes(name, mesh.cells[cell])
            subdomain = partitions[name][cell] + tearing.subdomain_offset[index]
            for node in nodes:
                copies = slice(tearing.first_copy[node], tearing.first_copy[node + 1])
                assert subdomain in tearing.copy_subdomain[copies]
    pairs = np.column_stack([tearing.copy_node, tearing.copy_subdomain])
    assert np.array_equal(pairs, np.unique(pairs, axis=0)), "copies are sorted, each is there once"


# Contact rows measure gap and slip, and leave gluing rows and each other alone.
@pytest.fixture(scope="module")
def torn_in_contact() -> TornSystem:
    scene, partitions = touching_blocks()
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))


def in_space(torn_in_contact: TornSystem, field: np.ndarray) -> np.ndarray:
    """Give every copy of a node the displacement of the node, shape (n_nodes, 3) -> (torn_size,)."""
    blocks = np.empty((torn_in_contact.B.shape[1] // 3, 3))
    blocks[torn_in_contact.decomposition.held[1]] = field[torn_in_contact.decomposition.tearing.copy_node]
    return blocks.ravel()


def measured(torn_in_contact: TornSystem, field: np.ndarray) -> np.ndarray:
    """Return what all rows measure of a nodal displacement, with the share of prescribed components."""
    found = torn_in_contact.B @ in_space(torn_in_contact, field)
    prescribed = np.where(torn_in_contact.decomposition.fixed, field, np.nan)
    return found + torn_in_contact.groups.of_supports(prescribed)


def all_points(torn_in_contact: TornSystem) -> np.ndarray:
    return np.vstack([body.mesh.points for body in torn_in_contact.scene.bodies.values()])


def test_the_scene_has_points_of_every_pair_and_shared_nodes_on_both_sides(
    torn_in_contact: TornSystem,
) -> None:
    assert np.bincount(torn_in_contact.points.pair).tolist() == [24, 9, 9]
    copies = torn_in_contact.decomposition.tearing.multiplicity
    touching = torn_in_contact.points.pair != 1
    assert copies[torn_in_contact.points.slave].max() > 2
    assert copies[torn_in_contact.points.master[touching].indices].max() > 2
    assert len(torn_in_contact.frictional) == 24 + 9


def free_points(torn_in_contact: TornSystem) -> np.ndarray:
    """Return which points have no node with a prescribed component."""
    return np.abs(torn_in_contact.points.jump) @ torn_in_contact.decomposition.fixed.any(axis=1) == 0.0


def test_contact_rows_are_orthogonal_to_gluing_and_support_rows(torn_in_contact: TornSystem) -> None:
    equality, contact = (
        torn_in_contact.B[: torn_in_contact.n_equality],
        torn_in_contact.B[torn_in_contact.n_equality :],
    )
    assert 20 < free_points(torn_in_contact).sum() < torn_in_contact.points.count
    assert abs(equality @ contact.T).max() < 1e-15


def test_normal_and_tangents_of_a_free_point_are_orthogonal_and_equally_long(
    torn_in_contact: TornSystem,
) -> None:
    gram = (torn_in_contact.B @ torn_in_contact.B.T).tocsr()
    free = free_points(torn_in_contact)[torn_in_contact.frictional]
    normal = torn_in_contact.normal_rows[torn_in_contact.frictional]
    rows = np.column_stack([normal, torn_in_contact.tangential_rows])[free]
    assert len(rows) > 20
    for triple in rows:
        block = gram[triple][:, triple].toarray()
        np.testing.assert_allclose(block, block[0, 0] * np.eye(3), atol=1e-14)
        assert block[0, 0] > 0.1


def test_frames_are_right_handed_and_orthonormal(torn_in_contact: TornSystem) -> None:
    frame = np.concatenate([torn_in_contact.points.tangents, torn_in_contact.points.normal[:, None]], axis=1)
    np.testing.assert_allclose(
        frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (len(frame), 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, rtol=1e-13)


def test_rows_measure_what_a_motion_of_the_slave_does(torn_in_contact: TornSystem) -> None:
    motion = np.array([0.3, -0.7, 1.1])
    nodes = np.zeros((len(all_points(torn_in_contact)), 3))
    tearing = torn_in_contact.decomposition.tearing
    nodes[tearing.node_offset[1] :] = motion  # everything but the lower block
    moved = measured(torn_in_contact, nodes)
    np.testing.assert_allclose(
        moved[torn_in_contact.normal_rows], -torn_in_contact.points.normal @ motion, atol=1e-14
    )
    slip = torn_in_contact.points.tangents[torn_in_contact.frictional] @ motion
    np.testing.assert_allclose(moved[torn_in_contact.tangential_rows], slip, atol=1e-14)


def test_rigid_motions_of_both_bodies_together_change_no_gap_between_them(
    torn_in_contact: TornSystem,
) -> None:
    moved = measured(torn_in_contact, np.tile([0.3, -0.7, 1.1], (len(all_points(torn_in_contact)), 1)))
    between = torn_in_contact.points.pair != 1
    assert abs(moved[torn_in_contact.normal_rows[between]]).max() < 1e-14
    assert abs(moved[torn_in_contact.normal_rows[~between]]).min() > 0.1, "the floor does not move along"


def test_closing_every_gap_meets_the_right_side_of_the_normal_rows(torn_in_contact: TornSystem) -> None:
    points = torn_in_contact.points
    assert points.gap[points.pair == 2] == pytest.approx(0.2)
    target = points.master @ all_points(torn_in_contact)
    onto = np.where((points.pair == 1)[:, None], 0.0, target + points.gap[:, None] * points.normal)
    slave = all_points(torn_in_contact)[points.slave]
    between = points.pair != 1
    np.testing.assert_allclose(onto[between], slave[between], atol=1e-12)
    right = torn_in_contact.right + torn_in_contact.supported
    np.testing.assert_array_equal(right[torn_in_contact.normal_rows], points.gap)
    np.testing.assert_array_equal(right[torn_in_contact.tangential_rows], 0.0)
    assert np.abs(torn_in_contact.supported[torn_in_contact.tangential_rows]).max() == pytest.approx(0.05), (
        "a support moves a slave"
    )


def test_a_frictionless_scene_has_no_tangential_rows(torn_in_contact: TornSystem) -> None:
    frictionless = np.setdiff1d(np.arange(torn_in_contact.points.count), torn_in_contact.frictional)
    assert (torn_in_contact.points.pair[frictionless] == 2).all()
    assert (
        torn_in_contact.numbering.total
        == torn_in_contact.n_equality + torn_in_contact.points.count + 2 * len(torn_in_contact.frictional)
    )
    assert isinstance(torn_in_contact.B, sp.csr_matrix)


def test_slip_bounds_belong_to_their_laws(torn_in_contact: TornSystem) -> None:
    pair = torn_in_contact.points.pair[torn_in_contact.frictional]
    slips = torn_in_contact.groups.slips
    np.testing.assert_array_equal(slips.coefficient, np.where(pair == 0, 0.3, 0.0))
    area = torn_in_contact.points.area[torn_in_contact.frictional]
    np.testing.assert_allclose(slips.tresca_bound, np.where(pair == 1, 0.4 * area, 0.0))
    assert area[pair == 1].sum() == pytest.approx(0.8), "nodal areas add up to the surface"
    assert area[pair == 0].sum() == pytest.approx(1.6**2)


# What rows of a face demand of each other: forces on dependent rows deform nothing.
@pytest.fixture(scope="module")
def problem() -> DualProblem:
    scene = corner(0.3, 0.002)
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    return DualSystem(build_torn_system(scene, decompose(scene, cut, MPI.COMM_SELF))).problem


def of_face(
    problem: DualProblem, rows: np.ndarray, factor: np.ndarray | float = 1.0
) -> tuple[RowsOfFace, np.ndarray]:
    """The preconditioner of free rows of multipliers divided by a factor, and a residual on them."""
    size = problem.layout.size
    face = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(size, len(rows)))
    scaled = replace(problem, scaling=Scaling.build(factor * np.ones(size), problem.coarse)).scaled_problem
    assert isinstance(scaled.preconditioner, FacePreconditioner)
    on_face = scaled.preconditioner.on_face(face)
    assert isinstance(on_face, RowsOfFace)
    return on_face, face @ np.random.default_rng(3).normal(size=len(rows))


def test_forces_of_a_contradiction_deform_nothing_and_leave_no_other(problem: DualProblem) -> None:
    on_face, residual = of_face(problem, np.arange(problem.layout.size))
    found = on_face.contradiction(residual)
    assert found is not None
    excess, force, group, count = found
    assert len(np.unique(group[group >= 0])) == 6 <= count  # the nodes of the edge
    flexed = problem.operator(force)
    assert np.abs(force).max() > 0.1
    assert np.abs(flexed).max() < 1e-9 * np.abs(problem.operator(residual)).max()
    assert np.abs(problem.coarse.apply(force)).max() < 1e-9 * np.abs(force).max()
    assert force @ residual < -0.1
    assert abs(force @ (residual - excess)) < 1e-8 * abs(force @ residual)
    assert on_face.contradiction(residual - excess) is None


def test_independent_rows_do_not_contradict_each_other(problem: DualProblem) -> None:
    layout = problem.layout
    on_face, residual = of_face(problem, np.concatenate([layout.equality, layout.normal]))
    assert on_face.contradiction(residual) is None


def test_scaled_rows_contradict_each_other_by_as_much(problem: DualProblem) -> None:
    factor = np.ones(problem.layout.size)
    for rows in (problem.layout.normal[:10], problem.layout.tangential[:10].ravel()):
        factor[rows] = 0.5
    rows = np.arange(problem.layout.size)
    (plain, residual), (scaled, _) = of_face(problem, rows), of_face(problem, rows, factor)
    found, expected = scaled.contradiction(factor * residual), plain.contradiction(residual)
    assert found is not None
    assert expected is not None
    np.testing.assert_allclose(found[0], factor * expected[0], atol=1e-12)
    np.testing.assert_allclose(factor * found[1], expected[1], atol=1e-12 * np.abs(expected[1]).max())
