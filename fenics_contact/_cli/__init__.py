"""The command line ``fenics-contact``: one module per command, all on top of the package.

Commands write to stdout on rank 0 only; the package's own messages go through logging to stderr. Exit codes
are in `fenics_contact._cli.console`.
"""

from fenics_contact._cli.app import app, main
from fenics_contact._cli.console import Console, ExitCode

__all__ = ["Console", "ExitCode", "app", "main"]
