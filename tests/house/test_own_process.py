"""A process of its own may crash: its caller goes on, and what it reports comes over."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
import warnings
from math import sqrt

import pytest

from fenics_contact import clean_environment
from fenics_contact._base.apart import OwnProcess
from fenics_contact.errors import InvalidInputError
from tests.house.source import ROOT


def own_process() -> OwnProcess:
    return OwnProcess("reading", "read another")


def test_what_a_call_leaves_is_found_by_the_next_and_not_here() -> None:
    before = sys.getrecursionlimit()
    with own_process() as process:
        process.call(sys.setrecursionlimit, before + 7)
        assert process.call(sys.getrecursionlimit) == before + 7
    assert sys.getrecursionlimit() == before


def test_a_crash_is_an_error_with_its_signal_and_what_to_do() -> None:
    words = r"^reading must end, but the process crashed \(signal 11, .*\): read another$"
    with own_process() as process, pytest.raises(InvalidInputError, match=words):
        process.call(signal.raise_signal, signal.SIGSEGV)


def test_an_exit_is_an_error_with_its_last_words() -> None:
    words = r"ended itself \(exit status 3, its last words: no such door\): read another"
    with own_process() as process:
        process.call(os.write, 2, b"no such\ndoor\n")
        with pytest.raises(InvalidInputError, match=words):
            process.call(os._exit, 3)


def test_errors_warnings_and_logs_come_over(caplog: pytest.LogCaptureFixture) -> None:
    logger = logging.getLogger("fenics_contact.far")
    with own_process() as process, caplog.at_level(logging.INFO, logger="fenics_contact"):
        with pytest.raises(ValueError, match="math domain error") as caught:
            process.call(sqrt, -1.0)
        assert "in a process of its own:\nTraceback" in caught.value.__notes__[0]
        with pytest.warns(UserWarning, match="thin ice"):
            process.call(warnings.warn, "thin ice")
        process.call(logger.info, "%d cells", 3)
    assert [record.getMessage() for record in caplog.records] == ["3 cells"]


def test_it_ends_with_its_parent_in_the_middle_of_a_call() -> None:
    code = """
import os, sys, threading, time
from fenics_contact._base.apart import OwnProcess
with OwnProcess("waiting", "wait less") as process:
    print(process.call(os.getpid), flush=True)
    process.call(time.sleep, 60)
"""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(
        command, cwd=ROOT, env=clean_environment(), stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        parent.kill()
    end = time.monotonic() + 10.0
    while time.monotonic() < end and _runs(child):
        time.sleep(0.05)
    assert not _runs(child)


def _runs(number: int) -> bool:
    """Return whether a process runs, and is not just waiting for somebody to ask how it ended."""
    done = subprocess.run(
        ["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, env=clean_environment()
    )
    return done.stdout.strip()[:1] not in ("", "Z")
