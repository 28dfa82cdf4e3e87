"""The patch test of MacNeal and Harder, whose elements are positive where they are integrated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, read_deck
from tests.decks.texts import deck, step

#: R. H. MacNeal, R. L. Harder, A proposed standard set of problems to test finite element accuracy, Finite
#: Elements in Analysis and Design 1 (1985) 3-20: a cube of side 1 with an irregular hexahedron inside.
POINTS = np.array(
    [[0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263], [0.273, 0.750, 0.230],
     [0.320, 0.186, 0.643], [0.677, 0.305, 0.683], [0.788, 0.693, 0.644], [0.165, 0.745, 0.702],
     [0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)  # fmt: skip
CELLS = [
    (1, 2, 3, 4, 5, 6, 7, 8), (1, 4, 3, 2, 9, 10, 11, 12), (5, 6, 7, 8, 13, 14, 15, 16),
    (1, 2, 6, 5, 9, 12, 14, 13), (2, 3, 7, 6, 12, 11, 15, 14), (3, 4, 8, 7, 11, 10, 16, 15),
    (4, 1, 5, 8, 10, 9, 13, 16),
]  # fmt: skip
#: u = 1e-3 (x + y/2 + z/2, x/2 + y + z/2, x/2 + y/2 + z); E = 1e6, ν = 0.25.
GRADIENT = 1e-3 * np.array([[1, 0.5, 0.5], [0.5, 1, 0.5], [0.5, 0.5, 1]])


def patch(element: str, points: np.ndarray) -> str:
    text = "*NODE\n" + "".join(f"{k}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(points, 1))
    text += f"*ELEMENT, TYPE={element}, ELSET=E\n"
    text += "".join(f"{k}, " + ", ".join(map(str, cell)) + "\n" for k, cell in enumerate(CELLS, 1))
    text += "*MATERIAL, NAME=M\n*ELASTIC\n1.E6, 0.25\n*SOLID SECTION, ELSET=E, MATERIAL=M\n"
    given = POINTS[8:] @ GRADIENT.T
    outer = "".join(f"{n}, {k + 1},, {given[n - 9, k]:.16g}\n" for n in range(9, 17) for k in range(3))
    return text + step("*BOUNDARY\n" + outer)


@pytest.mark.parametrize("element", ["C3D8", "C3D8I"])
def test_the_patch_of_macneal_and_harder_has_an_even_stress(element: str, tmp_path: Path) -> None:
    """Normal stresses of 2000 and shear stresses of 400, as published; one corner is turned inside out."""
    found = read_deck(deck(tmp_path, patch(element, POINTS)))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-12)
    moved = state.gather_displacement("E")
    np.testing.assert_allclose(moved, found.scene.bodies["E"].mesh.points @ GRADIENT.T, atol=1e-12)
    expected = np.full((3, 3), 400.0) + 1600.0 * np.eye(3)
    np.testing.assert_allclose(state.gather_stress("E"), np.tile(expected, (7, 1, 1)), rtol=1e-8)
    assert any("the Jacobian of 1 elements of body E is not positive" in n for n in found.notes)
    assert any("down to -0.0127 in element 4" in note for note in found.notes)


def test_an_element_that_is_turned_inside_out_is_named_with_its_jacobian(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[0] = [0.9, 0.9, 0.9]
    message = r"Gauss points, \d of 7 of type C3D8 are .* flat: 1, .*; the smallest is -.* in element "
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, patch("C3D8", points)))
