"""Shells of decks, compared with what CalculiX 2.20 prints for the same decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import read_deck, run_job
from fenics_contact.readers.deck_cards import DeckError
from tests.decks.plates import (
    BESIDE,
    CLAMPED,
    FIXED,
    FREE,
    HINGED,
    MIDDLE,
    PLATE,
    TIP,
    solved,
    text_of,
    triangles,
    two_planes,
)  # fmt: skip
from tests.fem.surfaces import grid, node_at

TURNED = "*TRANSFORM, NSET=NALL\n1., 1., 0., -1., 1., 0."
#: What is held and loaded, the section, the node and what CalculiX prints for it.
CASES = {
    "force at a corner": (CLAMPED, f"*CLOAD\n{TIP + 1}, 3, 1000.", "", TIP, (0, 0, 9.475214e-01)),
    "force between corners": (CLAMPED, f"*CLOAD\n{BESIDE + 1}, 3, 1000.", "", BESIDE, (0, 0, 9.712999e-01)),
    "moment at a corner": (CLAMPED, f"*CLOAD\n{TIP + 1}, 5, 1000.", "", TIP, (0, 0, -3.677770e-02)),
    "moment between corners": (CLAMPED, f"*CLOAD\n{BESIDE + 1}, 5, 1000.", "", BESIDE, (0, 0, -3.714207e-02)),
    "force in the plane": (CLAMPED, f"*CLOAD\n{TIP + 1}, 1, 1000.", "", TIP, (3.847797e-03, 0, 0)),
    "hinges": (HINGED, "*DLOAD\nALL, P, 1.", "", MIDDLE, (1.590130e-05, 0, 3.070005e-02)),
    "offset": (
        HINGED, "*DLOAD\nALL, P, 1.", ", OFFSET=0.5", MIDDLE, (1.590130e-05, 0, 3.070005e-02),
    ),
    "rotation held": (
        [(FIXED, "1, 3"), (FIXED, "5, 5")], "*DLOAD\nALL, P, 1.", "", TIP, (3.074983e-05, 0, 2.788523e-01),
    ),
    "rotation given": (
        [(FIXED, "1, 6"), (FREE, "5, 5, 0.01")], "*DLOAD\nALL, P, 1.", "", TIP,
        (3.074983e-05, 0, -1.039210e-01),
    ),
    "clamped along turned axes": (
        [(FIXED, "1, 6"), (FREE, "3, 3")], "*DLOAD\nALL, P, 1.", TURNED,
        MIDDLE, (1.566196e-05, 0, 1.231190e-02),
    ),
    "weight, end lifted": (
        [(FIXED, "1, 6"), (FREE, "3, 3, 0.1")], "*DLOAD\nALL, GRAV, 10., 0., 0., -1.", "",
        MIDDLE, (0, 0, -4.426520e-01),
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("case", CASES)
def test_plates_move_as_calculix_prints(case: str, tmp_path: Path) -> None:
    held, loads, section, node, calculix = CASES[case]
    model, section = (section, "") if section == TURNED else ("", section)
    _, moved, _ = solved(tmp_path, text_of(PLATE[0], {"S8R": PLATE[1]}, held, loads, section, model=model))
    np.testing.assert_allclose(moved[node], calculix, atol=1e-5 * np.abs(calculix).max())


@pytest.mark.parametrize(
    ("given", "offset"), [("0.5", 0.5), ("-0.5", -0.5), ("0.2", 0.2), ("SNEG", -0.5), ("SPOS", 0.5)]
)
def test_nodes_are_off_the_middle_of_a_shell(given: str, offset: float, tmp_path: Path) -> None:
    """At 0.5 they are on its top, as CalculiX writes the nodes of the solid: z from -4 to 0."""
    (tmp_path / "shell.inp").write_text(
        text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, "*DLOAD\nALL, P, 1.", f", OFFSET={given}")
    )
    (body,) = read_deck(tmp_path / "shell.inp").scene.bodies.values()
    across = body.mesh.points[:, 2]
    np.testing.assert_allclose([across.min(), across.max()], [-4 * (offset + 0.5), 4 * (0.5 - offset)])


def test_edges_of_shells_are_named_as_in_abaqus_too(tmp_path: Path) -> None:
    ends = []
    for label in ("S4", "E2"):  # behind both sides the edge of the second and third corner
        surface = f"*SURFACE, NAME=EDGE\n8, {label}\n"
        loads = "*DSLOAD\nEDGE, P, 1."
        text = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, loads, model=surface)
        (tmp_path / "shell.inp").write_text(text)
        (mesh,) = (body.mesh for body in read_deck(tmp_path / "shell.inp").scene.bodies.values())
        ends.append(np.unique(mesh.surfaces["EDGE"]))
    np.testing.assert_array_equal(*ends)


def test_turns_about_axes_oblique_to_a_shell_are_noted(tmp_path: Path) -> None:
    """CalculiX's shell7rot gives two components of a turn that has three, and takes them otherwise."""
    cosine = np.sqrt(0.5)
    turn = np.array([[1, 0, 0], [0, cosine, -cosine], [0, cosine, cosine]])
    for points, count in ((PLATE[0], 0), (PLATE[0] @ turn.T, 1)):
        held = [(FIXED, "1, 6"), (FREE, "5, 5, 0.01")]
        (tmp_path / "shell.inp").write_text(text_of(points, {"S8R": PLATE[1]}, held, ""))
        notes = read_deck(tmp_path / "shell.inp").notes
        assert sum("oblique to shells" in each for each in notes) == count


