"""The program of the package: `fenics-contact COMMAND`, or `python -m fenics_contact COMMAND`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

for _name in ("stdout", "stderr"):
    if getattr(sys, _name) is None:  # closed by who started the program; UFL asks for it when imported
        setattr(sys, _name, open(os.devnull, "w", encoding="utf-8"))

from fenics_contact import cli  # noqa: E402
from fenics_contact._libraries import MPI  # noqa: E402


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the arguments name on all ranks; return the exit status."""
    return cli.main(MPI.COMM_WORLD, arguments)


if __name__ == "__main__":
    sys.exit(main())
