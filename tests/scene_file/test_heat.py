"""Scene files of heat: the state is that of Python, and mistakes are named with their lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface, Tie, read_scene_file
from fenics_contact._cli.app import main
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductanceTable,
    ConductingBody,
    Conductor,
    Convection,
    FrictionHeat,
    GapConductance,
    GapRadiation,
    HeatAtNodes,
    HeatFlux,
    HeatScene,
    HeatSource,
    HeldTemperature,
    PressureConductance,
    Radiation,
    TemperatureTable,
    ThermalContact,
    heat_in_time,
    solve_heat,
    solve_heated,
)
from fenics_contact.heat.conductance import Touch
from fenics_contact.materials import PlaneStrain
from tests.conftest import ROOT

EXAMPLE = ROOT / "demos" / "scenes" / "chip_on_sink.toml"
BARS = """\
[meshes]
a = { shape = "rectangle", lower = [0.0, 0.0], upper = [1.0, 1.0], counts = [2, 2] }
b = { shape = "rectangle", lower = [1.0, 0.0], upper = [2.0, 1.0], counts = [2, 2] }

[heat.materials.steel]
conductivity = 2.0

[bodies.a]
mesh = "a"
heat.material = "steel"

[bodies.b]
mesh = "b"
heat.material = "steel"

[[heat.held]]
body = "a"
surface = "x0"
value = 20.0

[[heat.loads]]
kind = "heat_flux"
body = "b"
surface = "x1"
value = "3 * y"

