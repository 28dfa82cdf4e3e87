"""`fenics-contact optimize` writes the optimised surface as the scene file asks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import cli
from fenics_contact.mesh_io import read_cad

LID = """
[meshes.pad]
shape = "block"
lower = [0.0, 0.0, 0.0]
upper = [4.0, 2.0, 1.0]
counts = [4, 2, 1]
[materials.rubber]
young_modulus = 100.0
poisson_ratio = 0.3
[bodies.pad]
mesh = "pad"
material = "rubber"
[[supports]]
body = "pad"
surface = "z0"
[[loads]]
kind = "traction"
body = "pad"
surface = "z1"
value = [0.0, 0.0, -1.0]
[output]
files = []
[design]
objective = "strain_energy"
max_iterations = 1
[[design.surfaces]]
body = "pad"
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
    assert optimised(tmp_path, kinds, "units.length=m") == cli.Ending.NOT_CONVERGED
    assert "result.json, design.csv, design_pad.stl, design_pad.step\n" in capsys.readouterr().out
    assert "lengths in m," in (tmp_path / "design.csv").read_text()
    (pad,) = read_cad(tmp_path / "design_pad.step", 2000.0).values()
    np.testing.assert_allclose(np.ptp(pad.points, axis=0)[:2], [4000.0, 2000.0], rtol=1e-6)


def test_files_that_a_scene_cannot_have_are_refused_before_it_is_solved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert optimised(tmp_path, "output.design=['step']", "units.length=yd") == cli.Ending.WRONG_INPUT
    assert "known in millimetres, got 'yd': name one of µm, um, mm," in capsys.readouterr().err
    plane = (
        LID.replace("block", "rectangle").replace(", 0.0]\nupper", "]\nupper").replace(", 1.0]\nc", "]\nc")
    )
    plane = plane.replace("4, 2, 1]", "4, 2]").replace("0.0, 0.0, -1.0", "0.0, -1.0").replace("z", "y")
    plane = plane.replace("net = [2, 1]", "net = 2").replace("young", 'model = "plane_strain"\nyoung')
    assert optimised(tmp_path, "output.design=['stl']", text=plane) == cli.Ending.WRONG_INPUT
    assert 'must be "csv" or "step" for a plane scene, got "stl"' in capsys.readouterr().err
    assert not (tmp_path / "result.json").exists()
