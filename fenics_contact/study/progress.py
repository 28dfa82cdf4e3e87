"""Tells how far a study is and how long it will still take."""

from __future__ import annotations

import importlib.util
import logging
import sys
from collections.abc import Sequence
from types import TracebackType
from typing import Any, TextIO

import numpy as np

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


def duration(seconds: float | None) -> str:
    """Write a duration for readers: 8 s, 3 min, 1.5 h."""
    if seconds is None:
        return "?"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"


class Progress:
    """A bar on a terminal, lines in a log elsewhere."""

    def __init__(self, runs: Sequence[Parameters], title: str, stream: TextIO | None = None) -> None:
        """Announce so many measurements."""
        self._left, self._count, self._forecast = list(runs), len(runs), Forecast()
        stream = sys.stderr if stream is None else stream
        shown = stream.isatty() and importlib.util.find_spec("tqdm") is not None
        self._bar: Any = _bar(self._count, title, stream) if shown else None

    def __enter__(self) -> Progress:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the bar."""
        if self._bar is not None:
            self._bar.close()

    def begin(self, parameters: Parameters) -> None:
        """Say which run begins."""
        if self._bar is not None:
            self._bar.set_postfix_str(f"{described(parameters)}, {self.left()} left")

    def done(self, parameters: Parameters, seconds: float, words: str) -> None:
        """Count a run.

        Args:
            parameters: Its settings.
            seconds: Wall time from the start of its process to its end.
            words: What came out.
        """
        self._left.remove(parameters)
        self._forecast.learn(parameters, seconds)
        if self._bar is not None:
            self._bar.update()
            self._bar.set_postfix_str(f"{self.left()} left")
        else:
            number = self._count - len(self._left)
            logger.info(
                "%d/%d %s: %s, %s left", number, self._count, described(parameters), words, self.left()
            )

    def left(self) -> str:
        """Return the time that the remaining runs will take, in words."""
        return duration(self._forecast.seconds(self._left))


def described(parameters: Parameters) -> str:
    """Return the settings of a run in a few words."""
    words = [f"size {parameters.size}", parameters.cell, parameters.discretisation]
    words.append("balanced" if parameters.balanced else f"{parameters.tolerance:.0e}")
    if parameters.solver != "newton":
        words.append(parameters.solver)
    if parameters.subdomains is not None:
        words.append(f"{parameters.subdomains} subdomains")
    return ", ".join(words)


def _bar(count: int, title: str, stream: TextIO) -> Any:
    from tqdm import tqdm  # an extra: where it is missing there are lines

    pattern = "{desc} {n_fmt}/{total_fmt} |{bar}| {postfix}"
    return tqdm(total=count, desc=title, file=stream, bar_format=pattern, dynamic_ncols=True)
