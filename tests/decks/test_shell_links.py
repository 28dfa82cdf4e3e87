"""Springs, trusses, masses and solids at nodes of shells, compared with what CalculiX 2.20 prints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.decks.plates import BESIDE, CLAMPED, MIDDLE, PLATE, TIP, solved, text_of, two_planes

#: One that holds the free edge, one to a node above, and a mass in the middle.
LINKS = f"""\
*NODE
901, 50., 5., 10.
*ELEMENT, TYPE=SPRING1, ELSET=UPRIGHT
101, {TIP + 1}
*SPRING, ELSET=UPRIGHT
3
1000.
*ELEMENT, TYPE=SPRINGA, ELSET=SLANTED
102, {BESIDE + 1}, 901
*SPRING, ELSET=SLANTED

500.
*ELEMENT, TYPE=MASS, ELSET=HEAVY
103, {MIDDLE + 1}
*MASS, ELSET=HEAVY
2.
*BOUNDARY
901, 1, 3"""
LOADS = "*DLOAD\nALL, P, 1.\nHEAVY, GRAV, 1000., 0., 0., 1."


@pytest.mark.filterwarnings("ignore")
def test_springs_and_masses_move_with_the_mean_of_both_sides(tmp_path: Path) -> None:
    text = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, LOADS, model=LINKS)
    deck, moved, _ = solved(tmp_path, text)
    assert not deck.notes  # the node above is held for the spring
    calculix = {
        TIP: (-1.930942e-04, -7.338684e-04, 3.917670e-01),
        BESIDE: (-4.632561e-04, -6.997501e-04, 3.906994e-01),
        MIDDLE: (-1.020223e-04, -1.751386e-04, 1.879898e-01),
    }
    for node, value in calculix.items():
        np.testing.assert_allclose(moved[node], value, atol=2e-7)


@pytest.mark.filterwarnings("ignore")
def test_a_spring_holds_a_knot(tmp_path: Path) -> None:
    points, facets, above = two_planes(0.0)
    root, tip = np.flatnonzero(points[:, 2] == 0), np.flatnonzero(points[:, 0] == 100)
    used = np.unique(facets["S8R"])
    knot = np.intersect1d(above[points[above, 0] == 0], used)[0]
    loads = "*CLOAD\n" + "\n".join(f"{k + 1}, 3, 1." for k in tip if k in used)
    spring = f"*ELEMENT, TYPE=SPRING1, ELSET=S\n901, {knot + 1}\n*SPRING, ELSET=S\n1\n50."
    text = text_of(points, facets, [(root, "1, 6")], loads, model=spring)
    _, moved, _ = solved(tmp_path, text)
    end = next(k for k in tip if k in used)
    np.testing.assert_allclose(moved[knot], (-7.257608e-02, -5.570725e-05, -5.274639e-05), atol=1e-6)
    np.testing.assert_allclose(moved[end], (-7.266623e-02, 1.005856e-02, 2.299255e-01), atol=1e-6)
