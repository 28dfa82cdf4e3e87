"""The program of the package: `fenics-contact COMMAND`, or `python -m fenics_contact COMMAND`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

#: `fenics_contact._cli.console.ExitCode.MISSING`, which cannot be imported where something is missing.
MISSING = 5

for _name in ("stdout", "stderr"):
    if getattr(sys, _name) is None:  # closed by the caller; UFL needs it when imported
        setattr(sys, _name, open(os.devnull, "w", encoding="utf-8"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command given by the arguments on all ranks; return the exit status."""
    from fenics_contact._base.launching import started_alone
    from fenics_contact._base.libraries import MPI
    from fenics_contact._base.requirements import check, require_extra
    from fenics_contact.errors import MissingRequirementError

    try:
        check()
        require_extra("commands", "cli", "pydantic", "rich", "tomlkit", "typer")
        with started_alone():
            world = MPI.COMM_WORLD
    except MissingRequirementError as error:
        sys.stderr.write(f"error: {error}\n")
        return MISSING
    from fenics_contact import _cli as cli

    return cli.main(world, arguments)


def ccx() -> int:
    """Run `fenics-contact ccx` with the arguments of the process, as programs start CalculiX."""
    return main(["ccx", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
