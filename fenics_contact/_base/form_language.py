"""UFL and FFCx, imported without the setuptools of which releases of 2022 ask their own versions.

Rooms that write forms import this module first. ``pkg_resources`` takes 45 ms: more than UFL itself.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

from fenics_contact._base.requirements import installed_versions

__all__ = ["without_setuptools"]


class _Versions(ModuleType):
    """Stands for ``pkg_resources`` where a library asks for its version; the rest is that of the true one."""

    def get_distribution(self, name: str) -> Any:
        """Return something with the version of a distribution."""
        version = installed_versions(tuple(sys.path)).get(name.replace("-", "_"))
        return SimpleNamespace(version=version) if version else self.__getattr__("get_distribution")(name)

    def __getattr__(self, name: str) -> Any:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


@contextmanager
def without_setuptools() -> Iterator[None]:
    """Let libraries that are imported in a block find their versions without ``pkg_resources``."""
    versions = _Versions("pkg_resources")
    if sys.modules.setdefault(versions.__name__, versions) is not versions:
        yield
        return
    try:
        yield
    finally:
        if sys.modules.get(versions.__name__) is versions:
            del sys.modules[versions.__name__]


with without_setuptools():
    import ufl  # noqa: F401
