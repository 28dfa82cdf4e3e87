"""Every rank gets the same link, and all ranks stop together."""

from __future__ import annotations

import re
from collections.abc import Callable

from tests.gallery.links import digest

CODE = """
    import sys
    from mpi4py import MPI
    from fenics_contact.gallery import links as link
    from tests.gallery.links import SMALL, digest

    comm = MPI.COMM_WORLD

    def fail(shape):
        raise ValueError("gmsh is unwell")

    if comm.rank > 0:
        link.mesh_ring = None  # only rank 0 may mesh
    elif sys.argv[1] == "broken":
        link.mesh_ring = fail
    try:
        word = digest(comm)
    except Exception as error:
        word = f"{type(error).__name__}: {error}"
    lines = comm.gather(word, root=0) or []
    sys.stdout.write("".join(f"{line}\\n" for line in lines))
"""


def test_all_ranks_hold_the_same_bits(mpirun: Callable[..., str]) -> None:
    assert mpirun(CODE, 3, "sound").splitlines() == 3 * [digest(None)]


def test_an_error_of_gmsh_stops_all_ranks(mpirun: Callable[..., str]) -> None:
    lines = mpirun(CODE, 2, "broken", fresh=True).splitlines()
    assert lines[0] == "ValueError: gmsh is unwell"
    assert re.fullmatch(r"RemoteError: ValueError: gmsh is unwell \(.*\) \(met on rank 0\)", lines[1])
