"""Elements of a deck that are no cells: springs, trusses, masses and nodes that are means of others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fenics_contact.readers.deck_cards import Card

#: Types of them with the number of their nodes.
LINKS = {
    "DCOUP3D": 1, "MASS": 1, "SPRING1": 1, "SPRING2": 2, "SPRINGA": 2, "T2D2": 2, "T3D2": 2, "T3D3": 3,
}  # fmt: skip


@dataclass(frozen=True)
class Link:
    """An element of a type of `LINKS`; `row`: its line in the card; `nodes`: their numbers in the deck."""

    card: Card
    row: int
    kind: str
    number: int
    nodes: tuple[int, ...]


def is_of_links(card: Card) -> bool:
    """Return whether a card has elements that are no cells."""
    return card.name == "ELEMENT" and card.name_of("TYPE") in LINKS


def read_links(cards: Sequence[Card]) -> list[Link]:
    """Return the elements of a deck that are no cells."""
    return [link for card in cards if is_of_links(card) for link in _links_of(card)]


def _links_of(card: Card) -> Iterator[Link]:
    kind = card.name_of("TYPE")
    for row, (number, *nodes) in enumerate(card.integers(1 + LINKS[kind]).tolist()):
        yield Link(card, row, kind, number, tuple(nodes))


def sets_of_links(cards: Sequence[Card], links: Sequence[Link]) -> dict[str, list[Link]]:
    """Return the sets of elements that have such elements, and these."""
    known = {link.number: link for link in links}
    found: dict[str, list[Link]] = {}
    for link in links:
        if link.card.name_of("ELSET"):
            found.setdefault(link.card.name_of("ELSET"), []).append(link)
    for card in cards if known else ():
        if card.name != "ELSET":
            continue
        mine = found.setdefault(card.required("ELSET"), [])
        if "GENERATE" in card.parameters:
            for row in range(len(card.lines)):
                first, last, by = ([int(x) for x in card.floats(row)] + [1])[:3]
                mine += [known[n] for n in known if first <= n <= last and (n - first) % max(by, 1) == 0]
            continue
        for entry in (entry for row in card.rows for entry in row):
            mine += [known[int(entry)]] if entry.isdecimal() and int(entry) in known else []
            mine += found.get(entry.upper(), [])
    return {name: list(dict.fromkeys(own)) for name, own in found.items() if own}
