"""JSON files hold what they were given, or there is an error that says where it could not be held."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_contact.errors import InvalidInputError
from fenics_contact.output import write_json
from fenics_contact.output.files import plain


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Energies:
    strain: float
    parts: np.ndarray


def test_types_of_numpy_and_python_are_converted(tmp_path: Path) -> None:
    data = {
        "float": np.float64(1.5),
        "int": np.int32(3),
        "truth": np.bool_(True),
        "array": np.arange(4).reshape(2, 2),
        "tuple": (1, None, "ä"),
        "path": Path("a/b"),
        "enumeration": Colour.RED,
        "dataclass": Energies(2.0, np.zeros(1)),
    }
    path = write_json(tmp_path / "new" / "result.json", data)
    assert json.loads(path.read_text()) == {
        "float": 1.5,
        "int": 3,
        "truth": True,
        "array": [[0, 1], [2, 3]],
        "tuple": [1, None, "ä"],
        "path": "a/b",
        "enumeration": "red",
        "dataclass": {"strain": 2.0, "parts": [0.0]},
    }
    assert list(json.loads(path.read_text())) == list(data), "the order of the keys is kept"


json_data = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(json_data)
def test_what_json_knows_stays_as_it_is(data: Any) -> None:
    assert json.loads(json.dumps(plain(data), allow_nan=False)) == data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"a": [1.0, float("nan")]}, "data['a'][1] must be finite, got nan"),
        ({"a": np.array([np.inf])}, "data['a'][0] must be finite, got inf"),
        (Energies(-np.inf, np.zeros(0)), "data.strain must be finite, got -inf"),
        ({"a": {1: 2}}, "keys of data['a'] must be strings, got 1"),
        ({"a": object()}, "data['a'] must be a mapping, sequence"),
        ({"a": b"bytes"}, "got a bytes"),
        ({"a": 1j}, "got a complex"),
    ],
)
def test_what_json_does_not_know_is_refused_by_its_place(data: Any, message: str, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        write_json(path, data)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
