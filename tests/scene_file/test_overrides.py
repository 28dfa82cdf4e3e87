"""Expressions, keys and overrides of scene files."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from mpi4py import MPI
from pydantic import Field, PositiveFloat, ValidationError

from fenics_contact import Coulomb, read_scene_file
from fenics_contact._scene_file.model import FRICTION_LAWS
from fenics_contact._scene_file.part import Part, keys_of, table_of
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError, lines_of, nearest
from fenics_contact._scene_file.validation import json_schema
from fenics_contact._scene_file.values import Expression, VectorExpression, between
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape
from fenics_contact.materials import NeoHooke
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


@cache
def by_schema() -> Any:
    """Return what checks scene files; to load it takes two seconds, which every worker would need."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(json_schema())


def test_the_schema_is_one() -> None:
    schema = json_schema()
    by_schema().check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert "[force / length²]" in json.dumps(schema, ensure_ascii=False), "editors show units"


def test_the_schema_beside_the_examples_is_the_present_one() -> None:
    stored = json.loads((ROOT / "demos" / "scenes" / "scene_file.schema.json").read_text(encoding="utf-8"))
    assert stored == json_schema(), "write it: fenics-contact schema demos/scenes/scene_file.schema.json"


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_schema_knows_the_examples(path: Path) -> None:
    by_schema().validate(tomllib.loads(path.read_text()))
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
    found = list(by_schema().iter_errors(data))
    assert bool(found) == (name not in BEYOND)


# Formulas as text: arithmetic in x, y, z, and nothing else.
POINTS = np.array([[0.5, -1.0, 2.0], [0.0, 3.0, -4.0]])
X, Y, Z = POINTS.T


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("2 * x + y - z / 4", 2 * X + Y - Z / 4),
        ("-x**2 + 1e-3", -(X**2) + 1e-3),
        ("sin(pi * x) * exp(-y)", np.sin(np.pi * X) * np.exp(-Y)),
        ("where(z > 0, max(x, y), min(x, y))", np.where(Z > 0, np.maximum(X, Y), np.minimum(X, Y))),
        ("sqrt(x**2 + y**2 + z**2) - 9", np.linalg.norm(POINTS, axis=1) - 9),
        ("abs(y) * atan2(y, x)", np.abs(Y) * np.arctan2(Y, X)),
        ("3", np.full(2, 3.0)),
        ("+".join(["x"] * 400) + "-" + "-".join(["y"] * 400), 400 * X - 400 * Y),
    ],
)
def test_a_formula_has_the_values_of_numpy(text: str, values: np.ndarray) -> None:
    np.testing.assert_allclose(Expression(text)(POINTS), values, rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "x.real", "(lambda: 1)()", "[1, 2]", "x if y else z", "open",
        "sin", "sin(x, y)", "f'{x}'", "x; y", "x = 1", "True", "1j * x", "sinn(x)", "x @ y", "x << 2",
        "max(x)", "where(x, y)", "'a'", "x and y", "0 < x < 1", "sin(x=1)", "w", "", "(x",
        "-" * 60 + "x", "x" * 3000,
    ],
)  # fmt: skip
def test_anything_else_is_refused_and_not_run(text: str) -> None:
    with pytest.raises(InvalidInputError, match=r"a formula (may hold|must be like|must have at most)"):
        Expression(text)


def test_a_vector_mixes_numbers_and_formulas() -> None:
    found = VectorExpression((Expression("x"), 0.0, Expression("2 * z")))(POINTS)
    np.testing.assert_array_equal(found, np.column_stack([X, 0 * X, 2 * Z]))


def test_equal_texts_are_equal_values() -> None:
    assert Expression("x") == Expression("x")
    assert len({Expression("x"), Expression("x"), Expression("y")}) == 2


def test_z_is_refused_in_the_plane() -> None:
    with pytest.raises(InvalidInputError, match="depends on z, but the bodies lie in the plane"):
        Expression("x + z")(POINTS[:, :2])


