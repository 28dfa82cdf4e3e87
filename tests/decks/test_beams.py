"""Beams of decks, compared with what CalculiX 2.20 prints for the same decks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import Deck, read_deck, run_job
from fenics_contact.decks.shell_motions import ShellMotions
from fenics_contact.readers.deck_assembly import read_cards
from fenics_contact.readers.deck_cards import DeckError
from fenics_contact.readers.deck_shells import read_solid_mesh
from tests.fem.surfaces import grid, node_at
from tests.frd_files import read_frd


def text_of(
    points: Sequence[Sequence[float]],
    members: Sequence[tuple[int, int]],
    held: str,
    loads: str,
    sections: Sequence[str] = ("RECT\n10., 4.\n0., 1., 0.",),
    *,
    kind: str = "B32",
    per: int = 5,
    model: str = "",
    step: str = "*STEP\n*STATIC",
) -> str:
    """Return a deck of straight members of some elements each, in the sets M0, M1, ... with their sections.

    Ends have the numbers of the points from 1; nodes on members follow.
    """
    places, rows, number = [np.array(each, dtype=float) for each in points], [], 0
    width = int(kind[2])  # of B31 1, of B32 2 steps
    for k, (first, last) in enumerate(members):
        inner = np.linspace(0, 1, width * per + 1)[1:-1, None]
        line = [first, *(len(places) + np.arange(len(inner))), last]
        places += [*(places[first] + inner * (places[last] - places[first]))]
        rows.append(f"*ELEMENT, TYPE={kind}, ELSET=M{k}")
        for e in range(per):
            number += 1
            rows.append(
                ", ".join(str(n) for n in [number, *(1 + line[width * e + j] for j in range(width + 1))])
            )
    lines = [
        "*NODE, NSET=NALL",
        *(f"{k + 1}, {x:.10g}, {y:.10g}, {z:.10g}" for k, (x, y, z) in enumerate(places)),
    ]
    lines += [*rows, "*MATERIAL, NAME=M", "*ELASTIC", "200000., 0.3", "*DENSITY", "1."]
    for k in range(len(members)):
        section = sections[k % len(sections)]
        lines.append(f"*BEAM SECTION, ELSET=M{k}, MATERIAL=M, SECTION={section}")
    lines += [model, "*BOUNDARY", held, step, loads, "*NODE PRINT, NSET=NALL", "U"]
    lines += ["*NODE PRINT, NSET=NALL, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join(line for line in lines if line) + "\n"


def solved(folder: Path, text: str) -> tuple[Deck, dict[int, np.ndarray], np.ndarray]:
    """Return the deck, displacements by the numbers of nodes, and the sum of reactions."""
    path = folder / "beam.inp"
    path.write_text(text)
    deck = read_deck(path)
    state = deck.solve(MPI.COMM_WORLD, tolerance=1e-8)[-1]
    moved, reaction = deck.tables(state)
    return deck, {int(row[0]): row[1:] for row in moved.rows}, reaction.rows[-1, 1:]


ALONG_X = ([(0, 0, 0), (100, 0, 0)], [(0, 1)])
CLAMPED = "1, 1, 6"
ROUND = ["CIRC\n10., 10.\n0., 1., 0."]
#: Of a beam of five elements: what is held and loaded, kind, sections, node and what CalculiX prints for it.
CASES: Mapping[str, tuple[str, str, str, Sequence[str] | None, int, tuple[float, float, float]]] = {
    "forces": (
        CLAMPED, "*CLOAD\n5, 3, 100.\n2, 3, 10.\n2, 2, 5.", "B32", None, 2,
        (0, 2.467787e-02, 6.408008e-01),
    ),
    "two points along": (
        CLAMPED, "*CLOAD\n5, 3, 100.\n2, 3, 10.\n2, 2, 5.", "B32R", None, 2,
        (0, 2.473229e-02, 6.458721e-01),
    ),
    "round": (
        CLAMPED, "*CLOAD\n5, 3, 100.\n2, 3, 10.\n2, 2, 5.", "B32", ROUND, 2,
        (0, 1.664863e-02, 7.249280e-02),
    ),
    "round, two points along": (
        CLAMPED, "*CLOAD\n5, 3, 100.\n2, 2, 5.", "B32R", ROUND, 2,
        (0, 1.658942e-02, 3.912460e-02),
    ),
    "moments": (CLAMPED, "*CLOAD\n2, 5, 100.\n6, 6, 50.", "B32", None, 2, (0, 2.358036e-03, -4.569519e-02)),
    "offset": (
        CLAMPED, "*CLOAD\n2, 3, 10.\n2, 2, 5.\n4, 5, 20.", "B32",
        ["RECT, OFFSET1=0.5, OFFSET2=-0.25\n10., 4.\n0., 1., 0."], 2, (0, 2.467787e-02, 2.961185e-01),
    ),
    "pressures": (
        CLAMPED, "*DLOAD\nM0, P1, 1.\nM0, P2, 2.", "B32", None, 2,
        (2.250000e-04, 7.380411e-01, 2.216250e+01),
    ),
    "hinge": (
        "1, 1, 4\n2, 2, 3", "*DLOAD\nM0, GRAV, 10., 0., 0.6, -0.8", "B32", None, 5,
        (0, 3.855662e+00, -3.113159e+01),
    ),
    "rotation given": (
        "1, 1, 6\n2, 5, 5, 0.01\n2, 4, 4, 0.02", "*CLOAD\n5, 3, 10.", "B32", None, 2, (0, 0, -4.852398e-01),
    ),
    "spin": (
        CLAMPED, "*DLOAD\nM0, CENTRIF, 4., 0., 0., 0., 0., 0., 1.", "B32R", None, 2,
        (6.655922e+00, 0, 0),
    ),
    "default direction": (
        CLAMPED, "*CLOAD\n2, 3, 10.\n2, 2, 5.", "B32", ["RECT\n10."], 2,
        (0, 9.811012e-03, 1.962202e-02),
    ),
}  # fmt: skip


def case_text(case: str) -> str:
    held, loads, kind, sections, _, _ = CASES[case]
    return text_of(*ALONG_X, held, loads, sections or ["RECT\n10., 4.\n0., 1., 0."], kind=kind)


@pytest.mark.parametrize("case", CASES)
def test_beams_move_as_calculix_prints(case: str, tmp_path: Path) -> None:
    *_, node, calculix = CASES[case]
    _, moved, _ = solved(tmp_path, case_text(case))
    np.testing.assert_allclose(moved[node], calculix, atol=1e-6 * np.abs(calculix).max())


L_SHAPE = [(0, 0, 0), (0, 0, 100), (100, 0, 100)]
SPACE = [(0, 0, 0), (100, 0, 0), (100, 100, 0), (100, 100, 80)]
SQUARE = ["RECT\n10., 10.\n0., 1., 0."]
TURNED = ["CIRC\n10.\n0., 1., 0.", "CIRC\n10.\n1., 0., 0.", "CIRC\n10.\n1., 0., 0."]
THINNER = ["RECT\n10., 8.\n0., 1., 0.", "RECT\n5., 4.\n0., 1., 0."]
#: Frames: points, members, what is held and loaded, sections, node and what CalculiX prints for it.
FRAMES = {
    "a right angle": (
        L_SHAPE, [(0, 1), (1, 2)], CLAMPED, "3, 3, 10.\n3, 2, 4.", SQUARE, 3,
        (-2.913740e-02, 4.638220e-02, 7.687138e-02),
    ),
    "three in one point": (
        [*L_SHAPE, (-100, 0, 100)], [(0, 1), (1, 2), (1, 3)], CLAMPED, "3, 3, 10.\n4, 2, 5.", SQUARE, 3,
        (-2.913750e-02, -2.944039e-02, 7.687128e-02),
    ),
    "a sharp angle": (
        [(0, 0, 0), (100, 0, -60), (50, 0, 20)], [(0, 1), (1, 2)], CLAMPED, "3, 3, 10.\n3, 2, 5.", SQUARE, 3,
        (1.007344e-02, 2.196310e-02, 9.638968e-03),
    ),
    "in space": (
        SPACE, [(0, 1), (1, 2), (2, 3)], CLAMPED, "4, 1, 10.\n4, 2, 5.\n4, 3, 3.", TURNED,
        4, (2.603374e-01, 5.354946e-03, -5.350449e-02),
    ),
    "a joint held, with a force and a moment": (
        L_SHAPE, [(0, 1), (1, 2)], "1, 1, 6\n2, 2, 2", "2, 1, 7.\n2, 5, 100.\n3, 6, 10.",
        ["RECT, OFFSET1=0.5, OFFSET2=-0.25\n10., 8.\n0., 1., 0."], 3,
        (3.255294e-02, -2.746501e-03, -5.199343e-02),
    ),
    "offsets at a joint": (
        L_SHAPE, [(0, 1), (1, 2)], CLAMPED, "3, 3, 10.\n3, 2, 4.\n3, 1, 100.",
        ["RECT, OFFSET1=0.5, OFFSET2=-0.25\n10., 8.\n0., 1., 0."], 3,
        (3.331351e-01, 7.151490e-02, -4.472542e-01),
    ),
    "a step of sections": (
        [(0, 0, 0), (100, 0, 0), (200, 0, 0)], [(0, 1), (1, 2)], CLAMPED, "3, 3, 10.\n3, 2, 5.", THINNER, 3,
        (0, 2.712098e-01, 8.409294e-01),
    ),
    "elements that start at their common node": (
        [(0, 0, 0), (100, 0, 0), (200, 0, 0)], [(0, 1), (2, 1)], CLAMPED, "3, 3, 10.\n3, 2, 5.", SQUARE, 3,
        (0, 7.710814e-02, 1.542163e-01),
    ),
}  # fmt: skip


def frame_text(case: str) -> str:
    points, members, held, loads, sections, _, _ = FRAMES[case]
    return text_of(points, members, held, f"*CLOAD\n{loads}", sections, per=3)


@pytest.mark.parametrize("case", FRAMES)
def test_joints_of_beams_are_those_of_calculix(case: str, tmp_path: Path, caplog) -> None:
    *_, node, calculix = FRAMES[case]
    text = frame_text(case)
    deck, moved, reaction = solved(tmp_path, text)
    np.testing.assert_allclose(moved[node], calculix, atol=1e-6 * np.abs(calculix).max())
    assert len(deck.scene.bodies) == len(FRAMES[case][1])
    forces = [line.split(", ") for line in FRAMES[case][3].splitlines()]
    given = [sum(float(f) for _, way, f in forces if int(way) == k) for k in (1, 2, 3)]
    np.testing.assert_allclose(reaction, -np.array(given), atol=1e-5)
    assert "overlap" not in caplog.text
    with pytest.raises(DeckError, match=r"meet in a knot at node \d+, .*leave NLGEOM out"):
        solved(tmp_path, text.replace("*STEP", "*STEP, NLGEOM"))


def test_joints_in_a_plane_stretch_in_two_ways(tmp_path: Path) -> None:
    """Those of members one after the other; others have one uniform stretch."""
    for case, count in (("a step of sections", 8), ("a right angle", 7)):
        (tmp_path / "beam.inp").write_text(frame_text(case))
        mesh = read_solid_mesh(read_cards(tmp_path / "beam.inp"))
        motions = ShellMotions.of(mesh.shells, mesh.points)
        assert motions.is_knot.sum() == 1
        assert motions.joints.shape[0] == 48 - count
        field = mesh.points - mesh.points[1]
        assert np.abs(motions.joints @ field.ravel()).max() < 1e-12
        field[:, [0, 2]] = 0.0
        assert (np.abs(motions.joints @ field.ravel()).max() < 1e-12) == (count == 8)


def test_a_lattice_of_slender_single_bars_is_solved(tmp_path: Path) -> None:
    """Bending has 1e-8 of the energy of other motions: in single precision their stiffness is indefinite."""
    corners = [(x, y, z) for x in (0, 10) for y in (0, 10) for z in (0, 10)]
    _, moved, _ = solved(tmp_path, lattice_text(corners))
    np.testing.assert_allclose(moved[8], LATTICE, atol=2e-6 * np.abs(LATTICE).max())


def lattice_text(points: Sequence[tuple[int, int, int]]) -> str:
    """Bars between all points."""
    bars = list(combinations(range(len(points)), 2))
    section = ["RECT\n0.5, 0.2\n-0.15433221, -0.83205029, 0.55470020"]
    last = len(points)
    held = "1, 1, 3\n2, 1, 3\n3, 1, 3"
    return text_of(points, bars, held, f"*CLOAD\n{last}, 3, 1.\n{last}, 2, 0.7", section, kind="B32R", per=1)


#: What CalculiX prints for the last corner of the lattice.
LATTICE = (-1.147097e-03, 8.633033e-04, 1.110619e-03)


def test_members_that_leave_a_node_in_one_direction_have_sections_of_their_own(tmp_path: Path) -> None:
    """CalculiX lets all three share one, here no more than two cells have a face in common."""
    points = [(0, 0, 0), (100, 0, 0), (200, 0, 0)]
    text = text_of(points, [(0, 1), (1, 2), (0, 2)], CLAMPED, "*CLOAD\n3, 3, 1.", per=2)
    deck, moved, _ = solved(tmp_path, text)
    assert len(deck.scene.bodies) == 2
    sags = []
    for members in ([(0, 1), (1, 2)], [(0, 1)]):
        ends = points if len(members) == 2 else points[::2]
        load = f"*CLOAD\n{len(ends)}, 3, 1."
        sags.append(solved(tmp_path, text_of(ends, members, CLAMPED, load, per=2))[1][len(ends)][2])
    assert moved[3][2] == pytest.approx(1 / (1 / sags[0] + 1 / sags[1]), rel=0.02)


def ring_text() -> str:
    """A quarter of a ring, symmetric at both ends."""
    turn = np.linspace(0, np.pi / 2, 13)
    ring = np.round(np.column_stack([100 * np.cos(turn), 0 * turn, 100 * np.sin(turn)]), 8)
    text = text_of([*ring], [], "1, 2, 6\n13, 1, 2\n13, 4, 6", "*CLOAD\n13, 3, -0.5")
    lines = "".join(f"{k}, {2 * k - 1}, {2 * k}, {2 * k + 1}\n" for k in range(1, 7))
    section = "*BEAM SECTION, ELSET=R, MATERIAL=M, SECTION=RECT\n4., 2.\n0., 1., 0.\n"
    text = text.replace("*MATERIAL", f"*ELEMENT, TYPE=B32R, ELSET=R\n{lines}*MATERIAL")
    return text.replace("*BOUNDARY", section + "*BOUNDARY")


#: What CalculiX prints for the end of the ring.
RING = 0.1320222


def test_frames_are_solved_sharply_by_default(tmp_path: Path) -> None:
    (tmp_path / "beam.inp").write_text(frame_text("in space"))
    deck = read_deck(tmp_path / "beam.inp")
    assert deck.problem(MPI.COMM_WORLD).tolerance == 1e-6
    assert deck.problem(MPI.COMM_WORLD, tolerance=1e-3).tolerance == 1e-3


def test_a_cantilever_and_a_ring_have_the_deflections_of_theory(tmp_path: Path) -> None:
    """A slender one, and a quarter of a ring of radius 100, pinched at the end of its diameter.

    With Poisson's ratio 0.3 CalculiX's elements, and so these, are 0.8 % stiffer by 20 along the cantilever.
    """
    text = text_of(*ALONG_X, CLAMPED, "*CLOAD\n2, 3, 1.", ["RECT\n2., 1.\n0., 1., 0."], kind="B32R", per=20)
    _, moved, _ = solved(tmp_path, text)
    assert moved[2][2] == pytest.approx(10.0 * 0.9918, rel=1e-4)
    _, moved, _ = solved(tmp_path, text.replace("200000., 0.3", "200000., 0."))
    assert moved[2][2] == pytest.approx(100.0**3 / (3 * 2e5 * 2 / 12) + 120 / (1e5 * 2), rel=1e-4)
    _, moved, _ = solved(tmp_path, ring_text())
    assert moved[13][2] == pytest.approx(-RING, rel=1e-5)
    _, moved, _ = solved(tmp_path, ring_text().replace("200000., 0.3", "200000., 0."))
    assert moved[13][2] == pytest.approx(-0.5e6 * (np.pi / 4 - 2 / np.pi) / (2e5 * 32 / 12), rel=0.004)


def test_a_moment_about_an_oblique_axis_bends_about_that_axis_alone(tmp_path: Path) -> None:
    """CalculiX 2.20 bends a square beam with axes turned by 22.5 degrees as much about the other one."""
    section = ["RECT\n10., 10.\n0., 0.9238795, 0.3826834"]
    _, moved, _ = solved(tmp_path, text_of(*ALONG_X, CLAMPED, "*CLOAD\n2, 5, 100.", section))
    np.testing.assert_allclose(moved[2], (0, 0, -2.9525e-3), atol=2e-6)


@pytest.mark.parametrize("kind", ["B31", "B31R"])
def test_linear_beams_get_midpoints_and_bend_as_quadratic_ones(kind: str, tmp_path: Path) -> None:
    """CalculiX's own have 0.3089 and 0.8597 for the 0.3014 of B32R."""
    load = "*CLOAD\n2, 3, 10."
    deck, moved, _ = solved(tmp_path, text_of(*ALONG_X, CLAMPED, load, kind=kind))
    assert any(f"{kind} get nodes in the middle of their edges" in note for note in deck.notes)
    _, other, _ = solved(tmp_path, text_of(*ALONG_X, CLAMPED, load, kind="B32R"))
    assert moved[2][2] == pytest.approx(other[2][2], rel=1e-6)
    assert sorted(moved) == [1, 2, 3, 4, 5, 6]


