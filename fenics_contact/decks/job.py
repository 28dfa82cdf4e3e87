"""A deck solved as a job: its results in its folder, in the files that CalculiX writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.files import hidden_folder
from fenics_contact.decks.course import Moment, of_heat, of_statics, results_of
from fenics_contact.decks.deck import conducts, read_deck
from fenics_contact.decks.heat import read_heat_deck
from fenics_contact.decks.results import Computed, DeckResults, exponential
from fenics_contact.errors import together
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.output.files import OutputError, write_text
from fenics_contact.output.frd import add_on_first, writing

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class Increment:
    """One increment of a job that has been solved.

    Attributes:
        step: Number of the deck's step, from 1.
        number: Number in its step, from 1.
        iterations: Steps of the solver.
        time: Since the start of the first step.
        step_time: Since the start of its step.
        length: Its length in time.
        residual: Relative residual of the solver.
        contacts: Number of closed contact points.
    """

    step: int
    number: int
    iterations: int
    time: float
    step_time: float
    length: float
    residual: float
    contacts: int

    #: First lines of the files with a line for each increment, by their suffix.
    heads: ClassVar[dict[str, str]] = {
        ".sta": "SUMMARY OF JOB INFORMATION\n"
        "  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME\n",
        ".cvg": "SUMMARY OF C0NVERGENCE INFORMATION\n"
        "  STEP   INC  ATT   ITER     CONT.   RESID.        CORR.      RESID.      CORR.\n"
        "                              EL.    FORCE         DISP       FLUX        TEMP.\n"
        "                              (#)     (%)           (%)        (%)         (%)\n",
    }

    @property
    def lines(self) -> dict[str, str]:
        """Its line in each of these files."""
        times = "".join(f"{exponential(each, 6):>14s}" for each in (self.time, self.step_time, self.length))
        shares = "".join(f"{exponential(each, 4):>12s}" for each in (100.0 * self.residual, 0.0, 0.0, 0.0))
        return {
            ".sta": f"{self.step:6d}{self.number:11d}{1:6d}{self.iterations:6d}{times}\n",
            ".cvg": f"{self.step:6d}{self.number:6d}{1:6d}{self.iterations:6d}{self.contacts:9d}{shares}\n",
        }


@naming_arguments
def run_job(
    path: str | Path,
    comm: MPI.Comm,
    watch: Callable[[Increment], None] = lambda _: None,
    note: Callable[[str], None] = lambda _: None,
    **settings: Any,
) -> list[Path]:
    """Solve a deck and write its results beside it, in the files that CalculiX writes.

    ``job.frd`` has the fields that the deck asks for after each increment, ``job.dat`` what it prints,
    ``job.sta`` and ``job.cvg`` a line an increment, as soon as it is solved. Those of an earlier run are
    removed first. The first two are there when they are complete; if a step cannot be solved, with the
    increments before it, and not without any. Each time at which an amplitude changes its slope ends an
    increment, other increments of the deck are not needed.

    Args:
        path: The deck, ``job.inp``.
        comm: Communicator.
        watch: Is called after each increment, on all ranks.
        note: Is called with what is done otherwise than the deck says, on all ranks.
        **settings: Those of `ContactProblem`.

    Returns:
        The files.

    Raises:
        OutputError: If the folder cannot be written, before anything is solved.
        DeckError: As `read_deck`.

    Note:
        Collective on ``comm``.

    Example:
        >>> run_job("bracket.inp", MPI.COMM_WORLD)  # doctest: +SKIP
    """
    given = Path(path)
    files = {suffix: given.with_suffix(suffix) for suffix in (".frd", ".dat", ".sta", ".cvg")}
    with together(comm):
        if comm.rank == 0:
            _clear(given, list(files.values()))
    if on_root_then_bcast(comm, lambda: conducts(given)):
        heat = read_heat_deck(given, comm)
        known, notes, moments = results_of(heat), heat.notes, of_heat(heat, comm, settings)
    else:
        known = [DeckResults(read_deck(given, comm))]
        notes, moments = known[0].deck.notes, of_statics(known[0], comm, settings)
    for words in dict.fromkeys([*notes, *(each for results in known for each in results.notes)]):
        note(words)
    _solve(moments, known[0], comm, files, watch)
    return list(files.values())


def _clear(deck: Path, files: list[Path]) -> None:
    """Remove the results of an earlier run; raise unless the folder can be written."""
    if not deck.parent.is_dir():
        return  # there is no deck either
    try:
        with hidden_folder(deck.parent, deck.stem):
            for each in files:
                each.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"results cannot be written to the folder {str(deck.parent)!r}: {error.strerror or error}. Make "
            "it writable, or copy the deck elsewhere"
        ) from error


def _solve(
    moments: Iterator[Moment],
    results: DeckResults,
    comm: MPI.Comm,
    files: dict[str, Path],
    watch: Callable[[Increment], None],
) -> None:
    """Solve all increments and write the files. Collective."""
    printed, solved, failures = list[str](), list[Increment](), list[Exception]()
    materials = list(dict.fromkeys(name for kind, name in results.deck.sources if kind == "material"))
    with ExitStack() as stack:
        writer = stack.enter_context(writing(comm, files[".frd"], results.written, materials))
        while True:
            try:
                step, time, new = next(moments)
            except StopIteration:
                break
            except Exception as error:
                if not solved:
                    raise
                failures.append(error)
                break
            solved.append(last := _increment(step, time, new, solved))
            printed += [own.printout(state, step, last.time) for own, state, step in new]
            fields = [field for own, state, step in new for field in own.nodal(state, step)]
            add_on_first(comm, writer, fields, last.time, last.step, last.number)
            _write_lines(comm, files, solved)
            watch(last)
    with together(comm):
        if comm.rank == 0:
            write_text(files[".dat"], "".join(printed))
    for failure in failures:
        raise failure


def _increment(step: int, time: float, new: Sequence[Computed], before: list[Increment]) -> Increment:
    """Return the increment that ends at a time since the first step."""
    iterations, residuals, contacts = zip(*(own.progress(state) for own, state, _ in new), strict=True)
    number = 1 + sum(each.step == step + 1 for each in before)
    start = max((each.time for each in before if each.step <= step), default=0.0)
    last = max((each.time for each in before if each.time < time), default=0.0)
    return Increment(
        step + 1, number, sum(iterations), time, time - start, time - last, max(residuals), sum(contacts)
    )


def _write_lines(comm: MPI.Comm, files: dict[str, Path], solved: list[Increment]) -> None:
    """Write the files with a line for each increment. Collective."""
    with together(comm):
        if comm.rank == 0:
            for suffix, head in Increment.heads.items():
                write_text(files[suffix], head + "".join(each.lines[suffix] for each in solved))
