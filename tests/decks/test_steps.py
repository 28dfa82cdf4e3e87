"""Steps of decks: what they hold by OP=NEW and FIXED, how loads come, and what is taken as in CalculiX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import HoldCurrent, Support
from fenics_contact.__main__ import main
from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block
from tests.decks.texts import BAR, FREE_TO_CONTRACT, SECTION, STEEL, deck, mesh_cards, step

YOUNG, LENGTH, STRESS, PULL = 210000.0, 3.0, 50.0, 0.01
#: A traction on the end face by its nodal forces: 3 by 2 nodes, the middle ones of two cells.
PUSH = f"*DSLOAD, OP=NEW\nTIP, P, {-STRESS}\n"
TIP = "*SURFACE, NAME=TIP\nLAST, S4\n"
LAST = "*ELSET, ELSET=LAST\n5, 6\n"
HISTORY = (
    BAR + LAST + TIP + FREE_TO_CONTRACT
    + step(f"*BOUNDARY\nBAR_X1, 1, 1, {PULL}\n")
    + step(FREE_TO_CONTRACT.replace("*BOUNDARY", "*BOUNDARY, OP=NEW") + PUSH)
    + step("*BOUNDARY, FIXED\nBAR_X1, 1\n*DSLOAD, OP=NEW\n")
    + step("")
    + step(FREE_TO_CONTRACT.replace("*BOUNDARY", "*BOUNDARY, OP=NEW"))
)  # fmt: skip


def test_supports_are_released_and_kept_from_step_to_step(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, HISTORY))
    holding = [{s.surface for s in step.supports or () if isinstance(s, Support)} for step in found.steps]
    there, free = {"BAR_X0", "BAR_Y0", "BAR_Z0", "BAR_X1"}, {"BAR_X0", "BAR_Y0", "BAR_Z0"}
    assert holding == [there, free, there, there, free]
    for number in (2, 3):
        ends = [s for s in found.steps[number].supports or () if s.surface == "BAR_X1"]
        assert ends == [Support("BAR", "BAR_X1", (HoldCurrent(), None, None))]
    states = found.solve(MPI.COMM_SELF, tolerance=1e-11)
    mesh = found.scene.bodies["BAR"].mesh
    tip, stretch = mesh.points[:, 0] == LENGTH, STRESS * LENGTH / YOUNG
    for state, expected in zip(states, (PULL, stretch, stretch, stretch, 0.0), strict=True):
        np.testing.assert_allclose(state.gather_displacement("BAR")[tip, 0], expected, atol=1e-9 * PULL)
    forces = [float(state.reactions()["BAR BAR_X0"].force[0]) for state in states]
    np.testing.assert_allclose(forces, [-YOUNG * PULL / LENGTH, *[-STRESS] * 3, 0.0], atol=1e-6 * STRESS)


def test_single_nodes_that_are_held_in_some_steps_are_sets_of_their_own(tmp_path: Path) -> None:
    nodes = [line.split(",")[0] for line in BAR.partition("NSET=BAR_X1\n")[2].splitlines()[:6]]
    alone = "".join(f"{node}, 1, 1, {PULL}\n" for node in nodes)
    some = "".join(f"{node}, 1, 1, {PULL}\n" for node in nodes[:4])
    text = BAR + FREE_TO_CONTRACT + step("*BOUNDARY\n" + alone)
    text += step(FREE_TO_CONTRACT.replace("*BOUNDARY", "*BOUNDARY, OP=NEW") + "*BOUNDARY\n" + some)
    found = read_deck(deck(tmp_path, text))
    counts = []
    for each in found.steps:
        held = [s for s in each.supports or () if s.surface.startswith("BOUNDARY")]
        meshes = found.scene.bodies["BAR"].mesh
        counts.append(sum(len(meshes.nodes_to_hold(support.surface)) for support in held))
    assert counts == [6, 4]
    last = found.solve(MPI.COMM_SELF)[-1]
    moved = last.gather_displacement("BAR")[:, 0]
    assert (np.abs(moved - PULL) < 1e-9).sum() == 4


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    nodes = [line.split(",")[0] for line in BAR.partition("NSET=BAR_X1\n")[2].splitlines()[:6]]
    text = BAR + FREE_TO_CONTRACT + step(f"*BOUNDARY\n{nodes[0]}, 1, 1, {PULL}\n")
    text += step("*BOUNDARY, FIXED\nBAR_X1, 1\n")
    with pytest.raises(DeckError, match=r"nodes of 'BAR_X1' that are FIXED were partly free before"):
        read_deck(deck(tmp_path, text))
    driven = BAR + "*NODE\n501, 3., 0.5, 0.5\n*RIGID BODY, NSET=BAR_X1, REF NODE=501\n" + FREE_TO_CONTRACT
    driven += step("*CLOAD\n501, 1, 9.\n") + step("*BOUNDARY, FIXED\n501, 1\n")
    with pytest.raises(DeckError, match=r"node 501 drives a surface and was free before FIXED"):
        read_deck(deck(tmp_path, driven))


def test_loads_of_a_step_may_be_there_at_once(tmp_path: Path) -> None:
    turn = "*AMPLITUDE, NAME=TURN\n0., 0., 0.5, 1., 1., 0.\n"
    loads = "*CLOAD\nBAR_X1, 1, 8.\n*CLOAD, AMPLITUDE=TURN\nBAR_X1, 2, 3.\n"
    parts = {}
    for how in ("STEP", "RAMP"):
        text = BAR + turn + FREE_TO_CONTRACT + step(loads, f", AMPLITUDE={how}")
        found = read_deck(deck(tmp_path, text, f"{how}.inp"))
        parts[how] = [sorted(load.value for load in each.loads or ()) for each in found.steps]
    at_once, grown = ([value for values in part for value in values] for part in parts.values())
    assert max(value[0] for value in at_once[:1]) == 8.0
    assert max(value[0] for value in grown[:1]) == 4.0
    assert parts["STEP"][-1] == parts["RAMP"][-1]
    with pytest.raises(DeckError, match=r"AMPLITUDE=WAVE is not read: RAMP and STEP are"):
        read_deck(deck(tmp_path, text.replace("AMPLITUDE=RAMP", "AMPLITUDE=WAVE")))


OTHERS = "*STEP, PERTURBATION\n*MODAL DAMPING\n1, 2.\n*FREQUENCY\n10\n*END STEP\n" + step("")


@pytest.mark.parametrize("others", [OTHERS, OTHERS.replace(", PERTURBATION", "")])
def test_the_leading_static_steps_alone_are_read_if_that_is_wanted(others: str, tmp_path: Path) -> None:
    text = BAR + FREE_TO_CONTRACT + step("*CLOAD\nBAR_X1, 1, 5.\n") * 2
    path = deck(tmp_path, text + others)
    with pytest.raises(DeckError):
        read_deck(path)
    found, whole = read_deck(path, statics_only=True), read_deck(deck(tmp_path, text, "whole.inp"))
    assert len(found.steps) == len(whole.steps) == 2
    (words,) = set(found.notes) - {note.replace("whole.inp", "model.inp") for note in whole.notes}
    assert words.endswith("this step and all behind it are left out: they are no statics")
    line = text.count("\n") + (1 if "PERTURBATION" in others else 4)
    assert f"model.inp line {line}: this step" in words
    with pytest.raises(DeckError, match=r"the first step is not static: nothing remains"):
        read_deck(deck(tmp_path, BAR + FREE_TO_CONTRACT + others, "none.inp"), statics_only=True)


def test_the_command_line_takes_the_static_steps_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = deck(tmp_path, BAR + FREE_TO_CONTRACT + step("*CLOAD\nBAR_X1, 1, 5.\n") + OTHERS)
    assert main(["run", str(path), "--plan"]) == 2
    assert main(["run", str(path), "--plan", "--statics-only"]) == 0
    assert "are left out: they are no statics" in " ".join(capsys.readouterr().out.split())
    assert main(["convert", str(path), "--statics-only"]) == 0
    scene = str(path.with_suffix(".toml"))
    assert main(["run", scene, "--plan", "--statics-only"]) == 2
    assert "--statics-only is of decks, got the scene file" in " ".join(capsys.readouterr().err.split())


def test_large_deformations_stay_large_in_later_steps(tmp_path: Path) -> None:
    text = BAR + FREE_TO_CONTRACT + step("*BOUNDARY\nBAR_X1, 1, 1, 0.01\n", ", NLGEOM") + step("")
    assert read_deck(deck(tmp_path, text)).scene.deforms_much
    with pytest.raises(DeckError, match="all steps must have NLGEOM, or none"):
        read_deck(deck(tmp_path, text.replace("*STEP\n", "*STEP, NLGEOM=NO\n")))


def test_nodes_on_the_axis_of_a_cylinder_are_held_across_it_as_a_whole(tmp_path: Path) -> None:
    axis = "*TRANSFORM, NSET=BAR_X0, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    pinned, rolling = (
        BAR + axis + f"*BOUNDARY\nBAR_X0, 1, {last}\nBAR_Z0, 3\n" + step("*CLOAD\nBAR_X1, 1, 5.\n")
        for last in (2, 1)
    )
    plain = read_deck(deck(tmp_path, pinned.replace(axis, ""))).solve(MPI.COMM_SELF)[-1]
    turned = read_deck(deck(tmp_path, pinned, "turned.inp")).solve(MPI.COMM_SELF)[-1]
    expected = plain.gather_displacement("BAR")
    np.testing.assert_allclose(
        turned.gather_displacement("BAR"), expected, atol=1e-9 * np.abs(expected).max()
    )
    with pytest.raises(DeckError, match=r"node 1 is on the axis of the cylinder: hold 1 and 2 at zero"):
        read_deck(deck(tmp_path, rolling))


def test_numbers_of_bubbles_behind_the_nodes_of_an_element_are_overlooked(tmp_path: Path) -> None:
    text = BAR.replace("C3D8", "C3D8I") + FREE_TO_CONTRACT + step("*CLOAD\nBAR_X1, 1, 5.\n")
    head, _, rest = text.partition("ELSET=BAR\n")
    lines = rest.split("\n")
    more = [f"{line}, 901, 902, 903" for line in lines[:6]] + lines[6:]
    one, other = (
        read_deck(deck(tmp_path, each, f"{k}.inp")).scene.bodies["BAR"].mesh
        for k, each in enumerate((text, head + "ELSET=BAR\n" + "\n".join(more)))
    )
    np.testing.assert_array_equal(one.cells, other.cells)


def test_steps_have_the_names_that_the_deck_gives_them(tmp_path: Path) -> None:
    text = BAR + FREE_TO_CONTRACT + step("").replace("*STEP", "*STEP, NAME=press") + step("")
    found = read_deck(deck(tmp_path, text))
    assert [each.name for each in found.steps] == ["PRESS", "step 2"]
    assert found.source("step", "PRESS").line == text[: text.index("*STEP")].count("\n") + 1
    twice = text.replace("*STEP\n", "*STEP, NAME=Press\n")
    with pytest.raises(DeckError, match=r"\*STEP: a step before it has the name 'PRESS', too"):
        read_deck(deck(tmp_path, twice))


ON_ITS_BACK = "*BOUNDARY\nBAR_Z0, 1, 3\n"


def test_lines_of_single_elements_that_are_always_equal_are_one_load(tmp_path: Path) -> None:
    """Programs write a pressure face by face: one surface for each course of values, with the same forces."""
    plate = mesh_cards({"BAR": block((0, 0, 0), (3, 3, 1), (3, 3, 1))}) + STEEL + SECTION + ON_ITS_BACK
    first = "*DLOAD\n" + "".join(f"{k}, P2, 6.\n" for k in range(1, 10))
    second = "*DLOAD\n" + "".join(f"{k}, P2, {8 if k < 4 else 6}.\n" for k in range(1, 10)) + "1, P3, 8.\n"
    found = read_deck(deck(tmp_path, plate + step(first) + step(second)))
    assert [len(each.loads) for each in found.steps] == [2, 3]
    mesh = found.scene.bodies["BAR"].mesh
    sizes = {load.value: len(mesh.surfaces[load.surface]) for load in found.steps[1].loads[:2]}
    assert sizes == {8.0: 3, 6.0: 6}
    states = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    forces = [state.balance().loads.force[2] for state in states]
    assert forces == pytest.approx([-54.0, -3 * 8.0 - 6 * 6.0], rel=1e-9)


def test_what_is_wrong_in_lines_of_single_elements_is_named_by_its_line(tmp_path: Path) -> None:
    plate = mesh_cards({"BAR": block((0, 0, 0), (2, 1, 1), (2, 1, 1))}) + STEEL + SECTION + ON_ITS_BACK
    lines = (plate + step("*DLOAD\n1, P2, 6.\n2, P2, 6.\n")).splitlines()
    for wrong, message in (
        ("7, P2, 6.", "element 7 is not there"),
        ("2, P9, 6.", "got 'P9'"),
    ):
        text = "\n".join(wrong if line == "2, P2, 6." else line for line in lines)
        with pytest.raises(DeckError, match=message) as refused:
            read_deck(deck(tmp_path, text))
        assert refused.value.line == 1 + lines.index("2, P2, 6.")
