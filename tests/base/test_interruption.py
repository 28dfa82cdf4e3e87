"""Signals: heard by those who asked for it, obeyed at a safe point, and put back."""

from __future__ import annotations

import logging
import signal
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from fenics_contact import Checkpoint, Interrupted, interruptible
from fenics_contact._base.checkpoint import SIGNALS, safe_point, without_checkpoint
from fenics_contact.errors import InvalidInputError


class Aborted(Exception):
    """What a communicator of this test raises when all ranks are killed."""


def ranks(rank: int, others: int = 0) -> Any:
    """Return a communicator of two ranks, the other of which has heard a signal."""

    def abort(code: int) -> None:
        raise Aborted(code)

    return SimpleNamespace(rank=rank, size=2, allgather=lambda mine: [mine, others], Abort=abort)


def kept() -> str:
    return "2 of 3 steps are kept"


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_waits_for_a_safe_point(number: int, caplog: pytest.LogCaptureFixture) -> None:
    written = []
    with interruptible() as hearing:
        safe_point(kept, lambda: None, None)
        signal.raise_signal(number)
        assert hearing.requested == number
        with pytest.raises(Interrupted, match="2 of 3 steps are kept") as stop:
            safe_point(kept, lambda: written.append(True), None)
    assert written == [True]
    assert stop.value.code == 128 + number
    assert stop.value.signal is signal.Signals(number)
    name = signal.Signals(number).name
    assert caplog.messages == [
        f"{name}: the run stops after the step under way, at once on a second signal; so far 2 of 3 steps "
        "are kept",
        f"stopped by {name}: 2 of 3 steps are kept",
    ]
    assert {record.levelno for record in caplog.records} == {logging.WARNING}


def test_the_second_signal_stops_at_once() -> None:
    with interruptible():
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Interrupted, match="stopped at once by SIGTERM"):
            signal.raise_signal(signal.SIGTERM)


def test_the_second_signal_stops_all_ranks_at_once() -> None:
    with interruptible(ranks(0)):
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Aborted, match="143"):
            signal.raise_signal(signal.SIGTERM)


def test_a_signal_that_another_rank_has_heard_stops_this_one(caplog: pytest.LogCaptureFixture) -> None:
    with interruptible(ranks(1, signal.SIGUSR1)) as hearing, pytest.raises(Interrupted, match="SIGUSR1"):
        hearing.safe_point(kept)
    assert caplog.records == [], "rank 0 alone says it"


def test_ranks_that_have_heard_nothing_go_on() -> None:
    with interruptible(ranks(0)):
        safe_point(kept, lambda: pytest.fail("nothing is to be written"), None)


def test_without_asking_nothing_is_heard() -> None:
    before = [signal.getsignal(number) for number in SIGNALS]
    safe_point(kept, lambda: pytest.fail("nothing is to be written"), None)
    assert [signal.getsignal(number) for number in SIGNALS] == before


@pytest.mark.parametrize("number", SIGNALS)
def test_handlers_are_put_back_also_after_a_failure(number: int) -> None:
    def fail() -> None:
        with interruptible() as hearing:
            assert signal.getsignal(number) is hearing
            raise ZeroDivisionError

    before = signal.getsignal(number)
    with pytest.raises(ZeroDivisionError):
        fail()
    assert signal.getsignal(number) is before


def test_other_signals_can_be_asked_for() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interruptible(signals=(signal.SIGUSR2,)):
        assert signal.getsignal(signal.SIGINT) is before
        signal.raise_signal(signal.SIGUSR2)
        with pytest.raises(Interrupted, match="SIGUSR2"):
            safe_point(kept, lambda: None, None)


def test_a_loop_of_ones_own_has_safe_points() -> None:
    def run() -> None:
        with interruptible() as hearing:
            for number in range(10):
                hearing.safe_point()
                done.append(number)
                if number == 3:
                    signal.raise_signal(signal.SIGTERM)

    done: list[int] = []
    with pytest.raises(Interrupted):
        run()
    assert done == [0, 1, 2, 3]


def test_another_thread_is_refused() -> None:
    found: list[BaseException] = []

    def enter() -> None:
        try:
            with interruptible():
                pass
        except InvalidInputError as error:
            found.append(error)

    thread = threading.Thread(target=enter, name="helper")
    thread.start()
    thread.join()
    assert "signals reach the main thread alone: enter interruptible there" in str(found[0])


def test_words_say_how_to_go_on() -> None:
    assert Checkpoint("run.npz").resume_hint(3, "3 of 5 load steps") == (
        "3 of 5 load steps are kept in run.npz: run the same command again to go on"
    )
    assert Checkpoint("run.npz").resume_hint(1, "1 evaluation").startswith("1 evaluation is kept in run.npz")
    assert (
        Checkpoint("run.npz", resume=False)
        .resume_hint(3, "3 load steps")
        .endswith("to go on run again without resume=False")
    )
    assert "nothing was done yet that run.npz could keep" in Checkpoint("run.npz").resume_hint(
        0, "0 load steps"
    )
    assert without_checkpoint("3 load steps") == (
        'nothing is kept of 3 load steps: give checkpoint=Checkpoint("run.npz"), and the same command, run '
        "again, goes on from where it was stopped"
    )
