"""The operators have the same values on any number of ranks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.conftest import run_on_ranks
from tests.feti.on_ranks import collect

SCRIPT = Path(__file__).with_name("on_ranks.py")
Numbers = dict[str, np.ndarray]
INDEPENDENT = (
    "dual operator",
    "preconditioner",
    "right side",
    "diagonal",
    "coarse load",
    "resultant",
    "projection",
    "gap",
    "energy of F",
)


@pytest.fixture(scope="module")
def serial() -> Numbers:
    return collect(MPI.COMM_SELF)


@pytest.fixture(scope="module", params=[2, 4])
def ranks(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def parallel(ranks: int, tmp_path_factory: pytest.TempPathFactory) -> Numbers:
    path = tmp_path_factory.mktemp("ranks") / "numbers.npz"
    run_on_ranks(SCRIPT, ranks, path, timeout=60)
    with np.load(path) as stored:
        numbers = dict(stored)
    assert len(numbers["owned"]) == ranks
    return numbers


@pytest.mark.parametrize("name", INDEPENDENT)
def test_numbers_do_not_depend_on_the_number_of_ranks(serial: Numbers, parallel: Numbers, name: str) -> None:
    size = np.abs(serial[name]).max()
    assert size > 1e-3
    np.testing.assert_allclose(parallel[name], serial[name], rtol=0, atol=1e-10 * size)


def test_the_dual_operator_is_symmetric_across_ranks(parallel: Numbers) -> None:
    assert parallel["energy of F"] > 0
    assert abs(parallel["asymmetry of F"]) < 1e-11 * parallel["energy of F"]


def test_ghosts_and_owners_exchange_what_they_should(serial: Numbers, parallel: Numbers) -> None:
    assert parallel["ghosts"].sum() > 100
    assert serial["ghosts"].sum() == 0
    np.testing.assert_allclose(parallel["exchange"], 0.0, atol=1e-13)
    np.testing.assert_allclose(serial["exchange"], 0.0, atol=1e-13)


def test_every_multiplier_and_every_disc_has_one_owner(serial: Numbers, parallel: Numbers) -> None:
    assert parallel["owned"].sum() == serial["owned"].sum()
    assert parallel["discs"].sum() == serial["discs"].sum()
    assert parallel["owned"].min() > 0
    assert np.count_nonzero(parallel["discs"]) > 1, "all contact on one rank: nothing was tested"
