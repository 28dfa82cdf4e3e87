"""Runs in processes of their own: failures are recorded, progress is told, repeats become one."""

from __future__ import annotations

import io
import json
import logging
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fenics_contact._base.progress import LOGGER_NAME, Event
from fenics_contact.study import runner
from fenics_contact.study.runner import Job, Record, Store, fingerprint, measure, measure_all, summarised

JOB = Job("nothing", "math:sqrt", limit=60.0)


def test_a_process_that_crashes_is_recorded_with_its_last_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "PROGRAM", "raise SystemExit('out of memory')")
    record = measure(JOB)
    assert record["failed"] == {"kind": "crash", "message": "it ended with exit status 1: out of memory"}
    assert record["load_average"] >= 0.0


def test_a_process_that_writes_no_record_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "PROGRAM", "pass")
    assert measure(JOB)["failed"]["message"].startswith("it ended with exit status 0")


def test_a_process_without_end_is_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    sign = tmp_path / "late"
    code = f"import pathlib, time; time.sleep(2.0); pathlib.Path({str(sign)!r}).touch()"
    monkeypatch.setattr(runner, "PROGRAM", code)
    record = measure(replace(JOB, limit=0.5))
    assert record["failed"] == {"kind": "timeout", "message": "it did not end within 0.5 s and was ended"}
    time.sleep(2.0)
    assert not sign.exists()


def test_a_run_finds_this_package_and_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import os, sys, fenics_contact; sys.exit(fenics_contact.__file__ + os.environ['OMP_NUM_THREADS'])"
    monkeypatch.setattr(runner, "PROGRAM", code)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    words = measure(JOB)["failed"]["message"]
    assert words.endswith(str(Path(runner.__file__).parents[1] / "__init__.py") + "1")


def test_ranks_of_a_study_start_where_mpi_has_left_its_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMPI_MCA_ess", "singleton")
    code = "from mpi4py import MPI; raise SystemExit(f'{MPI.COMM_WORLD.size} ranks')"
    monkeypatch.setattr(runner, "PROGRAM", code)
    message = measure(replace(JOB, ranks=2))["failed"]["message"]
    assert "2 ranks" in message


def test_a_launcher_that_says_nothing_is_told_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "sharing_launcher", lambda ranks: ["false", str(ranks)])
    message = measure(replace(JOB, ranks=2))["failed"]["message"]
    assert message.startswith("it ended with exit status 1: it printed nothing and probably could not start")
    assert "`false 2 " in message


@pytest.mark.parametrize(
    ("last", "starts"),
    [("sys.exit(1)", 2), ("sys.exit('out of memory')", 1), ("os.kill(os.getpid(), 9)", 1)],
)
def test_only_a_process_that_ends_by_itself_without_a_word_is_started_once_more(
    last: str,
    starts: int,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
) -> None:
    count = tmp_path / "count"
    code = (
        "import json, os, sys; from pathlib import Path\n"
        f"count = Path({str(count)!r}); starts = count.read_text() + '.' if count.exists() else '.'\n"
        "count.write_text(starts)\n"
        f"if len(starts) == 1: {last}\n"
        "Path(json.loads(sys.argv[1])['file']).write_text('{\"seconds\": 2.0}')"
    )
    monkeypatch.setattr(runner, "PROGRAM", code)
    with caplog.at_level(logging.WARNING):
        record = measure(JOB)
    assert len(count.read_text()) == starts
    assert record.get("seconds") == (2.0 if starts == 2 else None)
    assert ("nothing exited with status 1 and printed nothing: once more" in caplog.text) == (starts == 2)


def test_a_function_is_called_with_its_arguments_and_its_memory_is_told(tmp_path: Path) -> None:
    code = "def known(comm, size, more=0):\n    return {'counts': {'ranks': comm.size, 'n': size + more}}\n"
    (tmp_path / "a_case.py").write_text(code)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(tmp_path))
        job = Job("a case", "a_case:known", {"size": 2}, {"more": 1}, ranks=2)
        first, later = measure(job), measure(job, first=False)
        alone = measure(replace(job, function="a_case:known", ranks=0))
    assert (first["counts"], later["counts"]) == ({"ranks": 2, "n": 3}, {"ranks": 2, "n": 2})
    assert first["peak_memory"] >= first["import_memory"] > 2**20
    assert "'NoneType' object has no attribute 'size'" in alone["failed"]["message"], (
        "no MPI, no communicator"
    )


def answers(monkeypatch: pytest.MonkeyPatch, **known: Record) -> list[str]:
    """Let jobs answer by their name, and return a list of those that were asked."""
    asked: list[str] = []

    def answer(job: Job, *, first: bool = True) -> Record:
        asked.append(job.name)
        return {"load_average": 0.1, **known.get(job.name, {"seconds": 1.0})}

    monkeypatch.setattr(runner, "measure", answer)
    return asked