def with_shells() -> str:
    """A plate, clamped at one end, with a beam under its middle."""
    points, facets, at = grid(4, 2, lambda w: w @ np.array([[40.0, 0, 0], [0, 20.0, 0]]))
    used = np.unique(facets)
    line = [node_at(at, k / 8, 0.5) + 1 for k in range(9)]
    lines = ["*NODE, NSET=NALL", *(f"{k + 1}, {', '.join(map(repr, points[k].tolist()))}" for k in used)]
    lines += ["*ELEMENT, TYPE=S8R, ELSET=PLATE"]
    lines += [", ".join(map(str, [k + 1, *(row + 1)])) for k, row in enumerate(facets)]
    lines += ["*ELEMENT, TYPE=B32, ELSET=BEAM"]
    lines += [f"{100 + k}, {line[2 * k]}, {line[2 * k + 1]}, {line[2 * k + 2]}" for k in range(4)]
    lines += [
        "*MATERIAL, NAME=M",
        "*ELASTIC",
        "200000., 0.3",
        "*SHELL SECTION, ELSET=PLATE, MATERIAL=M",
        "1.",
    ]
    lines += ["*BEAM SECTION, ELSET=BEAM, MATERIAL=M, SECTION=RECT", "4., 2.", "0., 0., 1.", "*BOUNDARY"]
    lines += [f"{k + 1}, 1, 6" for k in used if points[k, 0] == 0]
    lines += ["*STEP", "*STATIC", "*CLOAD", f"{node_at(at, 1, 0.5) + 1}, 3, 10.", "*DLOAD", "PLATE, P, 0.01"]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*NODE PRINT, NSET=NALL, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"


