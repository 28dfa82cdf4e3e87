"""Coarse matrices of faces, reduced to the motions on which contact acts."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import LinearState
from fenics_contact._base.sparse import SharedFactor
from fenics_contact.feti.reduced_coarse import Elimination, ReducedGrams, ReducedInverse
from fenics_contact.qp import coarse as coarse_module
from tests.feti.many_boxes import forces, resting

M, GLUED, CONTACT = 60, 200, 12


@pytest.fixture(scope="module")
def columns() -> sp.csr_matrix:
    """G of 60 motions: 200 equality rows on all of them, 12 contact rows on the last seven."""
    glued = sp.random(M, GLUED, 0.1, random_state=1)
    contact = sp.vstack([sp.csr_matrix((M - 7, CONTACT)), sp.random(7, CONTACT, 0.9, random_state=2)])
    return sp.hstack([glued, contact]).tocsr()


@pytest.fixture(scope="module")
def reduced(columns: sp.csr_matrix) -> ReducedGrams:
    found = Elimination(np.arange(GLUED))(MPI.COMM_SELF, columns)
    assert found is not None
    assert np.flatnonzero(found.touched).tolist() == list(range(M - 7, M))
    return found


def product(first: sp.csr_matrix, second: sp.csr_matrix) -> np.ndarray:
    return np.asarray((first @ second.T).toarray())


@pytest.mark.parametrize("kept", [0, 3, CONTACT])
def test_the_inverse_of_a_face_is_that_of_its_whole_matrix(
    columns: sp.csr_matrix, reduced: ReducedGrams, kept: int
) -> None:
    contact = columns[:, GLUED : GLUED + kept]
    inverse = reduced.inverse(contact)
    matrix = product(columns[:, :GLUED], columns[:, :GLUED]) + product(contact, contact)
    right = np.arange(1.0, M + 1)
    np.testing.assert_allclose(inverse.solve(right), np.linalg.solve(matrix, right), rtol=1e-11, atol=1e-11)
    assert (inverse.rank, inverse.null_space.shape) == (M, (M, 0))
    assert inverse.flops == reduced.eliminated.flops + 2 * 7**2


def test_an_unsymmetric_face_is_inverted(columns: sp.csr_matrix, reduced: ReducedGrams) -> None:
    contact = columns[:, GLUED:]
    tested = (contact @ sp.random(CONTACT, CONTACT, 1.0, random_state=4)).tocsr()
    inverse, right = reduced.square(contact, tested), np.arange(1.0, M + 1)
    matrix = product(columns[:, :GLUED], columns[:, :GLUED]) + product(contact, tested)
    assert np.abs(matrix - matrix.T).max() > 0.1 * np.abs(matrix).max()
    assert inverse is not None
    np.testing.assert_allclose(inverse.solve(right), np.linalg.solve(matrix, right), rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("limit", [coarse_module.DENSE_LIMIT, 0], ids=["eigenvectors", "filled"])
def test_motions_that_a_face_does_not_resist_are_its_null_vectors(
    monkeypatch: pytest.MonkeyPatch, limit: int
) -> None:
    monkeypatch.setattr(coarse_module, "DENSE_LIMIT", limit)
    generator = np.random.default_rng(3)
    loose = np.zeros((40, 2))  # two motions of 40 that no equality row resists
    loose[-10:] = generator.standard_normal((10, 2))
    loose[:30] = generator.standard_normal((30, 2))
    glued = generator.standard_normal((40, 90))
    glued -= loose @ np.linalg.lstsq(loose, glued, rcond=None)[0]
    contact = np.zeros((40, 9))
    contact[-10:] = generator.standard_normal((10, 9))
    found = Elimination(np.arange(90))(MPI.COMM_SELF, sp.csr_matrix(np.hstack([glued, contact])))
    assert found is not None
    for kept, rank in ((0, 38), (1, 39), (9, 40)):
        rows = contact[:, :kept]
        matrix, inverse = glued @ glued.T + rows @ rows.T, found.inverse(sp.csr_matrix(rows))
        assert (inverse.rank, inverse.null_space.shape[1]) == (rank, 40 - rank)
        np.testing.assert_allclose(matrix @ inverse.null_space, 0.0, atol=1e-9)
        right = matrix @ np.arange(1.0, 41.0)
        np.testing.assert_allclose(matrix @ inverse.solve(right), right, atol=1e-8)
    assert found.square(sp.csr_matrix(contact[:, :0]), sp.csr_matrix(contact[:, :0])) is None


def test_it_is_not_built_where_contact_acts_on_many_motions(columns: sp.csr_matrix) -> None:
    everywhere = sp.csr_matrix(np.ones((M, 1)))
    assert Elimination(np.arange(GLUED))(MPI.COMM_SELF, sp.hstack([columns, everywhere]).tocsr()) is None
    assert Elimination(np.arange(GLUED), largest=0.4)(MPI.COMM_SELF, columns) is None


@pytest.mark.parametrize("lost", [0.0, 1e-9], ids=["zero", "rounding"])
def test_it_is_not_built_where_nothing_resists_a_motion_without_contact(lost: float) -> None:
    generator = np.random.default_rng(1)
    rows = generator.standard_normal((20, 30))
    rows[1] = rows[0] + lost * rows[1]
    eliminate = Elimination(np.arange(28))
    rows[:-6, 28:] = 0.0
    assert eliminate(MPI.COMM_SELF, sp.csr_matrix(rows)) is None
    rows[1] = generator.standard_normal(30)
    rows[1, 28:] = 0.0
    assert eliminate(MPI.COMM_SELF, sp.csr_matrix(rows)) is not None


def assert_same(state: LinearState, other: LinearState) -> None:
    assert state.contact.status.tolist() == other.contact.status.tolist()
    size = np.abs(forces(other)).max()
    assert size > 1e-6
    np.testing.assert_allclose(forces(state), forces(other), rtol=0, atol=1e-8 * size)


@pytest.fixture(scope="module")
def dense() -> dict[bool, LinearState]:
    return {held: resting(MPI.COMM_SELF, (3, 3, 3), 10_000, held) for held in (True, False)}


@pytest.mark.parametrize("held", [True, False], ids=["held", "floating"])
def test_forces_are_those_of_dense_coarse_matrices_and_large_ones_are_factored_once(
    dense: dict[bool, LinearState], monkeypatch: pytest.MonkeyPatch, held: bool
) -> None:
    made: Counter[str] = Counter()

    def counted(kind: type) -> None:
        build = kind.__init__

        def init(self: object, *arguments: object, **named: object) -> None:
            made[kind.__name__] += 1
            build(self, *arguments, **named)

        monkeypatch.setattr(kind, "__init__", init)

    for kind in (SharedFactor, ReducedInverse):
        counted(kind)
    state = resting(MPI.COMM_SELF, (3, 3, 3), 0, held)
    assert_same(state, dense[held])
    assert isinstance(state.system.problem.coarse.gram, ReducedInverse)
    assert made["SharedFactor"] == 0, "nothing else is factored sparsely"
    steps = len(state.solution.history)
    assert steps >= 3
    assert made["ReducedInverse"] >= 3 * steps, "three matrices a face"
    assert abs(state.solution.products - dense[held].solution.products) <= 1


@pytest.mark.parametrize("boxes", [(2, 3, 4), (4, 2, 3)])
def test_forces_do_not_depend_on_the_cut(dense: dict[bool, LinearState], boxes: tuple[int, int, int]) -> None:
    assert_same(resting(MPI.COMM_SELF, boxes, 0), dense[True])


ON_RANKS = """
    import json
    from mpi4py import MPI
    from tests.feti.many_boxes import forces, resting
    comm = MPI.COMM_WORLD
    state = resting(comm, (3, 3, 3), 0)
    kind = type(state.system.problem.coarse.gram).__name__
    flops = comm.gather(state.system.problem.coarse.gram.flops)
    if comm.rank == 0:
        print(json.dumps([kind, state.solution.products, forces(state).tolist(), flops]))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_any_number_of_ranks_finds_the_same(
    dense: dict[bool, LinearState], mpirun: Callable[..., str], ranks: int
) -> None:
    kind, products, found, flops = json.loads(mpirun(ON_RANKS, ranks).splitlines()[-1])
    expected = forces(dense[True])
    assert (kind, products) == ("ReducedInverse", dense[True].solution.products)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert flops[0] > 0
    assert flops[1:] == [0] * (ranks - 1), "the first rank solves for all"


def test_the_coupling_of_motions_is_transposed_once(reduced: ReducedGrams) -> None:
    inside = reduced.eliminated
    assert inside is not None
    assert inside.coupling.nnz > 0
    assert inside.transposed is inside.transposed
    assert np.shares_memory(inside.transposed.data, inside.coupling.data)
