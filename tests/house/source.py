"""The package as a syntax tree: which module imports what, without importing any of it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "fenics_contact"


@dataclass(frozen=True)
class Import:
    """One imported name: ``target`` in full, the line it stands on, and whether only type checkers see it."""

    target: str
    line: int
    for_types: bool = False


@dataclass(frozen=True)
class Module:
    """One file of the package and its dotted name."""

    name: str
    path: Path

    @property
    def tree(self) -> ast.Module:
        """Its syntax tree, parsed anew: those of all files would make every collection of garbage slow."""
        return ast.parse(self.path.read_text(), str(self.path))

    @property
    def room(self) -> str:
        """The part of the house it belongs to: "feti" for ``fenics_contact.feti.decomposition``."""
        return room_of(self.name) or ""

    @cache
    def imports(self) -> list[Import]:
        """Return all imports, also those inside functions, with relative ones resolved.

        ``from a import b`` counts as ``a.b``: ``b`` may be a module.
        """
        return [
            Import(target, node.lineno, for_types)
            for node, for_types in _walk(self.tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for target in self._targets(node)
        ]

    def _targets(self, node: ast.Import | ast.ImportFrom) -> list[str]:
        if isinstance(node, ast.Import):
            return [alias.name for alias in node.names]
        parents = self.name.split(".") if self.path.name == "__init__.py" else self.name.split(".")[:-1]
        above = parents[: len(parents) + 1 - node.level] if node.level else []
        base = ".".join([*above, *([node.module] if node.module else [])])
        return [f"{base}.{alias.name}" for alias in node.names]


def _walk(node: ast.AST, for_types: bool = False) -> Iterator[tuple[ast.AST, bool]]:
    """Yield every node with whether it stands in an ``if TYPE_CHECKING:`` block."""
    yield node, for_types
    guarded = node.body if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) else []
    for child in ast.iter_child_nodes(node):
        yield from _walk(child, for_types or child in guarded)


def room_of(target: str) -> str | None:
    """Return the part of the house that a dotted name lies in, "" for the package itself, None outside it."""
    package, _, rest = target.partition(".")
    return rest.partition(".")[0] if package == PACKAGE else None


def modules(root: Path = ROOT) -> list[Module]:
    """List every file of the package below ``root``."""
    found = []
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found.append(Module(name, path))
    return found
