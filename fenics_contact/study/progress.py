"""Tells how far a study is and how long it will still take."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from types import TracebackType

import numpy as np

from fenics_contact.progress import Task, duration
from fenics_contact.study.parameters import Parameters

#: Power of `Parameters.size` with which time grows, until two sizes have shown what it is.
GROWTH = 1.5

logger = logging.getLogger(__name__)


class Forecast:
    """Learns what runs take from those that are done, by their mesh alone."""

    def __init__(self) -> None:
        """Begin without knowledge."""
        self._spent: dict[int, list[float]] = {}

    def learn(self, parameters: Parameters, seconds: float) -> None:
        """Note what a run took."""
        self._spent.setdefault(parameters.size, []).append(max(seconds, 1e-3))

    def seconds(self, runs: Sequence[Parameters]) -> float | None:
        """Return what these runs will take, None as long as nothing is known."""
        if not self._spent:
            return None
        return sum(self._expected(run.size) for run in runs)

    def _expected(self, size: int) -> float:
        if size in self._spent:
            return float(np.mean(self._spent[size]))
        sizes = sorted(self._spent, key=lambda known: abs(np.log(known / size)))
        nearest = float(np.mean(self._spent[sizes[0]]))
        growth = GROWTH
        if len(sizes) > 1:
            other = float(np.mean(self._spent[sizes[1]]))
            growth = np.log(nearest / other) / np.log(sizes[0] / sizes[1])
        return float(nearest * (size / sizes[0]) ** np.clip(growth, 0.0, 4.0))


class Progress:
    """Tells which run of a study is under way, and logs a line about each that is done."""

    def __init__(self, runs: Sequence[Parameters], title: str) -> None:
        """Announce so many measurements."""
        self._left, self._count, self._forecast = list(runs), len(runs), Forecast()
        self._task = Task(title, unit="runs", total=len(runs))

    def __enter__(self) -> Progress:
        """Begin."""
        self._task.begin(0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End."""
        self._task.end(error)

    def begin(self, parameters: Parameters) -> None:
        """Say which run begins."""
        seconds = self._forecast.seconds(self._left)
        self._task.step(self._count - len(self._left), words=described(parameters), left=seconds)

    def done(self, parameters: Parameters, seconds: float, words: str) -> None:
        """Count a run.

        Args:
            parameters: Its settings.
            seconds: Wall time from the start of its process to its end.
            words: What came out.
        """
        self._left.remove(parameters)
        self._forecast.learn(parameters, seconds)
        number, left = self._count - len(self._left), self._forecast.seconds(self._left)
        self._task.step(number, left=left)
        rest = f", {duration(left)} left" if self._left else ""
        logger.info("%d/%d %s: %s%s", number, self._count, described(parameters), words, rest)


def described(parameters: Parameters) -> str:
    """Return the settings of a run in a few words."""
    words = [f"size {parameters.size}", parameters.cell, parameters.discretisation]
    words.append("balanced" if parameters.balanced else f"{parameters.tolerance:.0e}")
    if parameters.solver != "newton":
        words.append(parameters.solver)
    if parameters.subdomains is not None:
        words.append(f"{parameters.subdomains} subdomains")
    return ", ".join(words)
