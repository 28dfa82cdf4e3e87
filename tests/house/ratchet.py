"""What the house is kept by, in numbers that only fall: conditions, fields that may be None, spread features.

`python -m tests.house.ratchet` writes today's numbers into `ratchet.toml`. What grows is seen in the change.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.house.source import Module, modules

RECORD = Path(__file__).with_suffix(".toml")

#: Words of features, counted in files whose names have none of them.
FEATURES = {
    "springs": "spring",
    "preloads": "preload|pretension",
    "linear constraints": "constraint",
    "cyclic symmetry": "sector",
    "rigid tools": "(?<!func)(?<!iter)tool",
    "axisymmetry": "axisymmetric|revol",
    "torsion": "torsion|twist",
    "thickness": "thickness",
    "dependent nodes": "hanging|followers",
    "fluid pressure": "fluid",
}


def counted(house: list[Module]) -> Counter[str]:
    """Count lines, modules and conditions of modules."""
    total: Counter[str] = Counter(modules=len(house))
    for module in house:
        total["lines"] += module.path.read_text().count("\n")
        for node in ast.walk(module.tree):
            total.update(_conditions(node))
    return total


def spread(house: list[Module]) -> dict[str, int]:
    """Return the number of files that name each feature outside its own."""
    texts = {module.path: module.path.read_text() for module in house}
    return {
        feature: sum(
            bool(re.search(words, text)) and not re.search(words, path.name) for path, text in texts.items()
        )
        for feature, words in FEATURES.items()
    }


def _conditions(node: ast.AST) -> Iterator[str]:
    """Yield what a node counts as, once for each time."""
    if isinstance(node, ast.Compare) and _tests_none(node):
        yield "tests for None"
    elif isinstance(node, ast.Call):
        name = ast.unparse(node.func)
        yield from (each for each in ("isinstance", "id") if each == name)
    elif isinstance(node, ast.ClassDef):
        annotated = (each.annotation for each in node.body if isinstance(each, ast.AnnAssign))
        yield from ("fields that may be None" for each in annotated if "None" in ast.unparse(each))
        yield from ("writes into frozen values" for each in node.body for _ in _late_writes(each))
    elif isinstance(node, ast.Raise):
        yield from ["lines that raise"] * ((node.end_lineno or node.lineno) - node.lineno + 1)
    elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        flags = (each for each in every if each.annotation and ast.unparse(each.annotation) == "bool")
        yield from ("flags" for _ in flags)
        if sum(each.arg not in ("self", "cls") for each in every) >= 6:
            yield "functions of six parameters and more"


def _tests_none(node: ast.Compare) -> bool:
    compared = (each.value for each in node.comparators if isinstance(each, ast.Constant))
    return isinstance(node.ops[0], ast.Is | ast.IsNot) and None in compared


def _late_writes(method: ast.stmt) -> list[ast.Call]:
    """List the calls of `object.__setattr__` in a method other than `__post_init__`."""
    if isinstance(method, ast.FunctionDef) and method.name == "__post_init__":
        return []
    calls = (each for each in ast.walk(method) if isinstance(each, ast.Call))
    return [each for each in calls if ast.unparse(each.func) == "object.__setattr__"]


def record() -> dict[str, dict[str, int]]:
    """Return the numbers that are held."""
    return tomllib.loads(RECORD.read_text())


def grown(now: Mapping[str, int], held: Mapping[str, int]) -> dict[str, str]:
    """Return what is more than is held, or not held at all."""
    return {
        name: f"{count}, held {held.get(name, 0)}" for name, count in now.items() if count > held.get(name, 0)
    }


def _write() -> None:
    house = modules()
    tables = {"house": dict(sorted(counted(house).items())), "files outside their own": spread(house)}
    lines = ["# Written by `python -m tests.house.ratchet`.\n"]
    for title, numbers in tables.items():
        lines += [f'["{title}"]\n', *(f'"{name}" = {count}\n' for name, count in numbers.items()), "\n"]
    RECORD.write_text("".join(lines).rstrip("\n") + "\n")


if __name__ == "__main__":
    _write()
