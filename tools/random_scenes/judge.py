"""What becomes of a random scene: solved and verified, refused with a reason, or one of the ways to fail."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from mpi4py import MPI

from fenics_contact import solve_scene
from fenics_contact.errors import ConvergenceError, FenicsContactError
from tools.random_scenes.generator import Sample, sample
from tools.random_scenes.refusals import unjust
from tools.random_scenes.revolved import revolved
from tools.random_scenes.verifier import complaints


class Outcome(StrEnum):
    """How a scene ended."""

    #: Solved, and everything that must hold was found to hold on whole bodies.
    SOLVED = "solved"
    #: Refused with an error of the package whose reason was found to be true.
    REFUSED = "refused"
    #: The solver said that it did not reach its tolerance.
    NOT_CONVERGED = "not converged"
    #: An answer that breaks a law, or a refusal of what can be solved.
    WRONG = "wrong"
    #: An error that is none of the package's.
    TRACEBACK = "traceback"
    #: No end within the time limit.
    HANG = "hang"
    #: The process ended.
    DIED = "died"


#: What need not be explained.
GOOD = (Outcome.SOLVED, Outcome.REFUSED)


@dataclass(frozen=True)
class Verdict:
    """What became of a scene.

    Attributes:
        seed: Its seed.
        outcome: How it ended.
        words: The scene in words.
        detail: Message of an error, or what is wrong.
        seconds: How long it took.
        products: Products with the dual operator, 0 where there was no answer.
        share: Error relative to what an interval allows, of judgements of intervals.
    """

    seed: int
    outcome: Outcome
    words: str = ""
    detail: str = ""
    seconds: float = 0.0
    products: int = 0
    share: float = 0.0

    def written(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)

    @classmethod
    def read(cls, data: dict[str, Any]) -> Verdict:
        """Take back what `written` gave."""
        return cls(**{**data, "outcome": Outcome(data["outcome"])})


def judge(seed: int, build: Callable[[int], Sample] = sample) -> Verdict:
    """Build a scene, solve it, and verify the answer or the refusal."""
    start = time.perf_counter()
    made = build(seed)
    outcome, detail, products = _ended(made)
    return Verdict(seed, outcome, made.words, detail, round(time.perf_counter() - start, 3), products)


def judge_revolved(seed: int) -> Verdict:
    """The same of bodies of revolution."""
    return judge(seed, revolved)


def placed(error: Exception) -> str:
    """Return an error in words with the line that raised it."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{place.filename.rsplit('/', 2)[-1]}:{place.lineno}"
    return f"{type(error).__name__}: {error} ({where})"


def _ended(made: Sample) -> tuple[Outcome, str, int]:
    try:
        state = solve_scene(made.scene, MPI.COMM_SELF, partitions=made.cut, tolerance=made.tolerance)
    except ConvergenceError as error:
        return Outcome.NOT_CONVERGED, str(error), error.history[-1].products if error.history else 0
    except FenicsContactError as error:
        objection = unjust(error, made.unturned)
        reason = f"{type(error).__name__}: {error}"
        return (Outcome.WRONG, f"{objection}; {reason}", 0) if objection else (Outcome.REFUSED, reason, 0)
    except Exception as error:  # whatever comes from inside is what is looked for
        return Outcome.TRACEBACK, placed(error), 0
    found = complaints(state, made)
    return (Outcome.WRONG if found else Outcome.SOLVED), "; ".join(found), state.solution.products