@pytest.mark.parametrize(("kind", "sag"), [("S8", 2.747404e-01), ("S6", 2.757152e-01)])
def test_other_quadratic_shells_have_the_points_of_calculix(kind: str, sag: float, tmp_path: Path) -> None:
    facets = PLATE[1] if kind == "S8" else triangles(PLATE[1], 6)
    deck, moved, _ = solved(tmp_path, text_of(PLATE[0], {kind: facets}, CLAMPED, "*DLOAD\nALL, P, 1."))
    assert moved[TIP][2] == pytest.approx(sag, rel=1e-6)
    assert not deck.notes


@pytest.mark.parametrize("kind", ["S4", "S4R", "S3"])
def test_linear_shells_get_midpoints_and_bend_as_quadratic_ones(kind: str, tmp_path: Path) -> None:
    """CalculiX's own have 0.2875, 3.0329 and 0.1713 for the 0.2772 of S8R."""
    facets = triangles(PLATE[1], 3) if kind == "S3" else PLATE[1][:, :4]
    deck, moved, reaction = solved(tmp_path, text_of(PLATE[0], {kind: facets}, CLAMPED, "*DLOAD\nALL, P, 1."))
    assert moved[TIP][2] == pytest.approx(2.772039e-01, rel=0.02 if kind == "S3" else 2e-5)
    np.testing.assert_allclose(reaction, (0, 0, -800), atol=1e-6)
    assert any(f"{kind} get nodes in the middle of their edges" in note for note in deck.notes)
    assert sorted(moved) == np.unique(facets).tolist()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("beyond", "direction", "calculix"),
    [(0.0, 3, 0.2710347), (0.0, 2, 0.1263392), (50.0, 3, 0.2707641), (50.0, 2, 0.1232291)],
)
def test_shells_that_meet_at_right_angles_are_joined_as_by_knots(
    beyond, direction, calculix, tmp_path, caplog
) -> None:
    points, facets, _ = two_planes(beyond)
    root, tip = np.flatnonzero(points[:, 2] == 0), np.flatnonzero(points[:, 0] == 100)
    loads = "*CLOAD\n" + "\n".join(f"{k + 1}, {direction}, 1." for k in tip if k in facets["S8R"])
    _, moved, reaction = solved(tmp_path, text_of(points, facets, [(root, "1, 6")], loads))
    corner = next(k for k in tip if k in moved)
    assert moved[corner][direction - 1] == pytest.approx(calculix, rel=1e-6)
    assert reaction[direction - 1] == pytest.approx(-9.0, rel=1e-6)
    assert "overlap" not in caplog.text


