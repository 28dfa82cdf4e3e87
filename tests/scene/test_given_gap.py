"""What a contact pair says about its gap, and what it may not say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import Body, ContactPair, Scene, Surface, Tie
from fenics_contact._base.fingerprint import described
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, hemisphere
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output.result import described_scene

SIDES = (Surface("a", "top"), Surface("b", "bottom"))


def pair(**given: Any) -> ContactPair:
    return ContactPair(*SIDES, **given)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        (
            {"gap": 0.1, "interference": 0.1},
            r"a gap or an interference, got gap=0\.1 and interference=",
        ),
        ({"gap": 0.0, "interference": "measured"}, "a gap or an interference"),
        ({"gap": -0.1}, r"ContactPair\.gap must be zero or positive and finite, got -0\.1: clearances are"),
        ({"interference": -0.1}, r"ContactPair\.interference must be zero or positive"),
        ({"adjust": -0.1}, r"ContactPair\.adjust must be zero or positive"),
        ({"gap": np.nan}, r"ContactPair\.gap must be zero or positive and finite, got nan"),
        ({"interference": np.inf}, r"ContactPair\.interference must be .* got inf"),
        ({"gap": "measured"}, r"ContactPair\.gap must be a number, a function or None, got 'measured'"),
        (
            {"interference": "all"},
            r"interference must be a number, a function, 'measured' or None, got 'all'",
        ),
        ({"gap": np.zeros(3)}, r"ContactPair\.gap must be a number, a function or None, got array"),
        ({"adjust": True}, r"ContactPair\.adjust must be a number or None, got True"),
        ({"adjust": lambda x: x[:, 0]}, r"ContactPair\.adjust must be a number or None"),
    ],
)
def test_what_is_no_gap_is_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        pair(**given)


def test_ties_have_no_gap() -> None:
    with pytest.raises(TypeError, match="gap"):
        Tie(*SIDES, gap=0.1)  # type: ignore[call-arg]


def test_it_is_told_in_words() -> None:
    assert pair().given_gap == ""
    assert pair(gap=0.0).given_gap == "gap 0"
    assert pair(interference=np.ones_like, adjust=0.25).given_gap == (
        "interference by a function, in touch within 0.25"
    )
    assert pair(interference="measured").given_gap == "interference measured"


def test_descriptions_and_fingerprints_contain_it() -> None:
    for name, value in {"gap": 0.125, "interference": 0.125, "adjust": 0.125}.items():
        assert described(pair(**{name: value}), "pair")[f"pair.{name}"] == "0.125"
    bodies = {
        name: Body(block((0, 0, low), (1, 1, low + 1), (1, 1, 1)), IsotropicElasticity(1.0, 0.3))
        for name, low in (("a", 1), ("b", 0))
    }
    sides = Surface("a", "z0"), Surface("b", "z1")
    contact = ContactPair(*sides, discretisation="best", interference="measured", adjust=0.5)
    scene = Scene(bodies, contacts=[contact])
    (entry,) = described_scene(scene, {"a": 1, "b": 1})["contacts"]
    assert (entry["gap"], entry["interference"], entry["adjust"]) == (None, "measured", 0.5)
    assert (entry["discretisation"], entry["reason"]) == ("node", "node, as the meshes match")
    assert "a z0 on b z1, without friction, interference measured" in repr(scene)
    assert str(scene.plan().contacts[0]).startswith(
        "flat on flat; node, as the meshes match; interference measured, in touch within 0.5; facets miss no"
    )


def test_facets_miss_nothing_where_all_gaps_are_given() -> None:
    ball = hemisphere(10.0, 6)
    steel = IsotropicElasticity(2.1e5, 0.3)
    plate = block((-4, -4, -2), (4, 4, 0), (4, 4, 2))
    bodies = {"ball": Body(ball, steel), "plate": Body(plate, steel)}
    surfaces = Surface("plate", "z1"), Surface("ball", "contact")
    heights = {
        str(given): Scene(bodies, contacts=[ContactPair(*surfaces, **given)]).plan().contacts[0].height
        for given in ({}, {"gap": 0.1}, {"gap": 0.1, "adjust": 0.1}, {"interference": "measured"})
    }
    assert heights.pop("{'gap': 0.1}") == 0.0
    assert len(set(heights.values())) == 1
    assert heights["{}"] > 0.01