def test_beams_stiffen_shells_at_common_nodes(tmp_path: Path) -> None:
    _, moved, reaction = solved(tmp_path, with_shells())
    np.testing.assert_allclose(max(each[2] for each in moved.values()), SHELLS, rtol=1e-5)
    np.testing.assert_allclose(reaction, (0, 0, -18), atol=1e-6)


#: The largest deflection of the plate with a beam that CalculiX prints.
SHELLS = 8.550560e-02


def with_solids() -> str:
    """Two blocks, held at their far ends, with a beam between, which may turn at both."""
    box = np.array([[x, y, z] for z in (0, 20) for x, y in ((0, 0), (20, 0), (20, 20), (0, 20))], dtype=float)
    points = [*box, *(box + np.array([120.0, 0, 0]))]
    text = text_of(
        points, [(5, 12)], "", "*CLOAD\n18, 3, 10.\n18, 2, 7.", ["RECT\n5., 4.\n0., 1., 0."], per=2
    )
    ends = "".join(f"{k}, 1, 3\n" for k in (1, 4, 5, 8, 10, 11, 14, 15)) + "18, 4\n"
    blocks = "*ELEMENT, TYPE=C3D8, ELSET=S\n101, 1, 2, 3, 4, 5, 6, 7, 8\n102, 9, 10, 11, 12, 13, 14, 15, 16\n"
    blocks += "*SOLID SECTION, ELSET=S, MATERIAL=M\n"
    return text.replace("*BOUNDARY\n", f"{blocks}*BOUNDARY\n{ends}")


