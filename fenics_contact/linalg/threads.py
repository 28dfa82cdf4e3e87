"""Oversubscription by BLAS threads of MPI ranks."""

from __future__ import annotations

import logging
import os
from functools import lru_cache

from fenics_contact.errors import safe_log

_LOG = logging.getLogger(__name__)

#: Environment variables for the number of threads of OpenBLAS, MKL and OpenMP.
SETTINGS = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


@lru_cache
def warn_of_threads(ranks: int) -> None:
    """Warn, once, if several ranks run and the number of their threads is unset.

    The number itself is the user's choice: a library that changed it would affect the whole process.

    Args:
        ranks: Number of ranks.
    """
    if ranks > 1 and not any(os.environ.get(name) for name in SETTINGS):
        safe_log(
            _LOG.warning,
            "%d ranks share the cores, and the BLAS of each may start threads on all of them, which can take "
            "several times as long: export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 before Python starts",
            ranks,
        )
