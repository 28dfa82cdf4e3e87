"""The libraries that draw, checked by name before any of this folder imports them."""

from __future__ import annotations

from fenics_contact._base.requirements import require_extra


def check_libraries() -> None:
    """Make sure that pyvista and matplotlib are installed."""
    require_extra("pictures", "viz", "pyvista", "matplotlib")


check_libraries()
