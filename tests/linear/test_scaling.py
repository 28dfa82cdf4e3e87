"""The Dirichlet preconditioner keeps the number of iterations bounded while subdomains are added."""

from __future__ import annotations

import sys

import pytest
from mpi4py import MPI

from fenics_contact import solve_scene
from tests.feti.scenes import CELLS, clamped_block

LAYERS = 4  # cells along the edge of a subdomain, H/h


@pytest.mark.parametrize("cell", CELLS)
def test_iterations_are_bounded_as_subdomains_are_added(cell: str) -> None:
    counts = {}
    for n in (2, 3, 4):
        scene, partitions = clamped_block(cell, (n, n, n), LAYERS)
        state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10)
        assert state.solution.residuals.gluing < 1e-10
        counts[n**3] = state.solution.products
    sys.stdout.write(f"\n{cell}, H/h = {LAYERS}: iterations by number of subdomains {counts}\n")
    assert counts[64] <= 1.3 * counts[8]
    assert 5 < counts[64] < 40
