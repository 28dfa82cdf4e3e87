"""Memory that does not suffice, as an error that says what limits it and what to do."""

from __future__ import annotations

import errno
import re
import sys

from fenics_contact.errors.kinds import FenicsContactError, OutOfMemoryError

#: PETSC_ERR_MEM: an allocation of PETSc failed.
PETSC_OUT_OF_MEMORY = 55
#: What loaders, compilers' processes and external solvers of PETSc write.
_WORDS = re.compile(r"cannot allocate memory|failed to map segment|out of memory|bad_alloc", re.IGNORECASE)


def is_of_memory(error: BaseException) -> bool:
    """Return whether an error, of any library, is due to memory that does not suffice."""
    if isinstance(error, FenicsContactError):
        return False
    if isinstance(error, MemoryError) or getattr(error, "ierr", None) == PETSC_OUT_OF_MEMORY:
        return True
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return True
    return isinstance(error, ImportError | RuntimeError) and _WORDS.search(str(error)) is not None


def naming_memory(error: BaseException) -> BaseException:
    """Return the error, in the words of this package where memory does not suffice."""
    if not is_of_memory(error):
        return error
    named = OutOfMemoryError(
        f"memory does not suffice ({type(error).__name__}: {str(error) or 'no more was given'}): this "
        f"process has taken up to {_taken()}{_limit()}. Take a coarser mesh, cells where they count "
        "(solve_to), or ranks on further machines; scene.plan() estimates what is needed before"
    )
    named.__cause__ = error
    return named


def _taken() -> str:
    """Return the most that this process ever had, in words."""
    from resource import RUSAGE_SELF, getrusage

    unit = 1.0 if sys.platform == "darwin" else 1024.0
    return f"{unit * getrusage(RUSAGE_SELF).ru_maxrss / 1e9:.2g} GB"


def _limit() -> str:
    """Return the limit that is set to the process, in words, and what to do about it."""
    from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit

    limit, _ = getrlimit(RLIMIT_AS)
    if limit == RLIM_INFINITY:
        return ", which is what the machine has"
    return f" and may address {limit / 1e9:.3g} GB (ulimit -v, libraries included): raise that limit"
