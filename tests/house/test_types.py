"""Arguments and fields that hold objects of dolfinx say of which type."""

from __future__ import annotations

import ast

import pytest

from tests.house.source import PACKAGE, modules

NAMES = {"mesh", "function", "functions", "space", "spaces", "form", "element", "tags"}


def annotated(tree: ast.AST) -> list[tuple[str, int, set[str]]]:
    """List arguments and fields called so: name, line, and the names that their annotation uses."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            name = node.arg if isinstance(node, ast.arg) else ast.unparse(node.target)
            used = {part.id for part in ast.walk(node.annotation) if isinstance(part, ast.Name)}
            if name in NAMES:
                found.append((name, node.lineno, used))
    return found


def test_what_holds_objects_of_dolfinx_has_their_type() -> None:
    house, face = modules(), f"{PACKAGE}._dolfinx"
    rooms = {module.room for module in house if any(face in found.target for found in module.imports())}
    assert {"_fem", "feti", "results", "design", "readers", "output"} <= rooms, "imports were not found"
    parts = [
        (f"{module.name}:{line} {name}", used)
        for module in house
        if module.room in {"_dolfinx", *rooms}
        for name, line, used in annotated(module.tree)
    ]
    assert len(parts) > 100, "hardly any arguments were found: nothing was tested"
    assert [place for place, used in parts if "Any" in used] == []


@pytest.mark.parametrize(
    "code",
    [
        "def f(mesh: Any) -> None: ...",
        "def f(*, functions: Sequence[Any] = ()) -> None: ...",
        "class C:\n    space: Any",
    ],
)
def test_an_argument_of_any_type_is_found(code: str) -> None:
    (found,) = annotated(ast.parse(code))
    assert "Any" in found[2]
