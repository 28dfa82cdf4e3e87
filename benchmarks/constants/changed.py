"""The package imported anew with some modules changed, beside the one that is at work.

So a constant has another value everywhere: in modules that import it, in defaults, in what is computed from
it when a module is loaded, and in nothing that was kept from before.
"""

from __future__ import annotations

import ast
import gc
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType
from typing import Any

from benchmarks.constants.listed import PACKAGE, Constant, Value, constants, module_of

#: What is imported anew.
ANEW = (PACKAGE.name, "benchmarks.constants.scenes")
#: Module -> what changes its syntax tree.
Changes = Mapping[str, Callable[[ast.Module], ast.Module]]


@contextmanager
def replaced(constant: Constant, value: Value) -> Iterator[None]:
    """Let a constant have another value in all that is imported from here on."""

    def assign(tree: ast.Module) -> ast.Module:
        number = next(n for n, each in enumerate(tree.body) if constant.name in _names(each))
        tree.body[number + 1 : number + 1] = ast.parse(f"{constant.name} = {value!r}").body
        return tree

    with _imported_anew({_full(constant.module): assign}, {}):
        yield


@contextmanager
def noted(read: set[str]) -> Iterator[None]:
    """Note the keys of the constants that are read by what is imported from here on."""
    known = _known_names()

    def note(key: str, value: Any) -> Any:
        read.add(key)
        return value

    changes = {module: _Noting(keys).visit for module, keys in known.items()}
    with _imported_anew(changes, {"_noted": note}):
        yield


@contextmanager
def unchanged() -> Iterator[None]:
    """Import the package anew as it is."""
    with _imported_anew({}, {}):
        yield


@contextmanager
def _imported_anew(changes: Changes, more: Mapping[str, Any]) -> Iterator[None]:
    before = {name: sys.modules.pop(name) for name in _loaded()}
    finder = _Finder(changes, more)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        for name in _loaded():
            del sys.modules[name]
        sys.modules.update(before)
        gc.collect()


def _loaded() -> list[str]:
    return [name for name in sys.modules if any(f"{name}.".startswith(f"{root}.") for root in ANEW)]


@dataclass(frozen=True)
class _Finder(MetaPathFinder):
    """Finds the modules that are changed before others do."""

    changes: Changes
    more: Mapping[str, Any]

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        found = PathFinder.find_spec(name, path, target) if name in self.changes else None
        if found is not None and isinstance(found.loader, SourceFileLoader):
            found.loader = _Changing(found.loader.name, found.loader.path)
            found.loader.change, found.loader.more = self.changes[name], self.more
        return found


class _Changing(SourceFileLoader):
    """Loads a module with another syntax tree, past what is kept of its compilation, and more names in it."""

    change: Callable[[ast.Module], ast.Module]
    more: Mapping[str, Any]

    def get_code(self, fullname: str) -> CodeType:
        tree = self.change(ast.parse(self.get_data(self.path)))
        return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        vars(module).update(self.more)
        super().exec_module(module)


class _Noting(ast.NodeTransformer):
    """Passes some names through ``_noted`` where they are read."""

    def __init__(self, keys: Mapping[str, str]) -> None:
        self.keys = keys

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id not in self.keys or not isinstance(node.ctx, ast.Load):
            return node
        call = ast.parse(f"_noted({self.keys[node.id]!r}, {node.id})", mode="eval").body
        return ast.copy_location(call, node)


def _known_names() -> dict[str, dict[str, str]]:
    """Return for every module the names under which it knows constants, its own and imported ones."""
    known: dict[str, dict[str, str]] = {}
    for constant in constants():
        known.setdefault(_full(constant.module), {})[constant.name] = constant.key
    imports = [
        (_full(module_of(path)), node.module, name)
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    ]
    more = True
    while more:  # a package passes on what its modules define
        more = False
        for module, source, name in imports:
            key, local = known.get(source, {}).get(name.name), name.asname or name.name
            if key and local not in known.setdefault(module, {}):
                known[module][local], more = key, True
    return known


def _names(statement: ast.stmt) -> set[str]:
    """Return the names that a statement assigns to."""
    if not isinstance(statement, ast.Assign | ast.AnnAssign):
        return set()
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    return {node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)}


def _full(module: str) -> str:
    return f"{PACKAGE.name}.{module}" if module else PACKAGE.name
