"""Rollers and sectors of scene files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import CyclicSymmetry, Roller, Surface, read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError


def file_with_block(**parts: Any) -> SceneFile:
    """A scene of one block "a"."""
    return read_scene_file(
        {
            "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [2, 1, 1], "counts": [4, 2, 2]}},
            "materials": {"s": {"young_modulus": 2.1e5, "poisson_ratio": 0.3}},
            "bodies": {"a": {"mesh": "m", "material": "s"}},
            **parts,
        },
        MPI.COMM_SELF,
    )


ROLLER = {"kind": "roller", "body": "a", "surface": "z1"}


def test_a_roller_is_that_of_the_package_and_steps_move_it() -> None:
    given = {**ROLLER, "value": -0.1, "direction": [0, 3, 4]}
    for table, expected in (
        (ROLLER, Roller("a", "z1")),
        (given, Roller("a", "z1", -0.1, (0.0, 0.6, 0.8))),
    ):
        assert list(file_with_block(supports=[table]).scene.supports) == [expected]
    steps: list[dict[str, Any]] = [
        {"count": 2, "supports": {"top": 0.04}},
        {"supports": {"top": "0.01 * t"}},
        {"supports": {"top": "0.01 * x"}},
    ]
    supports = [{**ROLLER, "name": "top"}, {"body": "a", "surface": "z0"}]
    found = [step.supports[0] for step in file_with_block(supports=supports, steps=steps).steps]
    at = np.array([[2.0, 0.0, 1.0]])
    np.testing.assert_allclose([each.amounts(at)[0] for each in found], [0.02, 0.04, 0.03, 0.02])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"value": [0, 0, 0]}, "supports.0.value must be a finite number, a formula in x, y and z in quotes"),
        ({"value": "x / (x - 2)"}, "must have a finite value at every node, got inf"),
        ({"direction": [0, 0, 0]}, "Roller.direction of surface 'z1' of body 'a' must be 3 finite numbers"),
        ({"surface": "top"}, "supports.0.surface must be a surface of the body 'a'"),
    ],
)
def test_a_roller_that_is_none_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneFileError, match=words):
        _ = file_with_block(supports=[{**ROLLER, **given}]).scene
    with pytest.raises(SceneFileError, match="must have the form of 'top' itself, 0"):
        _ = file_with_block(
            supports=[{**ROLLER, "name": "top"}], steps=[{"supports": {"top": [0, 0, 1]}}]
        ).scene


def test_a_sector_is_that_of_the_package() -> None:
    given = {
        "kind": "cyclic", "slave": {"body": "a", "surface": "x0"}, "master": {"body": "a", "surface": "y0"},
        "at": [0, 0, 2], "axis": [0, 0, 2],
    }  # fmt: skip
    square = {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [2, 2, 2]}
    parts: dict[str, Any] = {"meshes": {"m": square}, "ties": [given]}
    (found,) = file_with_block(**parts).scene.ties
    sides = Surface("a", "x0"), Surface("a", "y0")
    expected = CyclicSymmetry(*sides, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), None, "node")
    assert replace(found, choice=expected.choice) == expected
    assert found.reason == "node, as the meshes match"
    for wrong, words in (
        ({"kind": "round"}, "ties.0.kind must be one of 'cyclic', got "),
        ({"axis": [0, 0, 0]}, "CyclicSymmetry.axis must be 3 finite numbers"),
        ({"angle": 1.0}, "sides of a sector must be 360°/N apart"),
    ):
        with pytest.raises(SceneFileError, match=words):
            _ = file_with_block(meshes={"m": square}, ties=[{**given, **wrong}]).scene
