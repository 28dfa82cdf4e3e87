"""What the studies of this folder have in common: jobs, and what is written of their records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fenics_contact.study.runner import Job, Record

ROOT = Path(__file__).resolve().parents[1]
#: What the runner adds to every record.
_ADDED = ("name", "arguments", "code", "ranks", "peak_memory", "import_memory", "load_average")

#: Name of a job -> its measurements, none of them failed.
Records = Mapping[str, Sequence[Record]]


@dataclass(frozen=True)
class Study:
    """A study, or the benchmark itself.

    Attributes:
        jobs: Returns what is measured, for the quick study or the full one.
        write: Writes the results of some records into a folder; told whether they are of the quick study.
            Where records are missing it takes what is there already, unless `complete` is set.
        home: Where the results of the full study are.
        code: Folders of the code that is measured, beside the package.
        complete: Whether only all jobs together replace results.
        check: Returns what is wrong with records, in sentences.
        warm_up: Jobs whose compiled forms the others find.
    """

    jobs: Callable[[bool], Sequence[Job]]
    write: Callable[[Path, Records, bool], None]
    home: Path
    code: tuple[Path, ...]
    complete: bool = False
    check: Callable[[Records], list[str]] = lambda _: []
    warm_up: Sequence[Job] = ()


def found(record: Record) -> dict[str, Any]:
    """Return what the function of a job has returned, without what the runner adds."""
    return {name: value for name, value in record.items() if name not in _ADDED}


def chosen(jobs: Sequence[Job], names: Sequence[str]) -> list[Job]:
    """Return some jobs.

    Args:
        jobs: All jobs.
        names: Only these; a name that no job has stands for all that begin with it. All if empty.

    Raises:
        ValueError: If no job begins with a name.
    """
    known = [job.name for job in jobs]
    wanted: set[str] = set()
    for name in names:
        meant = {name} if name in known else {other for other in known if other.startswith(name)}
        if not meant:
            raise ValueError(
                f"--only needs the name of a run or how it begins, got {name!r}: use one of "
                + ", ".join(known)
            )
        wanted |= meant
    return [job for job in jobs if job.name in wanted or not names]


def filled(page: str, tables: Mapping[str, str]) -> str:
    """Return a page of Markdown with tables in their places, between ``<!-- table: NAME -->`` and an end.

    What stands around them is written by hand.

    Raises:
        ValueError: If the page has no place for a table.
    """
    for name, text in tables.items():
        before, start, rest = page.partition(f"<!-- table: {name} -->\n")
        _, end, after = rest.partition("\n<!-- end -->")
        if not end:
            raise ValueError(
                f"the page needs a place for {name!r}, got none: add the lines '<!-- table: {name} -->' and "
                "'<!-- end -->'"
            )
        page = f"{before}{start}\n{text.strip()}\n{end}{after}"
    return page


def unfilled(tables: Mapping[str, str]) -> str:
    """Return the tables alone: of a quick study nothing follows."""
    return "\n\n".join(f"## {name}\n\n{text.strip()}" for name, text in tables.items()) + "\n"
