"""Parts, instances and the assembly of a deck, written out as the cards of a flat one.

What belongs to an instance has its name in front, ``BOLT-1.HEAD``, and numbers of its own: those of the n-th
instance are larger by n times a power of ten, which `Instances` takes away where numbers are shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fenics_contact.readers.deck_cards import Card, Instances, cards_of, plain, whole_numbers
from fenics_contact.readers.deck_generated import with_generated
from fenics_contact.readers.deck_parameters import with_parameters

FRAMES = {"PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE"}
"""The cards that make up the structure."""
#: Parameters that name what belongs to a part.
_NAMES = {
    "NODE": ("NSET",), "ELEMENT": ("ELSET",), "NSET": ("NSET", "ELSET"), "ELSET": ("ELSET",),
    "SURFACE": ("NAME",), "SOLIDSECTION": ("ELSET", "ORIENTATION"), "ORIENTATION": ("NAME",),
    "SHELLSECTION": ("ELSET", "ORIENTATION"), "BEAMSECTION": ("ELSET", "ORIENTATION"),
    "HOURGLASSSTIFFNESS": (),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Instance:
    """A part in its place, shifted, then turned; `own`: cards up to *END INSTANCE."""

    card: Card
    name: str
    part: str
    own: list[Card]
    shift: np.ndarray
    turn: np.ndarray
    about: np.ndarray

    @classmethod
    def of(cls, card: Card) -> _Instance:
        """Read where a card puts a part."""
        unknown = sorted(set(card.parameters) - {"NAME", "PART"})
        if unknown:
            raise card.error(f"the parameter {unknown[0]} is not read: give NAME= and PART= alone")
        if len(card.lines) > 2:
            raise card.error("needs at most a line with a translation and one with a rotation", 2)
        shift, about, turn = np.zeros(3), np.zeros(3), np.eye(3)
        if card.lines:
            given = card.floats(0)
            if len(given) > 3:
                raise card.error(f"a translation needs three numbers, got {len(given)}", 0)
            shift[: len(given)] = given
        if len(card.lines) > 1:
            given = card.floats(1)
            axis = np.array(given[3:6]) - given[:3] if len(given) == 7 else np.zeros(3)
            if not axis.any():
                raise card.error(
                    f"needs two points and an angle, got {card.lines[1].strip()!r}: correct it", 1
                )
            about, turn = np.array(given[:3]), _rotation(axis, np.radians(given[6]))
        return cls(card, card.required("NAME"), card.required("PART"), [], shift, turn, about)

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return where points of the part are, (n, 3): moved first, then turned."""
        if not self.shift.any() and np.array_equal(self.turn, np.eye(3)):
            return points
        return np.asarray((points + self.shift - self.about) @ self.turn.T + self.about)

    def require_plane(self, element: Card) -> None:
        """Reject places of plane elements out of their plane, or off their axis."""
        kind = element.name_of("TYPE")[:3]
        fits = kind not in ("CPS", "CPE", "CAX") or (self.turn[2, 2] > 1.0 - 1e-12 and not self.shift[2])
        if kind == "CAX":
            fits &= not self.shift[0] and bool(np.allclose(self.turn, np.eye(3), rtol=0.0, atol=1e-12))
        if not fits:
            raise self.card.error(
                f"{element.name_of('TYPE')} of part {self.part!r} must stay in its plane, or on its axis"
            )


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Placed(Card):
    """Nodes or elements of an instance: with its numbers, nodes in its place."""

    instance: _Instance
    offset: int

    @property
    def body(self) -> str:
        """Name of the instance."""
        return self.instance.name

    def table(self, columns: int) -> np.ndarray:
        """Return nodes as the card has them, in the place of the instance."""
        found = super().table(columns)
        found[:, 0] += self.offset
        found[:, 1:4] = self.instance.moved(found[:, 1:4])
        return found

    def integers(self, width: int) -> np.ndarray:
        """Return elements with the numbers of the instance."""
        return super().integers(width) + self.offset


@dataclass(eq=False)
class _Deck:
    """The cards of a deck by where they are."""

    parts: dict[str, list[Card]] = field(default_factory=dict)
    instances: dict[str, _Instance] = field(default_factory=dict)
    assembly: list[Card] = field(default_factory=list)
    before: list[Card] = field(default_factory=list)
    after: list[Card] = field(default_factory=list)
    name: str = ""


