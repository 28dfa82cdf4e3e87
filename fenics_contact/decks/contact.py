"""What a deck says of contact pairs and ties: their surfaces and interactions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import TypeAlias

import numpy as np

from fenics_contact._scene.pairs import Coulomb, Surface
from fenics_contact._scene.sectors import CyclicSymmetry
from fenics_contact._scene.surface_laws import ClosureLaw, ClosureTable, ExponentialClosure, LinearClosure
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.deck_cards import AtLine, Card

#: Keeps what is worth knowing of a card.
Note: TypeAlias = Callable[[Card, str], None]


@dataclass(frozen=True, eq=False)
class Interaction:
    """A surface interaction with the cards behind it.

    `behavior`: how surfaces press; its own card, which means hard contact, if none is given.
    """

    behavior: Card
    friction: Card | None = None

    @property
    def tied(self) -> bool:
        """Whether surfaces stay together."""
        return self.behavior.name_of("PRESSURE-OVERCLOSURE") == "TIED"


@dataclass(frozen=True)
class Around:
    """An axis around which a sector repeats, and how often."""

    card: Card
    point: tuple[float, ...]
    axis: tuple[float, ...]
    count: float

    @classmethod
    def of(cls, tie: Card, cards: Sequence[Card]) -> Around:
        """Return that of a tie of both sides of a sector."""
        name = tie.name_of("NAME")
        models = [card for card in cards if card.name == "CYCLICSYMMETRYMODEL"]
        found = [card for card in models if card.name_of("TIE") == name or len(models) == 1]
        if not found:
            raise tie.error(f"needs a *CYCLIC SYMMETRY MODEL with TIE={name}: add it, with N= and the axis")
        numbers = found[0].floats(0) if found[0].lines else []
        count = found[0].number_of("N")
        if len(numbers) < 6 or count < 2:
            raise found[0].error("needs N= sectors and a line with two points of the axis: complete it")
        first, second = np.array(numbers[:3]), np.array(numbers[3:6])
        return cls(found[0], tuple(first.tolist()), tuple((second - first).tolist()), count)

    def tie(self, slave: Surface, master: Surface, meshes: Mapping[str, BodyMesh]) -> CyclicSymmetry:
        """Return the symmetry of a sector of 360°/N, in the sense that is measured between its sides."""
        made = CyclicSymmetry(slave, master, self.point, self.axis)
        angle = made.measured_angle(meshes[slave.body], meshes[master.body])
        if abs(2.0 * np.pi / abs(angle) - self.count) > 0.5:
            raise self.card.error(
                f"N={self.count:g} sectors are 360°/N apart, {master.in_words} is "
                f"{abs(np.degrees(angle)):.6g}° from {slave.in_words}: correct N, the axis or the surfaces"
            )
        return replace(made, angle=angle)


@dataclass(frozen=True)
class Sides(AtLine):
    """Two surfaces by name, and the card that names them.

    `tied`: whether they stay together; `around`: the axis of a sector, of which they are both sides.
    """

    slave: str
    master: str
    card: Card
    row: int
    tied: bool
    around: Around | None = None


def read_interactions(cards: Sequence[Card]) -> dict[str, Interaction]:
    """Return the surface interactions of a deck before its steps: their cards follow them."""
    found: dict[str, Interaction] = {}
    name = ""
    for card in takewhile(lambda card: card.name != "STEP", cards):
        if card.name == "SURFACEINTERACTION":
            name = card.required("NAME")
            found[name] = Interaction(card)
        elif card.name in ("SURFACEBEHAVIOR", "FRICTION"):
            if not name:
                raise card.error("must follow a *SURFACE INTERACTION, none is before it: add one with NAME=")
            part = "friction" if card.name == "FRICTION" else "behavior"
            found[name] = replace(found[name], **{part: card})
    return found


def interaction_of(card: Card, known: Mapping[str, Interaction]) -> Interaction:
    """Return the interaction that a contact pair names."""
    return card.known("surface interaction", card.required("INTERACTION"), known)


def read_sides(cards: Sequence[Card], known: Mapping[str, Interaction]) -> list[Sides]:
    """Return the surfaces of all contact pairs and ties."""
    found = []
    for card in cards:
        if card.name not in ("CONTACTPAIR", "TIE"):
            continue
        tied = card.name == "TIE" or interaction_of(card, known).tied
        around = Around.of(card, cards) if "CYCLICSYMMETRY" in card.parameters else None
        for row, entries in enumerate(card.rows):
            if len(entries) != 2:
                raise card.error("needs a slave and a master surface in each line: complete it", row)
            slave, master = (entry.upper().strip('"') for entry in entries)
            found.append(Sides(slave, master, card, row, tied, around))
    return found


def closure_of(interaction: Interaction, note: Note) -> ClosureLaw | None:
    """Return how surfaces give way; None where contact is hard, which is exact here."""
    card = interaction.behavior
    kind = card.name_of("PRESSURE-OVERCLOSURE") or "HARD"
    if kind == "HARD":
        note(card, "hard contact is exact, without a penalty stiffness")
        return None
    numbers = card.all_floats()
    if kind == "LINEAR" and numbers:
        note(card, f"surfaces give way with {numbers[0]:g} [force / length³] under pressure alone")
        return LinearClosure(numbers[0])
    if kind == "EXPONENTIAL" and len(numbers) >= 2:
        return ExponentialClosure(pressure=numbers[1], clearance=numbers[0])
    if kind == "TABULAR":
        pressures, closures = np.array([card.floats(k)[:2] for k in range(len(card.lines))]).T
        start = max(int(np.count_nonzero(pressures <= 0.0)) - 1, 0)
        return ClosureTable(tuple(closures[start:].tolist()), tuple(pressures[start:].tolist()))
    raise card.error(
        f"PRESSURE-OVERCLOSURE={kind} with {len(numbers)} numbers is not read: give HARD, LINEAR (slope), "
        "EXPONENTIAL (clearance, pressure), TABULAR (pressure, overclosure) or TIED"
    )


def friction_of(interaction: Interaction) -> Coulomb | None:
    """Return the friction of an interaction, with its stick slope if one is given."""
    card = interaction.friction
    if card is None:
        return None
    numbers = card.all_floats()
    if not numbers:
        raise card.error("needs a friction coefficient, it has no data line: add it")
    stick = numbers[1] if len(numbers) > 1 and numbers[1] > 0 else None
    return Coulomb(numbers[0], stick_stiffness=stick) if numbers[0] > 0 else None
