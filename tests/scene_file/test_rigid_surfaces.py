"""Rigid surfaces of scene files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._scene import supports as supports_module
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError

SELF = MPI.COMM_SELF
STEEL = {"young_modulus": 2.1e5, "poisson_ratio": 0.3}


def file_of(**parts: Any) -> SceneFile:
    """A scene of one block "a"."""
    return read_scene_file(
        {
            "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [2, 1, 1], "counts": [4, 2, 2]}},
            "materials": {"s": STEEL},
            "bodies": {"a": {"mesh": "m", "material": "s"}},
            **parts,
        },
        SELF,
    )


RIGID = {"kind": "rigid", "body": "a", "surface": "z1", "at": [1, 0.5, 3]}


def test_a_rigid_surface_is_that_of_the_package() -> None:
    moved = {**RIGID, "value": [0, "free", -1, "free", 0, 0.02], "moment": [3, 0, 0]}
    loaded = {**RIGID, "force": [0, 0, -5]}
    for given, expected in (
        (
            moved,
            supports_module.RigidSurface(
                "a", "z1", (1, 0.5, 3), (0, None, -1), (None, 0, 0.02), moment=(3, 0, 0)
            ),
        ),
        (loaded, supports_module.RigidSurface("a", "z1", (1, 0.5, 3), (None,) * 3, (None,) * 3, (0, 0, -5))),
    ):
        assert list(file_of(supports=[given]).scene.supports) == [expected]
    plane = {
        "meshes": {"m": {"shape": "rectangle", "lower": [0, 0], "upper": [2, 1], "counts": [4, 2]}},
        "materials": {"s": {**STEEL, "model": "plane_strain"}},
        "bodies": {"a": {"mesh": "m", "material": "s"}},
        "supports": [{**RIGID, "surface": "x1", "at": [2, 0.5], "value": [0, "free", 0.1]}],
    }
    (found,) = read_scene_file(plane, SELF).scene.supports
    assert found == supports_module.RigidSurface("a", "x1", (2, 0.5), (0, None), 0.1)


def test_steps_turn_a_rigid_surface() -> None:
    supports = [{**RIGID, "name": "top", "value": [0, 0, "free", 0, 0, 0]}, {"body": "a", "surface": "z0"}]
    steps: list[dict[str, Any]] = [
        {"count": 2, "supports": {"top": [0.1, 0, "free", 0, 0, 0.04]}},
        {"supports": {"top": [0.1, 0, "free", 0, 0, "0.01 * t"]}},
    ]
    found = [step.supports[0] for step in file_of(supports=supports, steps=steps).steps]
    assert [each.displacement for each in found] == [(0.05, 0.0, None), (0.1, 0.0, None), (0.1, 0.0, None)]
    np.testing.assert_allclose([each.rotation for each in found], [(0, 0, 0.02), (0, 0, 0.04), (0, 0, 0.03)])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"value": [0, 0]},
            "supports.0.value must be six numbers, formulas in t or 'free' in brackets: displac",
        ),
        ({"value": [0, 0, 0]}, "RigidSurface.rotation of surface 'z1' of body 'a' must be 3 finite numbers"),
        ({"at": [0, 0]}, "RigidSurface"),
        ({"kind": "stiff"}, "supports.0.kind must be one of 'rigid', got "),
        ({"force": [0, 0]}, "RigidSurface.force of surface 'z1' of body 'a' must be 3 finite numbers"),
        ({"surface": "top"}, "supports.0.surface must be a surface of the body 'a'"),
    ],
)
def test_a_rigid_surface_that_is_none_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneFileError, match=words):
        _ = file_of(supports=[{**RIGID, **given}]).scene
