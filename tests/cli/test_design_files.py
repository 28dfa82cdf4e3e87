"""`fenics-contact optimize` writes the optimised surface as the scene file asks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact import read_cad
from tests.scene_file.texts import GOOD

LID = f"""{GOOD}
[output]
files = []

[design]
objective = "strain_energy"
max_iterations = 1
[[design.surfaces]]
body = "upper"
surface = "z1"
net = [2, 1]
lower = -0.1
upper = 0.1
"""


def optimised(folder: Path, *settings: str, text: str = LID) -> int:
    path = folder / "lid.toml"
    path.write_text(text)
    given = [part for setting in settings for part in ("--set", setting)]
    return cli.main(MPI.COMM_SELF, ["optimize", str(path), "-o", str(folder), "--no-pictures", *given])


def test_all_kinds_of_files_are_written_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kinds = "output.design=['csv', 'stl', 'step']"
    assert optimised(tmp_path, kinds, "units.length=m") == cli.ExitCode.NOT_CONVERGED
    assert "result.json, design.csv, design_upper.stl, design_upper.step\n" in capsys.readouterr().out
    assert "lengths in m," in (tmp_path / "design.csv").read_text()
    (upper,) = read_cad(tmp_path / "design_upper.step", 500.0).values()
    np.testing.assert_allclose(np.ptp(upper.points, axis=0)[:2], [1000.0, 1000.0], rtol=1e-6)


def test_files_that_a_scene_cannot_have_are_refused_before_it_is_solved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert optimised(tmp_path, "output.design=['step']", "units.length=yd") == cli.ExitCode.WRONG_INPUT
    assert "known in millimetres, got 'yd': name one of µm, um, mm," in capsys.readouterr().err
    plane = re.sub(r"(\[\S+), \S+, ", r"\1, ", LID.replace("net = [2, 1]", "net = 2")).replace("z", "y")
    plane = plane.replace('"block"', '"rectangle"').replace("young", 'model = "plane_strain"\nyoung')
    assert optimised(tmp_path, "output.design=['stl']", text=plane) == cli.ExitCode.WRONG_INPUT
    assert 'must be "csv" or "step" for a plane scene, got "stl"' in capsys.readouterr().err
    assert not (tmp_path / "result.json").exists()
