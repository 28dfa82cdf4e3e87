"""One rank may print what all ranks hold: it says the same on any number of ranks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from tests.contact.printed_on_ranks import main

SCRIPT = Path(__file__).with_name("printed_on_ranks.py")


def replicated(printed: str) -> list[str]:
    """Return the lines that do not depend on the number of ranks: no times, work, rounding."""
    names = ("unknowns", "contact ", "largest force", "strain energy", "total potential", "bodies", "points")
    return [line for line in printed.splitlines() if line.strip().startswith(names)]


def test_one_rank_alone_prints_the_same_on_any_number_of_ranks(
    mpirun: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    main(MPI.COMM_SELF)
    alone, both = capsys.readouterr().out, mpirun(SCRIPT, 2)
    assert len(replicated(alone)) > 8
    assert replicated(both) == replicated(alone)
    assert "ranks      2" in both
