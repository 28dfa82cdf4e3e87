"""Examples in docstrings run; those that cannot, because they take a scene for given, name what exists."""

from __future__ import annotations

import ast
import builtins
import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import fenics_contact
from fenics_contact import LinearState, LoadSequence, Scene, ShapeProblem
from fenics_contact.design import Result
from fenics_contact.output import ResultSeries

#: Classes of what skipped examples take for given, where they ask it for an attribute.
CLASSES = {
    "scene": Scene,
    "state": LinearState,
    "steps": LoadSequence,
    "series": ResultSeries,
    "problem": ShapeProblem,
    "result": Result,
}
#: What they take for given besides.
GIVEN = {
    *CLASSES,
    "MPI",
    "alpha",
    "bodies",
    "build",
    "comm",
    "floor",
    "hot",
    "joint",
    "length",
    "links",
    "mesh",
    "optuna",
    "partitions",
    "path",
    "pressed",
    "pull",
    "response",
    "start",
    "steel",
    "sweep",
    "warm",
    "weight",
    "zinc",
}


def modules() -> Iterator[ModuleType]:
    for info in pkgutil.walk_packages(fenics_contact.__path__, "fenics_contact."):
        if "__main__" not in info.name:
            yield importlib.import_module(info.name)


def public_names() -> dict[str, Any]:
    offered = {name: getattr(fenics_contact, name) for name in fenics_contact.__all__}
    rooms = [value for value in offered.values() if isinstance(value, ModuleType)]
    return {name: getattr(room, name) for room in rooms for name in room.__all__} | offered


def examples() -> list[doctest.DocTest]:
    """Return the examples of every docstring, with the names of its module and all public ones."""
    known = {"np": np, **public_names()}
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = [
        test
        for module in modules()
        for test in finder.find(module, globs={**known, **vars(module)})
        if test.examples
    ]
    return sorted(found)


EXAMPLES = examples()


def test_there_are_examples() -> None:
    assert len(EXAMPLES) > 30


@pytest.mark.parametrize(
    "example", EXAMPLES, ids=lambda example: example.name.removeprefix("fenics_contact.")
)
def test_an_example_prints_what_it_says(
    example: doctest.DocTest, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    printed: list[str] = []
    results = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(
        example, out=printed.append, clear_globs=False
    )
    assert results.failed == 0, "".join(printed)


def unknown_names(code: str, globs: dict[str, Any]) -> list[str]:
    """Return names, attributes of what is given, and keywords of calls that do not exist."""
    nodes = list(ast.walk(ast.parse(code)))
    names = [node for node in nodes if isinstance(node, ast.Name)]
    made = {node.id for node in names if isinstance(node.ctx, ast.Store)}
    imports = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    made |= {each.asname or each.name for node in imports for each in node.names}
    made |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    made |= {str(node.name) for node in nodes if isinstance(node, ast.FunctionDef | ast.ExceptHandler)}
    known = {*made, *GIVEN, *globs, *dir(builtins)}
    wrong = {node.id for node in names if node.id not in known}
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            wrong |= unknown_attribute(node.value.id, node.attr)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in globs:
            wrong |= unknown_keywords(node, globs[node.func.id])
    return sorted(wrong)


def unknown_attribute(name: str, attribute: str) -> set[str]:
    """Return the attribute if what ``name`` stands for has none such."""
    if name not in CLASSES:
        return set()
    fields = {field for base in CLASSES[name].__mro__ for field in inspect.get_annotations(base)}
    there = hasattr(CLASSES[name], attribute) or attribute in fields
    return set() if there else {f"{name}.{attribute}"}


def unknown_keywords(call: ast.Call, function: Callable[..., Any]) -> set[str]:
    """Return the keywords of a call that the function does not take."""
    parameters = inspect.signature(function).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return set()
    given = {keyword.arg for keyword in call.keywords if keyword.arg}
    return {f"{function.__name__}({name}=)" for name in given - set(parameters)}


SKIPPED = [test for test in EXAMPLES if any(example.options.get(doctest.SKIP) for example in test.examples)]


@pytest.mark.parametrize("example", SKIPPED, ids=lambda example: example.name.removeprefix("fenics_contact."))
def test_an_example_that_is_not_run_names_what_exists(example: doctest.DocTest) -> None:
    code = "".join(part.source for part in example.examples)
    assert unknown_names(code, example.globs) == []


def test_a_name_that_does_not_exist_is_found() -> None:
    code = "state = solve_scene(scene, comm, tol=1)\nstate.presure\nplot(state)\n"
    assert unknown_names(code, public_names()) == ["plot", "solve_scene(tol=)", "state.presure"]