def test_beams_hang_on_solids_as_by_hinges(tmp_path: Path) -> None:
    deck, moved, reaction = solved(tmp_path, with_solids())
    np.testing.assert_allclose(moved[18], SOLIDS, atol=1e-3 * np.abs(SOLIDS).max())
    np.testing.assert_allclose(reaction, (0, -7, -10), atol=1e-6)
    assert any("2 nodes of shells or beams are of solids, too" in note for note in deck.notes)


#: What CalculiX prints for the middle of a beam between two blocks.
SOLIDS = (0, 1.322706e-02, 2.879898e-02)


def test_large_deflections_are_those_of_calculix(tmp_path: Path) -> None:
    load = "*CLOAD\n2, 3, 100."
    text = text_of(*ALONG_X, CLAMPED, load, step="*STEP, NLGEOM\n*STATIC")
    _, moved, _ = solved(tmp_path, text)
    np.testing.assert_allclose(moved[2], LARGE, atol=2e-4 * np.abs(LARGE).max())
    deck, moved, _ = solved(tmp_path, text.replace("B32", "B32R"))
    np.testing.assert_allclose(moved[2], LARGE, atol=2e-4 * np.abs(LARGE).max())
    assert any("integrated in full" in note for note in deck.notes)


#: What CalculiX prints for the end with NLGEOM.
LARGE = (-5.425838e-02, 0, 2.988622e00)


