"""Threads of BLAS: one while scenes are solved, whose matrices are cut small."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from threadpoolctl import ThreadpoolController

from fenics_contact._base.libraries import MPI
from fenics_contact.errors.kinds import safe_log

_LOG = logging.getLogger(__name__)

#: Environment variables for the number of threads of OpenBLAS, MKL and OpenMP.
SETTINGS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "GOTO_NUM_THREADS")


@contextmanager
def one_thread(comm: MPI.Comm) -> Iterator[None]:
    """Limit BLAS to one thread in a block, unless the environment gives a number. PETSc must be loaded.

    On two idle cores two threads take 3 to 20 % less time than one and twice the processor time; where other
    programs or ranks use the cores, up to five times as long.
    """
    if _given():
        yield
        return
    if comm.rank == 0:
        _warn(unlimited(comm.size))
    with libraries().limit(limits=1):
        yield


def unlimited(ranks: int) -> str:
    """Return a warning of threads that cannot be limited, if several ranks run; empty without."""
    if ranks == 1 or _given() or libraries().select(user_api="blas").info():
        return ""
    return (
        f"{ranks} ranks share the cores, and no BLAS is found whose threads can be limited: if it has some, "
        "export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 before Python starts"
    )


def _given() -> bool:
    return any(os.environ.get(name) for name in SETTINGS)


@lru_cache
def libraries() -> ThreadpoolController:
    """Return the libraries of this process that have threads, found once, as that takes 20 ms."""
    return ThreadpoolController()


@lru_cache
def _warn(message: str) -> None:
    if message:
        safe_log(_LOG.warning, "%s", message)
