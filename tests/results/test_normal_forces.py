"""Normal forces have a sum and a resultant: the same on flat surfaces, and named apart on curved ones."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
    contact_area,
    result_page,
    solve_scene,
    write_result,
)
from fenics_contact._cli.console import step_table
from fenics_contact._scene_file.document import UnitNames
from fenics_contact.gallery import disc, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.output import StepTable, read_result
from fenics_contact.output.tables import step_row
from fenics_contact.pictures import plot_contact_pressure
from fenics_contact.pictures.curves import contact_trace
from fenics_contact.results.contact import NormalForces, pairs_in_words
from fenics_contact.results.state import State

INNER, OUTER, OVERLAP, E, NU = 12.0, 20.0, 0.01, 2.1e5, 0.3
#: Pressure of a ring shrunk on a rigid shaft without friction, by Lamé, in plane strain.
SHRUNK = OVERLAP * E * (OUTER**2 - INNER**2) / (INNER * (1 + NU) * ((1 - 2 * NU) * INNER**2 + OUTER**2))


def collar() -> Scene:
    """A clamp collar in the plane."""
    mesh = disc(OUTER, 8, hole=INNER)
    pair = ContactPair(Surface("collar", "inner"), RigidSphere((0.0, 0.0), INNER), interference=OVERLAP)
    return Scene({"collar": Body(mesh, PlaneStrain(E, NU))}, contacts=[pair])


def turned() -> Scene:
    """The same as a body of revolution, between planes that hold its length of 5."""
    mesh = rectangle((INNER, 0.0), (OUTER, 5.0), (8, 5))
    shaft = RigidPlane((INNER, 0.0), (1.0, 0.0))
    pair = ContactPair(Surface("collar", "x0"), shaft, interference=OVERLAP)
    held = [Support("collar", side, (None, 0.0)) for side in ("y0", "y1")]
    body = Body(mesh, IsotropicElasticity(E, NU), axisymmetric=True)
    return Scene({"collar": body}, held, contacts=[pair])


@pytest.fixture(scope="module")
def state() -> State:
    return solve_scene(collar(), MPI.COMM_SELF)


def test_what_presses_on_a_shaft_adds_up_although_it_has_no_resultant(state: State) -> None:
    forces = state.contact.normal_forces()
    assert forces.sum == pytest.approx(SHRUNK * 2 * np.pi * INNER, rel=0.01)
    assert forces.resultant < 1e-6 * forces.sum
    assert forces.differ()
    (words,) = pairs_in_words(state.scene, state.contact, "N/mm", "MPa")
    assert f"; sum of normal forces {forces.sum:.6g} N/mm, their resultant " in words


def test_around_an_axis_radial_forces_have_no_resultant() -> None:
    forces = solve_scene(turned(), MPI.COMM_SELF).contact.normal_forces()
    assert forces.sum == pytest.approx(SHRUNK * 2 * np.pi * INNER * 5.0, rel=0.01)
    assert forces.resultant == 0.0


@pytest.mark.parametrize("by", ["node", "mortar"])
def test_a_thickness_multiplies_forces_and_areas_and_changes_their_units(by: str, tmp_path: Path) -> None:
    found = []
    steels = PlaneStrain(E, NU), PlaneStrain(E, NU, thickness=3.0)
    for given, steel in enumerate(steels):
        lower, upper = rectangle((0.0, 0.0), (7.0, 2.0), (21, 6)), rectangle((2.0, 2.0), (5.0, 4.0), (9, 6))
        pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), discretisation=by)  # type: ignore[arg-type]
        bend = Traction("upper", "y1", lambda x: np.stack([0 * x[:, 0], 300.0 - 260.0 * (x[:, 0] - 2.0)], 1))
        bodies, sides = {"lower": Body(lower, steel), "upper": Body(upper, steel)}, ("x0", "x1")
        held = [Support("lower", "y0"), *(Support("upper", side, (0.0, None)) for side in sides)]
        state = solve_scene(Scene(bodies, held, [bend], [pair]), MPI.COMM_SELF, tolerance=1e-10)
        write_result(state, folder := tmp_path / str(len(found)))
        (written,) = read_result(folder)["contact"]
        assert written["area"] == contact_area(state)
        assert bool(re.search(r"N/mm(?!²)", result_page(state).html or "")) is not bool(given)
        assert contact_trace(state, 0).space == state.scene.dimension_record
        found.append([contact_area(state), state.contact.normal_forces().sum])
    (area, force), thick = found
    assert 0.0 < area < 3.0
    assert thick == pytest.approx([3.0 * area, 3.0 * force], rel=1e-6)


@pytest.mark.parametrize("thickness", [1.0, 2.0])
def test_the_resultant_on_a_leaning_plane_is_the_sum_at_any_thickness(thickness: float) -> None:
    block = Body(rectangle((0.0, 0.0), (2.0, 1.0), (8, 4)), PlaneStrain(E, NU, thickness=thickness))
    pair = ContactPair(Surface("block", "y0"), RigidPlane((1.0, -0.2), (0.1, 1.0)))
    forces = solve_scene(
        Scene({"block": block}, [Support("block", "y1", (0.0, -0.3))], contacts=[pair]), MPI.COMM_SELF
    ).contact.normal_forces()
    assert forces.sum > 0.0
    assert forces.resultant == pytest.approx(forces.sum, rel=1e-12)


def test_every_output_names_both(state: State, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forces = state.contact.normal_forces()
    write_result(state, tmp_path)
    (pair,) = read_result(tmp_path)["contact"]
    assert (pair["normal_force"], pair["normal_resultant"]) == (forces.sum, forces.resultant)
    table = StepTable(tmp_path / "steps.csv", MPI.COMM_SELF)
    table.add(state, "shrunk")
    names, row = (line.split(",") for line in table.path.read_text().splitlines()[-2:])
    written = dict(zip(names, row, strict=True))
    assert float(written["normal_force"]) == pytest.approx(forces.sum)
    assert float(written["normal_resultant"]) == pytest.approx(forces.resultant, abs=1e-9)
    page = result_page(state).html or ""
    assert "sum of normal forces" in page
    assert "their resultant" in page
    told: list[str] = []

    def headline(title: str, facts: str) -> str:
        told.append(facts)
        return title

    monkeypatch.setattr("fenics_contact.pictures.unrolled.headline", headline)
    plot_contact_pressure(state, tmp_path / "pressure.png")
    assert re.search(r"sum of normal forces [\d\s]+ N/mm, their resultant ", told[0])


def test_the_table_of_load_steps_has_a_column_for_resultants_of_curved_surfaces(state: State) -> None:
    row = step_row(0, "shrunk", state)
    for curved in (True, False):
        if not curved:
            row |= {"normal_resultant": row["normal_force"]}
        file = SimpleNamespace(title="", scene=state.scene, document=SimpleNamespace(units=UnitNames()))
        columns = [str(column.header) for column in step_table([row], file).columns]  # type: ignore[arg-type]
        assert ("their resultant\n(N/mm)" in columns) is curved
        assert ("normal force\n(N/mm)" in columns) is not curved


def test_a_flat_surface_has_one_normal_force() -> None:
    up = np.tile((0.0, 1.0), (3, 1))
    flat = NormalForces.of(np.array([1.0, 2.0, 3.0]), up)
    assert (flat.sum, flat.resultant, flat.differ()) == (6.0, 6.0, False)
    assert flat.in_words("N") == "normal force 6 N"
    assert NormalForces.of(np.zeros(0), up[:0]).in_words() == "normal force 0"
