"""Habits that every file keeps: it takes a communicator, prints nothing and stays short."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.house.floors import FLOORS
from tests.house.source import ROOT, modules

MOST_LINES = 700


def names_used(tree: ast.AST) -> set[str]:
    """Return every name and attribute that the code mentions; comments and docstrings are not code."""
    nodes = list(ast.walk(tree))
    plain = {node.id for node in nodes if isinstance(node, ast.Name)}
    dotted = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
    return plain | dotted | imported


def python_files() -> list[Path]:
    """Return every Python file of the project."""
    folders = ("fenics_contact", "tests", "demos", "benchmarks", "docs", "notebooks", "scripts", "tools")
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


#: The program chooses the communicator of its commands; the package is handed one.
PROGRAM = "fenics_contact.__main__"
#: Where all commands write through, on rank 0 alone.
CONSOLE = "fenics_contact._cli.console"


@pytest.mark.parametrize(("name", "allowed"), [("print", [CONSOLE]), ("COMM_WORLD", [PROGRAM])])
def test_the_package_never_uses(name: str, allowed: list[str]) -> None:
    house = modules()
    assert len(house) > 10, "hardly any modules were found: nothing was tested"
    assert [module.name for module in house if name in names_used(module.tree)] == allowed


@pytest.mark.parametrize(
    "code", ["print(1)", "MPI.COMM_WORLD.size", "from mpi4py.MPI import COMM_WORLD", "f(PETSc.COMM_WORLD)"]
)
def test_a_forbidden_name_is_found(code: str) -> None:
    assert names_used(ast.parse(code)) & {"print", "COMM_WORLD"}


def test_a_name_in_a_docstring_is_not_code() -> None:
    assert not names_used(ast.parse('"""Call print(MPI.COMM_WORLD)."""  # print')) & {"print", "COMM_WORLD"}


#: Ways to start a process, and what frees its environment of the traces of MPI.
STARTS, FREES = {"run", "Popen", "check_call", "check_output"}, {"clean_environment", "LAUNCH"}
#: Runs before the package is there, and starts dpkg-query, which knows nothing of MPI.
SET_UP = [Path("scripts", "link_system_packages.py")]


def starts_processes(tree: ast.AST) -> bool:
    """Tell whether the code calls one of the functions of `subprocess`."""
    called = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return any(
        isinstance(name, ast.Attribute) and name.attr in STARTS and ast.unparse(name.value) == "subprocess"
        for name in called
    )


def test_whoever_starts_a_process_frees_it_of_mpi() -> None:
    texts = {path.relative_to(ROOT): path.read_text() for path in python_files()}
    trees = {path: ast.parse(text) for path, text in texts.items() if "subprocess" in text}
    starting = {path: names_used(tree) & FREES for path, tree in trees.items() if starts_processes(tree)}
    assert len(starting) > 10, "hardly any files start processes: nothing was tested"
    assert [path for path, free in starting.items() if not free] == SET_UP
    assert [path for path, free in starting.items() if "tests" not in path.parts and free == {"LAUNCH"}] == []


def test_files_are_short() -> None:
    lengths = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in python_files()}
    assert len(lengths) > 10, "hardly any files were found: nothing was tested"
    assert {path: lines for path, lines in lengths.items() if lines > MOST_LINES} == {}


#: Rooms of one module, and where their tests are.
ELSEWHERE = {"_responses": "study", "__main__": "cli"}


def test_every_room_has_a_folder_of_tests_of_its_name() -> None:
    folders = {room: ELSEWHERE.get(room, room.removeprefix("_")) for floor in FLOORS for room in floor}
    assert len(folders) > 20
    assert [room for room, name in folders.items() if not [*(ROOT / "tests" / name).glob("test_*.py")]] == []


def imported_tests(path: Path) -> list[str]:
    """List the imports of what stands in a test file, also those in scripts for several ranks."""
    line = r"^ *(?:from|import) +tests\.(?:[\w.]*\btest_\w+|[\w.]+ import test_\w+)"
    return re.findall(line, path.read_text(), re.MULTILINE)


def test_no_test_file_is_imported(tmp_path: Path) -> None:
    files = [path for path in python_files() if "tests" in path.parts]
    assert len(files) > 200, "no tests were found: nothing was tested"
    assert [f"{path}: {line}" for path in files for line in imported_tests(path)] == []
    script = tmp_path / "script.py"
    script.write_text("CODE = '\n    from tests.qp import test_solve\n    import tests.qp.test_solve'\n")
    assert len(imported_tests(script)) == 2
