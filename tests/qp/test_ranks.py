"""The same answers on one, two and four ranks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

#: Takes long: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

SCRIPT = Path(__file__).with_name("solve_on_ranks.py")


def test_one_two_and_four_ranks_give_the_same_multipliers(mpirun, tmp_path):
    for ranks in (1, 2, 4):
        output = mpirun(SCRIPT, ranks, tmp_path)
        assert f"{ranks} ranks refused: slip_bound must be in [0, ∞), got -1.0" in output
    alone = np.load(tmp_path / "ranks1.npz")
    assert len(alone.files) == 6
    for ranks in (2, 4):
        together = np.load(tmp_path / f"ranks{ranks}.npz")
        for name in alone.files:
            scale = np.abs(alone[name]).max()
            assert scale > 0
            np.testing.assert_allclose(together[name], alone[name], atol=1e-8 * scale, err_msg=name)
