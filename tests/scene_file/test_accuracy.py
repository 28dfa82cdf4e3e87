"""The accuracy that a scene file asks for."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from fenics_contact import AccurateResult, Level, Limits, read_scene_file, solve_to
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.design import ContactArea, Movement, Objective, PeakPressure, StrainEnergy, StressNear
from tests.conftest import ROOT
from tests.scene_file.texts import STEPS

ROLLER = tomllib.loads((ROOT / "demos" / "scenes" / "plate_on_roller.toml").read_text(encoding="utf-8"))


def asking(data: dict[str, Any] = ROLLER, /, **accuracy: Any) -> SceneFile:
    return read_scene_file({**data, "accuracy": {"relative_error": 0.3, **accuracy}}, MPI.COMM_SELF)


@pytest.fixture(scope="module")
def found() -> tuple[AccurateResult, list[Level]]:
    levels = list[Level]()
    return asking().solve_to(levels.append), levels


def test_a_file_finds_what_python_finds(found: tuple[AccurateResult, list[Level]]) -> None:
    result, levels = found
    same = solve_to(asking().scene, PeakPressure(), 0.3, MPI.COMM_SELF)
    assert result.reached
    assert tuple(levels) == result.levels
    assert len(levels) > 2
    assert [level.cells for level in levels] == [level.cells for level in same.levels]
    assert result.value == pytest.approx(same.value, rel=1e-9)
    assert result.state.scene.bodies["plate"].mesh.n_cells == levels[-1].cells > levels[0].cells == 50


def test_limits_of_a_file_are_those_of_python() -> None:
    part = asking(levels=2, unknowns=5000, seconds=1.5, memory=1e9).document.accuracy
    assert part is not None
    assert part.made() == Limits(levels=2, unknowns=5000, seconds=1.5, memory=1e9)
    assert part.in_words == "peak_pressure to 30 %"
    result = asking(levels=2).solve_to()
    assert not result.reached
    assert len(result.levels) == 2


OWN = """
from fenics_contact.design import StrainEnergy

TWICE = 2.0 * StrainEnergy()
"""


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, PeakPressure()),
        ({"quantity": "peak_pressure", "surface": "plate y0"}, PeakPressure(0)),
        ({"quantity": "effective_area"}, ContactArea()),
        (
            {"quantity": "displacement", "surface": "plate y1", "direction": [0, -1.0]},
            Movement("plate", "y1", (0.0, -1.0)),
        ),
        (
            {"quantity": "stress", "at": [0.0, 1.0], "component": "yy", "radius": 0.5},
            StressNear("plate", (0.0, 1.0), 0.5, "yy"),
        ),
    ],
)
def test_a_quantity_of_a_file_is_that_of_python(given: dict[str, Any], expected: Objective) -> None:
    file = asking(**given)
    file.check_accuracy()
    assert file.quantity == expected


def test_a_quantity_may_be_ones_own(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    text = (ROOT / "demos" / "scenes" / "plate_on_roller.toml").read_text(encoding="utf-8")
    (tmp_path / "scene.toml").write_text(text.replace('"peak_pressure"', '"own.py:TWICE"'))
    assert read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).quantity == 2.0 * StrainEnergy()
    with pytest.raises(SceneFileError, match=r"accuracy.quantity must not be Python code \(--no-python\)"):
        read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF, python=False)


MOVED = {"quantity": "displacement", "direction": [0.0, 1.0]}


@pytest.mark.parametrize(
    ("accuracy", "message"),
    [
        ({"relative_error": 0}, "accuracy.relative_error must be a number greater than 0, got 0"),
        ({"relative_error": 1.0}, "accuracy.relative_error must be a number less than 1, got 1.0"),
        ({"quantity": "peak_presure"}, "accuracy.quantity must be one of .*did you mean 'peak_pressure'"),
        ({"surface": "plate y7"}, "accuracy: a result by name needs .* got 'plate y7'"),
        (
            {**MOVED, "surface": "plate y7"},
            "accuracy: a quantity needs a surface of the scene, got 'plate y7'",
        ),
        ({**MOVED, "body": "pate"}, "accuracy.body must be a body, one of 'plate', got"),
        ({**MOVED, "at": [1.0]}, "accuracy.at must be"),
        ({"quantity": "displacement", "surface": "plate y1"}, "accuracy: this quantity needs a direction"),
        ({"direction": [0.0, 1.0]}, "accuracy: peak_pressure takes surface, got direction: leave it out"),
        ({"radius": 0.0}, "accuracy.radius must be a number greater than 0"),
        ({"levels": 0}, "accuracy: Limits.levels must be above zero, got 0"),
    ],
)
def test_what_cannot_be_asked_for_is_named(accuracy: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneFileError, match=message):
        asking(**accuracy).check_accuracy()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (tomllib.loads(STEPS), r"steps does not go with \[accuracy\]: load steps have a history"),
        ({**ROLLER, "solver": {"subdomains": 4}}, r"solver.subdomains does not .* every mesh is cut anew"),
        ({**ROLLER, "solver": {"newton": {"first": 0.5}}}, r"solver.newton does not .* of the default size"),
    ],
)
def test_what_refined_meshes_cannot_keep_is_refused(data: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneFileError, match=message):
        asking(data).check_accuracy()


@pytest.mark.parametrize(("levels", "count"), [(20, 0), (1, 1)])
def test_of_the_last_mesh_alone_there_are_warnings(
    levels: int, count: int, caplog: pytest.LogCaptureFixture
) -> None:
    asking(levels=levels).solve_to()
    said = [each for each in caplog.messages if "is too small for its cells" in each]
    assert len(said) == count
