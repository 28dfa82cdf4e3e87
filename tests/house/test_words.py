"""Public docstrings and pages use the field's terms: the words that kept coming back stay away."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.house.public import public, texts

#: Wordings, and what to write instead.
WORDS = {
    r"tells?|telling|told": "report, warn, print, show, identify",
    r"feels?|felt": "depend on, act on",
    r"mend(?:s|ed|ing)?": "repair, correct",
    r"lack(?:s|ing)?": "is missing, has no; residual",
    r"bears?": "carry, press, transmit",
    r"stood|stands? still|standing still": "lie, be fixed; stagnate",
    r"(?:that|which|what) (?:is|are) none": "is not finite, is not complete, does not exist",
    r"without a word": "and prints nothing",
    r"by \w+ from (?:that|those) by": "vector-Jacobian product",
}
FOUND = re.compile("|".join(rf"\b(?:{words})\b" for words in WORDS))


def docstrings(value: Any) -> Iterator[str]:
    """Yield the docstrings of a public thing and of its own members."""
    for part in [value, *vars(value).values()] if inspect.isclass(value) else [value]:
        part = part.fget if isinstance(part, property) else getattr(part, "func", part)
        if str(getattr(part, "__module__", "")).startswith("fenics_contact"):
            yield inspect.getdoc(part) or ""


def test_public_docstrings_use_the_terms_of_the_field() -> None:
    words = {name: " ".join(docstrings(value)) for name, value in public().items()}
    assert sum(map(len, words.values())) > 100_000, "no docstrings were found: nothing was tested"
    assert {name: FOUND.findall(text) for name, text in words.items() if FOUND.search(text)} == {}


def test_pages_use_the_terms_of_the_field() -> None:
    assert {str(path): FOUND.findall(text) for path, text in texts().items() if FOUND.search(text)} == {}


@pytest.mark.parametrize(
    "text",
    ["a warning tells it", "the slave feels it", "reject a number that is none", "the residual stands still"],
)
def test_a_wording_is_found(text: str) -> None:
    assert FOUND.search(text)
    assert not FOUND.search("where there is none; it stands for a support; intelligible, bearing")
