"""Mortar coupling is the same on any number of ranks, and all ranks raise what one of them meets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.conftest import run_on_ranks
from tests.pairing.mortar_on_ranks import collect, message_for_a_folded_facet

SCRIPT = Path(__file__).with_name("mortar_on_ranks.py")


@pytest.mark.parametrize("ranks", [3])
def test_coupling_and_errors_do_not_depend_on_the_number_of_ranks(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(SCRIPT, ranks, tmp_path / "numbers.npz", timeout=60)
    with np.load(tmp_path / "numbers.npz") as stored:
        parallel = dict(stored)
    messages = parallel.pop("messages")
    serial = collect(MPI.COMM_SELF)
    assert set(parallel) == set(serial)
    for name, numbers in serial.items():
        assert numbers.size > 0, f"{name} is empty: nothing was compared"
        np.testing.assert_allclose(parallel[name], numbers, rtol=1e-9, atol=1e-9 if " by " in name else 1e-12)
    assert len(messages) == ranks
    alone = message_for_a_folded_facet(MPI.COMM_SELF)
    assert "convex facets on the slave surface, but 1 are folded" in alone
    assert all(str(text).startswith(alone) for text in messages)
