"""The program of the package: `python -m fenics_contact COMMAND`."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence

from fenics_contact.study import command as accuracy

#: Modules with `add_parser`, one a command.
COMMANDS = (accuracy,)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the arguments name; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m fenics_contact", description="Contact mechanics with friction on FEniCSx."
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_parser(commands)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    return int(options.run(options))


if __name__ == "__main__":
    sys.exit(main())
