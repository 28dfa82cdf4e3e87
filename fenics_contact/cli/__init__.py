"""The command line ``fenics-contact``: one module per command, all on top of the package.

Commands write to stdout on rank 0 only; the package's own messages go through logging to stderr. Exit codes
are in `fenics_contact.cli.desk`.
"""

from fenics_contact.cli.app import app, main
from fenics_contact.cli.desk import Console, ExitCode

__all__ = ["Console", "ExitCode", "app", "main"]
