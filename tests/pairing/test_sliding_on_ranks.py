"""Contact of moved bodies is the same on any number of ranks, and all ranks raise what one of them meets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.conftest import run_on_ranks
from tests.pairing.sliding_on_ranks import collect

SCRIPT = Path(__file__).with_name("sliding_on_ranks.py")


@pytest.mark.parametrize("ranks", [2, 4])
def test_points_and_errors_do_not_depend_on_the_number_of_ranks(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(SCRIPT, ranks, tmp_path / "numbers.npz", timeout=60)
    with np.load(tmp_path / "numbers.npz") as stored:
        parallel = dict(stored)
    messages = parallel.pop("messages")
    serial = collect(MPI.COMM_SELF)
    assert parallel.keys() == serial.keys()
    for name, values in serial.items():
        assert np.array_equal(parallel[name], values), name
    assert all("no idea" in message for message in messages)
