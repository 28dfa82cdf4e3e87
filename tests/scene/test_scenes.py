"""A scene knows its parts by name, lists what it calls for, and refuses what points to nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    Tresca,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

STEEL = IsotropicElasticity(2.1e5, 0.3)
FLOOR = RigidPlane((0, 0, 0), (0, 0, 1))
BASE = Surface("upper", "z0")
TOP = Surface("lower", "z1")


def stack(**parts: Any) -> Scene:
    """One block on another."""
    lower = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL)
    upper = Body(block((0, 0, 1), (1, 1, 2), (1, 1, 1), "tetrahedron"), STEEL)
    return Scene({"lower": lower, "upper": upper}, **parts)


def test_a_scene_without_bodies_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"at least one body, got none: pass bodies=\{'name': Body"):
        Scene({})


@pytest.mark.parametrize(
    ("user", "parts"),
    [
        ("Support", {"supports": [Support("bottom", "z0")]}),
        ("Traction", {"loads": [Traction("bottom", "z0", (0, 0, 1))]}),
        ("TotalForce", {"loads": [TotalForce("bottom", "z0", (0, 0, 1))]}),
        ("BodyForce", {"loads": [BodyForce("bottom", (0, 0, 1))]}),
        ("ContactPair.slave", {"contacts": [ContactPair(Surface("bottom", "z0"), TOP)]}),
        ("ContactPair.master", {"contacts": [ContactPair(BASE, Surface("bottom", "z0"))]}),
    ],
)
def test_an_unknown_body_is_refused_by_whoever_names_it(user: str, parts: dict[str, Any]) -> None:
    message = rf"^{user} names body 'bottom', the scene has \['lower', 'upper'\]: use one of them$"
    with pytest.raises(InvalidInputError, match=message):
        stack(**parts)


@pytest.mark.parametrize(
    ("user", "parts"),
    [
        ("Support", {"supports": [Support("lower", "top")]}),
        ("Traction", {"loads": [Traction("lower", "top", (0, 0, 1))]}),
        ("TotalForce", {"loads": [TotalForce("lower", "top", (0, 0, 1))]}),
        ("ContactPair.slave", {"contacts": [ContactPair(Surface("lower", "top"), BASE)]}),
        ("ContactPair.master", {"contacts": [ContactPair(BASE, Surface("lower", "top"))]}),
    ],
)
def test_an_unknown_surface_is_refused_by_whoever_names_it(user: str, parts: dict[str, Any]) -> None:
    message = rf"^{user} names surface 'top' of body 'lower', which has \['x0', .*'z1'\]: use one of them$"
    with pytest.raises(InvalidInputError, match=message):
        stack(**parts)


def test_an_empty_contact_surface_cannot_be_made() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(InvalidInputError, match=r"'contact' must have .* at least one facet, got \(0, 4\)"):
        BodyMesh(mesh.points, mesh.cells, {"contact": mesh.surfaces["z0"][:0]})


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_coordinates_that_are_no_numbers_are_refused(bad: float) -> None:
    scene = stack()
    points = scene.bodies["lower"].mesh.points.copy()
    points[3, 1] = bad
    with pytest.raises(InvalidInputError, match=r"points must be finite .*, 1 of 8 are not, first node 3"):
        scene.moved({"lower": points})


def test_a_moved_scene_is_a_new_one_with_the_same_parts() -> None:
    scene = stack(supports=[Support("lower", "z0")], contacts=[ContactPair(BASE, TOP)])
    before = scene.bodies["upper"].mesh.points.copy()
    lifted = before + np.array([0.0, 0.0, 0.5])
    moved = scene.moved({"upper": lifted})
    np.testing.assert_array_equal(scene.bodies["upper"].mesh.points, before)
    np.testing.assert_array_equal(moved.bodies["upper"].mesh.points, lifted)
    assert moved.bodies["lower"] is scene.bodies["lower"]
    assert (moved.supports, moved.contacts) == (scene.supports, scene.contacts)
    assert moved.body_names == ("lower", "upper")


def test_moving_an_unknown_body_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"moved names body 'bottom', the scene has \['lower', 'up"):
        stack().moved({"bottom": np.zeros((8, 3))})


def test_effects_name_everything_a_scene_calls_for() -> None:
    scene = stack(
        supports=[Support("lower", "z0")],
        loads=[BodyForce("upper", (0, 0, -1)), TotalForce("upper", "z1", (0, 0, -1))],
        contacts=[
            ContactPair(BASE, TOP, Coulomb(0.3)),
            ContactPair(Surface("lower", "x0"), FLOOR, Tresca(2.0)),
        ],
    )
    assert {effect.name for effect in scene.effects()} == {
        "elasticity",
        "prescribed displacement",
        "body force",
        "surface load",
        "contact",
        "Tresca friction",
        "Coulomb friction",
    }
    assert all(effect.reason for effect in scene.effects())


@pytest.mark.parametrize("friction", [None, Coulomb(0.0), Tresca(0.0)])
def test_friction_that_can_carry_nothing_is_not_an_effect(friction: Coulomb | Tresca | None) -> None:
    pair = ContactPair(BASE, TOP, friction)
    assert not pair.has_friction
    assert [effect.name for effect in stack(contacts=[pair]).effects()] == ["elasticity", "contact"]


def test_a_scene_without_contact_calls_for_none() -> None:
    assert [effect.name for effect in stack().effects()] == ["elasticity"]


@pytest.mark.parametrize("kind", [ContactPair, Tie])
def test_the_same_surfaces_twice_are_refused(kind: type[ContactPair] | type[Tie]) -> None:
    pairs = [kind(BASE, TOP), kind(TOP, BASE)]
    name = "contacts" if kind is ContactPair else "ties"
    assert len(getattr(stack(**{name: pairs}), name)) == 2
    words = f"the surfaces of {kind.__name__} 2, upper z0 on lower z1, are those of {kind.__name__} 0: how"
    with pytest.raises(InvalidInputError, match=words):
        stack(**{name: [*pairs, pairs[0]]})


def test_plane_and_solid_bodies_in_one_scene_are_refused() -> None:
    solid, plane = stack().bodies["lower"], Body(rectangle((0, 0), (1, 1), (1, 1)), PlaneStrain(1.0, 0.3))
    with pytest.raises(InvalidInputError, match=r"be solid, got plane \['b'\] and solid \['a'\]: give"):
        Scene({"a": solid, "b": plane})
