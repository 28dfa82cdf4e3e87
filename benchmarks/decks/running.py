"""One deck in both programs."""

from __future__ import annotations

import re
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from types import FrameType

from mpi4py import MPI

from benchmarks.decks.calculix import Block, program, reference, run_calculix, text_of, with_requests
from benchmarks.decks.comparing import Agreement, agreement
from benchmarks.decks.refining import refined
from fenics_contact.decks import read_deck
from fenics_contact.errors import FenicsContactError

#: Where Debian's package calculix-ccx-test has the decks.
FOLDER = Path("/usr/share/doc/calculix-ccx-test/examples/test")
#: Tolerance of the dual solver.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Outcome:
    """What became of a deck.

    Attributes:
        contact: Whether it has contact pairs.
        seconds: Of reading and solving it here.
        calculix: Of CalculiX, None where it was not run.
        refused: Why it was not solved, "" if it was.
    """

    name: str
    contact: bool
    agreement: Agreement = field(default_factory=Agreement)
    seconds: float = 0.0
    calculix: float | None = None
    refused: str = ""

    @property
    def reason(self) -> str:
        """Why it was refused, without what differs between decks."""
        words = re.sub(r"^\S+\.inp(?:, line \d+)?: ", "", self.refused)
        return re.sub(r"\b\d+(?:\.\d+)?(?:e[+-]?\d+)?\b|'[^']*'", "#", words[:120])

    @property
    def row(self) -> str:
        """Its row in the table."""
        parts = self.agreement.displacement, self.agreement.force, self.agreement.stress
        numbers = ["–" if value is None else f"{value:.1e}" for value in parts]
        theirs = "–" if self.calculix is None else f"{self.calculix:.2f}"
        return f"| {self.name} | {' | '.join(numbers)} | {self.seconds:.2f} | {theirs} |"

    @property
    def line(self) -> str:
        """What the terminal shows."""
        return f"{self.name}: {self.refused[:300]}" if self.refused else self.row


def deck_names(folder: Path) -> list[str]:
    """Return the names of the decks in a folder."""
    return sorted({path.name.split(".inp")[0] for path in folder.glob("*.inp*")})


def outcome(folder: Path, name: str, limit: float = 120.0, run: bool = True, times: int = 0) -> Outcome:
    """Solve a deck, and compare it with CalculiX, or with the reference files if that is not to run.

    `times`: how often its hexahedra are cut into eight before.
    """
    text = text_of(folder / f"{name}.inp")
    for _ in range(times):
        text = refined(text)
    contact = bool(re.search(r"^\*CONTACT *PAIR", text, re.IGNORECASE | re.MULTILINE))
    start = perf_counter()
    try:
        with tempfile.TemporaryDirectory() as place, _at_most(limit):
            path = Path(place) / f"{name}.inp"
            path.write_text(text)
            deck = read_deck(path)
            states = deck.solve(MPI.COMM_SELF, tolerance=TOLERANCE)
            seconds = perf_counter() - start
            blocks, theirs = results_of(folder, name, text) if run else (reference(folder, name), None)
            return Outcome(name, contact, agreement(deck, states, blocks), seconds, theirs)
    except (FenicsContactError, TimeoutError) as error:
        return Outcome(name, contact, refused=" ".join(str(error).split()), seconds=perf_counter() - start)


def results_of(folder: Path, name: str, text: str) -> tuple[list[Block], float | None]:
    """Return CalculiX's results and seconds: of a run where it is installed, else of the reference files."""
    if program() is None:
        return reference(folder, name), None
    for tight in (True, False):  # not all decks converge that far
        try:
            return run_calculix(with_requests(text, tight))
        except RuntimeError:
            continue
    return reference(folder, name), None


@contextmanager
def _at_most(limit: float) -> Iterator[None]:
    """Allow so many processor seconds, in which the compiler of forms, which must not be cut, is not."""

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"takes more than {limit:g} processor seconds")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
