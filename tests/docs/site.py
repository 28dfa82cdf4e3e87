"""The built documentation as tests see it: one build for all of them, its links and its ids."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass, field
from functools import cached_property
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from fenics_contact import clean_environment
from tests.docs.pages import DOCS, ROOT

#: Seconds that a build may take on a busy machine.
PATIENCE = 400.0


@dataclass(frozen=True)
class Site:
    """A build: where its pages are, and what Sphinx said."""

    folder: Path
    returncode: int
    log: str

    @cached_property
    def pages(self) -> dict[Path, Page]:
        """Every page by its path."""
        paths = sorted(self.folder.rglob("*.html"))
        return {path: page_of(path) for path in paths if "_static" not in path.parts}


@dataclass
class Page(HTMLParser):
    """Links, pictures, ids and classes of one page."""

    links: list[str] = field(default_factory=list)
    ids: set[str] = field(default_factory=set)
    classes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in ("href", "src"):
                self.links.append(value)
            elif value and name == "id":
                self.ids.add(value)
            elif value and name == "class":
                self.classes += value.split()


def page_of(path: Path) -> Page:
    """Read a page."""
    page = Page()
    page.feed(path.read_text())
    return page


def broken_links(site: Site) -> list[str]:
    """Return the links inside the site that lead nowhere, a missing heading included."""
    broken = []
    for path, page in site.pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = site.pages.get(target)
            if not target.exists() or (parts.fragment and known and unquote(parts.fragment) not in known.ids):
                broken.append(f"{path.relative_to(site.folder)} -> {link}")
    return broken


def build(folder: Path) -> Site:
    """Build the documentation below ``folder``, once for all processes of a test run: others wait."""
    html, log, code = folder / "html", folder / "log.txt", folder / "returncode"
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        waiting_since = time.monotonic()
        while not code.exists():
            assert time.monotonic() - waiting_since < PATIENCE, f"the build in {folder} never ended"
            time.sleep(0.2)
    else:
        command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-E", "-c", str(DOCS)]
        command += ["-d", str(folder / "doctrees"), str(ROOT), str(html)]
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=clean_environment(),
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        log.write_text(done.stdout + done.stderr)
        unfinished = folder / "unfinished"
        unfinished.write_text(str(done.returncode))
        unfinished.replace(code)
    return Site(html, int(code.read_text()), log.read_text())