def test_on_the_way_from_one_formula_to_another_is_a_formula() -> None:
    half = between(Expression("x"), Expression("3 * y"), 0.5)
    assert callable(half)
    np.testing.assert_allclose(half(POINTS), 0.5 * X + 1.5 * Y)
    quarter = between(-2.0, Expression("z"), 0.25)
    assert callable(quarter)
    np.testing.assert_allclose(quarter(POINTS), -1.5 + 0.25 * Z)
    assert between(1.0, 3.0, 0.25) == 1.5
    assert between(0.1, 0.3, 1.0) == 0.3


# Keys of scene files are the arguments of what is built from them.
@dataclass
class Spring:
    """A spring.

    Attributes:
        stiffness: Of the wire, [force / length]. What follows is not for files.
        axis: Direction.
        turns: Windings.
        hidden: No key.
    """

    stiffness: float
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    turns: int = 7
    hidden: str = "x"


@keys_of(Spring, without=["hidden"])
class SpringPart(Part):
    """A spring of a file."""

    kind: Literal["spring"]
    stiffness: PositiveFloat = Field(alias="rate")


def test_types_defaults_and_words_are_those_of_the_class() -> None:
    schema = SpringPart.model_json_schema(by_alias=True)
    assert list(schema["properties"]) == ["kind", "rate", "axis", "turns"]
    assert schema["required"] == ["kind", "rate"]
    assert schema["properties"]["rate"]["description"] == "of the wire, [force / length]"
    assert schema["properties"]["rate"]["exclusiveMinimum"] == 0
    assert schema["properties"]["axis"]["maxItems"] == 3
    assert schema["properties"]["turns"]["default"] == 7


def test_a_table_makes_what_it_is_of() -> None:
    part = SpringPart.model_validate({"kind": "spring", "rate": 2, "axis": [1, 0, 0]})
    assert part.made() == Spring(2.0, (1.0, 0.0, 0.0))
    assert part.made(turns=3) == Spring(2.0, (1.0, 0.0, 0.0), 3)


def test_an_error_knows_the_keys_and_what_the_wrong_one_means() -> None:
    with pytest.raises(ValidationError) as caught:
        SpringPart.model_validate({"kind": "spring", "rate": -1.0, "stiffness": 1.0})
    low, extra = caught.value.errors()
    assert (low["loc"], low["ctx"]["kind"]) == (("rate",), "greater_than")
    assert low["ctx"]["hint"] == "of the wire, [force / length]"
    assert (extra["loc"], extra["ctx"]["kind"]) == (("stiffness",), "extra_forbidden")
    assert extra["ctx"]["keys"] == ["kind", "rate", "axis", "turns"]


def test_a_law_of_friction_is_built_by_its_own_arguments() -> None:
    _, coulomb, _ = FRICTION_LAWS
    part = coulomb.model_validate({"law": "coulomb", "coefficient": 0.25})
    assert part.made() == Coulomb(0.25)


def test_a_table_has_the_summary_of_its_class_and_the_limits_of_its_arguments() -> None:
    schema = table_of(NeoHooke, model="neo_hooke").model_json_schema()
    assert schema["description"].startswith("Compressible neo-Hookean elasticity")
    assert schema["properties"]["model"]["const"] == "neo_hooke"
    assert schema["properties"]["young_modulus"]["exclusiveMinimum"] == 0
    assert schema["properties"]["poisson_ratio"]["exclusiveMaximum"] == 0.5


def test_every_key_of_a_scene_file_is_described() -> None:
    tables = json_schema()["$defs"]
    keys = [
        (table, key, what) for table, found in tables.items() for key, what in found["properties"].items()
    ]
    assert len(keys) > 150
    assert [
        (table, key) for table, key, what in keys if "const" not in what and not what["description"]
    ] == []


def test_defaults_of_links_are_those_of_the_library() -> None:
    given = json_schema()["$defs"]["LinkMesh"]["properties"]
    assert {name: given[name]["default"] for name in vars(LinkShape())} == vars(LinkShape())
