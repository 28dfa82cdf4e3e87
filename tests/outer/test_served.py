"""Rank 0 drives and the others serve: nobody waits for ranks that are gone, whoever fails."""

from __future__ import annotations

import json
import multiprocessing
import pickle
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import served
from fenics_contact.errors import InvalidInputError
from tests.outer.pushed import response

HERE = Path(__file__).parent


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_no_rank_is_left_waiting_whoever_fails(mpirun: Callable[..., str], ranks: int) -> None:
    lines = mpirun(HERE / "serving.py", ranks, timeout=60.0).splitlines()
    ranks_total = ranks * (ranks + 1)
    others, bug = ranks - 1, "ZeroDivisionError" if ranks == 1 else "RemoteError"
    values = [float(ranks_total), "InfeasibleError", bug, 3.0 * ranks_total]

    def told(first: str, rest: str) -> list[list[str]]:
        return [[first], *([rest] for _ in range(others))]

    last = {"server_fails": "ValueError", "server_exits": "SystemExit"}
    assert lines == [
        f"answers: {[values, *([] for _ in range(others))]}",
        f"tool_fails: {told('KeyError', 'RemoteError')}",
        f"call_fails: {told('InfeasibleError', 'InfeasibleError')}",
        f"tool_exits: {told('SystemExit', 'SystemExit')}",
        *(f"{case}: {[*(others * [['RemoteError']]), [error]]}" for case, error in last.items()),
    ]


@pytest.mark.parametrize("ranks", [2, 4])
def test_rank_0_samples_a_scene_as_one_rank_would(mpirun: Callable[..., str], ranks: int) -> None:
    found = json.loads(mpirun(HERE / "sampled.py", ranks))
    alone, samples = response(failures="nan"), ((0.3, 1e3), (0.25, 9e2), (0.19, 1e3), (0.5, 5e2))
    expected = [alone(friction=friction, load=load).array for friction, load in samples]
    np.testing.assert_allclose(found["rows"], np.nan_to_num(expected, nan=-1.0), rtol=1e-4)
    assert found["evaluations"] == ranks * [4], "every rank serves every call"


def test_the_function_ends_with_its_block() -> None:
    with served(abs, MPI.COMM_SELF) as call:
        assert call is not None
        assert call(-2) == 2
    with pytest.raises(InvalidInputError, match="this one has ended: call it inside"):
        call(-2)


def test_threads_of_a_tool_take_turns() -> None:
    busy, most = 0, 0

    def slow(x: int) -> int:
        nonlocal busy, most
        busy += 1
        most = max(most, busy)
        threading.Event().wait(0.01)
        busy -= 1
        return x

    with served(slow, MPI.COMM_SELF) as call:
        threads = [threading.Thread(target=call, args=(k,)) for k in range(5)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert most == 1


def test_another_process_is_refused() -> None:
    def child(call: Callable[[int], int], heard: multiprocessing.SimpleQueue[str]) -> None:
        try:
            call(1)
        except InvalidInputError as error:
            heard.put(str(error))

    with served(abs, MPI.COMM_SELF) as call:
        with pytest.raises(InvalidInputError, match="one worker, no process pool"):
            pickle.dumps(call)
        context = multiprocessing.get_context("fork")
        heard = context.SimpleQueue()
        process = context.Process(target=child, args=(call, heard))
        process.start()
        process.join(30.0)
        assert not heard.empty()
        assert "belongs to the process of rank 0" in heard.get()