def test_there_is_a_line_about_every_run_and_the_time_left_follows_from_weights(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    answers(monkeypatch, b={"failed": {"kind": "crash", "message": "gone"}})
    moments = iter([0.0, 10.0, 10.0, 12.0])
    monkeypatch.setattr(runner, "perf_counter", lambda: next(moments))
    monkeypatch.setattr(runner, "show_progress", lambda stream: open(tmp_path / "lines", "w"))
    jobs = [Job("a", "m:f", weight=1.0), Job("b", "m:f", weight=4.0)]
    with caplog.at_level(logging.INFO), caplog.at_level(logging.DEBUG, LOGGER_NAME):
        measure_all(jobs, Store(tmp_path, "mark"), title="A study")
    lines = [record.message for record in caplog.records if record.name == runner.__name__]
    assert lines == ["1/2 a: 1.00 s, 40 s left", "2/2 b: failed: gone"]
    events = [record.progress for record in caplog.records if hasattr(record, "progress")]
    assert all(isinstance(event, Event) for event in events)
    begun = next(event for event in events if event.words == "b")
    assert (begun.what, begun.number, begun.total) == ("A study", 1, 2)


def test_repeats_come_after_all_others_and_warm_ups_only_before_something(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = answers(monkeypatch, long={"seconds": 20.0})
    jobs = [Job("short", "m:f", repeats=2, short=10.0), Job("long", "m:f", repeats=2, short=10.0)]
    store = Store(tmp_path, "mark")
    for _ in range(2):
        measure_all(jobs, store, title="", warm_up=[Job("warm", "m:f")], stream=io.StringIO())
    assert asked == ["warm", "short", "long", "short"]
    assert [len(store.records(job)) for job in jobs] == [2, 1]
    assert all(store.complete(job) for job in jobs)
    store.forget(jobs[0])
    assert not store.complete(jobs[0])


def test_other_arguments_ranks_and_threads_are_other_measurements(tmp_path: Path) -> None:
    store, job = Store(tmp_path, "mark"), Job("a", "m:f", {"n": 1})
    others = [replace(job, arguments={"n": 2}), replace(job, ranks=2), replace(job, threads=2)]
    assert len({store.file(each, 0) for each in (job, *others)}) == 4
    assert Store(tmp_path, "other").file(job, 0) != store.file(job, 0)
    assert store.file(replace(job, repeats=5, limit=1.0), 0) == store.file(job, 0)


def test_a_store_keeps_what_a_run_was(tmp_path: Path) -> None:
    store, job = Store(tmp_path, "mark"), Job("a", "m:f", {"n": 1})
    store.write(job, 0, {"seconds": 1.0, "load_average": 0.5})
    kept = json.loads(store.file(job, 0).read_text())
    assert (kept["name"], kept["arguments"], kept["code"]) == ("a", {"n": 1}, "mark")
    assert store.read(job, 1) == {}


def test_the_fingerprint_follows_the_code_that_is_measured(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text("x = 1\n")
    before = fingerprint([file])
    (tmp_path / "README.md").write_text("words\n")
    assert fingerprint([file]) == before
    file.write_text("x = 2\n")
    assert fingerprint([file]) != before


def record(**changes: Any) -> Record:
    known = {"counts": {"f_products": 50}, "seconds": 1.0, "phases": {"solve": 0.5}, "load_average": 0.1}
    return known | changes


def test_seconds_are_medians_and_the_rest_is_kept() -> None:
    runs = [record(seconds=s, phases={"solve": s / 2}, energy=-2.0) for s in (3.0, 1.0, 2.0)]
    summary = summarised("chain", runs)
    assert summary["seconds"] == 2.0
    assert summary["phases"] == {"solve": 1.0}
    assert summary["energy"] == -2.0
    assert summary["repeats"] == 3


def test_counts_that_change_from_run_to_run_are_refused() -> None:
    runs = [record(), record(counts={"f_products": 51})]
    with pytest.raises(ValueError, match=r"counts of chain must be equal in all repetitions, got .*51"):
        summarised("chain", runs)


def test_ranks_of_a_run_may_outnumber_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    ranks = (os.cpu_count() or 1) + 1
    code = "import sys; from mpi4py import MPI; sys.stderr.write('one of %d ranks\\n' % MPI.COMM_WORLD.size)"
    monkeypatch.setattr(runner, "PROGRAM", code)
    assert f"one of {ranks} ranks" in measure(replace(JOB, ranks=ranks))["failed"]["message"]