def read_cards(path: Path) -> list[Card]:
    """Return the cards of a deck and of the files that it includes, parts and instances written out.

    ``INTERNAL`` says which sets a window of the other program hides.
    """
    return in_one_piece([_shown(card) for card in with_parameters(cards_of(path))])


def _shown(card: Card) -> Card:
    if "INTERNAL" not in card.parameters or card.name not in ("NSET", "ELSET", "SURFACE"):
        return card
    rest = {name: value for name, value in card.parameters.items() if name != "INTERNAL"}
    return replace(card, parameters=rest)


def in_one_piece(cards: Sequence[Card]) -> list[Card]:
    """Return the cards of a flat deck in place of parts, instances and an assembly.

    Nodes, elements, sets, surfaces and sections of an instance are named ``INSTANCE.NAME`` there; cards of
    the assembly and behind it, which refer to such names or to ``INSTANCE.5``, keep their meaning.
    """
    if not any(card.name in FRAMES for card in cards):
        return with_generated(cards)
    deck = _sorted(cards)
    deck.parts = {name: with_generated(own) for name, own in deck.parts.items()}
    parts = [*deck.parts.values(), *(each.own for each in deck.instances.values())]
    every = (*(card for part in parts for card in part), *deck.before, *deck.assembly, *deck.after)
    numbered = [whole_numbers(card) for card in every if card.name in ("NODE", "ELEMENT")]
    largest = max((int(numbers.max(initial=0)) for numbers in numbered), default=0)
    instances = Instances(("", *deck.instances), 10 ** len(str(largest)))
    flat = list(deck.before)
    for each in deck.instances.values():
        if each.part not in deck.parts:
            there = ", ".join(deck.parts) or "none"
            raise each.card.error(f"part {each.part!r} is not there; the deck has {there}")
        flat += [_of_instance(card, each, instances) for card in (*deck.parts[each.part], *each.own)]
    flat += [_resolved(card, instances, deck.name) for card in (*deck.assembly, *deck.after)]
    return [replace(card, instances=instances) for card in flat]


def _sorted(cards: Sequence[Card]) -> _Deck:
    deck, inside = _Deck(), list[tuple[Card, list[Card]]]()
    for card in cards:
        opened = [frame.name for frame, _ in inside]
        if card.name not in FRAMES:
            outside = deck.after if deck.name else deck.before
            (inside[-1][1] if inside else outside).append(card)
            continue
        wanted = ["ASSEMBLY"] if card.name == "INSTANCE" else []
        if card.name.startswith("END"):
            if not inside or inside[-1][0].name != card.name.removeprefix("END"):
                raise card.error(f"closes what is not open here: see that each {card.name[3:]} has its end")
            inside.pop()
        elif opened != wanted:
            raise card.error("has no place here: parts come first, then the assembly with its instances")
        else:
            inside.append((card, _opened(deck, card)))
    if inside:
        raise inside[-1][0].error(f"is not closed: add *END {inside[-1][0].name}")
    return deck


def _opened(deck: _Deck, card: Card) -> list[Card]:
    """Return where the cards behind a card belong."""
    if card.name == "INSTANCE":
        instance = _Instance.of(card)
        if instance.name in deck.instances:
            raise card.error(f"instance {instance.name!r} is there already: give each a name of its own")
        deck.instances[instance.name] = instance
        return instance.own
    name = card.required("NAME")
    if card.name == "ASSEMBLY":
        if deck.name:
            raise card.error("a deck has one assembly, this is the second: join them")
        deck.name = name
        return deck.assembly
    if name in deck.parts:
        raise card.error(f"part {name!r} is there already: give each a name of its own")
    return deck.parts.setdefault(name, [])


