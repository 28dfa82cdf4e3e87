"""Pages of the documentation as tests see them: their code with what it prints, and their links."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GUIDE = DOCS / "guide"

#: A first line that says why a snippet is for reading alone.
NOT_RUN = "# not run: "
#: Numbers on a page may miss those of a run by this part: rounding of another library shows in some.
TOLERANCE = 0.05
#: Numbers below this are errors and residuals, of which the size alone is compared, to this factor.
SMALL, FACTOR = 1e-3, 3.0

#: Before the fence of an output of which parts differ from run to run: what of it is compared, which pages
#: do not show.
_COMPARED = re.compile(r"<!-- compared as:\n(.*?)-->", re.DOTALL)
_FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")
_TOKEN = re.compile(rf"{_NUMBER.pattern}|\w+|[^\w\s]")
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")


@dataclass(frozen=True)
class Snippet:
    """A piece of Python on a page.

    Attributes:
        code: The code.
        line: Line of the page on which it begins.
        output: What the page says that it prints, or None where the page says nothing.
        compared: The output with ``...`` for what differs from run to run; the output itself where nothing
            does.
    """

    code: str
    line: int
    output: str | None
    compared: str | None

    @property
    def is_run(self) -> bool:
        """Whether it is more than an example to read."""
        return not self.code.startswith(NOT_RUN)


def snippets_of(text: str) -> list[Snippet]:
    """Return the Python of a page; a fence of text right behind it is what it prints, errors included."""
    fences = list(_FENCE.finditer(text))
    found = []
    for index, fence in enumerate(fences):
        if fence[1] != "python":
            continue
        follows = fences[index + 1] if index + 1 < len(fences) else None
        between = "end" if follows is None else text[fence.end() : follows.start()].strip()
        comment = _COMPARED.fullmatch(between)
        direct = follows is not None and follows[1] == "text" and (comment is not None or not between)
        output = follows[2] if follows is not None and direct else None
        line = text.count("\n", 0, fence.start()) + 2
        found.append(Snippet(fence[2], line, output, comment[1] if comment and direct else output))
    return found


def fences_of(text: str, language: str) -> list[str]:
    """Return what stands in the fences of a language."""
    return [fence[2] for fence in _FENCE.finditer(text) if fence[1] == language]


def agrees(printed: str, page: str) -> bool:
    """Tell whether a page shows what was printed: words as they are, numbers to `TOLERANCE`.

    ``...`` of what is compared stands for anything; line breaks are no difference.
    """
    have = _TOKEN.findall(printed)
    parts = [_TOKEN.findall(part) for part in page.split("...")]
    if len(parts) == 1:
        return len(have) == len(parts[0]) and _same(have, parts[0])
    if not _same(have[: len(parts[0])], parts[0]):
        return False
    place = len(parts[0])
    for part in parts[1:-1]:
        starts = range(place, len(have) - len(part) + 1)
        place = next((start for start in starts if _same(have[start : start + len(part)], part)), -1)
        if place < 0:
            return False
        place += len(part)
    rest = len(have) - len(parts[-1])
    return rest >= place and _same(have[rest:], parts[-1])


def _same(have: list[str], wanted: list[str]) -> bool:
    return len(have) == len(wanted) and all(map(_equal, have, wanted))


def _equal(have: str, wanted: str) -> bool:
    if have == wanted:
        return True
    if not (_NUMBER.fullmatch(have) and _NUMBER.fullmatch(wanted)):
        return False
    one, other = (float(number.replace("−", "-")) for number in (have, wanted))
    small, large = sorted((abs(one), abs(other)))
    if one * other > 0.0 and large < SMALL:
        return large <= FACTOR * small
    return abs(one - other) <= TOLERANCE * large


def links_of(text: str) -> list[str]:
    """Return the targets of a page's links and pictures, those to other hosts left out."""
    targets = _LINK.findall(_FENCE.sub("", text))
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def anchors_of(text: str) -> set[str]:
    """Return what links call the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", _FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}
