"""PETSc objects go away together with the Python object that uses them."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact._base import sparse as disposal
from fenics_contact._base.sparse import SharedFactor, dispose_with, sweep
from fenics_contact.feti.factor import Factor


class Petsc:
    """Stands for a PETSc object."""

    def __init__(self) -> None:
        self.destroyed = 0

    def destroy(self) -> None:
        self.destroyed += 1


class Owner:
    """Holds one."""


class TwoRanks:
    """A communicator of two ranks of which the other still uses what was registered as the numbers given."""

    size = 2

    def __init__(self, *used: int) -> None:
        self.used = used

    def allgather(self, waiting: list[disposal.Key]) -> list[list[disposal.Key]]:
        return [waiting, [label for label in waiting if label[1] not in self.used]]


def test_objects_of_one_rank_are_destroyed_with_their_owner() -> None:
    owner, held = Owner(), (Petsc(), Petsc())
    dispose_with(owner, *held)
    assert [part.destroyed for part in held] == [0, 0]
    del owner
    assert [part.destroyed for part in held] == [1, 1]


def test_shared_objects_wait_until_no_rank_uses_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disposal, "_ranks_in", lambda comm, group: [0, 1])
    monkeypatch.setattr(disposal, "_place_of", lambda comm: 0)
    monkeypatch.setattr(disposal, "_groups", [MPI.COMM_SELF.group])
    owner, held = Owner(), Petsc()
    dispose_with(owner, held, comm=TwoRanks())  # type: ignore[arg-type]
    ((_, index),) = disposal._owned
    del owner
    assert held.destroyed == 0
    sweep(TwoRanks(index))  # type: ignore[arg-type]
    assert held.destroyed == 0
    sweep(TwoRanks())  # type: ignore[arg-type]
    assert held.destroyed == 1
    sweep(TwoRanks())  # type: ignore[arg-type]
    assert held.destroyed == 1


def resident() -> float:
    """Resident memory, [MB]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 2**20


@pytest.mark.parametrize("kind", ["Factor", "SharedFactor"])
def test_memory_does_not_grow_with_the_number_of_factors(kind: str) -> None:
    random = sp.random(1500, 1500, 0.01, random_state=1, format="csr")
    matrix = (random + random.T + 100 * sp.eye(1500)).tocsr()

    def build() -> None:
        if kind == "Factor":
            Factor(matrix)
        else:
            SharedFactor(MPI.COMM_SELF, matrix, np.ones(1500))
        gc.collect()

    for _ in range(3):
        build()
    before = resident()
    for _ in range(8):
        build()
    assert resident() - before < 20  # one factor takes more than that


def test_garbage_that_is_collected_during_a_sweep_waits_for_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting: dict[disposal.Key, tuple[tuple[()], None]] = {(0, 1): ((), None)}

    def collecting(*_: object) -> list[int]:
        waiting[0, 2] = (), None
        return [0, 1]

    monkeypatch.setattr(disposal, "_waiting", waiting)
    monkeypatch.setattr(disposal, "_groups", [None])
    monkeypatch.setattr(disposal, "_ranks_in", collecting)
    sweep(TwoRanks())  # type: ignore[arg-type]
    assert list(waiting) == [(0, 2)]
