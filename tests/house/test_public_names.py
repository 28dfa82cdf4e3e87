"""The public names: users come in by the front door and a few rooms, and each name is met somewhere."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import fenics_contact
from tests.conftest import ROOT, launch
from tests.house.public import code_of, public, rooms, texts

#: Import lines that a script of a user needs at most.
MOST_IMPORTS = 4


def hints_of(value: Any) -> str:
    """Return the annotations of a public thing, of its fields and of its members, and their docstrings."""
    parts = [value, *vars(value).values()] if inspect.isclass(value) else [value]
    words = [str(vars(value).get("__annotations__", ""))] if inspect.isclass(value) else []
    for part in parts:
        part = part.fget if isinstance(part, property) else getattr(part, "func", part)
        words.append(str(getattr(part, "__annotations__", "")))
        words.append(str(inspect.getdoc(part) or "") if callable(part) else "")
    bases = [base.__name__ for base in value.__mro__[1:]] if inspect.isclass(value) else []
    return " ".join([*words, *bases])


def unmet(names: dict[str, Any], read: str) -> list[str]:
    """List names in no text for users that no other public thing takes, holds, returns or raises."""
    words = {name: set(re.findall(r"\w+", hints_of(value))) for name, value in names.items()}
    read_words = set(re.findall(r"\w+", read))
    lost = []
    for name in names:
        bare = name.rpartition(".")[2]
        if bare not in read_words and not any(bare in has for other, has in words.items() if other != name):
            lost.append(name)
    return lost


def test_every_public_name_is_met_somewhere() -> None:
    names = public()
    assert len(names) > 200, "no names were found: nothing was tested"
    assert unmet(names, " ".join(texts().values())) == []
    assert unmet({"lost": unmet, "found": rooms}, "found") == ["lost"]


def test_every_public_name_is_in_the_code_of_a_demo_a_notebook_or_a_page() -> None:
    words = set(re.findall(r"\w+", " ".join(code_of(path, text) for path, text in texts().items())))
    names = [name.rpartition(".")[2] for name in public()]
    assert sorted(set(names) - words) == []


def test_code_of_a_page_is_what_is_set_as_code() -> None:
    page = "# Balance\n`state.tools()` of\n```python\nfound = 1\n```\na resultant\n"
    assert re.findall(r"\w+", code_of(Path("a.md"), page)) == ["state", "tools", "python", "found", "1"]
    assert code_of(Path("a.py"), page) == page


def test_a_public_name_has_one_place() -> None:
    names = [name.rpartition(".")[2] for name in public()]
    assert sorted(name for name in set(names) if names.count(name) > 1) == []


def test_the_front_lists_its_names() -> None:
    text = inspect.getdoc(fenics_contact) or ""
    assert [name for name in fenics_contact.__all__ if name[0] != "_" and name not in text] == []
    assert set(dir(fenics_contact)) >= set(fenics_contact.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'solve_everything'"):
        fenics_contact.solve_everything


def test_the_front_loads_what_is_used_and_starts_nothing() -> None:
    code = """
        import sys, fenics_contact
        loaded = [name for name in sys.modules if name.startswith("fenics_contact.")]
        assert len(loaded) < 10, loaded
        fenics_contact.Scene, fenics_contact.solve_scene, fenics_contact.ShapeProblem
        late = {"mpi4py.MPI", "petsc4py.PETSc", "dolfinx", "pyvista", "matplotlib"}
        print(*sorted(late & set(sys.modules)), "none")
    """
    answer = launch(1, "-c", inspect.cleandoc(code))
    assert answer.stdout.split() == ["none"], answer.stderr


@pytest.mark.parametrize("pattern", ["demos/*.py", "notebooks/[0-9]*.py"])
def test_scripts_of_users_take_public_names_in_few_lines(pattern: str) -> None:
    paths = sorted(ROOT.glob(pattern))
    assert len(paths) > 5
    for path in paths:
        found = re.findall(r"^(?:from|import) (fenics_contact[\w.]*)", path.read_text(), re.MULTILINE)
        assert not [name for name in found if "._" in name], path
        assert len(set(found)) <= MOST_IMPORTS, path
