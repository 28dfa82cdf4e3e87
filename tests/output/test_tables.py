"""Tables of contact points and load steps hold what states hold, in an order that ranks do not change."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    ElasticFoundation,
    FluidPressure,
    LinearClosure,
    LoadSequence,
    LoadStep,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Scene,
    Status,
    Support,
    Surface,
    Tie,
    ToolMotion,
    TotalForce,
    Traction,
    contact_area,
    solve_scene,
    write_result,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, NeoHooke, PlaneStrain
from fenics_contact.output import StepTable, read_result, write_contact_table
from tests.equilibrium.fluid_case import FLUID, seal
from tests.output.states import touching_blocks

COMM = MPI.COMM_SELF


def read(path: Path) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the remarks and the rows of a table, numbers as such."""

    def number(text: str) -> Any:
        try:
            return float(text)
        except ValueError:
            return text

    lines = path.read_text(encoding="utf-8").splitlines()
    remarks = [line for line in lines if line.startswith("#")]
    rows = csv.DictReader(lines[len(remarks) :])
    return remarks, [{key: number(text) for key, text in row.items()} for row in rows]


def column(rows: list[dict[str, Any]], *names: str) -> np.ndarray:
    return np.array([[row[name] for name in names] for row in rows])


def test_a_row_of_contact_has_place_gap_pressure_traction_slip_and_status(tmp_path: Path) -> None:
    state = touching_blocks()
    contact, points = state.contact, state.contact.points
    remarks, rows = read(write_contact_table(state, tmp_path / "new" / "contact.csv"))
    assert len(remarks) == 1
    assert len(rows) == points.count > 10
    assert [row["status"] for row in rows] == [Status(kind).name.lower() for kind in contact.status]
    assert {row["pair"] for row in rows} == {"upper block z0 on lower z1"}
    mesh, near = state.scene.bodies["upper block"].mesh, {"rtol": 1e-11, "atol": 1e-14}
    nodes = column(rows, "node")[:, 0].astype(int)
    np.testing.assert_allclose(column(rows, "x", "y", "z"), mesh.points[nodes], **near)
    moved = mesh.points[nodes] + state.gather_displacement("upper block")[nodes]
    np.testing.assert_allclose(column(rows, "x_moved", "y_moved", "z_moved"), moved, **near)
    np.testing.assert_allclose(column(rows, "gap")[:, 0], contact.gap, **near)
    normal, traction = (column(rows, *(f"{name}_{a}" for a in "xyz")) for name in ("normal", "traction"))
    force = column(rows, "area") * (column(rows, "pressure") * normal + traction)
    np.testing.assert_allclose(force, contact.force, rtol=1e-9, atol=1e-9 * np.abs(contact.force).max())
    assert np.abs(traction).max() > 1.0
    slip = column(rows, "slip_x", "slip_y", "slip_z")
    np.testing.assert_allclose(slip, contact.slip_in_space, **near)
    slips = np.array([row["status"] == "slip" for row in rows])
    assert (np.einsum("nd,nd->n", slip, traction)[slips] < 0).all(), "friction opposes the slip of the slave"


def held_between() -> Scene:
    """A strip with a comma in its name, tied to a plate, on a floor and above another one."""
    strip = rectangle((0.0, 0.0), (2.0, 1.0), (7, 3))
    facets, left = strip.surfaces["y0"], strip.points[strip.surfaces["y0"]].mean(axis=1)[:, 0] < 1.0
    named = {**strip.surfaces, "left": facets[left], "right": facets[~left]}
    strip = type(strip)(strip.points, strip.cells, named)
    plate, material = rectangle((0.0, 1.0), (2.0, 1.5), (5, 2)), PlaneStrain(100.0, 0.3)
    places = (("right", 0.0), ("left", 0.0), ("left", -0.1))
    floors = [(side, RigidPlane((0.0, height), (0.0, 1.0))) for side, height in places]
    pairs = [ContactPair(Surface("strip, long", side), floor) for side, floor in floors]
    supports = [Support("plate", "x0", (0.0, None)), Support("plate", "x0", (None, 0.0))]
    return Scene(
        {"plate": Body(plate, material), "strip, long": Body(strip, material)},
        supports,
        [TotalForce("plate", "y1", (0.0, -1.0))],
        pairs,
        [Tie(Surface("plate", "y0"), Surface("strip, long", "y1"))],
    )


