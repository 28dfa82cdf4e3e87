"""What wears is seen in words, tables, fields, records and scene files; odd coefficients are reported."""

from __future__ import annotations

import csv
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Wear,
    read_scene_file,
    result_page,
    solve_scene,
    solve_steps,
    write_result,
)
from fenics_contact._equilibrium import warnings
from fenics_contact._scene.plausible import odd_values
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.output import StepTable, read_result, write_contact_table
from fenics_contact.pictures import plot_contact_pressure
from fenics_contact.pictures.curves import contact_trace
from fenics_contact.results.contact import pairs_in_words
from tests.equilibrium.wear_cases import YOUNG, fretted, punch, worn
from tests.page.contents import content
from tests.scene_file.texts import STEPS, changed

COMM = MPI.COMM_SELF


@pytest.fixture(scope="module")
def fretting() -> Any:
    """A punch that has been pressed and moved to and fro."""
    return worn(*fretted(Wear(2e-4)))[-1]


@pytest.fixture(scope="module")
def dry() -> State:
    """The same without wear, pressed."""
    scene, steps = fretted(None)
    return worn(scene, steps[:1])[-1]


def read(path: Path) -> list[dict[str, str]]:
    """Read the rows of a table behind its remarks."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_words_tables_fields_and_records_have_what_wears(fretting: State, dry: State, tmp_path: Path) -> None:
    contact = fretting.contact
    volume, depth = contact.worn_volume(), float(contact.worn_depth.max())
    assert 0.1 * depth < volume < 3.5 * depth  # fourteen points of 0.25 press
    (words,) = pairs_in_words(fretting.scene, contact, "N/mm", "N/mm²", "mm")
    assert words.endswith(f", worn volume {volume:.5g} mm², worn depth {depth:.5g} mm")
    points = read(write_contact_table(fretting, tmp_path / "points.csv"))
    order = np.argsort(contact.points.slave)
    found = [float(row["worn_depth"]) for row in points]
    np.testing.assert_allclose(found, contact.worn_depth[order], rtol=1e-10)
    (row,) = read(StepTable(tmp_path / "steps.csv", COMM).add(fretting))
    assert float(row["punch y0 on rigid plane worn volume"]) == pytest.approx(volume, rel=1e-10)
    assert float(row["punch y0 on rigid plane worn depth"]) == pytest.approx(depth, rel=1e-10)
    assert float(row["surface_energy"]) == pytest.approx(fretting.energies.surface, rel=1e-10)
    (entry,) = read_result(write_result(fretting, tmp_path / "worn"))["contact"]
    assert (entry["worn_volume"], entry["worn_depth"]) == (volume, depth)
    field = fretting.gather_fields("punch").points["contact_worn_depth"]
    np.testing.assert_allclose(field[contact.points.slave], contact.worn_depth, rtol=1e-14)
    assert field.sum() == pytest.approx(contact.worn_depth.sum())
    assert "worn" not in pairs_in_words(dry.scene, dry.contact)[0]
    assert "worn_depth" not in read(write_contact_table(dry, tmp_path / "dry.csv"))[0]
    assert not any("worn" in name for name in read(StepTable(tmp_path / "dry.csv", COMM).add(dry))[0])
    assert not any("worn" in name for name in dry.gather_fields("punch").points)


def test_energies_of_worn_states_agree_and_their_errors_are_known(fretting: Any) -> None:
    energies, errors = fretting.energies, fretting.estimate_errors()
    assert energies.surface > 1e-5 * energies.strain
    assert energies.primal == pytest.approx(energies.dual, rel=1e-8)
    assert errors.algebraic < 1e-6 < 1e-2 < errors.discretisation < 0.1


def test_steps_of_scene_files_are_repeated(tmp_path: Path) -> None:
    wear = ("coefficient = 0.3 }\n", "coefficient = 0.3 }\nwear = { coefficient = 1e-4 }\n")
    path = tmp_path / "scene.toml"
    path.write_text(changed(wear, ("count = 2\n", "count = 2\ncycles = 25.0\n"), text=STEPS))
    file = read_scene_file(path, COMM)
    assert [step.cycles for step in file.steps] == [None, 25.0, 25.0]
    state = solve_steps(ContactProblem(file.scene, COMM, tolerance=1e-8), file.steps)[-1]
    contact, law = state.contact, state.scene.contacts[0].wears[0]
    assert law.cycles == 25.0
    slid = np.linalg.norm(contact.slip, axis=1)
    np.testing.assert_allclose(contact.worn, 25.0 * 1e-4 * contact.pressure * slid, rtol=1e-6, atol=1e-12)
    assert contact.worn_volume() > 0.0


@pytest.mark.parametrize(("given", "remedy"), [({}, "1e-05 if"), ({"hardness": 0.5}, "hardness has the")])
def test_a_coefficient_in_other_units_is_reported_before_it_is_solved(
    given: dict[str, Any], remedy: str, caplog: pytest.LogCaptureFixture
) -> None:
    k = 1e-2 * given.get("hardness", 1.0)
    with caplog.at_level(logging.WARNING):
        ContactProblem(punch(Wear(k, sliding=0.01, **given)), COMM).solve()
    (record,) = [each.message for each in caplog.records if each.message.startswith("odd wear")]
    assert record.startswith(
        f"odd wear in punch y0 on rigid plane? a coefficient of 0.01 times Young's modulus {YOUNG:g} is 20,"
    )
    assert remedy in record
    usual = Wear(k / 100.0, sliding=0.01, **given)
    assert list(odd_values(punch(usual))) == []
    assert list(odd_values(punch(replace(usual, coefficient=lambda x: np.ones(len(x)))))) == []


def pressed(discretisation: str, wear: Wear | None) -> tuple[State, ...]:
    """A coarse block pressed on one of finer cells, and lifted by less than what has been worn off."""
    upper = Body(rectangle((-2.0, 0.0), (2.0, 2.0), (8, 4)), PlaneStrain(YOUNG, 0.3))
    lower = Body(rectangle((-4.0, -2.0), (4.0, 0.0), (48, 12)), PlaneStrain(YOUNG, 0.3))
    sides: Any = Surface("upper", "y0"), Surface("lower", "y1")
    pair = ContactPair(*sides, wear=wear, discretisation=discretisation)  # type: ignore[arg-type]
    held = Support("lower", "y0")
    scene = Scene({"upper": upper, "lower": lower}, [held], contacts=[pair])
    steps = [
        LoadStep(str(depth), supports=[held, Support("upper", "y1", (0.0, -depth))])
        for depth in (0.15, 0.2, 0.12)
    ]
    return solve_steps(ContactProblem(scene, COMM), steps)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_bodies_whose_meshes_pass_by_what_wears_give_no_warning(
    discretisation: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = Wear(4e-4, sliding=1.0, cycles=50.0)
    with caplog.at_level(logging.WARNING):
        states = pressed(discretisation, law)
    assert [bool(state.contact.normal_force.any()) for state in states] == [True, True, False]
    assert states[-1].contact.worn_depth.max() > 0.12
    assert caplog.messages == []
    monkeypatch.setattr(warnings, "_nearest", lambda contact, number: 0.0)
    with caplog.at_level(logging.WARNING):
        pressed(discretisation, law)
    words = "pass between those of the slave" if discretisation == "node" else "nodes lie up to"
    assert any(words in message for message in caplog.messages)


def test_a_tip_on_an_axis_wears_by_its_force_and_way() -> None:
    """It presses alone under a cone at first; no area of a uniform pressure belongs to it."""
    mesh = quadratic(rectangle((0.0, -1.2), (1.2, 0.0), (6, 6)))
    cone = RigidPlane((0.0, -0.02), np.array([1.0, -2.7]) / np.hypot(1.0, 2.7))
    pair = ContactPair(Surface("block", "y1"), cone, interference="measured", wear=Wear(1e-5, sliding=2.0))
    block = Body(mesh, IsotropicElasticity(2e4, 0.3), axisymmetric=True)
    contact = solve_scene(Scene({"block": block}, [Support("block", "y0")], contacts=[pair]), COMM).contact
    assert contact.normal_force.sum() > 1.0
    assert contact.worn_volume() == pytest.approx(2e-5 * contact.normal_force.sum(), rel=1e-10)


def test_the_curve_of_a_pair_that_wears_has_the_depth(fretting: State, dry: State) -> None:
    trace, plain = contact_trace(fretting, 0), contact_trace(dry, 0)
    assert (trace.wears, plain.wears) == (True, False)
    assert trace.worn.max() == fretting.contact.worn_depth.max() > 0.0
    np.testing.assert_array_equal(trace.worn[trace.points], fretting.contact.worn_depth)
    assert not plain.worn.any()
    png = plot_contact_pressure(fretting, width=800).png, plot_contact_pressure(dry, width=800).png
    heights = [int.from_bytes((each or b"")[20:24], "big") for each in png]
    assert heights[0] - heights[1] == round(0.22 * 800)


def test_a_page_has_what_wears(fretting: State) -> None:
    known, _ = content(result_page(fretting).html)
    names = {entry["name"]: entry for entry in known["fields"]}
    assert names["contact_worn_depth"]["label"] == "worn depth"
    assert names["contact_worn_depth"]["extremes"][0][1] == pytest.approx(fretting.contact.worn_depth.max())