[[heat.contacts]]
slave = { body = "b", surface = "x0" }
master = { body = "a", surface = "x1" }
conductance = 5.0
"""


def test_the_example_is_that_of_python() -> None:
    silicon = Conductor(TemperatureTable((20.0, 120.0), (0.15, 0.1)))
    bodies = {
        "chip": ConductingBody(rectangle((10, 8), (20, 10), (20, 4)), silicon, thickness=10.0),
        "sink": ConductingBody(rectangle((0, 0), (30, 8), (30, 8)), Conductor(0.2), thickness=10.0),
    }
    law = PressureConductance(20.0, 1000.0, 0.95) + GapConductance(2.6e-5, least_gap=5e-3)
    loads = [HeatFlux("chip", "y1", 5.0, total=True), Convection("sink", "y0", 4e-4, 20.0)]
    contact = ThermalContact(Surface("chip", "y0"), Surface("sink", "y1"), law, pressure=0.5)
    by_hand = solve_heat(HeatScene(bodies, (), loads, [contact]), MPI.COMM_SELF)
    file: Any = read_scene_file(EXAMPLE, MPI.COMM_SELF)
    state = file.solve()
    np.testing.assert_array_equal(state.values, by_hand.values)
    assert state.balance.by_part["Convection sink y0"] == pytest.approx(-5.0)


def test_every_table_builds_its_part() -> None:
    pair = {"slave": {"body": "b", "surface": "x0"}, "master": {"body": "a", "surface": "x1"}}
    floor = {"obstacle": "plane", "point": [0, 0], "normal": [0, 1]}
    laws = {
        "pressure": {"coefficient": 2.0, "hardness": 9.0},
        "cooper_mikic_yovanovich": {"conductivity": 2.0, "hardness": 9.0, "roughness": 0.1, "slope": 0.2},
        "mikic": {"conductivity": 2.0, "modulus": 9.0, "roughness": 0.1, "slope": 0.2},
        "table": {"pressure": [0.0, 1.0], "closed": [2.0, 3.0], "gap": [0.1, 1], "open": [1.0, 0.0]},
        "gap": {"conductivity": 2.0, "least_gap": 0.1},
        "radiation": {"slave_emissivity": 0.5, "master_emissivity": 0.4, "constant": 1e-9},
    }
    film = {"body": "a", "surface": "y0", "ambient": 5.0}
    table = {"temperature": [0.0, 10.0], "value": [2.0, 3.0]}
    heat = {
        "materials": {
            "own": {"conductivity": [table, 2.0], "heat_capacity": table},
            "turned": {"conductivity": [[2.0, 0.5], [0.5, 1.0]]},
        },
        "held": [{"body": "a", "surface": "x0", "value": 20.0}],
        "loads": [
            {"kind": "heat_flux", "body": "b", "surface": "x1", "value": 2.0, "total": True},
            {"kind": "heat_source", "body": "b", "value": "x"},
            {"kind": "heat_at_nodes", "body": "b", "nodes": "y1", "value": 0.1},
            {"kind": "convection", **film, "coefficient": table},
            {"kind": "radiation", **film, "emissivity": 0.8, "absolute_zero": -273.15, "constant": 1e-9},
        ],
        "contacts": [
            {**pair, "conductance": [{"law": name, **own} for name, own in laws.items()], "pressure": "y"},
            {"slave": {"body": "a", "surface": "y1"}, "master": floor, "conductance": 3.0, "temperature": 9},
        ],
        "ties": [{"slave": {"body": "b", "surface": "y0"}, "master": {"body": "a", "surface": "x1"}}],
    }
    mesh = {"shape": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0], "counts": [1, 1]}
    bodies = {
        "a": {"mesh": "m", "heat": {"material": "own", "thickness": 2.0}},
        "b": {"mesh": "m", "heat": {"material": "turned"}},
    }
    file: Any = read_scene_file({"meshes": {"m": mesh}, "bodies": bodies, "heat": heat}, MPI.COMM_SELF)
    scene, by = file.scene, TemperatureTable((0.0, 10.0), (2.0, 3.0))
    assert scene.bodies["a"].material == Conductor((by, 2.0), by)
    assert scene.bodies["b"].material == Conductor(((2.0, 0.5), (0.5, 1.0)))
    assert (scene.bodies["a"].thickness, scene.bodies["b"].thickness) == (2.0, 1.0)
    assert scene.held == (HeldTemperature("a", "x0", 20.0),)
    flux, source, *others = scene.loads
    assert flux == HeatFlux("b", "x1", 2.0, total=True)
    assert isinstance(source, HeatSource)
    np.testing.assert_array_equal(source.value(np.array([[3.0, 1.0]])), [3.0])
    assert others == [
        HeatAtNodes("b", "y1", 0.1),
        Convection("a", "y0", by, 5.0),
        Radiation("a", "y0", 0.8, 5.0, -273.15, 1e-9),
    ]
    joint, below = scene.contacts
    cmy, mikic = PressureConductance.cooper_mikic_yovanovich, PressureConductance.mikic
    rough = {"roughness": 0.1, "slope": 0.2}
    touch = Touch(*(np.array([each]) for each in (0.7, 0.2, 30.0, 20.0, 1.0, 1.0)))
    expected = [
        PressureConductance(2.0, 9.0), cmy(2.0, 9.0, **rough), mikic(2.0, 9.0, **rough),
        ConductanceTable((0.0, 1.0), (2.0, 3.0), (0.1, 1.0), (1.0, 0.0)), GapConductance(2.0, 0.1),
        GapRadiation(0.5, 0.4, constant=1e-9),
    ]  # fmt: skip
    assert joint.law.at(touch) == pytest.approx(sum(law.at(touch) for law in expected))
    assert isinstance(below.master, RigidPlane)
    assert below.temperature == 9.0
    assert scene.ties == (Tie(Surface("b", "y0"), Surface("a", "x1")),)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("conductivity = 2.0", "conductivty = 2.0", "line 6: heat.materials.steel.conductivty is not known"),
        ("conductivity = 2.0", "conductivity = -2.0", "line 6: heat.materials.steel.conductivity must be a "),
        ('material = "steel"\n\n[bodies.b]', 'material = "stel"\n\n[bodies.b]',
         "line 10: bodies.a.heat.material must be a material of heat, one of 'steel', got \"stel\": did you"),
        ('mesh = "a"', 'mesh = "c"', "line 9: bodies.a.mesh must be a mesh, one of 'a', 'b', got \"c\""),
        ('body = "a"\nsurface = "x0"', 'body = "c"\nsurface = "x0"',
         "line 17: heat.held.0.body must be a body, one of 'a', 'b', got \"c\""),
        ('surface = "x1"\nvalue', 'surface = "right"\nvalue',
         "line 24: heat.loads.0.surface must be a surface of the body 'b', one of 'x0', 'x1', "),
        ('"heat_flux"', '"heatflux"', "line 22: heat.loads.0.kind must be one of 'heat_flux', 'heat_source'"),
        ('"3 * y"', '"3 * q"', "line 25: heat.loads.0.value: a formula may hold numbers"),
        ("conductance = 5.0", 'conductance = { law = "presure" }',
         "line 30: heat.contacts.0.conductance.law must be one of 'pressure', 'cooper_mikic_yovanovich'"),
        ("conductance = 5.0", "", "line 27: heat.contacts.0 must have 'conductance', got only slave"),
        ("conductance = 5.0", "conductance = 5.0\ntemperature = 3.0",
         "line 27: heat.contacts.0: ThermalContact.temperature of b x0 - a x1 is that of an obstacle, a b"),
        ("[[heat.held]]", '[[supports]]\nbody = "a"\nsurface = "x0"\n[[heat.held]]',
         "line 16: supports has no meaning in this file of heat alone: leave it out"),
        ("[meshes]", "solver.method = 'smalse'\n[meshes]", "line 1: solver.method has no meaning in"),
        ("[heat.materials.steel]", "[heat]\nduration = 1.0\n[heat.materials.steel]", "line 6: heat.duration"),
        ('heat.material = "steel"\n\n[bodies.b]', "\n[bodies.b]",
         "line 8: bodies.a must have 'heat', what it conducts with: this file has heat alone"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert BARS.count(old) == 1
    path = tmp_path / "bars.toml"
    path.write_text(BARS.replace(old, new))
    with pytest.raises(SceneFileError) as error:
        _ = read_scene_file(path, MPI.COMM_SELF).scene
    assert f"bars.toml, {message}" in str(error.value)


#: Bars between walls, which warm until they touch.
PRESSED = """\
[meshes]
a = { shape = "rectangle", lower = [0.0, 0.0], upper = [1.0, 1.0], counts = [2, 2] }
b = { shape = "rectangle", lower = [1.001, 0.0], upper = [2.001, 1.0], counts = [2, 2] }

