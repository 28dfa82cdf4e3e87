"""The command line ``fenics-contact``: one module a command, all on top of the package.

Commands write to stdout on rank 0 alone; the package's own words go through logging to stderr. How a command
ends is in `fenics_contact.cli.endings`.
"""

from fenics_contact.cli.app import app, main
from fenics_contact.cli.desk import Desk
from fenics_contact.cli.endings import Ending

__all__ = ["Desk", "Ending", "app", "main"]
