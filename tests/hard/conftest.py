"""The hard cases: their marker, their records, and the page that is written from them.

python -m pytest tests/hard -m hard --hard-table docs/hard_cases.md
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import pytest

from tools.hard_cases.table import Row, write

HERE = Path(__file__).parent
ROWS = pytest.StashKey[list[Row]]()
#: Names of the test files whose tests were left out, by a keyword or a marker.
LEFT_OUT = pytest.StashKey[list[str]]()


class Record(Protocol):
    """Notes one row of the page."""

    def __call__(self, group: str, case: str, **figures: object) -> None:
        """Take what `Row` takes."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hard-table", default=None, metavar="PAGE", help="write the table of hard cases, if all of them ran"
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[ROWS] = []
    config.stash[LEFT_OUT] = []


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of this folder."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.hard)


def pytest_deselected(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.config.stash.setdefault(LEFT_OUT, []).append(item.nodeid)


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Record:
    """Return ``record(group, case, **figures)``, which notes a row of the page, see `Row`."""
    rows = request.config.stash.setdefault(ROWS, [])

    def note(group: str, case: str, **figures: object) -> None:
        rows.append(Row(group, case, **figures))  # type: ignore[arg-type]

    return note


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    page = session.config.getoption("--hard-table", default=None)
    if page is None or exitstatus != pytest.ExitCode.OK:
        return
    ran = {item.path.name for item in session.items if HERE in item.path.parents}
    missing = {path.name for path in HERE.glob("test_*.py")} - ran
    left_out = session.config.stash.get(LEFT_OUT, [])
    if missing or left_out:
        raise pytest.UsageError(
            f"--hard-table needs all tests of {HERE.name}, {len(left_out)} tests were left out and "
            f"{len(missing)} files were not run: run `make test-hard`"
        )
    write(Path(page), session.config.stash[ROWS])
