"""Scene files with materials that have a history, through their load steps."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact.output import read_result

TEXT = """
meshes.m = { shape = "block", lower = [0, 0, 0], upper = [2, 1, 1], counts = [2, 1, 1] }
bodies.bar = { mesh = "m", material = "s" }
output.pictures = []

[materials.s]
model = "j2_plasticity"
young_modulus = 2.1e5
poisson_ratio = 0.3
yield_stress = 235
kinematic_hardening = 1e3

[[supports]]
name = "fix"
body = "bar"
surface = "x0"

[[supports]]
name = "pull"
body = "bar"
surface = "x1"

[[steps]]
name = "out"
supports = { pull = [0.01, 0.0, 0.0] }

[[steps]]
name = "back"
supports = { pull = [0.0, 0.0, 0.0] }
"""


def test_a_bar_that_was_stretched_and_put_back_presses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bar.toml"
    path.write_text(TEXT)
    assert cli.main(MPI.COMM_SELF, ["run", str(path), "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "nonlinear material (1 body deforms much or yields)" in printed
    assert "up to 0" in printed
    assert "nan" not in printed, "energies that are not known"
    result = read_result(tmp_path / "result.json")
    assert result["energies"]["strain"] is None
    pushed = next(each for each in result["forces"]["reactions"] if each["surface"] == "x0")
    assert 150 < pushed["force"][0] < 300
    assert not (tmp_path / "checkpoint.npz").exists()
    assert cli.main(MPI.COMM_SELF, ["run", str(path), "--set", "solver.tolerance='balanced'"]) == 2
    assert "tolerances of nonlinear materials must be numbers" in capsys.readouterr().err


RUBBER = """
[meshes.m]
shape = "rectangle"
lower = [0.0, 0.0]
upper = [1.0, 1.0]
counts = [4, 4]

[materials.rubber]
model = "neo_hooke"
young_modulus = 1.0
poisson_ratio = 0.32

[bodies.block]
mesh = "m"
material = "rubber"

[[supports]]
body = "block"
surface = "y0"

[[loads]]
kind = "traction"
name = "push"
body = "block"
surface = "y1"
value = [0.0, -120.0]
"""


@pytest.mark.parametrize("steps", ["", "[[steps]]\nname = 'push'\n"], ids=["at once", "steps"])
def test_the_last_equilibrium_before_a_crushing_load_is_written(
    steps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "block.toml"
    path.write_text(RUBBER + steps)
    assert cli.main(MPI.COMM_SELF, ["run", str(path), "-o", str(tmp_path)]) != 0
    found = capsys.readouterr()
    assert "the last equilibrium, at 0." in found.out
    assert "the load can be followed up to 0." in found.err
    result = read_result(tmp_path / "result.json")
    pushed = next(each for each in result["forces"]["reactions"] if each["surface"] == "y0")
    assert 0.5 < pushed["force"][1] < 120.0
    part = re.fullmatch(r".* below the tolerance, at (0\.\d+) of the load step", result["solver"]["reason"])
    assert part is not None
    assert pushed["force"][1] == pytest.approx(120.0 * float(part[1]), rel=0.01)
    assert list(tmp_path.glob("history*" if steps else "state*"))
