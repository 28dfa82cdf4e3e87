"""Rigid tools in scene files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import RigidSphere, RigidSurface, RigidTool, ToolMotion, read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from tests.scene_file.texts import changed
from tests.shapes.bodies import CUBE, SIDES

SELF = MPI.COMM_SELF
STEEL = {"young_modulus": 2.1e5, "poisson_ratio": 0.3}


def file_with_tool(**parts: Any) -> SceneFile:
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


BALL = {"obstacle": "sphere", "centre": [1, 0.5, 3], "radius": 2, "tool": "ball", "about": [1, 0.5, 3]}
ON_BALL = {"slave": {"body": "a", "surface": "z1"}, "master": BALL}
DRIVEN = {"kind": "tool", "tool": "ball", "value": [0, 0, "free", 0, "free", 0], "force": [0, 0, -5]}


def test_a_tool_is_that_of_the_package() -> None:
    springs = {"stiffness": [0, 0, 30], "rotational_stiffness": [0, 2, 0]}
    scene = file_with_tool(contacts=[ON_BALL], supports=[{**DRIVEN, **springs}]).scene
    tool = RigidTool("ball", RigidSphere((1, 0.5, 3), 2.0), (1, 0.5, 3))
    motion = ToolMotion("ball", (0, 0, None), (0, None, 0), (0, 0, -5), (0, 0, 0), (0, 0, 30), (0, 2, 0))
    assert scene.contacts[0].master == tool
    assert scene.supports == (motion.of(tool.at),)
    assert list(scene.bodies["ball"].springs) == [0, 0, 30, 0, 2, 0]
    plane = {
        "meshes": {"m": {"shape": "rectangle", "lower": [0, 0], "upper": [2, 1], "counts": [4, 2]}},
        "materials": {"s": {**STEEL, "model": "plane_strain"}},
        "bodies": {"a": {"mesh": "m", "material": "s"}},
        "contacts": [
            {
                "slave": {"body": "a", "surface": "y1"},
                "master": {
                    "obstacle": "sphere",
                    "centre": [1, 3],
                    "radius": 2,
                    "tool": "disc",
                    "about": [1, 3],
                },
            }
        ],
        "supports": [{"kind": "tool", "tool": "disc", "moment": 0.5, "value": [0, 0, "free"]}],
    }
    (found,) = read_scene_file(plane, SELF).scene.supports
    assert found == RigidSurface("disc", "tool", (1, 3), (0, 0), None, (0, 0), 0.5)


def test_steps_change_what_drives_a_tool() -> None:
    supports = [{**DRIVEN, "name": "drive"}, {"body": "a", "surface": "z0"}]
    free = [0, 0, "free", 0, "free", 0]
    steps: list[dict[str, Any]] = [
        {"count": 2, "supports": {"drive": [*free, 0, 0, -9, 0, 0, 0]}},
        {"supports": {"drive": [*free, 0, 0, "-9 - t", 0, 1, 0]}},
    ]
    file = file_with_tool(contacts=[ON_BALL], supports=supports, steps=steps)
    found = [step.supports[0] for step in file.steps]
    assert [each.force for each in found] == [(0, 0, -7), (0, 0, -9), (0, 0, -12)]
    assert [each.moment for each in found] == [(0, 0, 0), (0, 0, 0), (0, 1, 0)]
    assert [each.displacement for each in found] == [(0, 0, None)] * 3


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (
            {"supports": [{**DRIVEN, "tool": "bal"}]},
            r"supports\.0: a ToolMotion names tool 'bal', .* have \['ball'\]",
        ),
        (
            {"contacts": [{**ON_BALL, "master": {**BALL, "motion": [0, 0, 0, 0, 0, 0]}}]},
            r"contacts\.0: the tool 'ball' needs the point 'about' .* and no motion",
        ),
        (
            {"supports": [{**DRIVEN, "name": "d"}], "steps": [{"supports": {"d": [0, 0, 0, 0, 0, 0]}}]},
            r"steps\.0\.supports\.d must have the form of 'd' itself",
        ),
    ],
)
def test_a_tool_that_cannot_be_is_refused(parts: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneFileError, match=words):
        _ = file_with_tool(**{"contacts": [ON_BALL], "supports": [DRIVEN], **parts}).steps


def test_an_obstacle_of_triangles_comes_from_a_file(tmp_path: Path) -> None:
    meshio.write_points_cells(tmp_path / "tool.stl", CUBE, [("triangle", SIDES)])
    table = 'master = { obstacle = "triangulation", file = "tool.stl", scale = 2.0'
    moved = ', motion = [0.0, 0.0, "t", 0.0, 0.0, 0.0] }'
    body = 'master = { body = "lower", surface = "z1" }'
    for end in (" }", moved):
        (tmp_path / "scene.toml").write_text(changed((body, table + end)))
        (pair,) = read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).scene.contacts
        assert pair.master.distance(np.array([[1.0, 1.0, 2.5]])) == pytest.approx(0.5)  # type: ignore[union-attr]
    assert pair.master.at(0.25).distance(np.array([[1.0, 1.0, 2.5]])) == pytest.approx(0.25)
    meshio.write_points_cells(tmp_path / "tool.stl", CUBE, [("triangle", SIDES[1:])])
    with pytest.raises(
        SceneFileError, match=r"contacts\.0\.master: file .*tool.stl.* got 3 open edges of 18"
    ):
        _ = read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).scene
