"""Motions eliminated from coarse matrices by all ranks, whatever the sizes: run under mpirun."""

from __future__ import annotations

import json
import sys
from collections import Counter
from typing import Any
from unittest.mock import patch

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.eliminated import SharedCholesky, SharedEliminated
from fenics_contact.feti.reduced_coarse import Elimination, ReducedGrams, ReducedInverse
from fenics_contact.qp import coarse
from tests.feti.many_boxes import forces, resting

M, GLUED, TOUCHED = 60, 200, 9
made: Counter[str] = Counter()


def matrices(loose: int) -> tuple[np.ndarray, np.ndarray]:
    """Return columns of equality rows, which leave some motions loose, and of rows on the last motions."""
    generator = np.random.default_rng(3)
    glued, contact = generator.standard_normal((M, GLUED)), generator.standard_normal((M, 12))
    contact[:-TOUCHED] = 0.0
    motions = generator.standard_normal((M, loose))
    return glued - motions @ np.linalg.lstsq(motions, glued, rcond=None)[0], contact


def reduced(comm: MPI.Comm, glued: np.ndarray, contact: np.ndarray) -> ReducedGrams | None:
    """Eliminate; each rank has some of the columns. Collective."""
    mine = [part[:, comm.rank :: comm.size] for part in (glued, contact)]
    return Elimination(np.arange(mine[0].shape[1]))(comm, sp.csr_matrix(np.hstack(mine)))


def of_faces(comm: MPI.Comm) -> dict[str, Any]:
    """Return relative residuals of faces with all contact rows, and what those without leave. Collective."""
    found: dict[str, Any] = {}
    for loose in (0, 2):
        glued, contact = matrices(loose)
        grams = reduced(comm, glued, contact)
        assert grams is not None
        mine = sp.csr_matrix(contact[:, comm.rank :: comm.size])
        tested = mine + 0.5 * sp.csr_matrix(np.roll(mine.toarray(), 1, axis=0) * (mine.toarray() != 0))
        turn = contact + 0.5 * np.roll(contact, 1, axis=0) * (contact != 0)
        right = glued @ np.ones(GLUED)
        for name, inverse, matrix in (
            ("symmetric", grams.inverse(mine), glued @ glued.T + contact @ contact.T),
            ("not", grams.square(mine, tested), glued @ glued.T + contact @ turn.T),
        ):
            assert inverse is not None
            residual = matrix @ inverse.solve(right) - right
            found[f"{name}, {loose}"] = np.abs(residual).max() / np.abs(right).max()
        alone = grams.inverse(mine[:, :0])
        found[f"null, {loose}"] = np.abs(glued.T @ alone.null_space).max(initial=0.0)
        found[f"rank, {loose}"] = alone.rank
        found[f"singular, {loose}"] = grams.square(mine[:, :0], mine[:, :0]) is None
    return found


def refused(comm: MPI.Comm) -> list[bool]:
    """Return whether ranks eliminate where nothing resists a motion, and where one rank fails. Collective."""
    glued, contact = matrices(0)
    doubled, nearly = glued.copy(), glued.copy()
    doubled[3], nearly[3] = glued[4], glued[4] + 1e-9 * glued[3]

    def failing(factor: object) -> None:
        if comm.rank == comm.size - 1:
            raise ConvergenceError("no memory")

    with patch("fenics_contact.feti.eliminated.require_factored", failing):
        failed = reduced(comm, glued, contact) is None
    return [failed, *(reduced(comm, singular, contact) is None for singular in (doubled, nearly))]


def scene(comm: MPI.Comm, held: bool) -> dict[str, Any]:
    """Solve a block on a plane. Collective."""
    before = made["factors"]
    state = resting(comm, (3, 3, 3), 0, held)
    gram = state.system.problem.coarse.gram
    assert isinstance(gram, ReducedInverse)
    inside = gram._grams.eliminated
    assert isinstance(inside, SharedEliminated)
    return {
        "products": state.solution.products,
        "forces": forces(state).tolist(),
        "factors": made["factors"] - before,
        "entries": comm.gather(inside.factor.entries),
    }


if __name__ == "__main__":
    world, build = MPI.COMM_WORLD, SharedCholesky.__init__

    def counted(self: SharedCholesky, comm: MPI.Comm, share: sp.csr_matrix) -> None:
        made["factors"] += 1
        build(self, comm, share)

    # These processes run other scripts, too.
    several = patch.multiple(ReducedGrams, fewest=1, rows_per_rank=1), patch.object(coarse, "DENSE_LIMIT", 0)
    with several[0], several[1], patch.object(SharedCholesky, "__init__", counted):
        answer = {
            "faces": of_faces(world),
            "refused": refused(world),
            "held": scene(world, True),
            "floating": scene(world, False),
        }
    if world.rank == 0:
        sys.stdout.write("\n" + json.dumps(answer))
