"""The libraries that draw, checked by name before any of this folder imports them."""

from __future__ import annotations

import importlib.util

from fenics_contact.errors import MissingRequirementError


def check_libraries() -> None:
    """Make sure that pyvista and matplotlib are there.

    Raises:
        MissingRequirementError: One of them is not installed.
    """
    for module in ("pyvista", "matplotlib"):
        if importlib.util.find_spec(module) is None:
            raise MissingRequirementError(
                f"pictures need {module}, found none: pip install 'fenics_contact[viz]'", name=module
            )


check_libraries()
