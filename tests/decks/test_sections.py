"""What decks say of parts of bodies: thicknesses of plane sections, and initial stresses of elements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import InitialStress, read_scene_file
from fenics_contact.decks import Deck, DeckError, read_deck, write_scene_file
from fenics_contact.gallery import block, rectangle
from tests.decks.texts import BAR, FREE_TO_CONTRACT, SECTION, STEEL, deck, mesh_cards, step

PLATE = mesh_cards({"BAR": rectangle((0, 0), (4, 1), (4, 1))}, "CPS4") + STEEL.replace("0.3", "0.")
PLATE += "*ELSET, ELSET=THIN\n1, 2\n*ELSET, ELSET=THICK\n3, 4\n"
TWO = SECTION.replace("BAR", "THIN") + "0.5\n" + SECTION.replace("BAR", "THICK") + "2.0\n"
HELD = "*BOUNDARY\nBAR_X0, 1, 2\n"


def again(found: Deck, folder: Path) -> np.ndarray:
    """Return the displacement of the scene file of a deck."""
    path, *_ = write_scene_file(found, folder / "again.toml")
    state = read_scene_file(path, MPI.COMM_SELF, overrides=["solver.tolerance=1e-11"]).solve()
    return np.asarray(state.gather_displacement("BAR"))


def test_plane_sections_have_their_own_thickness(tmp_path: Path) -> None:
    """A bar pulled by 30 N: the stress is the force by the area, the tip moves by both halves."""
    loads = "*CLOAD\nBAR_X1, 1, 15.\n*NODE PRINT, NSET=BAR_X0, TOTALS=ONLY\nRF\n"
    found = read_deck(deck(tmp_path, PLATE + TWO + HELD + step(loads)))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    stress = state.gather_stress("BAR")[:, 0, 0]
    np.testing.assert_allclose(stress, [60.0, 60.0, 15.0, 15.0], rtol=1e-8)
    moved = state.gather_displacement("BAR")
    assert moved[:, 0].max() == pytest.approx((2 * 60.0 + 2 * 15.0) / 210000.0, rel=1e-8)
    (table,) = found.tables(state)
    assert table.rows[0, 1] == pytest.approx(-30.0, rel=1e-7)
    np.testing.assert_allclose(again(found, tmp_path), moved, atol=1e-8 * moved.max())


def test_a_pressure_and_a_weight_act_on_the_thickness_behind_them(tmp_path: Path) -> None:
    text = PLATE.replace("0.\n*ELSET", "0.\n*DENSITY\n1.\n*ELSET") + TWO + HELD
    for load, wanted in (("BAR, P3, 6.", 6.0 * (2 * 0.5 + 2 * 2.0)), ("BAR, GRAV, 6., 0., -1., 0.", 30.0)):
        found = read_deck(deck(tmp_path, text + step(f"*DLOAD\n{load}\n")))
        (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
        assert state.reactions()["BAR BAR_X0"].force[1] == pytest.approx(wanted, rel=1e-8)


def test_several_thicknesses_of_metal_that_yields_are_refused(tmp_path: Path) -> None:
    text = PLATE.replace("0.\n*ELSET", "0.\n*PLASTIC\n300., 0.\n*ELSET").replace("CPS4", "CPE4")
    text += TWO + HELD
    with pytest.raises(DeckError, match=r"plane bodies of several thicknesses with PLASTIC are not"):
        read_deck(deck(tmp_path, text + step("")))


def initial(lines: str, kind: str = "STRESS") -> str:
    return f"*INITIAL CONDITIONS, TYPE={kind}\n{lines}"


def at_points(*values: float, element: int = 1) -> str:
    """Stress along x at points of an element."""
    return "".join(f"{element}, {k + 1}, {s}, 0., 0., 0., 0., 0.\n" for k, s in enumerate(values))


@pytest.mark.parametrize(
    "lines",
    [at_points(*[84.0] * 8) + at_points(*[84.0] * 8, element=4), "PAIR, 84.\n"],
    ids=["points", "set"],
)
def test_initial_stresses_relax_between_free_ends(lines: str, tmp_path: Path) -> None:
    """Both elements at the foot shorten by σ₀ / E; the others are free of stress all along."""
    mesh = block((0, 0, 0), (3, 1, 1), (3, 2, 1))
    foot = 1 + np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.0)
    for old, new in zip(("1, ", "4, "), (f"{n}, " for n in foot), strict=True):
        lines = "".join(new + line[3:] if line.startswith(old) else line for line in lines.splitlines(True))
    text = BAR.replace("0.3", "0.") + f"*ELSET, ELSET=PAIR\n{foot[0]}, {foot[1]}\n" + FREE_TO_CONTRACT
    found = read_deck(deck(tmp_path, text + initial(lines) + step("") + step("")))
    for state in found.solve(MPI.COMM_SELF, tolerance=1e-12):
        moved = state.gather_displacement("BAR")[:, 0]
        assert moved.min() == pytest.approx(-84.0 / 210000.0, rel=1e-8)
        assert np.abs(state.gather_stress("BAR")).max() < 1e-6
    assert not found.notes
    np.testing.assert_allclose(again(found, tmp_path)[:, 0], moved, atol=1e-11)


def test_plastic_strain_of_a_free_bar_is_its_strain(tmp_path: Path) -> None:
    """Without NLGEOM; shears are those of the tensor."""
    text = BAR + FREE_TO_CONTRACT + initial("BAR, 0.01, -0.005, -0.004\n", "PLASTIC STRAIN")
    found = read_deck(deck(tmp_path, text + step("")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    points, moved = found.scene.bodies["BAR"].mesh.points, state.gather_displacement("BAR")
    longer = [0.01, 0.005, 0.004] * np.ptp(points, axis=0)
    np.testing.assert_allclose(np.ptp(moved, axis=0), longer, rtol=1e-7)
    assert np.abs(state.gather_stress("BAR")).max() < 1e-5
    with pytest.raises(DeckError, match="plastic strains need isotropic elasticity"):
        read_deck(deck(tmp_path, text + step("", ", NLGEOM")))
    shear = BAR + FREE_TO_CONTRACT + initial("BAR, 0., 0., 0., 0.002, 0., 0.\n", "PLASTIC STRAIN")
    (load,) = read_deck(deck(tmp_path, shear + step(""))).steps[0].loads or ()  # type: ignore[misc]
    assert isinstance(load, InitialStress)
    assert load.value == pytest.approx((0, 0, 0, 0, 0, -2 * 210000.0 / 2.6 * 0.002))


def test_orders_of_components_are_those_of_the_deck(tmp_path: Path) -> None:
    text = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 1), (1, 1, 1))}) + STEEL + SECTION
    text += "*BOUNDARY\nBAR_X0, 1, 3\nBAR_X1, 1, 3\n"
    found = read_deck(deck(tmp_path, text + initial("BAR, 1., 2., 3., 12., 13., 23.\n") + step("")))
    (load,) = found.steps[0].loads or ()  # type: ignore[misc]
    assert isinstance(load, InitialStress)
    assert load.value == (1.0, 2.0, 3.0, 23.0, 13.0, 12.0)
    (state,) = found.solve(MPI.COMM_SELF)
    wanted = [[1.0, 12.0, 13.0], [12.0, 2.0, 23.0], [13.0, 23.0, 3.0]]
    np.testing.assert_allclose(state.gather_stress("BAR")[0], wanted, atol=1e-9)


def test_stresses_that_differ_within_an_element_are_averaged_and_told(tmp_path: Path) -> None:
    text = BAR.replace("0.3", "0.") + FREE_TO_CONTRACT
    found = read_deck(deck(tmp_path, text + initial(at_points(*range(8))) + step("")))
    (load,) = found.steps[0].loads or ()  # type: ignore[misc]
    assert isinstance(load, InitialStress)
    assert callable(load.value)
    mesh = found.scene.bodies["BAR"].mesh
    np.testing.assert_array_equal(load.on_cells(mesh)[:, 0], [3.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert any("mean of the initial stresses" in note for note in found.notes)


@pytest.mark.parametrize(
    ("lines", "large", "message"),
    [
        (
            at_points(*range(8)).replace("1, 8,", "1, 7,"),
            "",
            r"all of its integration points, .* element 1 has",
        ),
        (
            at_points(*range(8)).replace("1, 8,", "1, 9,"),
            "",
            r"all of its integration points, .* element 1 has",
        ),
        (at_points(1.0) + "BAR, 1.\n", "", r"integration points, or none, got both"),
        ("BAR\n", "", r"needs an element or set and up to six stresses"),
        ("BOX, 1.\n", "", r"element set 'BOX' is not there"),
        ("BAR, 1.\n", ", NLGEOM", r"initial stresses need linear materials without NLGEOM"),
    ],
)
def test_initial_stresses_that_mean_nothing_are_refused(
    lines: str, large: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, BAR + FREE_TO_CONTRACT + initial(lines) + step("", large)))


@pytest.mark.parametrize("large", ["", ", NLGEOM"])
def test_of_two_materials_the_one_without_expansion_does_not_grow(tmp_path: Path, large: str) -> None:
    """A bar that is free to expand: its tip moves by what one half expands."""
    text = mesh_cards({"BAR": rectangle((0, 0), (4, 1), (4, 1))}, "CPE4")
    for half, members, heat in (("WARM", "1, 2", "*EXPANSION\n1E-5\n"), ("COLD", "3, 4", "")):
        text += f"*MATERIAL, NAME={half}\n*ELASTIC\n2E5, 0.\n{heat}*ELSET, ELSET={half}\n{members}\n"
        text += f"*SOLID SECTION, ELSET={half}, MATERIAL={half}\n"
    heated = step("*TEMPERATURE\nBAR_Y0, 100.\nBAR_Y1, 100.\n").replace("*STEP", f"*STEP{large}")
    found = read_deck(deck(tmp_path, text + "*BOUNDARY\nBAR_X0, 1\n1, 2\n" + heated))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    assert state.gather_displacement("BAR")[:, 0].max() == pytest.approx(2 * 1e-5 * 100.0, rel=1e-5)
