"""Keys of scene files are the arguments of what is built from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pytest
from pydantic import Field, PositiveFloat, ValidationError

from fenics_contact import Coulomb
from fenics_contact._scene_file.model import FRICTION_LAWS
from fenics_contact._scene_file.part import Part, keys_of, table_of
from fenics_contact._scene_file.validation import json_schema
from fenics_contact.gallery import LinkShape
from fenics_contact.materials import NeoHooke


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
