"""Continuous corrections keep jumps and save energy; products do not grow with thin cells beside supports."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.feti import ContinuousCorrection, DualSystem, build_torn_system, decompose
from fenics_contact.gallery import box_lattice
from fenics_contact.partition import box_partition
from fenics_contact.qp import ProjectedCG, solve
from fenics_contact.scene import Body, Scene, Support, Traction
from tests.feti.scenes import STEEL, Cut, lone_block, touching_blocks


def dual(cut: Cut) -> DualSystem:
    scene, partitions = cut
    return DualSystem(build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)))


@pytest.fixture(scope="module")
def system() -> DualSystem:
    return dual(touching_blocks())


@pytest.fixture(scope="module")
def correction(system: DualSystem) -> ContinuousCorrection:
    found = system.preconditioner.correction
    assert found is not None
    return found


def test_a_correction_changes_no_jump(system: DualSystem, correction: ContinuousCorrection) -> None:
    moved = np.random.default_rng(0).normal(size=len(system.inverse.interface))
    before, after = system.interface_jump(moved), system.interface_jump(correction(moved))
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * np.abs(before).max())
    assert np.abs(correction(moved) - moved).max() > 0.1


def test_a_correction_of_lifted_jumps_saves_energy(
    system: DualSystem, correction: ContinuousCorrection
) -> None:
    force = np.random.default_rng(1).normal(size=len(system.torn.numbering.owned))
    jump = system.problem.coarse.project(system.apply(force))
    lifted = system.preconditioner.lifting(sp.csr_matrix((len(jump), 0))).jump(jump)
    assert system.inverse.energy(correction(lifted))[0] < 0.9 * system.inverse.energy(lifted)[0]


def test_the_transpose_of_a_correction_is_its_transpose(correction: ContinuousCorrection) -> None:
    v, f = np.random.default_rng(2).normal(size=(2, correction.stiff.shape[0]))
    assert correction(v) @ f == pytest.approx(v @ correction.transposed(f), rel=1e-12)


def test_a_body_in_one_piece_needs_no_correction() -> None:
    assert dual(lone_block("hexahedron", (1, 1, 1))).preconditioner.correction is None


def roller(thinnest: float) -> DualSystem:
    """A block in four boxes on rollers, with layers of cells beside one of them that are ever thinner."""
    ticks, even = np.append(0.0, np.geomspace(thinnest, 1.0, 6)), np.linspace(0.0, 1.0, 7)
    mesh = box_lattice([even, ticks, even])
    held = [
        Support("block", side, value)
        for side, value in (("x0", (0.0, None, None)), ("y0", (None, 0.0, None)), ("z0", (None, None, 0.0)))
    ]
    scene = Scene({"block": Body(mesh, STEEL)}, held, [Traction("block", "z1", (0.3, 0.1, 1.0))])
    return dual((scene, {"block": box_partition(mesh, (2, 1, 2))}))


def test_thin_cells_beside_a_support_cost_few_products() -> None:
    even, thin = (solve(roller(h).problem, None, ProjectedCG(1e-8)).products for h in (1 / 6, 0.02))
    assert even < 20
    assert thin <= 1.3 * even
    plain = roller(0.02)
    plain.preconditioner.correction = None
    assert solve(plain.problem, None, ProjectedCG(1e-8)).products > 1.4 * thin
