"""Gluing rows are orthogonal, weighted by stiffness, and vanish exactly on fitting displacements."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fenics_contact import Body, Scene, Support
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import Rows
from fenics_contact.feti.decomposition import (
    Tearing,
    gluing_rows,
    prescribed_displacements,
    tear,
    weighted_helmert,
)
from fenics_contact.gallery import block
from tests.feti.scenes import CELLS, STEEL, Cut, lone_block, ragged_block

ROLLERS = (Support("block", "z0", (None, None, 0.1)), Support("block", "x0", (0.2, None, 0.1)))


def torn(cut: Cut, contrast: float = 0.0) -> Tearing:
    """Tear a scene, the stiffness of its cells spread over so many powers of ten."""
    scene, partitions = cut
    rng = np.random.default_rng(5)
    cells = {name: body.mesh.n_cells for name, body in scene.bodies.items()}
    return tear(
        scene, partitions, 1, {n: 10.0 ** (contrast * rng.random(count)) for n, count in cells.items()}
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
    with pytest.raises(InvalidInputError, match="may change their values, not what they hold"):
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
    message = (
        "component 1 of 5 nodes of surface 'x0' of body 'block' already has another value than 0.1: leave"
    )
    with pytest.raises(InvalidInputError, match=message):
        prescribed_displacements(scene, torn((scene, partitions)))


def test_supports_of_one_body_leave_the_nodes_of_others_alone() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    scene = Scene({"a": Body(mesh, STEEL), "b": Body(mesh, STEEL)}, [Support("b", "z0")])
    whole = {name: np.zeros(8, int) for name in "ab"}
    fixed = ~np.isnan(prescribed_displacements(scene, torn((scene, whole))))
    assert not fixed[: mesh.n_nodes].any()
    assert fixed[mesh.n_nodes :].all(axis=1).sum() == 9
