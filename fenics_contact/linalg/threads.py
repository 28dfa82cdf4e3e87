"""Threads of BLAS beside ranks of MPI: where every rank's BLAS takes all cores, all of them wait."""

from __future__ import annotations

import logging
import os
from functools import lru_cache

from fenics_contact.errors import tell

_LOG = logging.getLogger(__name__)

#: What tells OpenBLAS, MKL and OpenMP how many threads to start.
SETTINGS = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


@lru_cache
def warn_of_threads(ranks: int) -> None:
    """Warn, once, if several ranks run and nobody has said how many threads each may start.

    The number itself is the user's: a library that changes it would change it for all that runs beside it.

    Args:
        ranks: Number of ranks.
    """
    if ranks > 1 and not any(os.environ.get(name) for name in SETTINGS):
        tell(
            _LOG.warning,
            "%d ranks share the cores, and the BLAS of each may start threads on all of them, which can take "
            "several times as long: export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 before Python starts",
            ranks,
        )
