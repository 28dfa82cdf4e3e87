"""`fenics-contact run` and `optimize`: what they print, write and refuse."""

from __future__ import annotations

import csv
import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console
from rich.file_proxy import FileProxy
from typer.testing import CliRunner

from fenics_contact import LoadSequence, read_scene_file
from fenics_contact import _cli as cli
from fenics_contact.errors import ConvergenceError, InfeasibleError, MissingRequirementError
from fenics_contact.output import read_result
from tests.conftest import ROOT
from tests.scene_file.texts import GOOD, STEPS, changed

SCENES = ROOT / "demos" / "scenes"
#: Options for files of fields and tables.
BOTH = ("--set", "output.files=['vtu', 'csv']")


def run(*arguments: object) -> int:
    return cli.main(MPI.COMM_SELF, [str(argument) for argument in arguments])


def scene(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_a_scene_is_solved_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "there"
    path = scene(tmp_path, GOOD)
    assert run("run", path, "-o", output, "--set", "output.files=['vtu', 'xdmf']", "--no-pictures") == 0
    printed = capsys.readouterr().out
    assert "Two blocks: scene.toml on 1 rank\n" in printed
    assert "Coulomb friction (1 pair has a friction coefficient" in printed, "the plan comes first"
    assert printed.index("cone ") < printed.index("total potential")
    assert f"results in {output}/: result.json, state.vtm\n" in printed
    assert "\x1b" not in printed, "no colours where there is no terminal"
    table = [line.split() for line in printed.splitlines()]
    state = read_scene_file(path, MPI.COMM_SELF).solve()
    assert ["forces", "(N)", "and", "moments", "(N", "mm)"] in table
    rows = {
        "reaction 0 lower z0": state.reactions()[0],
        "contact 0 upper z0": state.resultants().contacts[0],
        "sum of loads": state.balance().loads,
        "sum of reactions": state.balance().reactions,
    }
    for name, found in rows.items():
        row = [line for line in table if line[: len(name.split())] == name.split()][-1]
        expected = [*found.force, *np.asarray(found.moment)]
        assert np.abs(expected).max() > 1.0
        np.testing.assert_allclose([float(cell) for cell in row[-6:]], expected, rtol=1e-4, atol=1e-6)
    assert float(next(row for row in table if row[:1] == ["imbalance"])[-1]) < 1e-9
    assert not [line for line in printed.splitlines() if line != line.rstrip()]
    record = read_result(output)
    assert record["more"]["scene_file"] == "scene.toml"
    assert record["energies"]["total_potential"] == pytest.approx(state.energies.total_potential, rel=1e-12)
    assert {file.name for file in output.iterdir()} >= {"state.vtm", "state_upper.xdmf", "result.json"}
    assert not list(output.glob("*.png"))


def test_options_count_more_than_the_file(tmp_path: Path) -> None:
    path = scene(tmp_path, GOOD)
    arguments = ("--no-pictures", "--set", "contacts.0.friction={law = 'none'}", "--tolerance", "1e-4")
    # Without friction nothing holds the upper block against the push.
    assert run("run", path, "-o", tmp_path, *arguments) == cli.ExitCode.NO_EQUILIBRIUM == 4
    assert run("run", path, "-o", tmp_path, *arguments, "--set", "loads.0.value=[0, 0, -100]") == 0
    assert read_result(tmp_path)["solver"]["tolerance"] == 1e-4


def test_a_dry_run_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "there"
    assert run("run", scene(tmp_path, GOOD), "-o", output, "--dry-run") == 0
    printed = capsys.readouterr().out
    assert f"would write to {output}/: result.json, vtu files, pictures of stress\n" in printed
    assert not output.exists()


def test_load_steps_are_listed_and_make_a_film(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", scene(tmp_path, STEPS), "-o", tmp_path) == 0
    printed = capsys.readouterr().out
    assert "load steps      3\n" in printed
    assert [f"  {number}   {name} " in printed for number, name in enumerate(("pressed", "shifted 1/2"))]
    record = read_result(tmp_path)["more"]["steps"]
    assert record["name"] == ["pressed", "shifted 1/2", "shifted 2/2"]
    assert record["friction_force"][0] < 1e-6 < record["friction_force"][1]
    assert record["slip"][2] > 0
    assert (tmp_path / "history.pvd").read_text().count("timestep") == 3
    assert not (tmp_path / "checkpoint.npz").exists(), "a run that is complete leaves none"


def test_tables_are_written_where_a_file_asks_for_csv(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = ("--set", "output.files=['csv']", "--no-pictures")
    assert run("run", scene(tmp_path, STEPS), "-o", tmp_path / "steps", *tables) == 0
    assert ": result.json, steps.csv, contact/\n" in capsys.readouterr().out
    files = {str(path.relative_to(tmp_path / "steps")) for path in (tmp_path / "steps").rglob("*.*")}
    assert files == {"result.json", "steps.csv", *(f"contact/step_000{k}.csv" for k in range(3))}
    head, *rows = csv.reader((tmp_path / "steps" / "steps.csv").read_text().splitlines()[2:])
    assert [row[1:3] for row in rows] == [["pressed", "1"], ["shifted 1/2", "2"], ["shifted 2/2", "3"]]
    steps = read_result(tmp_path / "steps")["more"]["steps"]
    forces = [float(row[head.index("block z1 Fx")]) for row in rows]
    assert forces[1:] == pytest.approx(steps["friction_force"][1:], rel=1e-6)
    assert run("run", scene(tmp_path, GOOD), "-o", tmp_path / "once", *tables) == 0
    assert ": result.json, steps.csv, contact.csv\n" in capsys.readouterr().out
    assert (tmp_path / "once" / "contact.csv").read_text().count("upper z0 on lower z1") == 9


def test_fields_are_drawn_by_their_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = scene(tmp_path, GOOD)
    fields = ("--set", "output.pictures=[]", "--set", "output.fields=['displacement_z', 'heat']")
    assert run("run", path, "-o", tmp_path / "out", *fields, "--dry-run") == 0
    assert "pictures of displacement_z, heat\n" in capsys.readouterr().out
    assert run("run", path, "-o", tmp_path / "out", *fields) == 2
    printed = capsys.readouterr().out
    assert "no picture heat.png: field must be one of nodal_von_mises, " in printed
    assert ", displacement_z.png\n" in printed
    assert [path.name for path in (tmp_path / "out").glob("*.png")] == ["displacement_z.png"]


def test_an_interrupted_history_goes_on_to_the_same_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, advance = scene(tmp_path, STEPS), LoadSequence.advance
    assert run("run", path, "-o", tmp_path / "whole", *BOTH) == 0

    def stopped(sequence: LoadSequence, step: object) -> object:
        if getattr(step, "name", "") == "shifted 2/2":
            raise KeyboardInterrupt
        return advance(sequence, step)  # type: ignore[arg-type]

    monkeypatch.setattr(LoadSequence, "advance", stopped)
    assert run("run", path, "-o", tmp_path / "cut", *BOTH) == cli.ExitCode.INTERRUPTED == 130
    monkeypatch.undo()
    assert not (tmp_path / "cut" / "result.json").exists()
    assert "interrupted" in capsys.readouterr().err
    assert run("run", path, "-o", tmp_path / "cut", *BOTH, "--resume") == 0
    assert "going on from" in capsys.readouterr().out
    whole, cut = (read_result(tmp_path / name) for name in ("whole", "cut"))
    np.testing.assert_allclose(
        cut["more"]["steps"]["normal_force"], whole["more"]["steps"]["normal_force"], rtol=1e-6
    )
    assert (tmp_path / "cut" / "history.pvd").read_text().count("timestep") == 3
    tables = [(tmp_path / name / "steps.csv").read_text().splitlines() for name in ("whole", "cut")]
    assert tables[0][:3] == tables[1][:3]
    assert len(tables[0]) == len(tables[1]) == 6


def test_a_checkpoint_of_another_scene_is_refused_with_the_way_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, advance = scene(tmp_path, STEPS), LoadSequence.finish
    monkeypatch.setattr(LoadSequence, "finish", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
    assert run("run", path, "-o", tmp_path) == 130
    monkeypatch.setattr(LoadSequence, "finish", advance)
    assert (tmp_path / "checkpoint.npz").exists()
    assert run("run", path, "-o", tmp_path, "--set", "materials.s.young_modulus=11") == 2
    assert "(with --fresh the run starts anew)" in capsys.readouterr().err
    assert run("run", path, "-o", tmp_path, "--set", "materials.s.young_modulus=11", "--fresh") == 0


def test_a_checkpoint_that_is_demanded_must_be_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", scene(tmp_path, STEPS), "-o", tmp_path, "--resume") == 2
    assert "checkpoint.npz" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nowhere.toml"], "error: there must be a scene file 'nowhere.toml', there is none"),
        (["run"], "Missing argument 'SCENE.toml'"),
        (["run", "a.toml", "--tolerence", "1"], "No such option: --tolerence"),
        (["runn"], "No such command 'runn'. Did you mean 'run'?"),
        (["run", str(SCENES / "two_blocks.toml"), "--tolerance", "2"], "--set: solver.tolerance must be a"),
        (["optimize", str(SCENES / "two_blocks.toml")], "an optimisation needs [design] with"),
    ],
)  # fmt: skip
def test_wrong_input_ends_with_two(
    arguments: Sequence[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments) == cli.ExitCode.WRONG_INPUT == 2
    written = capsys.readouterr()
    assert words in written.err
    assert written.out == ""
    assert "Traceback" not in written.err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ConvergenceError("stopped"), 3),
        (InfeasibleError("slides"), 4),
        (MissingRequirementError("gmsh"), 5),
        (KeyboardInterrupt(), 130),
        (RuntimeError("a bug"), 1),
    ],
)
def test_every_ending_has_its_number(
    error: BaseException, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("fenics_contact._cli.options.read_scene_file", fails)
    assert run("run", SCENES / "two_blocks.toml") == code
    written = capsys.readouterr().err
    assert ("Traceback" in written) == (code == 1), "a traceback is for bugs"
    assert str(error) in written


def test_help_tells_the_exit_codes() -> None:
    answer = CliRunner().invoke(cli.app, ["--help"], obj=cli.Console(MPI.COMM_SELF))
    assert answer.exit_code == 0
    for code in cli.ExitCode:
        assert f"\n  {code.value} " in answer.output
    for command in ("run", "optimize", "accuracy", "demo", "view", "info", "schema"):
        assert f"\n  {command} " in answer.output


def test_commands_run_in_the_runner_of_the_library(tmp_path: Path) -> None:
    arguments = ["run", str(scene(tmp_path, GOOD)), "-o", str(tmp_path), "--dry-run"]
    answer = CliRunner().invoke(cli.app, arguments, obj=cli.Console(MPI.COMM_SELF))
    assert (answer.exit_code, "nothing was solved" in answer.output) == (0, True)
    answer = CliRunner().invoke(cli.app, ["run", "nowhere.toml"], obj=cli.Console(MPI.COMM_SELF))
    assert answer.exit_code == 2


def test_pictures_are_drawn_with_the_names_of_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = scene(
        tmp_path,
        changed(("[solver]", '[units]\nstress = "kN/cm²"\n[output]\npictures = ["pressure"]\n[solver]')),
    )
    assert run("run", path, "-o", tmp_path) == 0
    assert "result.json, state.vtm, pressure.png\n" in capsys.readouterr().out
    assert (tmp_path / "pressure.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "result.json").read_text())["more"]["unit_names"]["stress"] == "kN/cm²"


def test_a_picture_that_cannot_be_drawn_is_named_once_all_else_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = GOOD[: GOOD.index("[[contacts]]")].replace('body = "upper"', 'body = "lower"')
    one_body = text[: text.index("[bodies.upper]")] + text[text.index("[[supports]]") :]
    path = scene(tmp_path, f'{one_body}[output]\npictures = ["stress", "pressure"]\n')
    assert run("run", path, "-o", tmp_path) == cli.ExitCode.WRONG_INPUT
    told = capsys.readouterr()
    assert "no picture pressure.png: " in told.out
    assert "result.json, state.vtm, stress.png\n" in told.out
    assert (tmp_path / "stress.png").exists()
    assert "error: pictures that a scene file requests must be possible, pressure.png could" in told.err
    assert run("run", path, "-o", tmp_path, "--no-pictures") == 0


def test_without_the_libraries_for_pictures_requested_ones_are_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> None:
        raise MissingRequirementError("pyvista is not installed", name="pyvista")

    monkeypatch.setattr("fenics_contact.pictures.canvas.check_renderer", missing)
    path = scene(tmp_path, changed(("[solver]", '[output]\npictures = ["stress", "pressure"]\n[solver]')))
    assert run("run", path, "-o", tmp_path) == cli.ExitCode.WRONG_INPUT
    told = capsys.readouterr()
    assert "no pictures: pyvista is not installed\n" in told.out
    assert f"results in {tmp_path}/: result.json, state.vtm\n" in told.out
    assert "must be possible, stress.png, pressure.png could not be drawn, all else is" in told.err
    assert run("run", path, "-o", tmp_path, "--no-pictures") == 0
    path = scene(tmp_path, GOOD)
    assert run("run", path, "-o", tmp_path) == 0, "no picture is asked for"
    assert "no pictures: pyvista is not installed\n" in capsys.readouterr().out


@pytest.mark.slow
def test_an_optimisation_writes_its_designs_and_says_when_it_stopped_early(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = (
        "meshes.links.n_around=36", "meshes.links.n_a=4", "meshes.links.n_b=10",
        "solver.subdomains=[4, 1, 1]", "design.surfaces.0.net=[5, 3]", "output.pictures=[]",
        "design.tolerance=1e-8", "output.design=['csv', 'step']",
    )  # fmt: skip
    settings = [part for value in small for part in ("--set", value)]
    arguments = ("optimize", SCENES / "chain_links.toml", "-o", tmp_path, *settings)
    assert run(*arguments, "--set", "design.max_iterations=1") == cli.ExitCode.NOT_CONVERGED == 3
    assert "not converged: max_iterations serious steps" in capsys.readouterr().out
    assert (tmp_path / "checkpoint.npz").exists(), "it goes on with a larger limit"
    assert run(*arguments, "--set", "design.max_iterations=2") == 3
    printed = capsys.readouterr().out
    assert "going on from" in printed
    assert "design.csv, design_link_1.step, control_net.png, convergence.png" in printed
    assert "design_link_1.step has the designed surface alone: a body in a CAD file needs few flat" in printed
    assert (tmp_path / "design_link_1.step").exists()
    record = read_result(tmp_path)
    assert record["optimisation"]["stop"]["iterations"] == 2
    assert record["optimisation"]["objective"]["final"] < record["optimisation"]["objective"]["initial"]
    assert (tmp_path / "designs.pvd").read_text().count("timestep") == 3


def test_what_is_said_while_bars_are_drawn_appears_above_them(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, underneath = io.StringIO(), io.StringIO()
    # Like this bars take over stdout while they are drawn.
    monkeypatch.setattr(sys, "stdout", FileProxy(Console(file=drawn), underneath))
    cli.Console(MPI.COMM_SELF).write("a line")
    assert (drawn.getvalue(), underneath.getvalue()) == ("a line\n", "")
