"""The program of the package: `fenics-contact COMMAND`, or `python -m fenics_contact COMMAND`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from mpi4py import MPI

from fenics_contact import cli


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the arguments name on all ranks; return the exit status."""
    return cli.main(MPI.COMM_WORLD, arguments)


if __name__ == "__main__":
    sys.exit(main())
