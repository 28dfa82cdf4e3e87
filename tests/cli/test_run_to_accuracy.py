"""`fenics-contact run --accuracy`: a line for each mesh, files, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact.output import read_result
from tests.conftest import ROOT
from tests.scene_file.texts import STEPS

ROLLER = ROOT / "demos" / "scenes" / "plate_on_roller.toml"
#: What a mesh may be predicted to take depends on how busy the machine is.
ANY_TIME = ("--set", "accuracy.seconds=1e9")


def run(*arguments: object) -> int:
    return cli.main(MPI.COMM_SELF, [str(argument) for argument in arguments])


@pytest.mark.parametrize("share", ["30%", "0.3"])
def test_every_mesh_is_a_line_and_in_the_result(
    share: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", ROLLER, "-o", tmp_path, "--accuracy", share, *ANY_TIME, "--no-pictures") == 0
    printed = capsys.readouterr().out
    assert "accuracy        peak_pressure to 30 %\n" in printed
    table = printed[printed.index("    cells") :].split("\n\n")[0].splitlines()
    assert table[0].split() == ["cells", "unknowns", "value", "error", "products", "seconds", "expected"]
    accuracy = read_result(tmp_path)["accuracy"]
    levels = accuracy["levels"]
    rows = [line.split() for line in table[1:-1]]
    assert [int(row[0]) for row in rows] == levels["cells"]
    assert [int(row[1]) for row in rows] == levels["unknowns"]
    np.testing.assert_allclose([float(row[2]) for row in rows], levels["value"], rtol=1e-5)
    assert rows[0][3] == "unknown"
    assert levels["error"][0] is None
    assert levels["predicted"][0] is None
    assert table[-1] == accuracy["reason"]
    assert accuracy["reached"]
    assert accuracy["wanted"] == 0.3
    assert accuracy["value"] == levels["value"][-1]
    assert accuracy["error"] == levels["error"][-1] < 0.3 * accuracy["value"]


def test_first_and_last_mesh_are_drawn_without_being_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = "run", ROLLER, "-o", tmp_path, "--accuracy", "30%", *ANY_TIME
    assert run(*command, "--dry-run") == 0
    assert "pictures of stress, meshes\n" in capsys.readouterr().out
    assert run(*command) == 0
    assert "stress.png, meshes.png\n" in capsys.readouterr().out
    image = imread(tmp_path / "meshes.png")[..., :3]
    left, right = np.split(image[len(image) // 2 :].mean(axis=2) < 0.5, 2, axis=1)
    assert right.sum() > 1.2 * left.sum() > 0  # the last mesh has more lines


def test_an_accuracy_that_is_not_reached_is_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = "--set", "accuracy.levels=2", *ANY_TIME
    assert run("run", ROLLER, "-o", tmp_path, "--of", "contact_area", *limits, "--no-pictures") == 3
    printed = capsys.readouterr().out
    assert "contact_area to 1 %" in printed
    assert "the accuracy was not reached: an unknown error after 2 meshes, as many as" in printed
    assert len(read_result(tmp_path)["accuracy"]["levels"]["cells"]) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--accuracy", "0"], "--accuracy must lie between 0 and 1, or 0% and 100%, got '0': 1% or 0.01"),
        (["--accuracy", "100%"], "got '100%'"),
        (["--accuracy", "fine"], "got 'fine'"),
        (["--accuracy", "nan"], "got 'nan'"),
        (["--of", "pressure"], "accuracy.quantity must be one of 'peak_pressure', 'contact_force', 'cont"),
        (
            ["--set", "accuracy.surface='plate y3'"],
            "accuracy: a result by name needs the body and the surface",
        ),
        (
            ["--of", "reaction", "--set", "accuracy.surface='plate y3'"],
            "accuracy: a quantity needs a surface",
        ),
    ],
)
def test_what_cannot_be_asked_for_is_refused_before_anything_is_solved(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", ROLLER, "-o", tmp_path / "out", "--dry-run", *options) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_load_steps_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "steps.toml").write_text(STEPS)
    assert run("run", tmp_path / "steps.toml", "--accuracy", "1%", "--dry-run") == 2
    assert "steps does not go with [accuracy]" in capsys.readouterr().err


def test_an_optimisation_asks_for_its_objective_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("optimize", "--help") == 0
    printed = capsys.readouterr().out
    assert "--of" not in printed
    assert "--accuracy" in printed
    assert run("run", "--help") == 0
    printed = capsys.readouterr().out
    assert "--accuracy" in printed
    assert "--of" in printed