[materials.steel]
model = "plane_strain"
young_modulus = 1e3
poisson_ratio = 0.0
thermal_expansion = 1e-4

[heat]
stress_free = 15.0
materials.steel.conductivity = 2.0

[bodies.a]
mesh = "a"
material = "steel"
heat.material = "steel"

[bodies.b]
mesh = "b"
material = "steel"
heat.material = "steel"

[[supports]]
body = "a"
surface = "x0"

[[supports]]
body = "b"
surface = "x1"

[[contacts]]
slave = { body = "b", surface = "x0" }
master = { body = "a", surface = "x1" }
discretisation = "node"

[[heat.held]]
body = "a"
surface = "x0"
value = 20.0

[[heat.loads]]
kind = "convection"
body = "b"
surface = "y0"
coefficient = 1.0
ambient = 99.0

[[heat.contacts]]
slave = { body = "b", surface = "x0" }
master = { body = "a", surface = "x1" }
discretisation = "node"
conductance = { law = "pressure", coefficient = 9.0, hardness = 50.0 }
friction = { coefficient = 0.2, speed = 0.5 }
"""


def test_mechanics_and_heat_of_one_file_are_those_of_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bars.toml"
    path.write_text(f"output = {{ folder = '{tmp_path}/out', files = ['vtu', 'csv'] }}\n{PRESSED}")
    file: Any = read_scene_file(path, MPI.COMM_SELF)
    steel = PlaneStrain(1e3, 0.0, thermal_expansion=1e-4)
    ends = {"a": (0.0, 1.0), "b": (1.001, 2.001)}
    scene = Scene(
        {name: Body(rectangle((x, 0), (y, 1), (2, 2)), steel) for name, (x, y) in ends.items()},
        [Support("a", "x0"), Support("b", "x1")],
        contacts=[ContactPair(Surface("b", "x0"), Surface("a", "x1"), discretisation="node")],
    )
    friction, law = FrictionHeat(0.2, 0.5), PressureConductance(9.0, 50.0)
    sides = Surface("b", "x0"), Surface("a", "x1")
    heat = HeatScene.on(
        scene, {"a": Conductor(2.0), "b": Conductor(2.0)}, held=[HeldTemperature("a", "x0", 20.0)],
        loads=[Convection("b", "y0", 1.0, 99.0)],
        contacts=[ThermalContact(*sides, law, discretisation="node", friction=friction)],
    )  # fmt: skip
    by_hand = solve_heated(scene, heat, MPI.COMM_SELF, stress_free=15.0)
    state = file.solve()
    np.testing.assert_allclose(state.heat.values, by_hand.heat.values, rtol=1e-9)
    assert by_hand.mechanics.contact.normal_force.sum() > 1.0
    assert main(MPI.COMM_SELF, ["run", str(path), "--no-pictures"]) == 0
    said = capsys.readouterr().out
    assert "pair 0" in said
    assert "rows of heat" in said
    assert "strain energy" in said
    assert "HeldTemperature a x0" in said
    for name in ("result.json", "contact.csv", "heat/result.json", "heat/contact.csv", "heat/steps.csv"):
        assert (tmp_path / "out" / name).exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[materials.steel]", "[[steps]]\n[materials.steel]", "line 5: steps does not go with mechanics"),
        ("[materials.steel]", "[solver]\nmethod = 'smalse'\n[materials.steel]", "line 6: solver.method"),
        ('material = "steel"\nheat.material = "steel"\n\n[bodies.b]', 'heat.material = "steel"\n[bodies.b]',
         "line 15: bodies.a must have 'material', got only mesh, heat"),
        ('heat.material = "steel"\n\n[bodies.b]', 'heat = { material = "steel", thickness = 2 }\n[bodies.b]',
         "line 18: bodies.a.heat.thickness does not go with mechanics and heat together"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_mechanics_and_heat_is_named(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    assert PRESSED.count(old) == 1
    path = tmp_path / "bars.toml"
    path.write_text(PRESSED.replace(old, new))
    with pytest.raises(SceneFileError) as error:
        _ = read_scene_file(path, MPI.COMM_SELF)
    assert message in str(error.value)


def test_a_file_of_mechanics_knows_the_key_of_heat(tmp_path: Path) -> None:
    path = tmp_path / "bars.toml"
    path.write_text(BARS.replace("[heat.", "[haet.").replace("[[heat.", "[[haet."))
    with pytest.raises(SceneFileError, match="haet is not known: did you mean 'heat'"):
        read_scene_file(path, MPI.COMM_SELF)


def test_the_command_solves_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bars.toml"
    path.write_text(f"output = {{ folder = '{tmp_path}/out', files = ['vtu', 'csv'] }}\n{BARS}")
    assert main(MPI.COMM_SELF, ["run", str(path), "--plan"]) == 0
    assert "conducting body (2); held temperature (1)" in capsys.readouterr().out
    assert main(MPI.COMM_SELF, ["run", str(path), "--no-pictures"]) == 0
    said = capsys.readouterr().out
    assert "heat through b x0 - a x1  1.5" in said
    assert "HeldTemperature a x0  -1.5" in said
    assert f"results in {tmp_path}/out/: result.json, state.vtm, steps.csv, contact.csv" in said
    for name in ("result.json", "state.vtm", "steps.csv", "contact.csv"):
        assert (tmp_path / "out" / name).exists()
    assert main(MPI.COMM_SELF, ["view", f"{tmp_path}/out"]) == 0
    assert "temperature" in capsys.readouterr().out
    assert main(MPI.COMM_SELF, ["run", str(path), "--set", "heat.held=[]"]) == 4
    assert "have none and heat of HeatFlux b x1 has no way out" in capsys.readouterr().err
    assert main(MPI.COMM_SELF, ["optimize", str(path)]) == 2


def test_files_without_heat_load_nothing_of_it(mpirun: Callable[..., str]) -> None:
    code = (
        "import sys; from fenics_contact import read_scene_file\n"
        "from mpi4py import MPI\n"
        f"read_scene_file({str(EXAMPLE.with_name('two_blocks.toml'))!r}, MPI.COMM_SELF).scene.plan()\n"
        "sys.stdout.write(str([n for n in sys.modules if n.startswith('fenics_contact.heat')]))"
    )
    assert mpirun(code, 1, fresh=True) == "[]"


def test_nothing_that_holds_a_temperature_is_an_error_of_the_file() -> None:
    file: Any = read_scene_file(EXAMPLE, MPI.COMM_SELF, overrides=["heat.loads.1.coefficient=0.0"])
    with pytest.raises(InfeasibleError, match="'chip' and 'sink' have none and heat of HeatFlux chip y1"):
        file.solve()


def test_temperatures_over_time_are_those_of_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    timed = BARS.replace("conductivity = 2.0", "conductivity = 2.0\nheat_capacity = 3.0").replace(
        'value = "3 * y"', 'value = "3 * y * t"'
    )
    timed += "\n[heat.time]\ninitial = { a = 20.0, b = 30.0 }\nduration = 2.0\nstep = 0.25\noutputs = [0.5]\n"
    path = tmp_path / "bars.toml"
    path.write_text(f"output = {{ folder = '{tmp_path}/out', files = ['vtu', 'csv'] }}\n{timed}")
    steel = Conductor(2.0, 3.0)
    bodies = {
        name: ConductingBody(rectangle((x, 0), (x + 1, 1), (2, 2)), steel) for name, x in (("a", 0), ("b", 1))
    }

    def at(t: float) -> HeatScene:
        load = HeatFlux("b", "x1", lambda points: 3 * points[:, 1] * t)
        joint = ThermalContact(Surface("b", "x0"), Surface("a", "x1"), 5.0)
        return HeatScene(bodies, [HeldTemperature("a", "x0", 20.0)], [load], [joint])

    start = {"a": 20.0, "b": 30.0}
    by_hand = heat_in_time(at, MPI.COMM_SELF, 2.0, start, step=0.25, outputs=[0.5])
    file: Any = read_scene_file(path, MPI.COMM_SELF)
    history = file.solve()
    np.testing.assert_allclose(history.values, by_hand.values, rtol=1e-10)
    assert file.steps == (0.5, 2.0)
    assert main(MPI.COMM_SELF, ["run", str(path), "--no-pictures"]) == 0
    said = capsys.readouterr().out
    assert "times           2" in said
    assert "error by steps" in said
    for name in ("result.json", "history.pvd", "steps.csv", "contact/step_0001.csv"):
        assert (tmp_path / "out" / name).exists()
    assert "\n2," in (tmp_path / "out" / "steps.csv").read_text()
    path.write_text(timed.replace("step = 0.25", "scheme = 'bdf3'"))
    with pytest.raises(SceneFileError, match=r"time.scheme must be 'bdf2', 'euler', 'crank-nicolson' or"):
        read_scene_file(path, MPI.COMM_SELF)
    path.write_text(f"solver.tolerance = 1e-9\n{timed}")
    with pytest.raises(SceneFileError, match=r"line 1: solver.tolerance has no meaning in this file of heat"):
        read_scene_file(path, MPI.COMM_SELF)
