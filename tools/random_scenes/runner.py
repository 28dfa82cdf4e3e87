"""Many random scenes in a few processes, each with a time limit, so that hangs and crashes are found."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from fenics_contact import clean_environment
from tools.random_scenes.corner_intervals import judge_corners, judge_nonlinear
from tools.random_scenes.deformed_judge import judge_history
from tools.random_scenes.intervals import judge_interval
from tools.random_scenes.judge import Outcome, Verdict, judge, judge_revolved
from tools.random_scenes.meetings_judge import judge_meeting

ROOT = Path(__file__).parents[2]
#: A process that waits and computes nothing hangs, too, if it does so for this many times the limit.
PATIENCE = 40.0
Judge = Callable[[int], Verdict]
#: Scenes of small strain and linear materials, those of revolution, and histories of large deformations;
#: intervals of quantities, and of scenes with corners and contrasts, of rubber, metal and large sliding;
#: scenes in which features meet, written in two ways.
JUDGES: dict[str, Judge] = {
    "linear": judge, "revolved": judge_revolved, "deformed": judge_history, "intervals": judge_interval,
    "corners": judge_corners, "meetings": judge_meeting,
    "nonlinear": judge_nonlinear,
}  # fmt: skip
#: Begins the lines that a worker writes; libraries may write others.
MARK = "verdict: "


def work(judge: Judge) -> None:
    """Judge the scenes whose seeds come in, one a line, until there are no more."""
    warnings.simplefilter("error", RuntimeWarning)  # numbers that are none come from inside, too
    for line in sys.stdin:
        print(MARK + json.dumps(judge(int(line)).written()), flush=True)


def judged(
    seeds: Iterable[int],
    processes: int,
    limit: float,
    told: Callable[[Verdict], None] = lambda verdict: None,
    kind: str = "linear",
) -> list[Verdict]:
    """Judge scenes in several processes.

    Args:
        seeds: Which.
        processes: How many at a time; 0 judges in this process, without a limit.
        limit: Seconds of processor time for a scene.
        told: Gets every verdict as it comes.
        kind: Which scenes, see `JUDGES`.

    Returns:
        By seed.
    """
    waiting: queue.Queue[int] = queue.Queue()
    for seed in seeds:
        waiting.put(seed)
    found: list[Verdict] = []
    lock = threading.Lock()

    def note(verdict: Verdict) -> None:
        with lock:
            found.append(verdict)
            told(verdict)

    if processes == 0:
        for seed in iter_of(waiting):
            note(JUDGES[kind](seed))
    threads = [threading.Thread(target=_serve, args=(waiting, limit, note, kind)) for _ in range(processes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sorted(found, key=lambda verdict: verdict.seed)


def iter_of(waiting: queue.Queue[int]) -> Iterator[int]:
    """Return what waits until there is no more."""
    while True:
        try:
            yield waiting.get_nowait()
        except queue.Empty:
            return


def _serve(waiting: queue.Queue[int], limit: float, note: Callable[[Verdict], None], kind: str) -> None:
    """Give the seeds that wait to one worker process; a new one where it dies or does not end in time."""
    # PETSc's handler, where it is loaded, would end this process when it writes to one that has died.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
    worker: _Worker | None = None
    for seed in iter_of(waiting):
        worker = worker or _Worker(kind)
        verdict = worker.judge(seed, limit)
        if verdict.outcome in (Outcome.HANG, Outcome.DIED):
            worker.end()
            worker = None
        note(verdict)
    if worker is not None:
        worker.end()


class _Worker:
    """A process that judges one scene after another."""

    def __init__(self, kind: str) -> None:
        command = [sys.executable, "-m", "tools.random_scenes", "--worker", "--kind", kind]
        self._process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=clean_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        assert self._process.stdout is not None
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    def _read(self, stream: IO[str]) -> None:
        for line in stream:
            if line.startswith(MARK):
                self._lines.put(line[len(MARK) :])
        self._lines.put(None)

    def judge(self, seed: int, limit: float) -> Verdict:
        """Let it judge one scene."""
        assert self._process.stdin is not None
        start, spent = time.monotonic(), self._spent()
        try:
            self._process.stdin.write(f"{seed}\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return self._died(seed)
        while True:
            try:
                line = self._lines.get(timeout=0.5)
                return self._died(seed) if line is None else Verdict.read(json.loads(line))
            except queue.Empty:
                used = self._spent() - spent
                if used > limit or time.monotonic() - start > PATIENCE * limit:
                    return Verdict(seed, Outcome.HANG, detail=f"no end after {used:.0f} s", seconds=used)

    def _died(self, seed: int) -> Verdict:
        return Verdict(seed, Outcome.DIED, detail=f"exit status {self._process.wait()}")

    def _spent(self) -> float:
        """Return the seconds of processor time so far: on a busy machine scenes may take longer."""
        try:
            times = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")

    def end(self) -> None:
        """Kill it."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            with suppress(BrokenPipeError):
                stream.close()


def table(verdicts: Sequence[Verdict]) -> str:
    """Return the counts of all outcomes, refusals by their reason, and what has to be explained."""
    lines = [f"{len(verdicts)} scenes"]
    for outcome in Outcome:
        own = [verdict for verdict in verdicts if verdict.outcome is outcome]
        lines.append(f"{outcome.value:15s} {len(own)}")
        if outcome is Outcome.REFUSED:
            reasons: dict[str, int] = {}
            for verdict in own:
                reasons[_reason(verdict)] = reasons.get(_reason(verdict), 0) + 1
            ordered = sorted(reasons.items(), key=lambda item: -item[1])
            lines += [f"    {count:4d} {reason}" for reason, count in ordered]
    products = sorted(verdict.products for verdict in verdicts if verdict.outcome is Outcome.SOLVED)
    seconds = sorted(verdict.seconds for verdict in verdicts)
    if products:
        lines.append(f"products: median {products[len(products) // 2]}, largest {products[-1]}")
    shares = sorted(verdict.share for verdict in verdicts if verdict.share > 0.0)
    if shares:
        lines.append(f"errors relative to intervals: median {shares[len(shares) // 2]:.2g}")
    if seconds:
        lines.append(f"seconds: median {seconds[len(seconds) // 2]:.2f}, largest {seconds[-1]:.1f}")
    return "\n".join(lines)


def _reason(verdict: Verdict) -> str:
    """Return the rule that was broken: the message up to where it tells what was given."""
    return verdict.detail.split(", but")[0].split(", got")[0][:150]