def test_jobs_print_displacements_of_the_nodes_of_beams(tmp_path: Path) -> None:
    _, moved, _ = solved(tmp_path, case_text("forces"))
    files = run_job(tmp_path / "beam.inp", MPI.COMM_SELF, tolerance=1e-8)
    printed = next(each for each in files if each.suffix == ".dat").read_text()
    table = printed[printed.index("displacements") :].split("forces")[0].splitlines()
    rows = [[float(number) for number in line.split()] for line in table if len(line.split()) == 4]
    assert len(rows) == len(moved) == 11
    for number, *values in rows:
        np.testing.assert_allclose(values, moved[int(number)], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("SECTION=RECT", "SECTION=PIPE", "SECTION must be RECT or CIRC, got PIPE: mesh the part with solid"),
        (", SECTION=RECT", "", r"needs the parameter SECTION="),
        ("\n10., 4.\n", "\n10., 0.\n", "size along directions 1 and 2 must be above zero, got 10 and 0"),
        ("\n10., 4.\n0., 1., 0.", "", "size along directions 1 and 2 must be above zero, got none"),
        ("\n0., 1., 0.\n", "\n0., 0., 0.\n", "direction 1 must be a vector, got '0., 0., 0.'"),
        (
            "\n0., 1., 0.\n",
            "\n1., 0., 0.\n",
            "element 1 has no length, or lies along direction 1 of its section",
        ),
        ("*BEAM SECTION", "*SOLID SECTION", r"the parameter SECTION is not read"),
        ("*STEP\n", "*SURFACE, NAME=W\nPART,\n*STEP\n", r"needs a face S1, S2, ... .*, got 'nothing'"),
        ("*BEAM SECTION, ELSET=M0", "*BEAM SECTION, ELSET=PART", r"element 2 has no \*BEAM SECTION with its"),
        ("*BEAM SECTION", "*BEAM GENERAL SECTION", "pipes and boxes are not solved here"),
        ("TYPE=B32", "TYPE=B33", r"elements of type B33, beams, are not supported: .* beams \(B31, B32\)"),
        ("*CLOAD", "*DLOAD\nM0, P3, 1.\n*CLOAD", "C3D20 has 6 faces, got 'P3'"),
        ("MATERIAL=M, SECTION", "MATERIAL=M, NODAL THICKNESS, SECTION", "NODALTHICKNESS is not read"),
    ],
)
def test_mistakes_about_beams_are_refused_at_their_lines(old: str, new: str, message: str, tmp_path) -> None:
    text = case_text("forces").replace("*MATERIAL", "*ELSET, ELSET=PART\n1\n*MATERIAL")
    assert old in text
    (tmp_path / "beam.inp").write_text(text.replace(old, new, 1))
    with pytest.raises(DeckError, match=rf"beam.inp, line \d+: .*{message}"):
        read_deck(tmp_path / "beam.inp")


