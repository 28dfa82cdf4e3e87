"""Decks of linear solids: their answers are those of theory, and of CalculiX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import PointForce, Pressure, Support, ThermalStrain, read_scene_file
from fenics_contact.decks import Deck, DeckError, read_deck, write_scene_file
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStress
from fenics_contact.mesh import joined_cells, quadratic, refined
from tests.decks.texts import BAR, END, FREE_TO_CONTRACT, PULLED, SECTION, STEEL, deck, mesh_cards, step
from tests.fem.mixed_cells import named_sides


def displacement(found: Deck, body: str = "BAR", number: int = -1) -> np.ndarray:
    return found.solve(MPI.COMM_SELF, tolerance=1e-12)[number].gather_displacement(body)


def stretched(points: np.ndarray, stress: float) -> np.ndarray:
    """Return the displacement of a bar under tension along x."""
    strain = stress / 210000.0
    return points * [strain, -0.3 * strain, -0.3 * strain][: points.shape[1]]


@pytest.mark.parametrize(
    "loads",
    [
        PULLED,
        "*SURFACE, NAME=TIP\nEND, S4\n*STEP\n*STATIC\n*DSLOAD\nTIP, P, -100.\n*END STEP\n",
    ],
)
def test_a_bar_under_pressure_is_that_of_theory(loads: str, tmp_path: Path) -> None:
    text = loads if "*STEP" in loads else step(loads)
    found = read_deck(deck(tmp_path, BAR + END + FREE_TO_CONTRACT + text))
    points = found.scene.bodies["BAR"].mesh.points
    np.testing.assert_allclose(displacement(found), stretched(points, 100.0), atol=1e-13)


def test_tetrahedra_with_nodes_on_edges_are_read_in_their_order(tmp_path: Path) -> None:
    mesh = quadratic(block((0, 0, 0), (3, 1, 1), (2, 1, 1), "tetrahedron"))
    surface = "*SURFACE, NAME=TIP, TYPE=NODE\nBAR_X1,\n"
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + surface + FREE_TO_CONTRACT
    found = read_deck(deck(tmp_path, text + step("*CLOAD\nBAR_X1, 1, 0.\n")))
    read = found.scene.bodies["BAR"].mesh
    assert read.cell_type == "tetrahedron10"
    assert read.volume == pytest.approx(3.0)
    assert set(read.surfaces) >= {"BAR_X0", "BAR_Y0", "BAR_Z0", "BAR_X1", "TIP"}
    assert found.source("surface", "TIP").card == "*SURFACE"
    assert refined(read, [0]).mesh.n_cells > read.n_cells, "a mesh without a crack can be refined"


@pytest.mark.parametrize("element", ["C3D20R", "C3D20", "CPS8R", "CPE8"])
def test_elements_without_centres_stretch_as_in_theory(element: str, tmp_path: Path) -> None:
    linear = (
        block((0, 0, 0), (3, 1, 1), (2, 1, 1)) if element[:3] == "C3D" else rectangle((0, 0), (3, 1), (2, 1))
    )
    text = (
        mesh_cards({"BAR": quadratic(linear)}, element)
        + STEEL
        + SECTION
        + "*BOUNDARY\nBAR_X0, 1\nBAR_Y0, 2\n"
    )
    text += "BAR_Z0, 3\n" if linear.dim == 3 else ""
    face = "P4" if linear.dim == 3 else "P2"
    found = read_deck(deck(tmp_path, text + step(f"*DLOAD\n2, {face}, -100.\n")))
    mesh = found.scene.bodies["BAR"].mesh
    assert mesh.cells_in_words.startswith("2 serendipity")
    assert (found.node_numbers["BAR"] == 0).sum() == mesh.n_nodes - text.partition("*ELEMENT")[0].count(
        "\n"
    ) + 1
    exact = stretched(mesh.points, 100.0)
    if element == "CPE8":
        exact = mesh.points * np.array([1 - 0.3**2, -0.3 * 1.3]) * 100.0 / 210000.0
    np.testing.assert_allclose(displacement(found), exact, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_prisms_beside_hexahedra_stretch_as_one_body(order: int, tmp_path: Path) -> None:
    box = block((0, 0, 0), (3, 1, 1), (2, 1, 1))
    prisms = box.cells[1, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    mesh = named_sides(box.points, joined_cells({"hexahedron": box.cells[:1], "prism": prisms}))
    mesh = mesh if order == 1 else quadratic(mesh)
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + "*BOUNDARY\nBAR_X0, 1\nBAR_Y0, 2\nBAR_Z0, 3\n"
    assert ("TYPE=C3D15" if order == 2 else "TYPE=C3D6") in text
    found = read_deck(deck(tmp_path, text + step("*BOUNDARY\nBAR_X1, 1, 1, 0.01\n")))
    read = found.scene.bodies["BAR"].mesh
    assert read.has_several_shapes
    assert any(f"CalculiX takes {9 if order == 2 else 2} points" in note for note in found.notes)
    rate = np.array([1.0, -0.3, -0.3]) * 0.01 / 3
    np.testing.assert_allclose(displacement(found), read.points * rate, atol=1e-12)


def test_a_plate_of_a_thickness_is_loaded_by_whole_forces(tmp_path: Path) -> None:
    """CPS4 of 2 mm: three nodes with the forces of 10 N/mm² on 1 mm by 2 mm."""
    mesh = rectangle((0, 0), (3, 1), (3, 2))
    section = "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n2.0\n"
    corners = [k + 1 for k in np.unique(mesh.surfaces["x1"])]
    forces = "".join(f"{node}, 1, {5.0 * (1 + (k == 1))}\n" for k, node in enumerate(corners))
    text = mesh_cards({"BAR": mesh}) + STEEL + section + "*BOUNDARY\nBAR_X0, 1\nBAR_Y0, 2\n"
    found = read_deck(deck(tmp_path, text + step("*CLOAD\n" + forces)))
    assert found.thickness == 2.0
    assert found.scene.bodies["BAR"].material == PlaneStress(210000.0, 0.3)
    np.testing.assert_allclose(displacement(found), stretched(mesh.points, 10.0), atol=1e-14)


def test_a_turning_ring_is_that_of_lame(tmp_path: Path) -> None:
    """u(a) of a thin ring that turns, ρ ω² r³ / E; the square of the angular velocity is given."""
    mesh = rectangle((100.0, 0.0), (100.2, 0.2), (1, 1))
    density = "*DENSITY\n7.8E-9\n"
    text = mesh_cards({"BAR": mesh}, "CAX4") + STEEL + density + SECTION
    spin = step("*DLOAD\nBAR, CENTRIF, 1.D6, 0., 0., 0., 0., 1., 0.\n")
    found = read_deck(deck(tmp_path, text + "*BOUNDARY\nBAR_Y0, 2\n" + spin))
    assert found.scene.axisymmetric
    mean = displacement(found)[:, 0].mean()
    assert mean == pytest.approx(7.8e-9 * 1e6 * 100.1**3 / 210000.0, rel=2e-3)


def test_weight_hangs_as_in_theory(tmp_path: Path) -> None:
    text = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 8), (1, 1, 8))}) + STEEL.replace("0.3", "0.0")
    text += "*DENSITY\n1.E-3,\n" + SECTION + "*BOUNDARY\nBAR_Z1, 1, 3\n"
    found = read_deck(deck(tmp_path, text + step("*DLOAD\nBAR, GRAV, 1000., 0., 0., -1.\n")))
    # ρ g L² / (2 E), exact at nodes of linear cells.
    assert displacement(found)[:, 2].min() == pytest.approx(-1.0 * 64 / 2 / 210000.0, rel=1e-9)


def test_a_weight_on_some_elements_of_several_densities(tmp_path: Path) -> None:
    """Elements 1 to 4 are of steel, 5 to 8 of lead; 3 to 6 are loaded, and all of them by the second step."""
    text = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 8), (1, 1, 8))}) + STEEL.replace("0.3", "0.0")
    text += "*DENSITY\n1.E-3,\n*MATERIAL, NAME=LEAD\n*ELASTIC\n16000., 0.\n*DENSITY\n3.E-3,\n"
    for name, span in (("LOW", "1, 4"), ("HIGH", "5, 8"), ("MIDDLE", "3, 6")):
        text += f"*ELSET, ELSET={name}, GENERATE\n{span}\n"
    text += SECTION.replace("BAR", "LOW") + SECTION.replace("BAR", "HIGH").replace("STEEL", "LEAD")
    text += "*BOUNDARY\nBAR_Z0, 1, 3\n"
    found = read_deck(
        deck(
            tmp_path,
            text
            + step("*DLOAD\nMIDDLE, GRAV, 1000., 0., 0., -1.\n")
            + step("*DLOAD, OP=NEW\nBAR, GRAV, 1000., 0., 0., -1.\n"),
        )
    )
    assert len(found.scene.bodies["BAR"].materials) == 2
    first, second = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    assert first.nodal_reactions("BAR")[:, 2].sum() == pytest.approx(2.0 + 6.0, rel=1e-9)
    assert second.nodal_reactions("BAR")[:, 2].sum() == pytest.approx(4.0 + 12.0, rel=1e-9)
    # Below z the column has the weight above it: N = −8 on both elements at the foot, −7.5 .. −6.5 in the
    # next; means of the third to sixth fall by halves of their own weight.
    means = first.gather_stress("BAR")[:, 2, 2]
    np.testing.assert_allclose(means, [-8.0, -8.0, -7.5, -6.5, -4.5, -1.5, 0.0, 0.0], atol=1e-7)
    path, *_ = write_scene_file(found, tmp_path / "bar.toml")
    again = read_scene_file(path, MPI.COMM_SELF, overrides=["solver.tolerance=1e-11"]).solve()
    wanted = second.gather_displacement("BAR")
    np.testing.assert_allclose(again.gather_displacement("BAR"), wanted, atol=1e-8 * np.abs(wanted).max())


def test_temperature_counts_from_the_initial_one(tmp_path: Path) -> None:
    text = BAR.replace("210000., 0.3\n", "210000., 0.3\n*EXPANSION\n1.2E-5\n") + FREE_TO_CONTRACT
    text += "*NSET, NSET=ALL, GENERATE\n1, 24\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20.\n"
    found = read_deck(deck(tmp_path, text + step("*TEMPERATURE\nALL, 120.\n")))
    (heat,) = found.steps[0].loads
    assert isinstance(heat, ThermalStrain)
    assert heat.temperature_change == 100.0
    points = found.scene.bodies["BAR"].mesh.points
    np.testing.assert_allclose(displacement(found), 1.2e-3 * points, atol=1e-13)


def test_a_temperature_by_nodes_strains_as_it_varies(tmp_path: Path) -> None:
    text = BAR.replace("210000., 0.3\n", "210000., 0.\n*EXPANSION\n1.E-3\n") + "*BOUNDARY\nBAR_X0, 1, 3\n"
    text += "*NSET, NSET=ALL, GENERATE\n1, 24\n*BOUNDARY\nALL, 2, 3\n"
    heat = "*TEMPERATURE\nBAR_X1, 30.\n"
    found = read_deck(deck(tmp_path, text + step(heat)))
    points, moved = found.scene.bodies["BAR"].mesh.points, displacement(found)
    tip = moved[points[:, 0] == 3.0, 0]
    assert tip.mean() == pytest.approx(1e-3 * 15.0, rel=1e-6)  # the last cell has 15 degrees in the mean


def test_steps_keep_replace_and_add_loads(tmp_path: Path) -> None:
    """Forces of a step add up, those of earlier ones are replaced, OP=NEW removes the others."""
    first = "*CLOAD\nBAR_X1, 1, 1.\n24, 1, 2.\n"
    steps = step(first) + step("*CLOAD\n24, 1, 7.\n") + step("*CLOAD, OP=NEW\n24, 2, 5.\n") + step("")
    found = read_deck(deck(tmp_path, BAR + "*BOUNDARY\nBAR_X0, 1, 3\n" + steps))
    total = []
    for each in found.steps:
        force = np.zeros(3)
        for load in each.loads:
            assert isinstance(load, PointForce)
            mesh = found.scene.bodies["BAR"].mesh
            force += load.at(mesh.points[mesh.nodes_of(load.nodes)], 3).sum(axis=0)
        total.append(force.tolist())
    # CalculiX 2.20 prints reactions of 5 + 3 and 7 + 5 for the first two of these steps on one element.
    assert total == [[8.0, 0.0, 0.0], [12.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 5.0, 0.0]]
    reactions = [state.reactions()[0].force for state in found.solve(MPI.COMM_SELF, tolerance=1e-10)]
    np.testing.assert_allclose(reactions, -np.array(total), atol=1e-6)


def test_an_amplitude_cuts_a_step_where_it_turns(tmp_path: Path) -> None:
    text = BAR + END + "*AMPLITUDE, NAME=CYCLE\n0., 0., 0.25, 1., 0.5, -1., 1., 0.\n" + FREE_TO_CONTRACT
    moved = "*BOUNDARY, AMPLITUDE=CYCLE\nBAR_X1, 1, 1, 0.1\n"
    found = read_deck(deck(tmp_path, text + step(moved)))
    assert [each.time for each in found.steps] == [0.25, 0.5, 1.0]
    pulls = [s.value[0] for each in found.steps for s in each.supports if s.surface == "BAR_X1"]
    assert pulls == pytest.approx([0.1, -0.1, 0.0])
    assert list(found.step_of) == [0, 0, 0]
    assert len(found.solve(MPI.COMM_SELF)) == 1, "one state for a step of the deck"


@pytest.mark.parametrize(("young", "words"), [("210.", "in GPa"), ("2.1E11", "in Pa"), ("2.1E5", "")])
def test_odd_units_are_reported(young: str, words: str, tmp_path: Path) -> None:
    text = mesh_cards({"BAR": block((0, 0, 0), (1000, 100, 100), (2, 1, 1))}) + STEEL.replace(
        "210000.", young
    )
    found = read_deck(deck(tmp_path, text + SECTION + "*BOUNDARY\nBAR_X0, 1, 3\n" + step("")))
    odd = [note for note in found.notes if "odd units?" in note]
    assert len(odd) == bool(words)
    assert all(words in note and "the body is 1000 long" in note for note in odd)


def test_an_amplitude_may_start_later(tmp_path: Path) -> None:
    text = (
        BAR
        + "*AMPLITUDE, NAME=RAMP\n0., 1., 1., 2., 2., 3.\n*BOUNDARY\nBAR_X0, 1, 3\n*STEP\n*STATIC\n1.5, 1.5\n"
    )
    late = "*CLOAD, AMPLITUDE=RAMP, TIME DELAY=1.\n24, 2, 4.\n*END STEP\n"
    found = read_deck(deck(tmp_path, text + late))
    assert [each.time for each in found.steps] == [1.0, 1.5]
    forces = [load.value[1] for each in found.steps for load in each.loads if isinstance(load, PointForce)]
    assert forces == pytest.approx([4.0, 6.0])


def test_nodes_that_are_no_face_are_held_as_nodes(tmp_path: Path) -> None:
    held = "*BOUNDARY\n1, 1, 3\n5, 2\nBAR_X0, 1, 1\n3, 2, 6\n"
    found = read_deck(deck(tmp_path, BAR + END + held + step(PULLED)))
    mesh = found.scene.bodies["BAR"].mesh
    names = {
        support.surface: support.value for support in found.scene.supports if isinstance(support, Support)
    }
    assert names["BAR_X0"] == (0.0, None, None)
    assert names["BOUNDARY 1 2 3"] == (0.0, 0.0, 0.0)
    assert names["BOUNDARY 2"] == (None, 0.0, None)
    assert set(mesh.node_sets) >= {"BOUNDARY 1 2 3", "BOUNDARY 2"}
    (pressed,) = found.steps[0].loads
    assert pressed == Pressure("BAR", "END P4", -100.0)


def test_bodies_are_elements_that_share_nodes_and_regions_are_sections(tmp_path: Path) -> None:
    lower, upper = block((0, 0, 0), (2, 1, 1), (2, 1, 1)), block((0, 0, 1), (2, 1, 2), (2, 1, 1))
    text = mesh_cards({"LOW": lower, "UP": upper}) + STEEL + "*MATERIAL, NAME=TIN\n*ELASTIC\n50000., 0.3\n"
    text += "*ELSET, ELSET=LEFT\n1\n*ELSET, ELSET=RIGHT\n2\n*SOLID SECTION, ELSET=LEFT, MATERIAL=STEEL\n"
    text += "*SOLID SECTION, ELSET=RIGHT, MATERIAL=TIN\n*SOLID SECTION, ELSET=UP, MATERIAL=TIN\n"
    found = read_deck(deck(tmp_path, text + "*BOUNDARY\nLOW_Z0, 1, 3\nUP_Z1, 1, 3\n" + step("")))
    assert list(found.scene.bodies) == ["LOW", "UP"]
    assert found.scene.bodies["LOW"].material == {
        "LEFT": IsotropicElasticity(210000.0, 0.3), "RIGHT": IsotropicElasticity(50000.0, 0.3),
    }  # fmt: skip
    assert found.scene.bodies["UP"].material == IsotropicElasticity(50000.0, 0.3)
    np.testing.assert_array_equal(found.node_numbers["UP"], 13 + np.arange(12))
    np.testing.assert_array_equal(found.element_numbers["UP"], [3, 4])
    assert str(found.source("body", "UP")).startswith("*SOLID SECTION, model.inp line")


PRINTS = (
    "*NODE PRINT, NSET=BAR_X1, TOTALS=YES\nU\n*NODE PRINT, NSET=BAR_X0, TOTALS=ONLY\nRF\n"
    "*EL PRINT, ELSET=END\nS, E\n*NODE FILE\nU\n"
)


def test_a_deck_prints_what_it_asks_for(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, BAR + END + FREE_TO_CONTRACT + step(PULLED + PRINTS)))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    moved, forces, stress = found.tables(state)
    assert [table.name for table in (moved, forces, stress)] == [
        "NODE PRINT U BAR_X1",
        "NODE PRINT RF BAR_X0",
        "EL PRINT S END",
    ]
    assert moved.columns == ("node", "ux", "uy", "uz")
    np.testing.assert_array_equal(moved.rows[:-1, 0], found.node_sets["BAR_X1"])
    np.testing.assert_allclose(moved.rows[:-1, 1], 300.0 / 210000.0)
    assert moved.rows[-1, 1] == pytest.approx(6 * 300.0 / 210000.0)
    np.testing.assert_allclose(forces.rows, [[0.0, -100.0, 0.0, 0.0]], atol=1e-8)
    np.testing.assert_allclose(stress.rows, [[5, 100, 0, 0, 0, 0, 0], [6, 100, 0, 0, 0, 0, 0]], atol=1e-8)
    assert [each.card for each in found.prints] == ["NODE PRINT", "NODE PRINT", "EL PRINT", "NODE FILE"]


def test_tables_of_elements_of_several_types_have_their_numbers(tmp_path: Path) -> None:
    """A hexahedron between two others of wedges: the numbers of the deck go with the cells that have them."""
    nodes = "*NODE\n" + "".join(
        f"{1 + k + 4 * i}, {i}., {y}., {z}.\n"
        for i in range(3)
        for k, (y, z) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)])
    )
    elements = "*ELEMENT, TYPE=C3D6, ELSET=BAR\n7, 5, 8, 9, 6, 7, 10\n8, 9, 8, 12, 10, 7, 11\n"
    elements += "*ELEMENT, TYPE=C3D8, ELSET=BAR\n3, 1, 5, 6, 2, 4, 8, 7, 3\n"
    text = nodes + elements + STEEL + SECTION + "*BOUNDARY\n1, 1, 3\n2, 1\n3, 1\n4, 1, 2\n"
    found = read_deck(deck(tmp_path, text + step("*CLOAD\n9, 1, 1.\n*EL PRINT, ELSET=BAR\nS\n")))
    mesh = found.scene.bodies["BAR"].mesh
    middles = dict(
        zip(found.element_numbers["BAR"].tolist(), mesh.points[mesh.cells].mean(axis=1)[:, 0], strict=True)
    )
    assert middles[3] < 1.0 < min(middles[7], middles[8])


@pytest.mark.parametrize(
    ("element", "load"),
    [
        ("CAX4", "CENTRIF, 1., 0., 0., 0., 1., 0., 0."),
        ("CAX4", "CENTRIF, 1., 2., 0., 0., 0., 1., 0."),
        ("CAX4", "GRAV, 1., 1., 0., 0."),
        ("CPS4", "CENTRIF, 1., 0., 0., 0., 0., 1., 0."),
        ("CPE4", "GRAV, 1., 0., 0., 1."),
    ],
)
def test_loads_out_of_the_plane_are_refused(element: str, load: str, tmp_path: Path) -> None:
    text = (
        mesh_cards({"BAR": rectangle((1.0, 0.0), (2.0, 1.0), (1, 1))}, element)
        + STEEL
        + "*DENSITY\n1.\n"
        + SECTION
    )
    with pytest.raises(DeckError, match=r"(CENTRIF|GRAV) here must be along (the axis|z|the plane)"):
        read_deck(deck(tmp_path, text + "*BOUNDARY\nBAR_Y0, 1, 2\n" + step(f"*DLOAD\nBAR, {load}\n")))


def test_a_yield_stress_by_temperature_is_refused(tmp_path: Path) -> None:
    text = BAR.replace("0.3\n", "0.3\n*PLASTIC\n300., 0., 20.\n200., 0., 300.\n", 1) + FREE_TO_CONTRACT
    with pytest.raises(DeckError, match=r"a yield stress that depends on the temperature is not read"):
        read_deck(deck(tmp_path, text + step("")))


def test_forces_of_many_sizes_on_a_plate_are_per_thickness_and_add_up(tmp_path: Path) -> None:
    mesh = rectangle((0, 0), (1, 7), (1, 7))
    nodes = 1 + np.unique(mesh.surfaces["x1"])
    lines = "".join(f"{node}, 1, {k + 1}.\n" for k, node in enumerate(nodes)) + f"{nodes[0]}, 1, 9.\n"
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + "4.0\n*BOUNDARY\nBAR_X0, 1, 2\n"
    found = read_deck(
        deck(tmp_path, text + step("*CLOAD\n" + lines + "*NODE PRINT, NSET=BAR_X0, TOTALS=ONLY\nRF\n"))
    )
    (load,) = found.steps[0].loads or ()
    assert isinstance(load, PointForce)
    read = found.scene.bodies["BAR"].mesh
    forces = load.at(read.points[read.nodes_of(load.nodes)], 2)
    assert sorted(forces[:, 0]) == pytest.approx(sorted([10.0, *range(2, 9)] / np.array(4.0)))
    (table,) = found.tables(found.solve(MPI.COMM_SELF, tolerance=1e-10)[0])
    assert table.rows[0, 1] == pytest.approx(-45.0, rel=1e-6)


@pytest.mark.parametrize("vector", ["0., 0., -1.", "0., 0., -2.5"])
def test_the_vector_of_gravity_is_a_direction(vector: str, tmp_path: Path) -> None:
    """A column of height 1 under ρ g = 2100 gets shorter by ρ g h² / 2 E, whatever the vector's length."""
    text = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 1), (1, 1, 1))}) + STEEL.replace("0.3", "0.0")
    text += "*DENSITY\n7.\n" + SECTION + "*BOUNDARY\nBAR_Z0, 1, 3\n"
    found = read_deck(deck(tmp_path, text + step(f"*DLOAD\nBAR, GRAV, 300., {vector}\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert state.gather_displacement("BAR")[:, 2].min() == pytest.approx(-2100.0 / 2 / 210000.0, rel=1e-8)
    with pytest.raises(DeckError, match=r"GRAV needs a direction, its last three numbers, got zeros"):
        read_deck(deck(tmp_path, text + step("*DLOAD\nBAR, GRAV, 300., 0., 0., 0.\n")))
