"""The whole way on many ranks, which share the cores of this machine."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.ranks.counted import whole_way

SCRIPT = """
    import json, sys
    from pathlib import Path
    from mpi4py import MPI
    from tests.ranks.counted import refused, whole_way
    comm = MPI.COMM_WORLD
    found = {**whole_way(comm, Path(sys.argv[1])), "refused": refused(comm)}
    if comm.rank == 0:
        print(json.dumps(found))
"""
#: Bytes of a table that may be copied to every rank.
SMALL = 1_000_000


@pytest.mark.slow
def test_64_ranks_find_the_answer_of_one_and_copy_no_large_table(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    many = json.loads(mpirun(SCRIPT, 64, tmp_path / "many", timeout=900.0))
    one = whole_way(MPI.COMM_SELF, tmp_path / "one")
    assert one["status"][0] > 0
    assert min(one["status"][1:]) > 0, "some stick, some slip"
    assert many["status"] == one["status"]
    for name in ("potential", "forces", "displacement", "stress", "reaction"):
        found, known = (np.asarray(each[name]) for each in (many, one))
        assert np.abs(found - known).max() <= 1e-8 * np.abs(known).max() > 0.0, name
    assert abs(many["products"] - one["products"]) <= 2
    assert 0 < many["copied"] < SMALL
    assert 0 < many["reduced"] < SMALL
    assert one["copied"] == one["reduced"] == 0
    assert many["refused"].startswith("64 ranks need as many subdomains, got 48")
    assert (tmp_path / "many" / "result.json").exists()
