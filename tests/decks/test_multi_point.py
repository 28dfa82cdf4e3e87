"""Multi-point constraints, rigid sets of nodes, means and sectors of decks, as in theory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import CyclicSymmetry, RigidSurface, read_scene_file
from fenics_contact.decks import DeckError, read_deck, write_scene_file
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import block
from tests.decks.solved import solved
from tests.decks.texts import FIXED, SECTION, STEEL, deck, mesh_cards, step
from tests.decks.texts import PLAIN_BAR as BAR

#: A node without elements whose coordinates are the axis of the bar.
PILOT = "*NODE\n700, 2., 0., 0.\n"


def test_the_mean_rotation_of_an_end_is_given(tmp_path: Path) -> None:
    """The corners of the end turn by 0.01 on average; the moment that does it is that at the root."""
    turned = "*MPC\nMEANROT, 17, 17, 17, 18, 18, 18, 19, 19, 19,\n20, 20, 20, 700\n"
    _, state, moved, places = solved(
        tmp_path, BAR + PILOT + FIXED + turned + step("*BOUNDARY\n700, 1, 1, 0.01\n")
    )
    ends = np.array([moved[k] for k in (17, 18, 19, 20)])
    arms = np.array([places[k] for k in (17, 18, 19, 20)]) - [4.0, 0.5, 0.5]
    angles = np.cross(arms, ends)[:, 0] / np.einsum("nd,nd->n", arms[:, 1:], arms[:, 1:])
    assert angles.mean() == pytest.approx(0.01, rel=1e-8)
    root = state.reactions(about=(0.0, 0.5, 0.5))["BAR BAR_X0"]
    moment = state.constraints()["EQUATIONS"].force[0]
    assert abs(moment) > 1.0
    assert root.moment[0] == pytest.approx(-moment, rel=1e-7)
    np.testing.assert_allclose(root.force, 0.0, atol=1e-7 * abs(moment))


def test_the_mean_rotation_is_about_the_mean_displacement(tmp_path: Path) -> None:
    """Of three corners, whose arms differ; what they move together turns nothing."""
    turned = "*MPC\nMEANROT, 17, 17, 17, 18, 18, 18, 20, 20, 20,\n700\n"
    shifted = step("*BOUNDARY\n700, 1, 1, 0.01\n*CLOAD\n19, 2, 40.\n")
    _, _, moved, places = solved(tmp_path, BAR + PILOT + FIXED + turned + shifted)
    ends, at = (np.array([each[k] for k in (17, 18, 20)]) for each in (moved, places))
    arms, ways = at - at.mean(axis=0), ends - ends.mean(axis=0)
    squares = np.einsum("nd,nd->n", arms[:, 1:], arms[:, 1:])
    assert (np.cross(arms, ways)[:, 0] / squares).mean() == pytest.approx(0.01, rel=1e-8)
    assert abs((np.cross(arms, ends)[:, 0] / squares).mean() - 0.01) > 1e-4


def test_nodes_stay_in_planes_and_lines_and_keep_their_distance(tmp_path: Path) -> None:
    mesh = block((0, 0, 0), (4, 1, 1), (4, 2, 2))
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + FIXED
    numbers = {tuple(point): k for k, point in enumerate(mesh.points.tolist(), 1)}
    line = [numbers[x, 0.0, 1.0] for x in (2.0, 3.0, 4.0)]
    pair = [numbers[1.0, 1.0, 0.0], numbers[3.0, 0.0, 1.0]]
    alike = [numbers[2.0, 1.0, 1.0], numbers[3.0, 1.0, 1.0]]
    cards = f"*MPC\nPLANE, BAR_X1\nSTRAIGHT, {', '.join(map(str, line))}\nBEAM, {pair[0]}, {pair[1]}\n"
    cards += f"PIN, {alike[0]}, {alike[1]}\n"
    load = step(f"*CLOAD\n{line[1]}, 3, 50.\n{numbers[4.0, 0.5, 0.5]}, 1, 80.\n{pair[0]}, 2, 30.\n")
    found, state, moved, places = solved(tmp_path, text + cards + load)
    end = [k for k, place in places.items() if place[0] == 4.0]
    normal = np.array([moved[k][0] for k in end])
    spread = np.column_stack([np.ones(len(end)), np.array([places[k][1:] for k in end])])
    left = normal - spread @ np.linalg.lstsq(spread, normal, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-11)
    assert np.ptp(normal) > 1e-6
    across = np.array([moved[k][1:] for k in line])
    np.testing.assert_allclose(across[0] - 2.0 * across[1] + across[2], 0.0, atol=1e-11)
    along = places[pair[1]] - places[pair[0]]
    assert along @ (moved[pair[1]] - moved[pair[0]]) == pytest.approx(0.0, abs=1e-11)
    np.testing.assert_allclose(moved[alike[0]], moved[alike[1]], atol=1e-12)
    free = read_deck(deck(tmp_path, text + load, "free.inp")).solve(MPI.COMM_SELF)[-1]
    assert np.abs(free.gather_displacement("BAR") - state.gather_displacement("BAR")).max() > 1e-4
    assert state.balance().imbalance < 1e-9
    assert found.scene.constraints[0].label == "EQUATIONS"


def test_a_set_of_nodes_moves_as_one_rigid_piece(tmp_path: Path) -> None:
    """Two opposite corners of the end, no faces, turned by a moment on the node of rotations."""
    rigid = "*NODE\n501, 4., 0.5, 0.5\n502, 4., 0.5, 0.5\n*NSET, NSET=FEW\n17, 20\n"
    rigid += "*RIGID BODY, NSET=FEW, REF NODE=501, ROT NODE=502\n"
    text = BAR + rigid + FIXED + step("*CLOAD\n501, 2, 3.\n502, 1, 7.\n")
    found, state, moved, places = solved(tmp_path, text)
    (piece,) = (each for each in found.scene.supports if isinstance(each, RigidSurface))
    assert piece.surface == "FEW RIGID"
    ends, arm = moved[20] - moved[17], places[20] - places[17]
    assert np.abs(ends).max() > 1e-6
    assert ends @ arm == pytest.approx(0.0, abs=1e-11)
    root = state.reactions(about=(4.0, 0.5, 0.5))["BAR BAR_X0"]
    np.testing.assert_allclose(root.force, [0.0, -3.0, 0.0], atol=1e-7)
    assert root.moment[0] == pytest.approx(-7.0, rel=1e-7)
    files = write_scene_file(found, tmp_path / "scene.toml")
    again = read_scene_file(files[0], MPI.COMM_SELF, overrides=["solver.tolerance=1e-10"]).solve()
    np.testing.assert_allclose(again.gather_displacement("BAR"), state.gather_displacement("BAR"), atol=1e-9)
    about = "".join(f"502, {k + 1}, {arm[k]}\n" for k in range(3))
    with pytest.raises(InfeasibleError, match="lie on the axis of its moment: name others"):
        solved(tmp_path, BAR + rigid + FIXED + step(f"*CLOAD\n{about}"))


COUPLED = "*ELEMENT, TYPE=DCOUP3D, ELSET=E1\n99, 700\n"
SHARED = "*SOLID SECTION, ELSET=E1, MATERIAL=STEEL\n*DISTRIBUTING COUPLING, ELSET=E1\n17, 1.\n18, 3.\n"


def test_a_mean_shares_its_force_and_may_be_held(tmp_path: Path) -> None:
    text = BAR + PILOT + COUPLED + SHARED + FIXED
    loaded = solved(tmp_path, text + step("*CLOAD\n700, 2, 8.\n"))[1]
    plain = solved(tmp_path, BAR + FIXED + step("*CLOAD\n17, 2, 2.\n18, 2, 6.\n"))[1]
    np.testing.assert_allclose(
        loaded.gather_displacement("BAR"), plain.gather_displacement("BAR"), atol=1e-12
    )
    _, state, moved, _ = solved(tmp_path, text + step("*BOUNDARY\n700, 2, 2, 0.02\n"))
    assert 0.25 * moved[17][1] + 0.75 * moved[18][1] == pytest.approx(0.02, rel=1e-9)
    held = state.constraints()["EQUATIONS"]
    assert state.reactions()["BAR BAR_X0"].force[1] == pytest.approx(-held.on_bodies["BAR"][1], rel=1e-8)


def sector() -> str:
    """A twelfth of a thick ring between radii 1 and 2, loaded inside, held along its axis."""
    mesh = block((1, 0, 0), (2, 1, 1), (8, 3, 1))
    angle = mesh.points[:, 1] * np.pi / 6
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    mesh = mesh.moved(np.column_stack([mesh.points[:, :1] * way, mesh.points[:, 2]]))
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + "*BOUNDARY\nBAR_Z0, 3\nBAR_Z1, 3\n"
    sides = "*SURFACE, NAME=SLAVE, TYPE=NODE\nBAR_Y1\n*SURFACE, NAME=MASTER, TYPE=NODE\nBAR_Y0\n"
    tie = "*TIE, NAME=SIDES, CYCLIC SYMMETRY\nSLAVE, MASTER\n"
    cells = mesh.cells
    inner = np.flatnonzero(np.isin(cells, mesh.nodes_of("x0")).sum(axis=1) == 4) + 1
    inside = "*ELSET, ELSET=INNER\n" + "".join(f"{k},\n" for k in inner)
    return text + sides + tie + inside


MODEL = "*CYCLIC SYMMETRY MODEL, N=12, TIE=SIDES, ELSET=BAR\n0., 0., 0., 0., 0., 1.\n"


def test_a_sector_of_a_ring_widens_as_the_ring(tmp_path: Path) -> None:
    """Pressure inside: u_r = (1 + ν) p a² ((1 − 2ν) r + b²/r) / (E (b² − a²)), by Lamé."""
    found, state, moved, places = solved(
        tmp_path, sector() + MODEL + "*BOUNDARY\n1, 2\n" + step("*DLOAD\nINNER, P6, 100.\n")
    )
    (tie,) = found.scene.ties
    assert isinstance(tie, CyclicSymmetry)
    assert tie.angle == pytest.approx(np.pi / 6, rel=1e-12)
    nodes = [k for k in moved if k > 0]
    points = np.array([places[k] for k in nodes])
    radius = np.linalg.norm(points[:, :2], axis=1)
    out = np.einsum("nd,nd->n", np.array([moved[k] for k in nodes])[:, :2], points[:, :2]) / radius
    exact = 1.3 * 100.0 * (0.4 * radius + 4.0 / radius) / (210000.0 * 3.0)
    np.testing.assert_allclose(out, exact, rtol=1.5e-2)
    around = [np.ptp(out[np.abs(radius - r) < 1e-6]) for r in np.unique(radius.round(6))]
    assert max(around) < 1e-6 * np.abs(out).max()
    files = write_scene_file(found, tmp_path / "scene.toml")
    again = read_scene_file(files[0], MPI.COMM_SELF, overrides=["solver.tolerance=1e-10"]).solve()
    np.testing.assert_allclose(again.gather_displacement("BAR"), state.gather_displacement("BAR"), atol=1e-9)


def test_pressures_on_a_face_add_up_within_a_step_and_are_replaced_by_the_next(tmp_path: Path) -> None:
    text = BAR + "*BOUNDARY\nBAR_X0, 1, 3\n"
    twice = read_deck(
        deck(tmp_path, text + step("*DLOAD\n4, P4, -3.\n4, P4, -4.\n") + step("*DLOAD\n4, P4, 5.\n"))
    )
    assert [step.loads[0].value for step in twice.steps] == [-7.0, 5.0]


WRONG = [
    (
        BAR + "*MPC\nGAP, 17, 18\n",
        "",
        r"line \d+: \*MPC: a multi-point constraint GAP is not read: give MEANROT",
    ),
    (BAR + "*MPC\nBEAM, 17, 18\n", ", NLGEOM", r"\*MPC: BEAM is not supported with NLGEOM"),
    (BAR + "*MPC\nBEAM, 17\n", "", r"BEAM needs 2 nodes, got 1"),
    (BAR + "*MPC\nPLANE, 17, 18, 19, 1\n", "", r"PLANE needs nodes in a plane, one is 1 off"),
    (BAR + "*MPC\nSTRAIGHT, 17, 18, 19\n", "", r"STRAIGHT needs nodes in a line"),
    (BAR + PILOT + "*MPC\nMEANROT, 1, 5, 9, 700\n", "", r"MEANROT needs nodes away from the axis"),
    (
        BAR + SHARED.partition("STEEL\n")[2],
        "",
        r"needs ELSET= a set with an element of type DCOUP3D",
    ),
    (sector(), "", r"needs a \*CYCLIC SYMMETRY MODEL with TIE=SIDES"),
    (sector() + MODEL.replace("N=12", "N=10"), "", r"N=10 sectors are 360°/N apart, BAR MASTER is"),
    (sector() + MODEL.replace(", 0., 0., 1.", ""), "", r"needs N= sectors and a line with two points"),
]


@pytest.mark.parametrize(("text", "large", "message"), WRONG, ids=[each[2][:30] for each in WRONG])
def test_what_has_no_counterpart_is_refused_by_line(
    text: str, large: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, text + FIXED + step("*CLOAD\n17, 2, 1.\n", large)))
