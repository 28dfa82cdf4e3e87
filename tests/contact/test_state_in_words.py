"""What is said of each contact pair."""

from __future__ import annotations

import re

import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, Scene, solve_scene
from fenics_contact.results.state import pairs_in_words
from tests.contact.gallery import partitions, pressed_block, two_blocks

RUBBING = r"\w+ \w+ on \w+ \w+: \d+ points, \d+ open, \d+ stick, \d+ slip; normal force \S+ N, friction \d"
SMOOTH = r"\w+ \w+ on rigid plane: \d+ points, \d+ open, [1-9]\d* closed; normal force [1-9.]"


@pytest.mark.parametrize(
    ("scene", "told"),
    [(two_blocks(Coulomb(0.6)), RUBBING), (pressed_block(None), SMOOTH)],
    ids=["two bodies with friction", "rigid plane without"],
)
def test_a_pair_is_told_by_its_surfaces_and_its_points_by_what_they_can_do(scene: Scene, told: str) -> None:
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene))
    (words,) = pairs_in_words(scene, state.contact, "N", "MPa")
    assert re.match(told, words), words
    assert re.search(r" \S+ N, pressure up to \S+ MPa$", words), words
    # These surfaces are flat.
    pressing = re.search(r"normal force (\S+) N", words)
    assert pressing is not None
    assert float(pressing[1]) == pytest.approx(state.contact.normal_force.sum(), rel=1e-5)
