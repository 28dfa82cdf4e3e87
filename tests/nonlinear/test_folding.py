"""A body that folds: its surface is slave and master at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import run_on_ranks
from tests.hard.deformed.slender import slot_closes


@pytest.mark.parametrize("ranks", [1, *(pytest.param(n, marks=pytest.mark.claim) for n in (2, 4))])
def test_a_slot_closes_alike_as_one_surface_and_as_two(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(Path(__file__).with_name("folding_on_ranks.py"), ranks, tmp_path / "state.npz")
    found, sides = np.load(tmp_path / "state.npz"), slot_closes("left", "right").solve()[-1]
    pressed = sides.contact.normal_force > 0.0
    assert np.count_nonzero(pressed) > 3
    assert found["displacement"] == pytest.approx(sides.gather_displacement("block"), abs=1e-7)
    assert found["force"].sum(axis=0) == pytest.approx(sides.contact.force.sum(axis=0), abs=1e-7)
