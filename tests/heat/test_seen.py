"""Heat in pictures, files, tables, records and pages."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    Scene,
    Support,
    Surface,
    result_page,
    write_result,
    write_vtu,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    HeatedState,
    HeatFlux,
    HeatScene,
    HeatState,
    HeldTemperature,
    PressureConductance,
    ThermalContact,
    solve_heat,
    solve_heated,
)
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import (
    ResultSeries,
    read_result,
    write_contact_table,
    write_frd,
    write_heat_balance,
    write_xdmf,
)
from fenics_contact.pictures import Units, plot_field, plot_stress
from fenics_contact.pictures.canvas import LEVEL_MAP
from fenics_contact.pictures.section import field_entries
from tests.frd_files import read_frd


@cache
def plates() -> HeatState:
    """Solve two plates with a joint: 0.1 W/mm² go down through both, their sides touch nothing."""
    bodies = {
        name: ConductingBody(block((0, 0, z), (6, 3, z + 2), (n, 2, 2)), Conductor(k))
        for name, z, n, k in (("lower", 0.0, 3, 0.05), ("upper", 2.0, 4, 0.1))
    }
    joint = ThermalContact(Surface("upper", "z0"), Surface("lower", "z1"), 0.02)
    scene = HeatScene(bodies, [HeldTemperature("lower", "z0", 20.0)], [HeatFlux("upper", "z1", 0.1)], [joint])
    return solve_heat(scene, MPI.COMM_SELF)


@cache
def strip() -> HeatState:
    """Solve a plane body on an obstacle of 50 degrees, 100 above: see test_closed_forms."""
    body = ConductingBody(rectangle((0.0, 0.0), (2.0, 1.0), (4, 2)), Conductor(1.0))
    floor = ThermalContact(Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), 10.0, temperature=50.0)
    scene = HeatScene({"block": body}, [HeldTemperature("block", "y1", 100.0)], contacts=[floor])
    return solve_heat(scene, MPI.COMM_SELF)


def test_fields_are_temperature_flux_and_what_passes_through_contacts():
    upper, lower = (plates().gather_fields(name) for name in ("upper", "lower"))
    mesh = plates().scene.bodies["upper"].mesh
    assert upper.points["temperature"] == pytest.approx(29.0 + (mesh.points[:, 2] - 2.0), abs=1e-9)
    for flux in (upper.cells["heat_flux"], upper.points["nodal_heat_flux"], lower.cells["heat_flux"]):
        assert flux == pytest.approx(np.tile([0.0, 0.0, -0.1], (len(flux), 1)), abs=1e-10)
    joint = np.unique(mesh.surfaces["z0"])
    for name, value in (("heat_flux", 0.1), ("temperature_jump", 5.0), ("conductance", 0.02)):
        values = upper.points[f"contact_{name}"]
        assert values[joint] == pytest.approx(value, abs=1e-9)
        assert np.count_nonzero(values) == len(joint)
        assert not lower.points[f"contact_{name}"].any()


def test_temperatures_have_colours_from_the_coldest_to_the_hottest(tmp_path: Path):
    grids = plates().to_pyvista()
    entries = {
        each["name"]: each for each in field_entries([dict(zip(grids.keys(), grids, strict=True))], Units())
    }
    assert entries["temperature"]["colours"] == "level"
    assert entries["temperature"]["range"] == pytest.approx([20.0, 31.0])
    assert (entries["temperature"]["unit"], entries["heat_flux"]["unit"]) == ("K", "W/mm²")
    assert entries["contact_conductance"]["unit"] == "W/(mm² K)"
    assert entries["heat_flux"]["range"][0] == 0.0
    picture = plot_field(
        plates(), "temperature", tmp_path / "a.png", width=400, units=Units(temperature="°C")
    )
    assert picture.png is not None
    assert (tmp_path / "a.png").stat().st_size > 5_000
    assert LEVEL_MAP(1.0)[0] > 0.9 > LEVEL_MAP(0.0)[0], "hot is bright"


@pytest.mark.parametrize("field", ["heat_flux", "heat_flux_y", "contact_temperature_jump"])
def test_plane_heat_is_drawn_with_its_obstacle(field: str):
    assert plot_field(strip(), field, width=400).png is not None


def test_a_field_that_heat_does_not_have_is_refused():
    with pytest.raises(InvalidInputError, match=r"field must be one of temperature, .*got 'von_mises'"):
        plot_field(plates())


def test_files_for_paraview_have_all_fields(tmp_path: Path):
    write_vtu(plates(), tmp_path, "heat")
    mesh = meshio.read(tmp_path / "heat_upper.vtu")
    assert mesh.point_data["temperature"].max() == pytest.approx(31.0)
    assert mesh.cell_data["heat_flux"][0] == pytest.approx(np.tile([0, 0, -0.1], (16, 1)), abs=1e-10)
    files = write_xdmf(plates(), tmp_path / "heat.xdmf")
    assert 'Name="temperature"' in files["lower"].read_text()


def test_states_in_time_are_a_series_for_paraview(tmp_path: Path):
    series = ResultSeries(tmp_path, "warming", MPI.COMM_SELF, formats=["xdmf"])
    for time, state in ((0.0, strip()), (1.5, strip())):
        series.add(state, time)
    assert [member.value for member in series.members] == [0.0, 1.5]
    mesh = meshio.read(tmp_path / "warming" / "warming_0001_block.vtu")
    assert mesh.point_data["temperature"].max() == pytest.approx(100.0)


def test_frd_files_have_temperature_and_flux(tmp_path: Path):
    found = read_frd(write_frd(tmp_path / "heat.frd", plates()))
    assert [each.kind for each in found.blocks] == ["NDTEMP", "FLUX"]
    temperature, flux = found.block("NDTEMP"), found.block("FLUX")
    height = np.array([found.nodes[node][2] for node in temperature.values])
    values = np.array(list(temperature.values.values()))[:, 0]
    upper = np.arange(len(height)) >= plates().scene.bodies["lower"].mesh.n_nodes
    assert values == pytest.approx(np.where(upper, 27.0 + height, 20.0 + 2.0 * height), abs=1e-4)
    assert flux.at(list(flux.values))[:, 2] == pytest.approx(-0.1, abs=1e-6)


def rows_of(path: Path) -> list[dict[str, str]]:
    lines = path.read_text().splitlines()
    assert lines[0].startswith("# one row a ")
    return list(csv.DictReader(lines[1:]))


def test_the_table_of_contact_points_has_both_temperatures(tmp_path: Path):
    rows = rows_of(write_contact_table(plates(), tmp_path / "contact.csv", pair="upper z0"))
    assert len(rows) == 15
    assert {row["contact"] for row in rows} == {"upper z0 - lower z1"}
    assert [float(rows[0][name]) for name in ("slave", "master", "flux")] == pytest.approx([29, 24, 0.1])
    assert sum(float(row["heat"]) for row in rows) == pytest.approx(1.8)
    points = plates().scene.bodies["upper"].mesh.points
    for row in rows:
        place = [float(row[axis]) for axis in "xyz"]
        assert place == pytest.approx(points[int(row["node"])])


def test_the_table_of_the_balance_has_a_row_for_each_state(tmp_path: Path):
    path = write_heat_balance([plates(), plates()], tmp_path / "balance.csv", times=np.array([0.0, 2.5]))
    with pytest.raises(InvalidInputError, match="needs a time of each state, 2, got 3"):
        write_heat_balance([plates(), plates()], tmp_path / "other.csv", times=[0.0, 1.0, 2.0])
    rows = rows_of(path)
    assert [row["time"] for row in rows] == ["0", "2.5"]
    assert float(rows[1]["HeatFlux upper z1"]) == pytest.approx(1.8)
    assert float(rows[1]["HeldTemperature lower z0"]) == pytest.approx(-1.8)
    assert float(rows[1]["through upper z0 - lower z1"]) == pytest.approx(1.8)
    assert float(rows[1]["upper largest"]) == pytest.approx(31.0)
    assert float(rows[1]["error"]) < 1e-12


def test_records_have_the_balance_and_pages_show_it(tmp_path: Path):
    write_result(strip(), tmp_path, more={"note": "a strip"})
    write_vtu(strip(), tmp_path)
    record = read_result(tmp_path)
    assert record["kind"] == "heat"
    assert record["scene"]["contacts"][0]["master"]["type"] == "RigidPlane"
    heat = 2.0 * 50.0 / 1.1
    assert record["contact"][0]["heat"] == pytest.approx(heat)
    assert record["contact"][0]["largest_jump"] == pytest.approx(50.0 / 11.0)
    assert record["heat_balance"]["parts"]["HeldTemperature block y1"] == pytest.approx(heat)
    assert record["heat_balance"]["error"] < 1e-12
    assert json.loads((tmp_path / "result.json").read_text())["more"] == {"note": "a strip"}
    for page in (result_page(tmp_path), result_page(strip()), result_page({"hot": strip()})):
        text = page.html or ""
        assert "<td>temperature of block</td>" in text
        assert "90.909 W" in text
        assert "largest jump of the temperature" in text
        assert '"colours": "level"' in text


@cache
def pressed() -> HeatedState:
    """Press a warm block on a cold one."""
    steel = IsotropicElasticity(2.1e5, 0.3, thermal_expansion=1.2e-5)
    bodies = {
        name: Body(block((0, 0, z), (2, 2, z + 2), (n, n, 2)), steel)
        for name, z, n in (("lower", 0.0, 2), ("upper", 2.0, 3))
    }
    sides = Surface("upper", "z0"), Surface("lower", "z1")
    supports = [
        Support("lower", "z0", (0.0, 0.0, 0.0)),
        Support("upper", "z1", (0.0, 0.0, -0.001)),
    ]
    scene = Scene(bodies, supports, contacts=[ContactPair(*sides)])
    joint = ThermalContact(*sides, PressureConductance(50.0, 1000.0))
    held = [HeldTemperature("lower", "z0", 20.0), HeldTemperature("upper", "z1", 60.0)]
    heat = HeatScene.on(scene, {name: Conductor(50.0) for name in bodies}, held=held, contacts=[joint])
    return solve_heated(scene, heat, MPI.COMM_SELF, stress_free=20.0)


def test_mechanics_and_heat_are_seen_together(tmp_path: Path):
    state = pressed()
    fields = state.gather_fields("upper")
    assert {"displacement", "temperature", "contact_pressure", "contact_heat_flux"} <= set(fields.points)
    assert {"von_mises", "heat_flux", "subdomain"} <= set(fields.cells)
    assert plot_field(state, "temperature", scale=100.0, width=300).png is not None
    write_result(state, tmp_path)
    write_vtu(state, tmp_path)
    write_xdmf(state, tmp_path / "both.xdmf")
    record = read_result(tmp_path)
    assert record["kind"] == "heated"
    assert record["forces"]["contacts"][0]["force"][2] > 1.0
    assert record["heat"]["contact"][0]["heat"] == pytest.approx(state.heat.contacts[0].total)
    text = result_page(tmp_path).html or ""
    assert "temperature of upper" in text
    assert f"{state.heat.balance.by_part['HeldTemperature upper z1']:.5g} mW" in text  # N mm/s
    named = Units(**state.unit_names)
    pictures = [plot_field(state, "nodal_heat_flux", units=units, width=300).png for units in (None, named)]
    assert pictures[0] == pictures[1] != plot_field(state, "nodal_heat_flux", units=Units(), width=300).png
    assert "sum of normal forces" in text
    frd = read_frd(write_frd(tmp_path / "both.frd", state))
    kinds = {"DISP", "STRESS", "TOSTRAIN", "FORC", "CONTACT", "NDTEMP", "FLUX"}
    assert {each.kind for each in frd.blocks} == kinds
    assert len(rows_of(write_contact_table(state, tmp_path / "contact.csv"))) == 16


def test_pictures_of_mechanics_know_no_heat():
    with pytest.raises(InvalidInputError, match="state must be a State, got a HeatState"):
        plot_stress(plates())  # type: ignore[arg-type]


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import write_vtu, write_result
from fenics_contact.gallery import block
from fenics_contact.heat import *
from fenics_contact import Surface
from fenics_contact.output import write_contact_table, write_heat_balance, write_xdmf
comm = MPI.COMM_WORLD
bodies = {
    name: ConductingBody(block((0, 0, z), (6, 3, z + 2), (n, 2, 2)), Conductor(0.05))
    for name, z, n in (("lower", 0.0, 3), ("upper", 2.0, 4))
}
joint = ThermalContact(Surface("upper", "z0"), Surface("lower", "z1"), 0.02)
held, flux = [HeldTemperature("lower", "z0", 20.0)], [HeatFlux("upper", "z1", lambda x: 0.1 * x[:, 0])]
state = solve_heat(HeatScene(bodies, held, flux, [joint]), comm)
write_vtu(state, "out")
write_xdmf(state, "out/heat.xdmf")
write_result(state, "out")
write_heat_balance([state], "out/balance.csv")
write_contact_table(state, "out/contact.csv")
"""


@pytest.mark.claim
def test_files_are_the_same_on_two_ranks(
    mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    mpirun(ON_RANKS, 2)
    texts = [Path("out/contact.csv").read_text()]
    exec(ON_RANKS.replace("COMM_WORLD", "COMM_SELF"), {})
    texts.append(Path("out/contact.csv").read_text())
    tables = [list(csv.reader(text.splitlines()[1:])) for text in texts]
    assert len(tables[0]) > 15
    for one, other in zip(*tables, strict=True):
        assert one[:5] == other[:5]
        if one and one[0] != "contact":
            assert [float(x) for x in one[5:]] == pytest.approx([float(x) for x in other[5:]], rel=1e-8)