@pytest.mark.parametrize("direction", ["\n0., 1., 0.", ""])
def test_sections_in_parts_turn_with_their_instances(direction: str, tmp_path: Path) -> None:
    text = case_text("default direction").replace("RECT\n10.", f"RECTANGULAR\n10., 4.{direction}")
    moved = solved(tmp_path, text)[1][2]
    model, steps = text.split("*BOUNDARY")
    mesh, material = model.split("*MATERIAL")
    material, section = material.split("*BEAM")
    where = "*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n"
    where += "0., 0., 0.\n0., 0., 0., 1., 0., 0., 90.\n*END INSTANCE\n*NSET, NSET=NALL, INSTANCE=I\n1, 2\n"
    steps = steps.replace("1, 1, 6", "I.1, 1, 6").replace("2, 3, 10.\n2, 2, 5.", "I.2, 2, -10.\nI.2, 3, 5.")
    turned = f"*PART, NAME=P\n{mesh}*BEAM{section}{where}*END ASSEMBLY\n*MATERIAL{material}*BOUNDARY{steps}"
    (tmp_path / "beam.inp").write_text(turned)
    deck = read_deck(tmp_path / "beam.inp")
    table, _ = deck.tables(deck.solve(MPI.COMM_WORLD, tolerance=1e-8)[-1])
    np.testing.assert_allclose(table.rows[1, [1, 3, 2]] * (1, 1, -1), moved, atol=1e-6)


