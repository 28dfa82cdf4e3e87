"""The cards of a deck: keywords with their parameters and data lines, each with the line where it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from fenics_contact._base.checks import LARGEST, require_file
from fenics_contact._base.progress import visible
from fenics_contact.errors import InvalidInputError

#: Largest number of a node or element, as in the other programs.
MOST_NUMBERS = 2**31 - 1
T = TypeVar("T")


class DeckError(InvalidInputError):
    """A deck cannot be used as it is; the message says where and what would be accepted.

    Attributes:
        card: Keyword of the card, such as ``"*SOLID SECTION"``; "" where there is none.
        line: Its line, or that of the data that is wrong, from 1; 0 where there is none.
        file: Name of the file.
    """

    def __init__(self, words: str, file: str = "", line: int = 0, card: str = "") -> None:
        """Build the message."""
        self.card, self.line, self.file = card, line, file
        place = f"{file}, line {line}" if line else file
        super().__init__(": ".join(part for part in (place, card, words) if part))

    def __reduce__(self) -> tuple[type[DeckError], tuple[str]]:
        """Pickle it by its message: other ranks raise it, too."""
        return type(self), (str(self),)


@dataclass(frozen=True)
class Origin:
    """Where something in a deck is said.

    Attributes:
        card: Keyword of the card, such as ``"*SOLID SECTION"``.
        line: Its line, from 1.
        file: Name of the file.
    """

    card: str
    line: int
    file: str

    def __str__(self) -> str:
        """Return card, file and line."""
        return f"{self.card}, {self.file} line {self.line}"

    def error(self, words: str, line: int = 0) -> DeckError:
        """Return an error there, or at a data line of the card."""
        return DeckError(words, self.file, line or self.line, self.card)


@dataclass(frozen=True, eq=False)
class Instances:
    """Numbers of nodes and elements of a deck with instances of parts.

    `names`: of the instances, in the order of the deck, behind "" for what belongs to none; `stride`: what is
    added to numbers of an instance, times its place among the names.
    """

    names: Sequence[str]
    stride: int

    def offset(self, name: str) -> int:
        """Return what is added to the numbers of an instance."""
        return self.names.index(name) * self.stride

    def own(self, numbers: np.ndarray) -> tuple[list[str], np.ndarray]:
        """Return for numbers of the flat deck the instances, "" for none, and the numbers within these."""
        numbers = np.asarray(numbers, dtype=np.int64)
        place = np.minimum(numbers // self.stride, len(self.names) - 1)
        return [self.names[k] for k in place.tolist()], numbers - place * self.stride


#: Those of a deck without parts.
NO_INSTANCES = Instances(("",), 2**63 - 1)


@dataclass(frozen=True, eq=False)
class Card:
    """A keyword, its parameters and its data.

    `parameters`: names in capitals without blanks -> values as written, "" for flags; `numbers`: numbers of
    the data lines in their files; `files`: names of the files of the data lines, where not all are of that of
    the keyword.
    """

    name: str
    written: str
    parameters: Mapping[str, str]
    lines: Sequence[str]
    numbers: Sequence[int]
    line: int
    file: str
    instances: Instances = NO_INSTANCES
    files: Sequence[str] = ()

    @property
    def body(self) -> str:
        """Name of the instance of a part that it belongs to, "" for none."""
        return ""

    def label(self, number: int) -> str:
        """Return how a node or element is called in the deck: "5", or "BOLT-1.5" of an instance."""
        (name,), (own,) = self.instances.own(np.array([number]))
        return f"{name}.{own}" if name else str(own)

    @property
    def origin(self) -> Origin:
        """Where it is."""
        return Origin(f"*{self.written}", self.line, self.file)

    def error(self, words: str, row: int | None = None) -> DeckError:
        """Return an error at the keyword, or at a data line, numbered from 0."""
        if row is None:
            return self.origin.error(words)
        origin = replace(self.origin, file=self.files[row]) if self.files else self.origin
        return origin.error(words, self.numbers[row])

    def known(self, what: str, name: str, named: Mapping[str, T], row: int | None = None) -> T:
        """Return what has a name, which must be there."""
        if name not in named:
            close = get_close_matches(name, list(named), n=1, cutoff=0.6)
            hint = f"did you mean {close[0]}? " if close else ""
            there = ", ".join(sorted(named)[:8]) + (", ..." if len(named) > 8 else "")
            raise self.error(f"{what} {name!r} is not there; {hint}the deck has {there or 'none'}", row)
        return named[name]

    def name_of(self, parameter: str) -> str:
        """Return the name that a parameter gives, in capitals, "" without it."""
        return plain(self.parameters.get(parameter, ""))

    def required(self, parameter: str) -> str:
        """Return the name that a parameter must give, in capitals."""
        if not self.name_of(parameter):
            raise self.error(f"needs the parameter {parameter}=, got {self.given}: add it")
        return self.name_of(parameter)

    def number_of(self, parameter: str, default: float = 0.0) -> float:
        """Return the number that a parameter gives."""
        text = self.parameters.get(parameter)
        return default if text is None else self._number(text, f"the parameter {parameter}=", None)

    @property
    def given(self) -> str:
        """The parameters as given, in words."""
        pairs = (f"{name}={value}" if value else name for name, value in self.parameters.items())
        return visible(", ".join(pairs)) or "none"

    def _number(self, text: str, what: str, row: int | None) -> float:
        try:
            value = float(text.upper().replace("D", "E"))
        except ValueError:
            raise self.error(f"{what} must be a number, got {text!r}: correct it", row) from None
        if not abs(value) < LARGEST:
            raise self.error(f"{what} must be finite and below {LARGEST:g}, got {text!r}: correct it", row)
        return value

    def number(self, text: str, row: int) -> float:
        """Return an entry of a data line as a number."""
        return self._number(text, "an entry", row)

    def whole(self, text: str, row: int) -> int:
        """Return an entry of a data line, or a count, as a whole number."""
        return int(self.wholes(np.array([self.number(text, row)]), row)[0])

    def wholes(self, values: np.ndarray, row: int | None = None) -> np.ndarray:
        """Return numbers, one of each data line or those of one, as whole ones, (n,)."""
        wrong = np.flatnonzero((values != np.round(values)) | (np.abs(values) > MOST_NUMBERS))
        if len(wrong):
            at = int(wrong[0]) if row is None else row
            got = f"{values[wrong[0]]:g}"
            raise self.error(f"numbers must be whole and at most {MOST_NUMBERS}, got {got}: correct it", at)
        return values.astype(np.int64)

    @cached_property
    def rows(self) -> list[list[str]]:
        """The entries of each data line, without blanks around them; an empty last one is dropped."""
        split = [[entry.strip() for entry in line.split(",")] for line in self.lines]
        return [row[:-1] if len(row) > 1 and not row[-1] else row for row in split]

    def floats(self, row: int, start: int = 0) -> list[float]:
        """Return the entries of a data line as numbers, zero where one is empty."""
        entries = self.rows[row][start:]
        return [
            self._number(text, f"entry {start + k + 1}", row) if text else 0.0
            for k, text in enumerate(entries)
        ]

    def all_floats(self) -> list[float]:
        """Return the numbers of all data lines one after the other."""
        return [number for row in range(len(self.rows)) for number in self.floats(row)]

    def table(self, columns: int) -> np.ndarray:
        """Return data lines of numbers, shape (n, columns), zero where entries are missing.

        Whole blocks are read at once; line by line only where lines are not alike.
        """
        text = [line.rstrip().rstrip(",") for line in self.lines]
        count = {line.count(",") for line in text}
        if len(count) == 1:
            values = _numbers(",".join(text), float)
            width = count.pop() + 1
            if values is not None and values.size == width * len(text):
                found = values.reshape(len(text), width)[:, :columns]
                return np.pad(found, ((0, 0), (0, columns - found.shape[1])))
        result = np.zeros((len(text), columns))
        for row in range(len(text)):
            entries = self.floats(row)[:columns]
            result[row, : len(entries)] = entries
        return result

    @cached_property
    def numbers_alone(self) -> np.ndarray:
        """The data lines as rows of numbers, without columns where lines are not alike or hold names."""
        text = [line.rstrip().rstrip(",") for line in self.lines]
        count = {line.count(",") for line in text}
        values = _numbers(",".join(text), float) if len(count) == 1 else None
        return np.zeros((0, 0)) if values is None else values.reshape(len(text), -1)

    def integers(self, width: int) -> np.ndarray:
        """Return records of a number of integers each, which may go over several lines, shape (n, width)."""
        text = [line.strip().rstrip(",") for line in self.lines]
        values = _numbers(",".join(text), np.int64)
        ends = np.cumsum([line.count(",") + 1 for line in text])
        if values is None:
            row = next(k for k, line in enumerate(text) if _numbers(line, np.int64) is None)
            raise self.error(f"must list whole numbers, got {self.lines[row].strip()!r}: correct it", row)
        records = np.arange(width, ends[-1] + 1, width) if len(ends) else ends
        lost = np.flatnonzero(~np.isin(records, ends))
        if lost.size or (len(ends) and ends[-1] % width):
            start = records[lost[0]] - width if lost.size else ends[-1] // width * width
            row = int(np.searchsorted(ends, start, side="right"))
            raise self.error(f"needs {width} numbers for each element: correct this line, or TYPE=", row)
        return values.reshape(-1, width)


class AtLine:
    """What a data line of a card gives; errors about it are at that line."""

    card: Card
    row: int

    def error(self, words: str) -> DeckError:
        """Return an error at the line."""
        return self.card.error(words, self.row)


def plain(text: str) -> str:
    """Return a name as both programs read it: in capitals, without quotes and blanks around it."""
    return text.strip().strip('"').strip().upper()


def _numbers(text: str, kind: type) -> np.ndarray | None:
    """Return numbers between commas, None if something else is among them."""
    if not text:
        return np.zeros(0, dtype=kind)
    if kind is float and ("D" in text or "d" in text):
        text = text.replace("D", "E").replace("d", "e")
    try:
        values = np.array(text.split(","), dtype=np.float64 if kind is float else np.int64)
    except (ValueError, OverflowError):
        return None
    return values if kind is not float or (np.abs(values) < LARGEST).all() else None


def whole_numbers(card: Card) -> np.ndarray:
    """Return the whole numbers with which the lines of nodes or elements begin, or all of elements."""
    if card.name == "NODE":
        return card.wholes(card.table(1)[:, 0])
    found = _numbers(",".join(line.strip().rstrip(",") for line in card.lines), np.int64)
    return np.zeros(0, dtype=np.int64) if found is None else np.minimum(found, MOST_NUMBERS)


#: Most files that include each other, one inside the other.
DEEPEST = 20
#: Parameters without a value, with which a keyword that ends with a comma may go on in its next line.
_FLAGS = {
    "GENERATE", "UNSORTED", "INTERNAL", "NLGEOM", "PERTURBATION", "DIRECT", "FIXED", "REMOVE", "ADD", "USER",
    "SMALLSLIDING", "CYCLICSYMMETRY", "READ", "WRITE", "OGDEN", "MOONEY-RIVLIN", "NEOHOOKE", "YEOH",
    "POLYNOMIAL", "REDUCEDPOLYNOMIAL", "ARRUDA-BOYCE",
}  # fmt: skip


@dataclass(frozen=True)
class _Stretch:
    """A keyword and the data lines behind it in its file, or, without one, data of the card before.

    `line`: number of the line of the keyword, 0 without one.
    """

    keyword: str
    line: int
    file: str
    lines: Sequence[str]
    numbers: Sequence[int]

    def error(self, words: str) -> DeckError:
        """Return an error at its first line."""
        return DeckError(words, self.file, self.numbers[0])


def cards_of(path: Path) -> list[Card]:
    """Return the cards of a deck; the text of a file that it includes is in the place of *INCLUDE."""
    parts: list[list[_Stretch]] = []
    for stretch in _stretches(path, path.parent, ()):
        if stretch.keyword:
            parts.append([stretch])
        elif stretch.lines and parts:
            parts[-1].append(stretch)
        elif stretch.lines and any(line.partition(",")[0].strip().isdecimal() for line in stretch.lines):
            raise stretch.error(f"data must follow a card, got {stretch.lines[0].strip()[:40]!r}")
    return [_with_temperatures(_card(stretches), path.parent) for stretches in parts]


def _stretches(path: Path, folder: Path, inside: tuple[Path, ...]) -> Iterator[_Stretch]:
    lines = [line.lstrip() for line in path.read_text("utf-8-sig", errors="replace").splitlines()]
    heads = [k for k, line in enumerate(lines) if line[:1] == "*" and line[:2] != "**"]
    if not heads and not inside:
        raise DeckError("a deck must have cards such as *NODE, got a file without", path.name)
    yield _stretch("", lines, -1, 0, heads[0] if heads else len(lines), path.name)
    for head, end in zip(heads, [*heads, len(lines)][1:], strict=True):
        keyword, start = _keyword(lines, head, end)
        found = _stretch(keyword, lines, head, start, end, path.name)
        if keyword == "*":
            found = _without_keyword(found)
        elif _name(keyword) == "INCLUDE":
            yield from _included(_card([found]), folder, (*inside, path))
            found = replace(found, keyword="")
        yield found


def _stretch(keyword: str, lines: Sequence[str], head: int, start: int, end: int, file: str) -> _Stretch:
    inner = [k for k in range(start, end) if _is_data(lines[k])]
    return _Stretch(keyword, head + 1, file, [lines[k] for k in inner], [k + 1 for k in inner])


def _without_keyword(stretch: _Stretch) -> _Stretch:
    """Take an asterisk alone for a comment, which data cannot follow."""
    if stretch.lines:
        raise stretch.error("data cannot follow an asterisk alone: name a card, or write ** for a comment")
    return replace(stretch, keyword="")


def _keyword(lines: Sequence[str], head: int, end: int) -> tuple[str, int]:
    """Return a keyword with its parameters, without a comment, and the first line behind it.

    After a comma at its end the next line goes on with it if a parameter is there; if data are, it does not.
    """
    keyword, place = _bare(lines[head]), head + 1
    while keyword.endswith(",") and place < end:
        more = _bare(lines[place])
        first, equals, _ = more.partition(",")[0].partition("=")
        if more and not equals and _squeezed(first) not in _FLAGS:
            break
        keyword, place = keyword + more, place + 1
    return keyword, place


def _bare(line: str) -> str:
    return line.partition("**")[0].strip()


def _squeezed(text: str) -> str:
    return "".join(text.split()).upper()


def _name(keyword: str) -> str:
    return _squeezed(keyword[1:].partition(",")[0])


def _is_data(line: str) -> bool:
    return line[:2] != "**" and bool(line)


def _card(stretches: Sequence[_Stretch]) -> Card:
    """Return the card of a keyword with the data behind it, of one file or of several."""
    first = stretches[0]
    written, *rest = first.keyword[1:].split(",")
    parameters = {}
    for part in rest:
        name, _, value = part.partition("=")
        if name.strip():
            parameters[_squeezed(name)] = value.strip()
    shown = " ".join(written.split()).upper()
    if shown.startswith("HEADING "):  # a title in the line of the keyword
        shown, parameters = "HEADING", {}
    lines = [line for each in stretches for line in each.lines]
    numbers = [number for each in stretches for number in each.numbers]
    files = [each.file for each in stretches for _ in each.lines] if len(stretches) > 1 else ()
    return Card(
        _squeezed(shown), visible(shown), parameters, lines, numbers, first.line, first.file, files=files
    )


def _included(card: Card, folder: Path, inside: tuple[Path, ...]) -> Iterator[_Stretch]:
    given = card.parameters.get("INPUT", "").strip().strip('"')
    if not given:
        raise card.error(f"needs the parameter INPUT=, got {card.given}: name the file")
    path = folder / given
    if len(inside) > DEEPEST or path in inside:
        raise card.error(f"file {given!r} includes itself: leave one of the two out")
    try:
        require_file(path, "an included file")
    except InvalidInputError as error:
        raise card.error(str(error)) from error
    yield from _stretches(path, folder, inside)


def _with_temperatures(card: Card, folder: Path) -> Card:
    """Return a card with the temperatures at the end of a step in a file of results, if it names one."""
    if card.name != "TEMPERATURE" or not {"FILE", "BSTEP"} & set(card.parameters):
        return card
    given, step = card.parameters.get("FILE", "").strip('"'), card.number_of("BSTEP", 1.0)
    now, rows, wanted = "", list[str](), False
    if not (folder / given).is_file():
        raise card.error(f"there must be a file of results, .frd, {given!r}, there is none: correct FILE=")
    for line in (folder / given).read_text("utf-8", errors="replace").splitlines():
        if line[4:10] == "1PSTEP":
            now = line[48:60].strip()
        elif line[:3] == " -4":
            wanted = now == f"{step:.0f}" and line[5:11] == "NDTEMP"
            rows = [] if wanted else rows
        elif wanted and line[:3] == " -1":
            rows.append(f"{line[3:13]}, {line[13:25]}")
    if card.lines or not rows:
        raise card.error(
            f"needs NT of step {step:g} in {given!r}, and no lines: write it there by *NODE FILE"
        )
    return replace(card, lines=rows, numbers=[card.line] * len(rows), files=())
