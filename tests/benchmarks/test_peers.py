"""The comparison with other programs: its page is its record, and all are judged in the same way."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.peers import calculix, in_kratos, in_ngsolve, ironing, report
from benchmarks.peers.evaluation import FACES, Whole, evaluated
from benchmarks.peers.ours import in_ours
from benchmarks.peers.scenes import (
    HEIGHT,
    HUB,
    INNER,
    OUTER,
    SCENES,
    SHAFT,
    PeerScene,
    cubes,
    hertz_peak,
    lame_force,
    press_fit,
    sliding_block,
)
from benchmarks.study import filled
from fenics_contact import solve_scene, theory
from fenics_contact.study.runner import measure
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "studies" / "peers.md"


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return json.loads(PAGE.with_suffix(".json").read_text())


def test_the_page_is_its_record_and_complete(record: dict[str, Any]) -> None:
    page = PAGE.read_text()
    assert page == filled(page, report.tables(record))
    names = [job.name for job in report.jobs(False)]
    assert [name for name in names if name in record] == list(record)
    assert set(names) - set(record) <= {"block-92k CalculiX, face"}  # five minutes of processor time


def test_forces_of_the_programs_are_near_each_other(record: dict[str, Any]) -> None:
    """A scene that one of them reads otherwise would be no comparison."""
    for scene, programs in report.MEASURED.items():
        names = (f"{scene} {program}" for program in programs)
        lines = [record[name] for name in names if name in record]
        key = "hoop" if scene == "press-fit" else "normal"
        found = [each[key] for each in lines if each["converged"]]
        assert len(found) >= min(2, len(lines))
        np.testing.assert_allclose(found, found[0], rtol=0.1, err_msg=scene)


def test_lines_in_which_others_are_better_are_all_listed(record: dict[str, Any]) -> None:
    rows = report.tables(record)["better"].splitlines()[2:]
    worse = {**record, "cubes GetFEM": {**record["cubes GetFEM"], "memory": 1}}
    more = report.tables(worse)["better"].splitlines()[2:]
    assert [row for row in more if row not in rows and "| cubes | GetFEM | MB | 0 |" in row]


def test_a_program_that_is_missing_keeps_its_numbers(
    record: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "block-2k GetFEM"
    report.write(tmp_path, {name: [{"skipped": "GetFEM cannot be imported"}]}, False)
    assert json.loads((tmp_path / "peers.json").read_text()) == record
    assert f"{name}: skipped, GetFEM cannot" in capsys.readouterr().out


def test_programs_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    for name in ("ngsolve", "KratosMultiphysics"):
        monkeypatch.setitem(sys.modules, name, None)
    for function, program, word in (
        (calculix.measure, "cubes", "apt-get install calculix-ccx"),
        (in_ngsolve.measure, "cubes", "pip install ngsolve"),
        (in_kratos.measure, "cubes", "pip install Kratos"),
    ):
        assert word in function(None, program)["skipped"]
    assert "calculix-ccx" in ironing.by_calculix(None)["skipped"]


def test_formulae_agree_with_those_of_the_package() -> None:
    modulus = theory.contact_modulus(2.1e5, 0.3, 2.1e5, 0.3)
    assert hertz_peak(250.0) == pytest.approx(theory.hertz_point(1e3, (0.1, 0.1), modulus).peak_pressure)
    # A ring under p at r: u = (1 + ν)/E ((1 − 2ν) A r + B/r), σ_r = A − B/r² is zero on its free side.
    pressure, r = lame_force() / (SHAFT * HEIGHT), SHAFT
    moved = []
    for free, sign in ((INNER, -1.0), (OUTER, 1.0)):
        a = sign * pressure * r**2 / abs(free**2 - r**2)
        moved.append(1.3 / 2.1e5 * (0.4 * a * r + a * free**2 / r))
    assert moved[1] - moved[0] == pytest.approx(SHAFT - HUB)


def uniform(scene: PeerScene, strain: float) -> tuple[Whole, np.ndarray]:
    whole = Whole(scene)
    return whole, strain * whole.points * [0.0, 0.0, 1.0]


def test_nodal_forces_of_a_uniform_strain_are_its_stress_on_the_sides() -> None:
    scene = sliding_block((4, 3, 2))
    whole, displacement = uniform(scene, -0.01)
    forces = whole.forces(displacement) + whole.loads()
    stress = -0.01 * (1 - 0.3) / (1.3 * 0.4)  # E (1 − ν) / ((1 + ν)(1 − 2ν)) ε
    sums = {side: forces[whole.nodes(("block", side)), 2].sum() for side in ("z0", "z1")}
    assert sums == pytest.approx({"z0": -2.0 * stress, "z1": 2.0 * stress})
    inside = np.setdiff1d(
        np.arange(len(whole.points)),
        np.concatenate([whole.nodes(("block", s)) for s in scene.bodies["block"].surfaces]),
    )
    assert len(inside) == 6
    assert np.abs(forces[inside]).max() < 1e-15
    np.testing.assert_allclose(whole.loads().sum(axis=0), 2.0 * np.array([0.02, 0.01, -0.05]))


def test_facets_are_faces_of_cells_and_weights_their_areas() -> None:
    whole = Whole(press_fit())
    side = ("hub", "inner")
    faces = whole.faces(side)
    corners = np.take_along_axis(whole.cells[faces[:, 0]], FACES[faces[:, 1]], axis=1)
    np.testing.assert_array_equal(np.sort(corners, axis=1), np.sort(whole.facets(side), axis=1))
    chord = 2 * 29.95 * np.sin(np.pi / 4 / 36)
    assert whole.weights(side).sum() == pytest.approx(36 * chord * HEIGHT)


@pytest.mark.parametrize("depth", [0.003, -0.003])
def test_overlap_is_the_depth_of_the_slave_below_the_master(depth: float) -> None:
    whole = Whole(cubes(3, 2))
    displacement = np.zeros_like(whole.points)
    displacement[whole.first["high"] :] = [0.01, 0.0, -depth]
    assert whole.overlap(displacement) == pytest.approx(max(depth, 0.0), abs=1e-15)
    block = Whole(sliding_block((2, 2, 2)))
    assert block.overlap(np.full_like(block.points, -0.02 - depth)) == pytest.approx(
        max(depth, 0.0), abs=1e-15
    )


def test_forces_of_displacements_are_the_contact_forces_of_the_state() -> None:
    scene = sliding_block((6, 3, 3))
    state = solve_scene(in_ours(scene), MPI.COMM_SELF, tolerance=1e-9)
    found = evaluated(Whole(scene), state.gather_displacement("block"))
    assert found["normal"] == pytest.approx(state.contact.normal_force.sum(), rel=1e-6)
    np.testing.assert_allclose(found["tangential"], np.abs(state.contact.force.sum(axis=0)[:2]), rtol=1e-5)
    assert found["overlap"] < 1e-8


def test_the_last_table_of_displacements_is_read() -> None:
    head = " displacements (vx,vy,vz) for set ALL and time  0.{}\n\n"
    rows = "         1  1.0E-01  2.0E+00  3.0E+00\n         2  0.0E+00  0.0E+00 -{}\n"
    text = "".join(head.format(k) + rows.format(f"{k}.5E+00") for k in (1, 2))
    np.testing.assert_array_equal(calculix.last_displacement(text, 2), [[0.1, 2, 3], [0, 0, -2.5]])
    assert calculix.last_displacement("nothing", 2) is None


@pytest.mark.skipif(calculix.missing() is not None, reason="CalculiX is not installed")
def test_calculix_finds_the_forces_of_a_small_scene() -> None:
    scene = sliding_block((6, 3, 3))
    whole = Whole(scene)
    run = calculix.solved(calculix.deck(whole, "face", 1000.0), 60.0)
    assert run["converged"], run["printed"][-2000:]
    found = evaluated(whole, calculix.last_displacement(run["written"], len(whole.points)))
    state = solve_scene(in_ours(scene), MPI.COMM_SELF)
    assert found["normal"] == pytest.approx(state.contact.normal_force.sum(), rel=0.01)
    assert run["seconds"] > 0.0
    assert run["program_memory"] > 1e7


def test_a_die_is_pressed_and_drawn_in_two_steps_of_its_deck() -> None:
    deck = ironing.deck(12, 50.0)
    assert deck.count("*STEP, NLGEOM") == 2
    assert "TOP,1,1,5.0" in deck
    assert deck.count("TOP,2,2,-1.0") == 2


@pytest.mark.slow
@pytest.mark.parametrize("program", ["GetFEM", "NGSolve, penalty", "Kratos, mortar"])
def test_other_programs_answer_as_the_record_says(record: dict[str, Any], program: str) -> None:
    name = f"{'ball' if program.startswith('Kratos') else 'block'}-2k {program}"
    (job,) = (job for job in report.jobs(False) if job.name == name)
    found = measure(job)
    if "skipped" in found:
        pytest.skip(found["skipped"])
    assert found["normal"] == pytest.approx(record[name]["normal"], rel=1e-3)
    assert set(SCENES) >= set(report.MEASURED)
