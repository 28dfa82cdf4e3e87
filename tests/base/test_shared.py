"""What all ranks need is made and held once a machine."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact._base.shared import is_shared, once_a_machine
from fenics_contact.errors import InvalidInputError
from tests.base.shared_on_ranks import LARGE
from tests.conftest import run_on_ranks

#: Of the numbers, and of the table of half as many.
BYTES = 8 * LARGE + 4 * LARGE
SEVERAL = pytest.mark.parametrize("ranks", [2, 4])


@cache
def found(ranks: int) -> list[dict[str, Any]]:
    script = Path(__file__).with_name("shared_on_ranks.py")
    every: list[dict[str, Any]] = json.loads(run_on_ranks(script, ranks).splitlines()[-1])
    assert len(every) == ranks
    return every


def assert_right(facts: dict[str, Any]) -> None:
    assert facts["equal"]
    assert facts["one array"]
    assert facts["layout"]


def test_one_rank_gets_the_object_itself() -> None:
    made = {"table": np.arange(LARGE)}
    assert once_a_machine(MPI.COMM_SELF, lambda: made) is made
    assert not is_shared(made["table"])


def test_what_is_no_function_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"make must be a function of no argument, got .*: write a lambda"
    ):
        once_a_machine(MPI.COMM_SELF, np.arange(3))  # type: ignore[arg-type]


@SEVERAL
def test_ranks_of_a_machine_hold_one_protected_file(ranks: int) -> None:
    every = [each["one machine"] for each in found(ranks)]
    for rank, each in enumerate(every):
        assert_right(each)
        assert each["times"] == (rank == 0), "made once"
        assert each["shared"] == each["protected"] == [True, True]
        assert each["files"] == every[0]["files"], "the same memory on all ranks"
        assert 0 < each["copied"] < 2000
    (size,) = every[0]["files"].values()
    assert BYTES <= size <= BYTES + 8192


@SEVERAL
def test_memory_is_returned_with_the_last_array_of_each_rank(ranks: int) -> None:
    for each in found(ranks):
        assert len(each["one machine"]["while one is used"]) == 1
        assert each["one machine"]["afterwards"] == []


@SEVERAL
def test_each_machine_makes_and_holds_its_own(ranks: int) -> None:
    every = [each["two machines"] for each in found(ranks)]
    assert [each["ranks of machines"] for each in found(ranks)] == [[ranks, ranks // 2]] * ranks
    for rank, each in enumerate(every):
        assert_right(each)
        assert each["times"] == (rank < 2), "by the first rank of each"
        assert each["files"] == every[rank % 2]["files"]
        assert each["shared"] == [ranks > 2] * 2
    if ranks > 2:
        assert every[0]["files"] != every[1]["files"]


@SEVERAL
def test_machines_of_one_rank_make_what_they_need(ranks: int) -> None:
    for each in found(ranks):
        assert_right(each["machines of one rank"])
        assert each["machines of one rank"]["times"] == 1
        assert each["machines of one rank"]["files"] == {}


@SEVERAL
@pytest.mark.parametrize("case", ["last is blind", "another file"])
def test_ranks_that_do_not_see_each_others_files_hold_copies(ranks: int, case: str) -> None:
    for rank, each in enumerate(found(ranks)):
        assert_right(each[case])
        assert each[case]["times"] == (rank == 0)
        assert each[case]["shared"] == [False, False]
        assert each[case]["protected"] == [True, True]
        assert BYTES <= each[case]["copied"] < BYTES + 2000


@SEVERAL
def test_few_numbers_are_sent(ranks: int) -> None:
    assert all(each["small"] for each in found(ranks))


@SEVERAL
def test_all_ranks_raise_what_the_first_one_does(ranks: int) -> None:
    words = [each["failed"] for each in found(ranks)]
    assert words == ["there must be a table", *["there must be a table (met on rank 0)"] * (ranks - 1)]
