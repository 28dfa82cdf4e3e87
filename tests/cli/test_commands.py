"""`fenics-contact info`, `demo`, `view` and `schema`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact._cli.console import Console, facts
from fenics_contact._cli.demos import folder_of_demos, shipped
from fenics_contact._cli.info import gathered, loaded_blas
from fenics_contact._cli.view import show_record
from fenics_contact._scene_file.validation import json_schema
from tests.conftest import ROOT
from tests.scene_file.texts import GOOD


def run(*arguments: object) -> int:
    return cli.main(MPI.COMM_SELF, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the result of two blocks."""
    folder = tmp_path_factory.mktemp("result")
    (folder / "scene.toml").write_text(GOOD)
    assert run("run", folder / "scene.toml", "-o", folder, "--no-pictures") == 0
    return folder


def test_info_knows_versions_petsc_blas_and_ranks(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "--json") == 0
    known = json.loads(capsys.readouterr().out)
    assert known["versions"]["dolfinx"].startswith("0.")
    assert known["machine"]["ranks"].startswith("1 on 1 node, ")
    assert "mumps" in known["machine"]["PETSc packages"]
    assert known["machine"]["C compiler"] == "works"
    assert known["machine"]["pictures"].startswith("can")
    assert run("info") == 0
    printed = capsys.readouterr().out
    assert "OPENBLAS_NUM_THREADS=1" in printed
    assert "dolfinx" in printed


def test_what_is_written_in_brackets_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    Console(MPI.COMM_SELF).write(facts({"pictures": "'fenics_contact[viz]'"}, "block[left]"))
    assert capsys.readouterr().out.split() == ["block[left]", "pictures", "'fenics_contact[viz]'"]