def test_beams_along_the_default_direction_need_another_one(tmp_path: Path) -> None:
    text = text_of([(0, 0, 0), (0, 0, 100)], [(0, 1)], CLAMPED, "*CLOAD\n2, 1, 1.", ["RECT\n10., 4."])
    with pytest.raises(
        DeckError, match=r"beam.inp, line \d+: .*element 1 has no length, .* by default: give"
    ):
        solved(tmp_path, text)


def test_files_have_beams_with_their_own_nodes(tmp_path: Path) -> None:
    """With OUTPUT=2D as CalculiX 2.20 writes them: type 12, its ends, then the node in the middle."""
    loads = "*CLOAD\n2, 3, 100.\n*NODE FILE, OUTPUT=2D\nU, RF\n*EL FILE, SECTION FORCES\nS"
    path, notes = tmp_path / "beam.inp", list[str]()
    path.write_text(text_of(*ALONG_X, CLAMPED, loads))
    run_job(path, MPI.COMM_SELF, note=notes.append)
    found, (_, moved, _) = read_frd(path.with_suffix(".frd")), solved(tmp_path, path.read_text())
    middle = [(12, [n, n + 2, n + 1]) for n in (4, 6, 8)]
    assert list(found.cells.values()) == [(12, [1, 4, 3]), *middle, (12, [10, 2, 11])]
    written = found.block("DISP").values
    np.testing.assert_allclose([written[n] for n in moved], [*moved.values()], rtol=1e-4, atol=1e-6)
    assert sum(found.block("FORC").at([*moved])[:, 2]) == pytest.approx(0.0, abs=1e-3)
    assert any("SECTION FORCES not written" in each for each in notes)
