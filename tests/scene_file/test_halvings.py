"""Scene files whose cells are halved before the final solve."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file, solve_nested
from fenics_contact._cli import main
from fenics_contact._scene_file.source import SceneFileError
from tests.conftest import ROOT
from tests.scene_file.texts import STEPS

FILE = ROOT / "demos" / "scenes" / "plate_on_roller.toml"
ROLLER = tomllib.loads(FILE.read_text(encoding="utf-8"))
PLAIN = {key: value for key, value in ROLLER.items() if key not in ("accuracy", "output")}
RUBBER = {"model": "neo_hooke", "young_modulus": 5.0, "poisson_ratio": 0.3}


def halved(data: dict[str, Any], /, **solver: Any) -> dict[str, Any]:
    return {**data, "solver": {"tolerance": 1e-8, "halvings": 1, **solver}}


def test_a_file_finds_what_python_finds() -> None:
    file = read_scene_file(halved(PLAIN), MPI.COMM_SELF)
    state = file.solve()
    same = solve_nested(file.scene, 1, MPI.COMM_SELF, tolerance=1e-8)
    assert state.scene.bodies["plate"].mesh.n_cells == 4 * file.scene.bodies["plate"].mesh.n_cells
    assert state.energies.strain == pytest.approx(same.energies.strain, rel=1e-12)


def test_a_dry_run_reports_the_cells_of_the_last_mesh(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = FILE.read_text(encoding="utf-8").partition("[accuracy]")[0]
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    options = ["--dry-run", "--set", "solver.halvings=2"]
    assert main(MPI.COMM_SELF, ["run", str(tmp_path / "a.toml"), *options]) == 0
    assert "cells halved    2 times, to 800 cells" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (halved(tomllib.loads(STEPS)), "steps does not go with solver.halvings: load steps have a history"),
        (halved(ROLLER), "accuracy does not go with solver.halvings: it refines where that pays"),
        (halved(PLAIN, subdomains=4), "solver.subdomains does not .* every mesh is cut anew, leave it out"),
        (halved(PLAIN, halvings=-1), "solver.halvings must be a number of at least 0, got -1"),
        (
            halved({**PLAIN, "materials": dict.fromkeys(PLAIN["materials"], RUBBER)}),
            "solver.halvings: coarser meshes start finer ones where all materials are linear",
        ),
    ],
)
def test_what_halved_meshes_cannot_keep_is_refused(data: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneFileError, match=message):
        read_scene_file(data, MPI.COMM_SELF).solve()