def test_a_knot_is_held_and_loaded_as_one_piece(tmp_path: Path) -> None:
    points, facets, above = two_planes(0.0)
    root, tip = np.flatnonzero(points[:, 2] == 0), np.flatnonzero(points[:, 0] == 100)
    used = np.unique(facets["S8R"])
    knots = np.intersect1d(above[points[above, 0] == 0], used)
    loads = "*CLOAD\n" + "\n".join(f"{k + 1}, 3, 1." for k in tip if k in used)
    loads += f"\n{knots[0] + 1}, 5, 100.\n{knots[1] + 1}, 1, 3."
    text = text_of(points, facets, [(root, "1, 6"), (knots, "2, 2")], loads)
    _, _, reaction = solved(tmp_path, text)
    np.testing.assert_allclose(reaction, (-3, 0, -9), atol=1e-7)
    with pytest.raises(DeckError, match=r"shells or beams meet in a knot at node \d+, .*leave NLGEOM out"):
        solved(tmp_path, text.replace("*STEP", "*STEP, NLGEOM"))


def cylinder(side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An eighth of a cylinder of radius 300 and length 600."""

    def place(w: np.ndarray) -> np.ndarray:
        turn = np.pi / 2 * w[:, 0]
        return np.column_stack([300 * np.sin(turn), 300 * w[:, 1], 300 * np.cos(turn)])

    points, facets, at = grid(side, side, place)
    return points, facets[:, [0, 3, 2, 1, 7, 6, 5, 4]], at


def test_a_pinched_cylinder_has_the_deflection_of_calculix(tmp_path: Path) -> None:
    points, facets, at = cylinder(8)
    left, right, end, middle = (np.flatnonzero(at[:, k] == v) for k in (0, 1) for v in (0, 1))
    flat = at[middle, 0] <= 0.5
    held = [(end, "1, 1"), (end, "3, 3"), (left, "1, 1"), (left, "5, 5"), (middle, "2, 2")]
    held += [(middle[flat], "4, 4"), (middle[~flat], "6, 6"), (right, "3, 3"), (right, "5, 5")]
    loads = f"*CLOAD\n{node_at(at, 0, 1) + 1}, 3, -0.25"
    text = text_of(points, {"S8R": facets}, held, loads, thick=3.0, law="3e6, 0.3")
    _, moved, reaction = solved(tmp_path, text)
    assert moved[node_at(at, 0, 1)][2] == pytest.approx(-1.773729e-05, rel=1e-5)
    assert reaction[2] == pytest.approx(0.25, rel=1e-6)


def test_rotations_about_normals_are_left_free(tmp_path: Path) -> None:
    """Held together, rotations 4 and 6 of a curved edge make CalculiX 2.20 give 0.13 of the deflection."""
    top = np.radians(40)
    points, facets, at = grid(
        8,
        8,
        lambda w: np.column_stack([25 * np.sin(top * w[:, 0]), 25 * w[:, 1], 25 * np.cos(top * w[:, 0])]),
    )
    left, _, end, middle = (np.flatnonzero(at[:, k] == v) for k in (0, 1) for v in (0, 1))
    held = [(end, "1, 1"), (end, "3, 3"), (left, "1, 1"), (left, "5, 5"), (middle, "2, 2"), (middle, "4, 4")]
    weight = "*DLOAD\nALL, GRAV, 360., 0., 0., -1."
    for more in ([], [(middle, "6, 6")]):
        turned = facets[:, [0, 3, 2, 1, 7, 6, 5, 4]]
        text = text_of(points, {"S8R": turned}, held + more, weight, thick=0.25, law="4.32e8, 0.")
        deck, moved, _ = solved(tmp_path, text)
        assert moved[node_at(at, 1, 1)][2] == pytest.approx(-0.3019568, rel=1e-5)
        assert any("rotations about the normals" in note for note in deck.notes) == bool(more)


def test_shells_that_face_opposite_ways_are_one_plate(tmp_path: Path) -> None:
    facets = PLATE[1].copy()
    facets[::2] = facets[::2][:, [0, 3, 2, 1, 7, 6, 5, 4]]
    loads = f"*CLOAD\n{TIP + 1}, 3, 1000."
    deck, moved, _ = solved(tmp_path, text_of(PLATE[0], {"S8R": facets}, CLAMPED, loads))
    assert list(deck.scene.bodies) == ["ALL"]
    assert moved[TIP][2] == pytest.approx(9.475214e-01, rel=1e-6)


def test_thickness_of_nodes_and_steps_of_thickness(tmp_path: Path) -> None:
    """Of two plates, one after the other, the thinner one bends more; their middles are in one plane."""
    load = f"*CLOAD\n{TIP + 1}, 3, 1000."
    thick = "*NODAL THICKNESS\nNALL, 4."
    text = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, load, ", NODAL THICKNESS", model=thick)
    _, moved, _ = solved(tmp_path, text)
    assert moved[TIP][2] == pytest.approx(9.475214e-01, rel=1e-6)
    inner = "*ELSET, ELSET=END\n5, 6, 7, 8\n*SHELL SECTION, ELSET=END, MATERIAL=M\n2."
    deck, moved, _ = solved(tmp_path, text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, load, model=inner))
    assert len(deck.scene.bodies) == 2
    assert moved[TIP][2] == pytest.approx(THINNER, rel=1e-4)


#: What CalculiX prints where the outer half of the plate is 2 thick.
THINNER = 1.775730


def test_local_axes_and_reactions_of_hinged_nodes(tmp_path: Path) -> None:
    """Their sum is the load, whatever the axes along which they are held."""
    for model in ("", "*TRANSFORM, NSET=NALL\n1., 1., 0., -1., 1., 0."):
        text = text_of(PLATE[0], {"S8R": PLATE[1]}, HINGED, "*DLOAD\nALL, P, 1.", model=model)
        text = text.replace("NSET=NALL, TOTALS=ONLY", "NSET=NALL, TOTALS=YES")
        (tmp_path / "shell.inp").write_text(text)
        deck = read_deck(tmp_path / "shell.inp")
        state = deck.solve(MPI.COMM_WORLD, tolerance=1e-10)[-1]
        _, reaction = deck.tables(state)
        held = {int(row[0]) - 1 for row in reaction.rows[:-1] if np.abs(row[1:]).max() > 1e-3}
        assert held <= set(FIXED.tolist()) | set(FREE.tolist())
        np.testing.assert_allclose(reaction.rows[-1, 1:], (0, 0, -800), atol=1e-6)


@pytest.mark.filterwarnings("ignore")
def test_sides_of_shells_touch_and_are_pressed(tmp_path: Path) -> None:
    """Two clamped plates, one on the other: the pressed one hands half of the load on."""
    points = np.vstack([PLATE[0], PLATE[0] + [0, 0, -4.0]])
    facets = {"S8R": np.vstack([PLATE[1], PLATE[1] + len(PLATE[0])])}
    held = [(np.concatenate([FIXED, FREE, FIXED + len(PLATE[0]), FREE + len(PLATE[0])]), "1, 6")]
    model = "*ELSET, ELSET=UP, GENERATE\n1, 8\n*ELSET, ELSET=LOW, GENERATE\n9, 16\n"
    model += "*SURFACE, NAME=SU\nUP, SNEG\n*SURFACE, NAME=SL\nLOW, SPOS\n"
    model += "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE\nSU, SL\n"
    model += "*SURFACE INTERACTION, NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
    loads = "*DLOAD\nUP, P2, 1."
    text = text_of(points, facets, held, loads, model=model)
    path = tmp_path / "shell.inp"
    path.write_text(text)
    deck = read_deck(path)
    state = deck.solve(MPI.COMM_WORLD)[-1]
    assert np.median(state.contact.pressure) == pytest.approx(0.5, abs=0.1)
    moved = {int(row[0]) - 1: row[1:] for row in deck.tables(state)[0].rows}
    assert moved[MIDDLE][2] == pytest.approx(moved[MIDDLE + len(PLATE[0])][2], rel=0.02)
    assert moved[MIDDLE][2] < 0


@pytest.mark.filterwarnings("ignore")
def test_shells_hang_on_solids_at_the_nodes_of_these(tmp_path: Path) -> None:
    """A plate between two blocks: their nodes move it, as hinges, and carry its weight."""
    text = text_of(PLATE[0], {"S8R": PLATE[1]}, [], "*DLOAD\nALL, GRAV, 10., 0., 0., -1.")
    root = PLATE[1][PLATE[2][PLATE[1][:, 0], 0] == 0]
    lines, number = [], 1000
    for at, facets in ((-10.0, root[:, [0, 3]]),):
        below = np.unique(facets)
        extra = {}
        for k in below:
            for shift in ((at, 0), (at, -10.0), (0.0, -10.0)):
                number += 1
                extra[k, shift] = number
                x, y, z = PLATE[0][k] + [shift[0], 0, shift[1]]
                lines.append(f"{number}, {x}, {y}, {z}")
        lines.append("*ELEMENT, TYPE=C3D8, ELSET=BLOCK")
        for place, (a, b) in enumerate(facets):
            ring = [(extra[k, (at, -10.0)], extra[k, (0.0, -10.0)], k + 1, extra[k, (at, 0)]) for k in (a, b)]
            lines.append(f"{900 + place}, " + ", ".join(map(str, [*ring[1], *ring[0]])))
    solid = "*NODE\n" + "\n".join(lines) + "\n*SOLID SECTION, ELSET=BLOCK, MATERIAL=M\n"
    held = "*NSET, NSET=FOOT\n" + "\n".join(str(n) for n in extra.values()) + "\n*BOUNDARY\nFOOT, 1, 3\n"
    held += "\n".join(f"{k + 1}, 3" for k in FREE if k in PLATE[1]) + "\n"
    text = text.replace("*STEP", solid + held + "*STEP").replace("*BOUNDARY\n*NODE", "*NODE")
    _, moved, reaction = solved(
        tmp_path,
        text.replace("NALL, TOTALS", "EVERY, TOTALS").replace(
            "*STEP", "*NSET, NSET=EVERY\nNALL, FOOT\n*STEP"
        ),
    )
    np.testing.assert_allclose(reaction, (0, 0, 32000), rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(moved[MIDDLE], (2.900819e-03, 0, -1.241290), atol=1e-6)  # of CalculiX 2.20


PRESSED = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, "*DLOAD\nALL, P, 1.")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("\n4.0\n", "\n0.\n", r"the thickness must be above zero, got 0: give it"),
        ("\n4.0\n", "\n", r"the thickness must be above zero, got none: give it"),
        ("\n4.0\n", "\n1e-9\n", r"element 1 is 10 long and 1e-09 thick: it bends within rounding"),
        ("*SHELL SECTION, ELSET=ALL, MATERIAL=M\n4.0\n", "", r"element 1 has no \*SHELL SECTION"),
        ("*SHELL SECTION", "*SOLID SECTION", r"element 1 has no \*SHELL SECTION"),
        ("MATERIAL=M\n4.0", "MATERIAL=M, NODAL THICKNESS\n4.0", r"node \d+ has no \*NODAL THICKNESS"),
        ("*DLOAD", "*TEMPERATURE\nNALL, 20., 5.\n*DLOAD", "gradients of temperature across shells"),
        ("ALL, P, 1.", "ALL, P9, 1.", r"C3D20R has 6 faces, got 'P9'"),
        ("*DLOAD", "*CLOAD\n43, 6, 1.\n*DLOAD", r"node 43 has a moment about the normal of its shell"),
        ("*STEP\n", "*BOUNDARY\n43, 6, 6, 0.1\n*STEP\n", r"a rotation about the normal of a shell cannot"),
        ("*DLOAD", "*BOUNDARY\n43, 3\n*DLOAD", ""),
        (
            "*END STEP\n",
            "*END STEP\n*STEP\n*STATIC\n*BOUNDARY\n43, 3\n*END STEP\n",
            r"held alike in all steps",
        ),
        ("*STEP\n", "*SURFACE, NAME=W\nALL,\n*STEP\n", r"needs a face S1, S2, ... .*, got 'nothing'"),
        (
            "*STEP\n",
            "*RIGID BODY, ELSET=ALL, REF NODE=43\n*STEP\n",
            r"node 43 of a shell or beam also drives a surface",
        ),
        ("*STATIC", "*STATIC\n*CLOAD\n43, 5, 1.", ""),
    ],
)
def test_mistakes_about_shells_are_refused_at_their_lines(old: str, new: str, message: str, tmp_path) -> None:
    path = tmp_path / "shell.inp"
    path.write_text(PRESSED.replace(old, new, 1))
    if not message:
        read_deck(path)
        path.write_text(path.read_text().replace("*STEP\n", "*STEP, NLGEOM\n", 1))
        message = "with NLGEOM rotations and moments of nodes of shells" if "43, 5" in new else ""
    if message:
        with pytest.raises(DeckError, match=rf"shell.inp, line \d+: .*{message}"):
            read_deck(path)
    else:
        assert read_deck(path).scene.bodies


def test_thickness_of_nodes_that_no_section_names_has_no_effect(tmp_path: Path) -> None:
    path = tmp_path / "shell.inp"
    path.write_text(PRESSED.replace("*BOUNDARY", "*NODAL THICKNESS\nNALL, 2.\n*BOUNDARY", 1))
    deck = read_deck(path)
    assert any("has no effect, as in CalculiX" in note for note in deck.notes)
    assert np.ptp(deck.scene.bodies["ALL"].mesh.points[:, 2]) == pytest.approx(4.0)


def test_a_row_of_single_shells_is_stabilised(tmp_path: Path) -> None:
    """0.98782 of beam theory with shear, as CalculiX has it."""
    points, facets, at = grid(20, 1, lambda w: w @ np.array([[100.0, 0, 0], [0, 10.0, 0]]))
    root, end = np.flatnonzero(at[:, 0] == 0), np.flatnonzero((at[:, 0] == 1) & (at[:, 1] != 0.5))
    loads = (
        "*CLOAD\n"
        + "\n".join(f"{k + 1}, 3, {1 / 6}" for k in end)
        + f"\n{node_at(at, 1, 0.5) + 1}, 3, {4 / 6}"
    )
    deck, moved, _ = solved(tmp_path, text_of(points, {"S8R": facets}, [(root, "1, 6")], loads, thick=10.0))
    assert deck.scene.bodies["ALL"].integration == "stabilised"
    theory = 1e6 / (3 * 2e5 * 1e4 / 12) + 120 / (2e5 / 2.6 * 100)
    assert moved[node_at(at, 1, 0.5)][2] / theory == pytest.approx(0.98782, abs=1e-4)


@pytest.mark.parametrize("kinds", [("S8R", "S6"), ("S4", "S3")])
def test_quadrilaterals_and_triangles_are_joined(kinds: tuple[str, str], tmp_path: Path) -> None:
    """CalculiX locks with S3."""
    widths = [{"S8R": 8, "S6": 6, "S4": 4, "S3": 3}[kind] for kind in kinds]
    facets = PLATE[1][:4, : widths[0]], triangles(PLATE[1], 8)[[4, 5, 6, 7, 12, 13, 14, 15], : widths[1]]
    text = text_of(PLATE[0], dict(zip(kinds, facets, strict=True)), CLAMPED, "*DLOAD\nALL, P, 1.")
    deck, moved, reaction = solved(tmp_path, text)
    assert [body.integration for body in deck.scene.bodies.values()] == ["reduced", "reduced"]
    assert moved[TIP][2] == pytest.approx(2.770060e-01, rel=1e-6)
    np.testing.assert_allclose(reaction, (0, 0, -800), atol=1e-6)


def test_equations_link_nodes_of_shells(tmp_path: Path) -> None:
    model = f"*EQUATION\n2\n{TIP + 1}, 3, 1., {MIDDLE + 1}, 3, -2."
    _, moved, _ = solved(
        tmp_path, text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, "*DLOAD\nALL, P, 1.", model=model)
    )
    np.testing.assert_allclose(moved[MIDDLE], (1.590130e-05, 0, 7.864884e-02), atol=1e-7)
    np.testing.assert_allclose(moved[TIP], (3.074983e-05, 0, 1.570886e-01), atol=1e-7)


def test_jobs_print_displacements_of_the_nodes_of_shells(tmp_path: Path) -> None:
    """Their numbers are not in the mesh of the results, which has those across the thickness."""
    text = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, "*DLOAD\nALL, P, 1.")
    deck, moved, _ = solved(tmp_path, text)
    notes = list[str]()
    files = run_job(tmp_path / "shell.inp", MPI.COMM_SELF, note=notes.append, tolerance=1e-9)
    printed = next(each for each in files if each.suffix == ".dat").read_text()
    table = printed[printed.index("displacements") :].split("forces")[0].splitlines()
    rows = [[float(number) for number in line.split()] for line in table if len(line.split()) == 4]
    assert len(rows) == len(moved) == 37
    for number, *values in rows:
        np.testing.assert_allclose(values, moved[int(number) - 1], rtol=1e-5, atol=1e-9)
    assert not any("belong to no element" in note for note in notes)
    across = deck.across_shells(np.array([TIP + 1]))
    assert len(across) == 4
    assert across[0] == TIP + 1


#: What CalculiX 2.20 writes at the loaded node and at one in the middle of an edge with OUTPUT=2D.
FLAT: dict[str, dict[str, list[tuple[float, ...]]]] = {
    "S8R": {
        "DISP": [(7.72634e-03, 0, 2.77204e-01), (4.21727e-03, -1.80011e-04, 2.76979e-01)],
        "STRESS": [(92.1734, 41.7154, 39.0109), (24.999, 13.5273, 9.57839)],
        "TOSTRAIN": [(3.39777e-04, 1.18003e-05, -5.77843e-06), (9.03365e-05, 1.57702e-05, -9.89741e-06)],
        "FORC": [(2000.0, 0, -16.6667), (0, 0, 33.3333)],
    },
    "S6": {
        "DISP": [(0.00759995, 0.000261398, 0.275715), (0.00433203, -0.000354459, 0.275267)],
        "STRESS": [(78.0779, 30.8773, 19.4985), (8.6079, 19.7164, 12.8807)],
        "TOSTRAIN": [(0.000314826, 8.02158e-06, -6.594e-05), (-5.85609e-06, 6.63489e-05, 2.19171e-05)],
        "FORC": [(2000.0, -5.77254e-11, 7.16261e-10), (-2.1771e-11, 2.78706e-11, 16.6667)],
    },
}


@pytest.mark.parametrize("kind", ["S8R", "S6", "S4"])
def test_jobs_write_fields_on_the_nodes_of_shells(kind: str, tmp_path: Path) -> None:
    facets = {"S8R": PLATE[1], "S6": triangles(PLATE[1], 6), "S4": PLATE[1][:, :4]}[kind]
    loads = f"*DLOAD\nALL, P, 1.\n*CLOAD\n{TIP + 1}, 1, 2000.\n*NODE FILE, OUTPUT=2D\nU, RF\n*EL FILE\nS, E"
    (tmp_path / "shell.inp").write_text(text_of(PLATE[0], {kind: facets}, CLAMPED, loads))
    run_job(tmp_path / "shell.inp", MPI.COMM_SELF, tolerance=1e-9)
    nodes, *fields = (tmp_path / "shell.frd").read_text().split(" -4  ")
    cells = [line.split() for line in nodes.split("    3C")[1].splitlines()]
    assert [list(map(int, line[1:])) for line in cells if line[0] == "-2"] == (facets + 1).tolist()
    assert {line[2] for line in cells if line[0] == "-1"} == {{"S8R": "10", "S6": "8", "S4": "9"}[kind]}
    for field in fields:
        values = {
            int(line[3:13]): [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(3)]
            for line in field.splitlines()
            if line.startswith(" -1")
        }
        assert sorted(values) == (np.unique(facets) + 1).tolist()
        expected = FLAT.get(kind, {}).get(field.split()[0], [])  # S4 is solved as S8R here
        for node, calculix in zip((TIP, BESIDE), expected, strict=False):
            np.testing.assert_allclose(values[node + 1], calculix, atol=1e-4 * np.abs(calculix).max())
