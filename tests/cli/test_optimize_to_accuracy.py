"""`fenics-contact optimize --accuracy`: a line for each mesh, files, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact.output import read_result
from tests.conftest import ROOT

DESIGN = """
[design]
objective = "strain_energy"
constraints = [{ kind = "volume", at_most = 1.00001 }]
[[design.surfaces]]
body = "plate"
surface = "y0"
net = 4
lower = -0.01
upper = 0.01
"""
ROLLER = (ROOT / "demos" / "scenes" / "plate_on_roller.toml").read_text(encoding="utf-8")
#: What a mesh may be predicted to take depends on how busy the machine is.
ANY_TIME = ("--set", "accuracy.seconds=1e9")


def optimised(folder: Path, *options: str, text: str = ROLLER + DESIGN) -> int:
    path = folder / "roller.toml"
    path.write_text(text, encoding="utf-8")
    return cli.main(MPI.COMM_SELF, ["optimize", str(path), "-o", str(folder), *options])


def test_an_optimisation_to_an_accuracy_writes_its_meshes_and_the_design(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert optimised(tmp_path, "--accuracy", "10%", *ANY_TIME, "--set", "output.files=['vtu', 'csv']") == 0
    printed = capsys.readouterr().out
    assert "accuracy        objective to 10 %\n" in printed
    table = printed[printed.index("    cells") :].split("\n\n")[0].splitlines()
    record = read_result(tmp_path)
    levels = record["accuracy"]["levels"]
    assert [int(line.split()[0]) for line in table[1:-1]] == levels["cells"]
    assert len(levels["cells"]) > 2
    assert record["optimisation"]["objective"]["final"] == pytest.approx(levels["state_value"][-1])
    assert f" {sum(levels['products'])} products with F\n" in printed
    assert "seconds" in printed
    assert record["accuracy"]["reached"]
    assert f"results in {tmp_path}/: result.json, state.vtm, design.csv, contact.csv, stress_" in printed
    assert printed.endswith("control_net.png, meshes.png\n")
    for name in ("state.vtm", "design.csv", "contact.csv", "control_net.png", "meshes.png"):
        assert (tmp_path / name).exists()
    values = record["optimisation"]["design"]["values"]
    before = float(printed.split("objective before")[1].split()[0])
    assert np.abs(values).max() <= 0.01 + 1e-9
    assert record["optimisation"]["objective"]["final"] < 0.95 * before  # on the same mesh


@pytest.mark.parametrize(
    ("options", "text", "code", "message"),
    [
        (["--accuracy", "2"], ROLLER + DESIGN, 2, "--accuracy must lie between 0 and 1"),
        (["--resume"], ROLLER + DESIGN, 2, "--resume needs a checkpoint, and an optimisation to an accuracy"),
        (["--of", "stress"], ROLLER + DESIGN, 2, "No such option"),
        (
            [],
            ROLLER + DESIGN + '[[steps]]\nname = "push"\n',
            2,
            "steps does not go with [accuracy]: load steps have a history",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused(
    options: list[str],
    text: str,
    code: int,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert optimised(tmp_path, "--no-pictures", *options, text=text) == code
    assert message in capsys.readouterr().err


def test_an_accuracy_that_is_not_reached_is_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert optimised(tmp_path, "--no-pictures", "--set", "accuracy.levels=1") == cli.ExitCode.NOT_CONVERGED
    assert "the accuracy was not reached: an unknown error after 1 meshes" in capsys.readouterr().out
