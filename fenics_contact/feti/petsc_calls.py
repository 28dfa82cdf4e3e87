"""Functions of PETSc's C interface that petsc4py does not wrap."""

from __future__ import annotations

import ctypes
from functools import lru_cache

from fenics_contact._libraries import PETSc


def petsc_call(name: str, *arguments: object) -> None:
    """Call a function by its name; integers are handles of objects.

    Raises:
        PETSc.Error: If it returns an error.
    """
    wrapped = [ctypes.c_void_p(a) if isinstance(a, int) else a for a in arguments]
    code = getattr(_petsc(), name)(*wrapped)
    if code:
        raise PETSc.Error(code)


@lru_cache(maxsize=1)
def _petsc() -> ctypes.CDLL:
    # The symbols of libpetsc are resolved through the extension module that is linked with it.
    return ctypes.CDLL(PETSc.__file__)