def test_pairs_are_chosen_by_name_and_frictionless_points_are_closed(tmp_path: Path) -> None:
    state = solve_scene(held_between(), COMM, tolerance=1e-9)
    _, rows = read(write_contact_table(state, tmp_path / "all.csv"))
    assert {row["status"] for row in rows} == {"open", "closed"}
    assert "z" not in rows[0]
    _, right = read(write_contact_table(state, tmp_path / "right.csv", pair="strip, long right"))
    assert right == [row for row in rows if row["pair"] == "strip, long right on rigid plane"]
    assert 0 < len(right) < len(rows)
    for unknown, words in (
        ("strip, long left", r"'strip, long left' is the slave of 2: give 'strip, long left on rigid plane'"),
        (3, "a contact pair has a number from 0 to 2, or the name of its slave, got 3"),
        ("plate y0", "a result by name needs .* got 'plate y0': name one of them"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            write_contact_table(state, tmp_path / "none.csv", pair=unknown)
        with pytest.raises(InvalidInputError, match=words):
            contact_area(state, unknown)
    assert not (tmp_path / "none.csv").exists()


def test_a_row_of_steps_has_loads_reactions_contacts_ties_and_energies(tmp_path: Path) -> None:
    state = solve_scene(held_between(), COMM, tolerance=1e-9)
    table = StepTable(tmp_path / "steps.csv", COMM)
    remarks, (row,) = read(table.add(state, "pressed, hard", 0.5))
    assert "plate x0 (0, 1.25)" in remarks[1]
    assert (row["number"], row["name"], row["time"]) == (0, "pressed, hard", 0.5)
    reactions, pairs = state.reactions(), state.resultants()
    assert row["loads Fy"] == pytest.approx(-1.0)
    assert row["plate x0 Fy"] == pytest.approx(reactions[1].force[1])
    assert row["plate x0 M"] == pytest.approx(reactions[0].moment + reactions[1].moment)
    balance = row["loads Fy"] + row["plate x0 Fy"]
    contacts = [name for name in row if name.startswith("strip, long") and name.endswith(" Fy")]
    assert contacts == [
        "strip, long right on rigid plane Fy",
        "strip, long left on rigid plane (1) Fy",
        "strip, long left on rigid plane (2) Fy",
    ]
    assert balance + sum(row[name] for name in contacts) == pytest.approx(0.0, abs=1e-9)
    assert row["plate y0 on strip, long y1 Fy"] == pytest.approx(pairs.ties[0].force[1])
    assert row["strip, long right on rigid plane area"] == pytest.approx(contact_area(state, 0))
    assert row["strain_energy"] == pytest.approx(state.energies.strain)
    assert row["products"] == state.solution.products


def test_moments_keep_their_points_from_step_to_step(tmp_path: Path) -> None:
    """Rubber that a load draws to twice its length: the middle of its box is elsewhere in every step."""
    bar = Body(rectangle((0.0, 0.0), (2.0, 1.0), (4, 2)), NeoHooke(1.0, 0.3))
    steps = LoadSequence(ContactProblem(Scene({"bar": bar}, [Support("bar", "x0")]), COMM))
    table = StepTable(tmp_path / "steps.csv", COMM)
    for number, pull in enumerate((0.4, 0.8)):
        state = steps.advance(LoadStep(f"{pull} N", loads=[Traction("bar", "x1", (pull, 0.01))]))
        remarks, rows = read(table.add(state, f"{pull} N"))
        assert len(rows) == number + 1, "the file is complete after every step"
    assert np.ptp(state.gather_displacement("bar")[:, 0]) > 0.8
    about = next(part for part in remarks[1].split(": ")[1].split("; ") if part.startswith("loads"))
    point = tuple(float(x) for x in about.removeprefix("loads (").rstrip(")").split(","))
    loads, held = state.balance(point).loads, state.reactions(point)["bar x0"]
    assert rows[1]["loads M"] == pytest.approx(loads.moment, rel=1e-5)
    assert loads.moment == pytest.approx(-held.moment, rel=1e-5)
    assert loads.moment != pytest.approx(state.balance().loads.moment, rel=0.1)
    assert rows[1]["bar x0 Fx"] == pytest.approx(-0.8, rel=1e-6)


def test_what_materials_do_not_define_is_empty(tmp_path: Path) -> None:
    metal = J2Plasticity(2.1e5, 0.3, 250.0, 1000.0)
    supports = [Support("bar", "x0"), Support("bar", "x1", (0.01, 0.0, 0.0))]
    scene = Scene({"bar": Body(block((0, 0, 0), (2, 1, 1), (2, 1, 1)), metal)}, supports)
    table = StepTable(tmp_path / "steps.csv", COMM)
    _, (row,) = read(table.add(solve_scene(scene, COMM)))
    assert row["strain_energy"] == ""
    assert row["bar x1 Fx"] > 100.0


def test_springs_and_surfaces_that_give_way_have_columns(tmp_path: Path) -> None:
    scene = Scene(
        {"slab": Body(rectangle((0, 0), (2, 1), (5, 2)), PlaneStrain(100.0, 0.3))},
        [Support("slab", "x0", (0.0, None))],
        [TotalForce("slab", "y1", (0.0, -1.0))],
        [ContactPair(Surface("slab", "y0"), RigidPlane((0, 0), (0, 1)), closure=LinearClosure(50.0))],
        foundations=[ElasticFoundation("slab", "x1", (0.0, 30.0))],
    )
    state = solve_scene(scene, COMM, tolerance=1e-9)
    _, (row,) = read(StepTable(tmp_path / "steps.csv", COMM).add(state))
    springs, floor = row["foundation slab x1 Fy"], row["slab y0 on rigid plane Fy"]
    assert springs > 0.1
    assert springs + floor == pytest.approx(1.0, rel=1e-6)
    assert row["surface_energy"] == pytest.approx(state.energies.surface, rel=1e-9)
    assert row["surface_energy"] > 1e-3


def test_tools_have_columns_of_motion_force_and_moment_also_of_revolution(tmp_path: Path) -> None:
    plane = Body(rectangle((0, 0), (3, 1), (6, 2)), PlaneStrain(100.0, 0.3))
    tool = RigidTool("die", RigidSphere((1.2, 3.0), 2.0), (1.2, 3.0))
    pair = ContactPair(Surface("slab", "y1"), tool, Coulomb(0.3))
    pressed = [Support("slab", "y0"), ToolMotion("die", (0.1, None), 0.01, force=(0.0, -2.0))]
    state = solve_scene(Scene({"slab": plane}, pressed, [], [pair]), COMM, tolerance=1e-10)
    _, (row,) = read(StepTable(tmp_path / "steps.csv", COMM).add(state))
    die = state.tools()["die"]
    columns = [name.removeprefix("tool die ") for name in row if name.startswith("tool")]
    assert columns == ["ux", "uy", "turn z", "Fx", "Fy", "M"]
    numbers = [row[f"tool die {name}"] for name in columns]
    assert numbers == pytest.approx([0.1, die.displacement[1], 0.01, die.force[0], 2.0, die.moment], rel=1e-9)
    assert abs(die.force[0]) > 0.1
    write_result(state, tmp_path)
    found = read_result(tmp_path)["forces"]
    rubbed = state.resultants().friction[0]
    assert found["friction"][0]["force"] == pytest.approx(rubbed.force)
    assert found["friction"][0]["surface"] == "y1"
    assert abs(rubbed.force[0]) > 0.1
    disc = Body(rectangle((0, 0), (3, 1), (6, 2)), IsotropicElasticity(100.0, 0.3), axisymmetric=True)
    ball = RigidTool("die", RigidSphere((0.0, 3.0), 2.0), (0.0, 3.0))
    pressed = [Support("slab", "y0"), ToolMotion("die", (0.0, None), 0.0, force=(0.0, -2.0))]
    scene = Scene({"slab": disc}, pressed, [], [ContactPair(Surface("slab", "y1"), ball)])
    state = solve_scene(scene, COMM, tolerance=1e-10)
    _, (row,) = read(StepTable(tmp_path / "steps.csv", COMM).add(state))
    columns = [name for name in row if name.startswith("tool die")]
    assert columns == [f"tool die {each}" for each in ("ur", "uz", "Fr", "Fz")]
    assert row["tool die Fz"] == pytest.approx(2.0, rel=1e-8)
    write_result(state, tmp_path)
    assert "friction" not in read_result(tmp_path)["forces"]


def test_points_that_fluid_has_reached_are_marked(tmp_path: Path) -> None:
    state = solve_scene(seal(FluidPressure(FLUID, enters="x1")), COMM, tolerance=1e-8)
    _, rows = read(write_contact_table(state, tmp_path / "contact.csv"))
    assert state.contact.wet is not None
    wet = column(rows, "wet")[:, 0]
    np.testing.assert_array_equal(wet, state.contact.wet)
    assert 0 < wet.sum() < len(rows)
    assert "wet" not in read(write_contact_table(touching_blocks(), tmp_path / "dry.csv"))[1][0]


def test_tables_of_bodies_of_revolution_have_radial_and_axial_forces(tmp_path: Path) -> None:
    material = IsotropicElasticity(1000.0, 0.3)
    meshes = {"lid": rectangle((0, 1), (3, 2), (7, 2)), "pipe": rectangle((1, 0), (2, 1), (3, 3))}
    scene = Scene(
        {name: Body(mesh, material, axisymmetric=True) for name, mesh in meshes.items()},
        [Support("pipe", "y0", (None, 0.0))],
        [TotalForce("lid", "y1", (0.0, -20.0))],
        [ContactPair(Surface("lid", "y0"), Surface("pipe", "y1"))],
    )
    state = solve_scene(scene, COMM, tolerance=1e-9)
    _, (row,) = read(StepTable(tmp_path / "steps.csv", COMM).add(state))
    assert [name for name in row if name.startswith("loads")] == ["loads Fr", "loads Fz"]
    assert row["loads Fz"] == pytest.approx(-20.0)
    assert row["pipe y0 Fz"] == pytest.approx(row["lid y0 on pipe y1 Fz"]) == pytest.approx(20.0)
    _, rows = read(write_contact_table(state, tmp_path / "contact.csv"))
    force = sum(row["area"] * row["pressure"] for row in rows)
    assert force == pytest.approx(20.0, rel=1e-6), "areas are those of the full revolution"


RANKS = """
    import sys
    from mpi4py import MPI
    from fenics_contact.output import StepTable, write_contact_table
    from tests.results.resultant_cases import SCENES, solved

    comm, folder = MPI.COMM_WORLD, sys.argv[1]
    state = solved(SCENES["dragged"](), comm)
    write_contact_table(state, f"{folder}/contact.csv")
    StepTable(f"{folder}/steps.csv", comm).add(state, "dragged")
"""


def test_two_ranks_write_the_same_tables_once(mpirun: Callable[..., str], tmp_path: Path) -> None:
    for ranks in (1, 2):
        mpirun(RANKS, ranks, tmp_path / str(ranks))
    for name in ("contact.csv", "steps.csv"):
        (remarks, rows), (same, others) = (read(tmp_path / ranks / name) for ranks in "12")
        assert remarks == same
        assert len(rows) == len(others) > 0
        for row, other in zip(rows, others, strict=True):
            assert list(row) == list(other)
            for key, value in row.items():
                size = max(abs(each[key]) for each in rows) if isinstance(value, float) else 0.0
                if key in ("iterations", "products") or "slip" in key:
                    continue  # cost, and slip of points that stick: rounding
                near = pytest.approx(value, rel=1e-5, abs=1e-6 * size + 1e-8) if size else value
                assert other[key] == near, key
    assert len(rows) == 1