def _of_instance(card: Card, instance: _Instance, instances: Instances) -> Card:
    """Return a card of a part as that of an instance."""
    if card.name not in _NAMES:
        raise card.error("this card is not supported within a part: give it in the assembly or behind it")
    parameters, offset = dict(card.parameters), instances.offset(instance.name)
    for name in _NAMES.get(card.name, ()):
        if plain(parameters.get(name, "")):
            parameters[name] = f"{instance.name}.{plain(parameters[name])}"
    if card.name in ("NODE", "ELEMENT"):
        if card.name == "ELEMENT":
            instance.require_plane(card)
        return _Placed(
            card.name, card.written, parameters, card.lines, card.numbers, card.line, card.file,
            files=card.files, instance=instance, offset=offset,
        )  # fmt: skip
    lines = card.lines
    if card.name in ("NSET", "ELSET", "SURFACE"):
        lines = _members(card, instance.name, offset, instances.stride)
    elif card.name == "ORIENTATION":
        lines = _turned(card, instance)
    elif card.name == "BEAMSECTION":
        lines = _turned_section(card, instance)
    return replace(card, parameters=parameters, lines=lines)


def _members(card: Card, instance: str, offset: int, stride: int) -> list[str]:
    """Return the lines of a set or surface with numbers and names of an instance."""
    ranges = "GENERATE" in card.parameters
    count = 1 if card.name == "SURFACE" else 2 if ranges else None
    lines = []
    for number, row in enumerate(card.rows):
        own = []
        for entry in row[:count]:
            if not entry.isdecimal():
                own.append(f"{instance}.{plain(entry)}" if entry else entry)
            elif int(entry[:20]) < stride or ranges:  # of ranges numbers may be missing
                own.append(str(min(int(entry[:20]), stride - 1) + offset))
            else:
                raise card.error(f"{instance}.{entry} is not there: correct the number", number)
        lines.append(", ".join([*own, *(row[count:] if count else [])]))
    return lines


def _turned(card: Card, instance: _Instance) -> list[str]:
    """Return the lines of an orientation that turns with its instance."""
    given = card.floats(0) if card.lines else []
    if len(given) < 6:
        return list(card.lines)
    points = np.array(given[:6]).reshape(2, 3)
    if (card.name_of("SYSTEM") or "RECTANGULAR")[:1] == "R":  # axes through the origin
        points = points @ instance.turn.T
    else:
        points = instance.moved(points)
    first = ", ".join(repr(float(x)) for x in [*points.ravel(), *given[6:]])
    return [first, *card.lines[1:]]


def _turned_section(card: Card, instance: _Instance) -> list[str]:
    """Return the lines of a section of beams, whose direction 1 turns with its instance."""
    given = card.floats(1) if len(card.lines) > 1 else [0.0, 0.0, -1.0]
    if not card.lines or len(given) != 3 or np.array_equal(instance.turn, np.eye(3)):
        return list(card.lines)
    return [card.lines[0], ", ".join(repr(float(x)) for x in instance.turn @ np.array(given))]


def _resolved(card: Card, instances: Instances, assembly: str) -> Card:
    """Return a card of the assembly, or behind it, that refers to what instances have."""
    parameters = dict(card.parameters)
    instance = plain(parameters.pop("INSTANCE", ""))
    if instance:
        if instance not in instances.names:
            there = ", ".join(instances.names[1:]) or "none"
            raise card.error(f"instance {instance!r} is not there; the assembly has {there}")
        if card.name not in ("NSET", "ELSET"):
            raise card.error("INSTANCE= is read of *NSET and *ELSET alone: name what the instance has")
        lines = _members(card, instance, instances.offset(instance), instances.stride)
        return replace(card, parameters=parameters, lines=lines)

    def flat(text: str, row: int | None) -> str:
        """Return the number of a node or element, ``BLOCK-1.5``; else the text, or the name that it is."""
        name = plain(text).removeprefix(f"{assembly}.") if "." in text else ""
        head, _, tail = name.partition(".")
        if not head or head not in instances.names:
            return text
        if not tail.isdecimal():
            return name
        if int(tail[:20]) >= instances.stride:
            raise card.error(f"{name} is not there: correct the number", row)
        return str(instances.offset(head) + int(tail))

    parameters = {name: flat(value, None) for name, value in parameters.items()}
    lines = [
        ",".join(flat(entry, row) for entry in line.split(",")) if "." in line else line
        for row, line in enumerate(card.lines)
    ]
    return replace(card, parameters=parameters, lines=lines)
