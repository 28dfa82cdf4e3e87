"""What rows of a face demand of each other: forces on dependent rows deform nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import box_partition
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.qp import DualProblem, FacePreconditioner
from fenics_contact.qp.problem import RowsOfFace, Scaling
from tests.contact.corner_cases import corner


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
