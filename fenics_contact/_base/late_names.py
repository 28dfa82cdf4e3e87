"""Names of a package that are loaded on first use, listed once: by its imports for type checkers."""

from __future__ import annotations

import ast
import sys
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import Any

__all__ = ["homes", "late_names", "warn_of_old_name"]


def warn_of_old_name(old: str, new: str) -> None:
    """Warn whoever uses a public name that is renamed; the old one stays for one minor version."""
    text = f"{old} is now {new} and will be removed in the next minor version: use {new}"
    warnings.warn(text, DeprecationWarning, stacklevel=3)


@cache
def homes(package: str) -> dict[str, str]:
    """Return the module of each name that the imports for type checkers of a package list."""
    spec = sys.modules[package].__spec__
    assert spec is not None
    loader: Any = spec.loader  # its class is in importlib.abc, which loads importlib.resources
    tree = ast.parse(loader.get_source(package) or "")
    parts = [part for part in tree.body if isinstance(part, ast.If)]
    for_types = [part for part in parts if ast.unparse(part.test) == "TYPE_CHECKING"]
    statements = [each for part in for_types for each in part.body if isinstance(each, ast.ImportFrom)]
    return {name.asname or name.name: str(each.module) for each in statements for name in each.names}


def late_names(
    package: str, renamed: Mapping[str, str] = MappingProxyType({})
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package whose names stand below ``if TYPE_CHECKING``.

    A name that a submodule has, too, must be imported at once: the import of that submodule would hide it.
    Old names of what is ``renamed`` load the new ones, with a `DeprecationWarning`.

    Example::

        if TYPE_CHECKING:
            from fenics_contact.shapes.profile import Profile

        __all__ = ["Profile"]
        __getattr__, __dir__ = late_names(__name__)
    """
    module = sys.modules[package]

    def load(name: str) -> Any:
        """Load a public name on first use."""
        if name in renamed:
            warn_of_old_name(f"{package}.{name}", renamed[name])
            return getattr(module, renamed[name])
        if name not in module.__all__:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = homes(package)[name]
        if home == package:  # a submodule
            return import_module(f"{package}.{name}")
        value = getattr(import_module(home), name)
        setattr(module, name, value)
        return value

    return load, lambda: sorted({*vars(module), *module.__all__})