@pytest.mark.parametrize(
    ("file", "slow"),
    [("/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0", True), ("/lib/libopenblas.so", False)],
)
def test_a_reference_blas_is_advised_against(file: str, slow: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    assert any("blas" in Path(library).name for library in loaded_blas()), "this process multiplies matrices"
    monkeypatch.setattr("fenics_contact._cli.info.loaded_blas", lambda: [file])
    known = gathered(MPI.COMM_SELF)
    assert known["machine"]["BLAS"] == file
    assert any("the BLAS is the slow reference one" in line for line in known["advice"]) == slow


def test_the_blas_that_petsc_brings_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is loaded with PETSc, after NumPy's."""
    loaded = ["numpy.libs/libscipy_openblas64_.so"]

    def packages() -> list[str]:
        loaded.append("petsc/lib/libopenblas.so.0")
        return ["mumps works"]

    monkeypatch.setattr("fenics_contact._cli.info._packages", packages)
    monkeypatch.setattr("fenics_contact._cli.info.loaded_blas", lambda: list(loaded))
    assert "petsc/lib/libopenblas.so.0" in gathered(MPI.COMM_SELF)["machine"]["BLAS"]


def test_demos_are_listed_with_their_titles(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("demo") == 0
    printed = capsys.readouterr().out
    for path in (ROOT / "demos").glob("demo_*.py"):
        assert path.stem.removeprefix("demo_") in printed
    assert "Hertz: a steel ball on a steel block\n" in printed
    assert "two_blocks.toml" in printed
    assert re.search(r"valve.inp +A valve on its seat, axisymmetric, pressed by 20 N/mm2\n", printed)
    assert folder_of_demos() == ROOT / "demos"


def test_an_unknown_demo_is_refused_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("demo", "hertz_spher") == 2
    assert "got 'hertz_spher': did you mean 'hertz_sphere'?" in capsys.readouterr().err


def test_a_demo_gets_its_options_and_refuses_wrong_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("demo", "chain_links", "--size", "huge") == 2
    assert "--size: invalid choice: 'huge'" in capsys.readouterr().err
    assert "--size" in " ".join(shipped()) or "chain_links" in shipped()


def test_a_demo_runs_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "demos").mkdir()
    demo = tmp_path / "demos" / "demo_tiny.py"
    demo.write_text(
        "# # A tiny demo. It writes.\nimport sys\nfrom pathlib import Path\nPath(sys.argv[1]).touch()\n"
    )
    monkeypatch.setattr("fenics_contact._cli.demos.folder_of_demos", lambda: tmp_path / "demos")
    monkeypatch.chdir(tmp_path)
    assert run("demo") == 0
    assert "A tiny demo\n" in capsys.readouterr().out
    assert run("demo", "tiny", "made") == 0
    assert (tmp_path / "made").exists()


def test_an_example_scene_is_copied_with_its_schema_and_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("demo", "two_blocks.toml", "--copy") == 0
    assert "run it with `fenics-contact run two_blocks.toml`" in capsys.readouterr().out
    assert (tmp_path / "scene_file.schema.json").exists()
    assert run("demo", "two_blocks.toml", "--copy") == 2
    assert "'two_blocks.toml' is there already" in capsys.readouterr().err
    assert run("run", "two_blocks.toml", "--no-pictures") == 0
    assert (tmp_path / "output" / "two_blocks" / "result.json").exists()
    assert run("demo", "two_blocks.toml", "--set", "title=x") == 2
    assert "a scene takes no options here" in capsys.readouterr().err


def test_a_copied_scene_that_optimises_is_run_by_its_own_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("demo", "chain_links.toml", "--copy") == 0
    assert "run it with `fenics-contact optimize chain_links.toml`" in capsys.readouterr().out
    assert run("optimize", "chain_links.toml", "--dry-run") == 0
    assert run("demo", "chain_links.toml", "--set", "title=x") == 2
    assert "--copy` and use `fenics-contact optimize chain_links.toml`" in capsys.readouterr().err


def test_view_shows_numbers_and_fields(result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("view", result) == 0
    printed = capsys.readouterr().out
    for words in (
        "torn_unknowns",
        "normal_force",
        "fields of state.vtm",
        "von_mises",
        "sum of loads",
    ):
        assert words in printed
    assert run("view", result / "result.json") == 0


def test_view_tells_the_range_of_every_component_of_the_stress(
    result: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = pv.read(result / "state.vtm")
    assert run("view", result / "state.vtm") == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    told = {words[0]: words[1].strip() for words in lines if len(words) == 2}
    components = ("xx", "yy", "zz", "xy", "yz", "xz")
    names = {f"stress_{axes}": ("stress", column) for column, axes in enumerate(components)}
    names |= {f"principal_stress_{k}": ("principal_stress", k - 1) for k in (1, 2, 3)}
    for name, (source, column) in names.items():
        for where, before in (("point_data", "nodal_"), ("cell_data", "")):
            data = [getattr(blocks[body], where)[before + source][:, column] for body in blocks.keys()]
            values = np.concatenate(data)
            assert np.ptp(values) > 1.0
            assert told[before + name] == f"{values.min():.5g} to {values.max():.5g}"
    assert "stress" not in told
    assert "displacement" in told


def test_view_lists_the_first_and_the_last_evaluations(capsys: pytest.CaptureFixture[str]) -> None:
    count = 50
    history = {
        "evaluations": list(range(1, count + 1)),
        "kind": ["start"] + ["null"] * (count - 2) + ["rejected"],
        "value": [-1.0 - number for number in range(count - 1)] + [None],
        "best": [-1.0 - number for number in range(count - 1)] + [-49.0],
        "aggregate_norm": [1.0] * count,
    }
    show_record(Console(MPI.COMM_SELF), {"optimisation": {"stop": {"converged": True}, "history": history}})
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["stop.converged", "True"] in told
    assert told.index(["1", "start", "-1", "-1"]) + 1 == told.index(["..."])
    assert told.index(["..."]) + 1 == told.index(["32", "null", "-32", "-32"])
    assert ["50", "rejected", "-49"] in told
    assert "aggregate" not in str(told)


@pytest.mark.parametrize("field", ["displacement", "nodal_stress_xx", "principal_stress_3"])
def test_view_draws_to_a_file(
    field: str, result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "there" / "picture.png"
    assert run("view", result / "state.vtm", "--save", picture, "--field", field) == 0
    assert f"picture in {picture}\n" in capsys.readouterr().out
    assert picture.stat().st_size > 5000


def test_view_draws_some_bodies_and_cuts_them(result: Path, tmp_path: Path) -> None:
    options: list[tuple[str, ...]] = [(), ("--body", "upper"), ("--clip", "y=1"), ("--clip=-y=1",)]
    pictures = []
    for number, more in enumerate(options):
        picture = tmp_path / f"{number}.png"
        assert run("view", result / "state.vtm", "--save", picture, *more) == 0
        pictures.append(picture.read_bytes())
    assert len(set(pictures)) == len(options)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "a result needs a folder or file that exists, got 'nowhere'"),
        (("{result}/scene.toml",), "a result must be a whole JSON file"),
        (("{result}", "--save", "a.jpg"), "pictures are PNG files, got the name 'a.jpg'"),
        (("{result}", "--save", "a.png", "--field", "strain"), "--field must be one of ['nodal_von_mises'"),
        (("{result}", "--save", "a.png", "--body", "lid"), "bodies must be some of ['lower', 'upper']"),
        (("{result}", "--save", "a.png", "--clip", "1=y"), "--clip must be an axis and a place on it"),
    ],
)
def test_view_refuses_what_is_no_result(
    arguments: tuple[str, ...], words: str, result: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("view", *(text.format(result=result) for text in arguments)) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("text", ["<VTKFile", "<VTKFile><Collection/></VTKFile>"])
def test_view_refuses_a_series_without_members(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.pvd").write_text(text)
    assert run("view", tmp_path / "a.pvd") == 2
    assert "must be a whole .pvd file" in (err := capsys.readouterr().err) or "it names none" in err


def test_the_schema_is_written_or_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("schema") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json_schema()
    assert run("schema", tmp_path / "a.json") == 0
    assert json.loads((tmp_path / "a.json").read_text()) == printed
