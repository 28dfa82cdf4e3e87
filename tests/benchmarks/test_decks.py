"""CalculiX's test decks: its files are read as they are written, and answers here are its own.

Decks and reference files are read where Debian's package calculix-ccx-test has put them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.decks.__main__ import summary, table
from benchmarks.decks.calculix import read_dat, read_frd, with_requests
from benchmarks.decks.comparing import Agreement
from benchmarks.decks.refining import refined
from benchmarks.decks.running import FOLDER, Outcome, deck_names, outcome
from fenics_contact.decks import read_deck
from fenics_contact.gallery import block
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.quality import volume
from tests.decks.texts import STEEL, deck, mesh_cards

installed = pytest.mark.skipif(not FOLDER.is_dir(), reason="needs Debian's package calculix-ccx-test")

#: Decks without contact within 0.1 %, decks with contact that are solved, and those of them within 1 %.
CLOSE, TOUCHING, NEAR = 65, 21, 17

DAT = """
 displacements (vx,vy,vz) for set NALL and time  0.5000000E+00

         1  1.000000E-03 -2.000000E-04  0.000000E+00
        12 -1.000000E-10-1.250000E+00-3.000000-102

 stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set EALL and time  0.5000000E+00

         7   1  1.000000E+00  2.000000E+00  3.000000E+00  4.000000E+00  5.000000E+00  6.000000E+00

 total force (fx,fy,fz) for set FIX and time  0.1000000E+01

        1.000000E+01 -2.000000E+01  0.000000E+00
"""
FRD = """    1C
    2C                             2                                     1
 -1         1 0.00000E+00 0.00000E+00 0.00000E+00
 -3
    1PSTEP                         1           1           1
  100CL  101 1.000000000           2                     0    1           1
 -4  DISP        4    1
 -5  D1          1    2    1    0
 -1         1 1.00000E-03-2.00000E+00 3.00000E+00
 -1        22-1.00000E-03 0.00000E+00 5.00000E-01
 -3
 9999
"""


def test_printed_tables_are_read() -> None:
    moved, stressed, total = read_dat(DAT)
    assert (moved.quantity, moved.place, moved.time) == ("U", "NALL", 0.5)
    assert moved.labels[:, 0].tolist() == [1, 12]
    np.testing.assert_array_equal(moved.values, [[1e-3, -2e-4, 0.0], [-1e-10, -1.25, -3e-102]])
    assert stressed.labels.tolist() == [[7, 1]]
    assert stressed.values.tolist() == [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]
    assert (total.quantity, total.place, total.values.tolist()) == ("RF", "FIX", [[10.0, -20.0, 0.0]])


def test_result_files_are_read() -> None:
    (moved,) = read_frd(FRD)
    assert (moved.quantity, moved.time, moved.labels[:, 0].tolist()) == ("U", 1.0, [1, 22])
    np.testing.assert_array_equal(moved.values, [[1e-3, -2.0, 3.0], [-1e-3, 0.0, 0.5]])


def test_decks_are_asked_for_all_displacements_and_solved_to_the_end() -> None:
    asked = with_requests("*ELEMENT, TYPE=CAX8\n*STATIC,SOLVER=ITERATIVE SCALING\n*End Step\n", True)
    assert asked.splitlines()[1:] == [
        "*STATIC", "*NODE FILE,FREQUENCY=99999,GLOBAL=YES,OUTPUT=2D", "U,RF",
        "*CONTROLS,PARAMETERS=FIELD", "1.E-5,1.E-5", "*End Step",
    ]  # fmt: skip


def test_table_has_what_is_solved_and_what_is_refused_by_reason() -> None:
    found = [
        Outcome("one", False, Agreement(1e-6, 2e-2), 1.0, 0.5),
        Outcome("two", True, refused="two.inp, line 7: *MPC: this card is not known: leave it out"),
        Outcome("three", False, refused="three.inp, line 9: *MPC: this card is not known: leave it out"),
    ]
    text = table(found)
    assert "| one | 1.0e-06 | 2.0e-02 | – | 1.00 | 0.50 |" in text
    assert "| *MPC: this card is not known: leave it out | 2 | two, three |" in text
    assert "without contact: 2 decks, 1 solved, 0 within 0.1 %, 0 within 1 %" in summary(found)


@installed
@pytest.mark.parametrize("name", ["beam8p", "beam10p", "beampset", "achtelp", "planestrain2"])
def test_small_decks_have_the_answers_of_their_reference_files(name: str) -> None:
    found = outcome(FOLDER, name, run=False)
    assert not found.refused
    assert found.agreement.displacement is not None
    assert found.agreement.displacement < 5e-6
    assert found.agreement.stress is not None
    assert found.agreement.stress < 1e-4


@installed
@pytest.mark.slow
def test_as_many_decks_agree_as_before() -> None:
    """Solved decks and those within 0.1 % and 1 %: the numbers must not fall."""
    found = [outcome(FOLDER, name, 300.0) for name in deck_names(FOLDER)]
    assert len(found) > 300
    apart = {each.name: each.agreement.worst for each in found if not each.refused and not each.contact}
    touching = {each.name: each.agreement.worst for each in found if not each.refused and each.contact}
    close = [name for name, worst in apart.items() if worst is not None and worst <= 1e-3]
    near = [name for name, worst in touching.items() if worst is not None and worst <= 1e-2]
    assert len(close) >= CLOSE, sorted(apart.items())
    assert len(touching) >= TOUCHING, sorted(touching)
    assert len(near) >= NEAR, sorted(touching.items())


@pytest.mark.parametrize("element", ["C3D8", "C3D20"])
def test_a_refined_deck_is_the_same_body_with_more_cells(element: str, tmp_path: Path) -> None:
    """Bent by a pressure it comes nearer to the beam of theory."""
    mesh = block((0, 0, 0), (6, 1, 1), (4, 1, 1))
    cards = mesh_cards({"BAR": mesh if element == "C3D8" else quadratic(mesh)}, element)
    middle = "*ELSET, ELSET=ROW, GENERATE\n3, 4\n*NODE\n900, 9., 9., 9.\n"
    loads = "*BOUNDARY\nBAR_X0, 1, 3\n*STEP\n*STATIC\n*DLOAD\n1, P2, 1.\n2, P2, 1.\nROW, P2, 1.\n*END STEP\n"
    text = cards + STEEL + "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n" + middle + loads
    finer = refined(text)
    tips, volumes = [], []
    for words in (text, finer):
        found = read_deck(deck(tmp_path, words))
        (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
        tips.append(state.gather_displacement("BAR")[:, 2].min())
        mesh_of = found.scene.bodies["BAR"].mesh
        volumes.append(volume(mesh_of.points, mesh_of.cells))
        force = state.reactions()["BAR BAR_X0"].force
        np.testing.assert_allclose(force, [0.0, 0.0, 6.0], atol=1e-7)
    np.testing.assert_allclose(volumes, 6.0, rtol=1e-12)
    assert mesh_of.n_cells == 32
    exact = -(6.0**4 / 8.0 * 12.0 + 1.2 * 6.0**2 / 2.0 * 2.6) / 210000.0  # Timoshenko's beam under 1 N/mm
    coarse, fine = (abs(tip - exact) for tip in tips)
    assert fine < 0.7 * coarse


def test_only_hexahedra_are_refined() -> None:
    with pytest.raises(ValueError, match="only hexahedra are cut into eight, the deck has C3D10"):
        refined("*NODE\n1, 0., 0., 0.\n*ELEMENT, TYPE=C3D10\n1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1\n")
