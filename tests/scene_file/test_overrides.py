"""Keys given elsewhere, lines of keys, and the schema."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError, lines_of, nearest
from fenics_contact._scene_file.validation import json_schema
from tests.conftest import ROOT
from tests.scene_file.mistakes import MISTAKES
from tests.scene_file.texts import GOOD, changed

SCENES = sorted((ROOT / "demos" / "scenes").glob("*.toml"))


def read(folder: Path, *overrides: str, text: str = GOOD) -> SceneFile:
    path = folder / "scene.toml"
    path.write_text(text)
    return read_scene_file(path, MPI.COMM_SELF, overrides=overrides)


def test_a_key_can_be_given_elsewhere(tmp_path: Path) -> None:
    file = read(
        tmp_path,
        "contacts.0.friction.coefficient=0.2", "solver.tolerance=balanced", "title=Other blocks",
        "loads.0.value.2=-5", 'output.folder="there"', "contacts.0.discretisation=mortar",
    )  # fmt: skip
    (pair,) = file.document.contacts
    assert getattr(pair.friction, "friction_coefficient", None) == 0.2
    assert pair.discretisation == "mortar"  # type: ignore[attr-defined]
    assert file.document.solver.tolerance == "balanced"
    assert (file.title, str(file.folder)) == ("Other blocks", "there")
    assert getattr(file.document.loads[0], "value", None) == (10.0, 0.0, -5.0)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("contacts.0.friction.coefficient", r"--set: must be KEY=VALUE .*: there is no ="),
        ("contacts.3.friction.coefficient=1", r"got 'contacts.3.friction.*: 3 of 1 entries, numbered from 0"),
        ("title.x=1", r'must be KEY=VALUE .*: x, but there is "Two blocks"'),
        ("contacts.0.friction.coefficient=-1", r"--set: contacts.0.friction.coefficient must be a number of"),
        ("solver.tolerence=1", r"--set: solver.tolerence is not known: did you mean 'tolerance'\?"),
        ("=1", "must be KEY=VALUE"),
        ("a b=1", "there is no key before ="),
        ("title\n[x]\ny=1", "there is no key before ="),
        ("solver.tolerance=1e-8\ny = 2", r"--set: solver.tolerance must be a number between 0 and 1"),
        ("contacts.99999999999999999999.friction=1", r"must be KEY=VALUE .* 1 entries, numbered from 0"),
        ('"\\u001b[31m"=1', r'--set: "\\x1b\[31m" must be text that can be shown'),
    ],
)
def test_what_cannot_be_given_is_named(override: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneFileError, match=message):
        read(tmp_path, override)


TEXT = '''#:schema x
title = """
two
lines"""

[a.b]
x = 1
y = { p = [1,
  2], q = 3 }

[[c]]
d.e = 1
[[c]]
[c.d]
e = 2

[a.f]
"odd key" = 1
'''


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("title",), 2), (("a",), 6), (("a", "b"), 6), (("a", "b", "x"), 7), (("a", "b", "y", "p"), 8),
        (("a", "b", "y", "p", 1), 9), (("a", "b", "y", "q"), 9), (("c",), 11), (("c", 0), 11),
        (("c", 0, "d", "e"), 12), (("c", 1), 13), (("c", 1, "d"), 14), (("c", 1, "d", "e"), 15),
        (("a", "f"), 17),
        (("a", "f", "odd key"), 18), (("a", "f", "missing"), 17), (("nowhere",), 0), (("c", 7), 11),
    ],
)  # fmt: skip
def test_keys_are_found_on_their_lines(path: tuple[str | int, ...], line: int) -> None:
    assert nearest(lines_of(TEXT), path) == line


def test_the_schema_is_one() -> None:
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert "[force / length²]" in json.dumps(schema, ensure_ascii=False), "editors show units"


def test_the_schema_beside_the_examples_is_the_present_one() -> None:
    stored = json.loads((ROOT / "demos" / "scenes" / "scene_file.schema.json").read_text(encoding="utf-8"))
    assert stored == json_schema(), "write it: fenics-contact schema demos/scenes/scene_file.schema.json"


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_schema_knows_the_examples(path: Path) -> None:
    jsonschema.validate(tomllib.loads(path.read_text()), json_schema())
    assert path.read_text().startswith("#:schema scene_file.schema.json\n"), "editors look for it"


def test_there_are_examples() -> None:
    assert {path.stem for path in SCENES} >= {"two_blocks", "sheared_block", "hertz", "chain_links"}


#: Mistakes that no schema of the form alone can know.
BEYOND = {
    "a material is not there", "a body is not there", "a surface is not there", "corners are swapped",
    "a body touches itself", "a formula is no arithmetic", "a sum is fine, brackets are too many",
    "a formula has no value", "a number has four hundred digits", "a vector has four hundred digits",
    "a name changes colours", "a path is longer than any can be",
}  # fmt: skip


NO_TOML = {"a bracket is not closed", "a byte-order mark comes first", "a key is there twice"}


@pytest.mark.parametrize("name", sorted(set(MISTAKES) - NO_TOML))
def test_editors_see_the_mistakes_that_a_schema_can_know(name: str) -> None:
    old, new, _ = MISTAKES[name]
    data: dict[str, Any] = tomllib.loads(changed((old, new)))
    found = list(jsonschema.Draft202012Validator(json_schema()).iter_errors(data))
    assert bool(found) == (name not in BEYOND)
