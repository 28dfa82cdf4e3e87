"""Memory that does not suffice is an error that says what limits it, on all ranks."""

from __future__ import annotations

import errno
from collections.abc import Callable
from contextlib import AbstractContextManager
from resource import RLIM_INFINITY, RLIMIT_AS

import pytest
from mpi4py import MPI

from fenics_contact._base.memory import addressable_memory
from fenics_contact._scene import memory as memory_of_scenes
from fenics_contact.errors import InvalidInputError, OutOfMemoryError, collective, memory, together


class PetscError(RuntimeError):
    """Has the code of an error of PETSc."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.ierr = code


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory"), PetscError(55),
        ImportError("libx.so: failed to map segment from shared object"), RuntimeError("std::bad_alloc"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("block", [together, lambda comm: collective(comm, "a block")])
def test_errors_of_memory_of_any_library_are_one(
    error: Exception, block: Callable[..., AbstractContextManager[None]]
) -> None:
    words = rf"memory does not suffice \({type(error).__name__}: .* has taken up to [\d.e+]+ GB"
    with pytest.raises(OutOfMemoryError, match=words) as raised, block(MPI.COMM_SELF):
        raise error
    assert raised.value.__cause__ is error
    assert isinstance(raised.value, MemoryError)


@pytest.mark.parametrize("error", [PetscError(76), OSError(errno.ENOSPC, "full"), InvalidInputError("")])
def test_other_errors_stay_as_they_are(error: Exception) -> None:
    with pytest.raises(type(error)) as raised, together(MPI.COMM_SELF):
        raise error
    assert raised.value is error


def test_the_limit_of_a_process_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("resource.getrlimit", lambda _: (4_000_000_000, RLIM_INFINITY))
    assert "may address 4 GB (ulimit -v, libraries included): raise that limit" in str(
        memory.naming_memory(MemoryError())
    )
    monkeypatch.setattr("resource.getrlimit", lambda _: (RLIM_INFINITY, RLIM_INFINITY))
    assert ", which is what the machine has. Take a coarser mesh" in str(memory.naming_memory(MemoryError()))


def test_what_a_limit_leaves_counts_for_each_rank_of_a_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    assert addressable_memory() is None
    monkeypatch.setattr(
        "fenics_contact._base.memory.getrlimit", lambda which: (10**12 * (which == RLIMIT_AS), 0)
    )
    own = addressable_memory()
    assert own is not None
    assert 0.9e12 < own < 1e12
    for left, addressable, expected in ((8e9, 1e9, 2e9), (8e9, 7e9, 8e9), (8e9, None, 8e9), (None, 1e9, 2e9)):
        monkeypatch.setattr(memory_of_scenes, "available_memory", lambda left=left: left)
        monkeypatch.setattr(memory_of_scenes, "addressable_memory", lambda own=addressable: own)
        assert memory_of_scenes._left(2) == expected


def test_all_ranks_raise_when_one_has_no_memory(mpirun: Callable[..., str]) -> None:
    script = """
        import sys
        import numpy as np
        from mpi4py import MPI
        from fenics_contact.errors import OutOfMemoryError, collective, together
        for block in (together(MPI.COMM_WORLD), collective(MPI.COMM_WORLD, "a block", closed=True)):
            try:
                with block:
                    if MPI.COMM_WORLD.rank == 1:
                        np.ones(2**55)
            except OutOfMemoryError as error:
                sys.stdout.write(f"{'Unable to allocate' in str(error)} ")
    """
    assert mpirun(script, 2).split() == 4 * ["True"]
