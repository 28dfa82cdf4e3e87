"""Contact pairs and ties of a deck."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact._scene.pairs import ContactPair, Coulomb, Surface, Tie
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._scene.surface_laws import ClosureLaw, ClosureTable, ExponentialClosure, LinearClosure
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh

#: Keeps what is worth knowing of a card.
Note: TypeAlias = Callable[[Card, str], None]


@dataclass(eq=False)
class Interaction:
    """A surface interaction with the cards behind it."""

    card: Card
    behavior: Card | None = None
    friction: Card | None = None

    @property
    def tied(self) -> bool:
        """Whether surfaces stay together."""
        return self.behavior is not None and self.behavior.name_of("PRESSURE-OVERCLOSURE") == "TIED"


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
                f"N={self.count:g} sectors are 360°/N apart, but {master.in_words} is "
                f"{abs(np.degrees(angle)):.6g}° from {slave.in_words}: correct N, the axis or the surfaces"
            )
        return replace(made, angle=angle)


@dataclass(frozen=True)
class Sides:
    """Two surfaces by name, and the card that names them.

    Attributes:
        tied: Whether they stay together.
        around: The axis of a sector, of which they are both sides.
    """

    slave: str
    master: str
    card: Card
    row: int
    tied: bool
    around: Around | None = None


def read_interactions(cards: Sequence[Card]) -> dict[str, Interaction]:
    """Return the surface interactions of a deck: their cards follow them."""
    found: dict[str, Interaction] = {}
    now: Interaction | None = None
    for card in cards:
        if card.name == "STEP":
            break  # what steps change is another matter
        if card.name == "SURFACEINTERACTION":
            now = found[card.required("NAME")] = Interaction(card)
        elif card.name in ("SURFACEBEHAVIOR", "FRICTION"):
            if now is None:
                raise card.error("must follow a *SURFACE INTERACTION, none is before it: add one with NAME=")
            if card.name == "FRICTION":
                now.friction = card
            else:
                now.behavior = card
    return found


def interaction_of(card: Card, known: Mapping[str, Interaction]) -> Interaction:
    """Return the interaction that a contact pair names."""
    name = card.required("INTERACTION")
    if name not in known:
        raise card.error(
            f"surface interaction {name!r} is not there; the deck has {', '.join(known) or 'none'}"
        )
    return known[name]


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
    kind = "HARD" if card is None else card.name_of("PRESSURE-OVERCLOSURE") or "HARD"
    if card is None or kind == "HARD":
        note(interaction.card if card is None else card, "hard contact is exact, without a penalty stiffness")
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
        f"PRESSURE-OVERCLOSURE={kind} with {len(numbers)} numbers is not read: HARD, LINEAR (slope), "
        "EXPONENTIAL (clearance, pressure), TABULAR (pressure, overclosure) and TIED are"
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


def clearances(cards: Sequence[Card]) -> dict[tuple[str, str], tuple[Card, float]]:
    """Return the clearances by slave and master."""
    return {
        (card.required("SLAVE"), card.required("MASTER")): (card, card.number_of("VALUE"))
        for card in cards
        if card.name == "CLEARANCE"
    }


def adjusted(
    sides: Sequence[Sides], nodes_of: Callable[[Sides], np.ndarray], mesh: DeckMesh
) -> dict[tuple[str, str], tuple[Card, float]]:
    """Return no clearance of the pairs that ADJUST a set with all nodes of their slave.

    `nodes_of`: returns the nodes of the slave.
    """
    found = {}
    for of in sides:
        name = of.card.parameters.get("ADJUST")
        if of.tied or name is None or _is_number(name):
            continue
        chosen, own = mesh.nodes_named(name, of.card), nodes_of(of)
        left = np.setdiff1d(own, chosen)
        if len(left):
            raise of.card.error(
                f"ADJUST={name} must be a distance, or a set with all nodes of the slave, but {len(left)} of "
                f"{len(own)} are not in it, such as {mesh.numbers[left[0]]}: add them"
            )
        found[of.slave, of.master] = of.card, 0.0
    return found


def near(one: BodyMesh, surface: str, other: BodyMesh, facing: str) -> bool:
    """Return whether the boxes around two surfaces, half as large again, overlap."""
    boxes = []
    for mesh, name in ((one, surface), (other, facing)):
        points = mesh.points[np.unique(mesh.surfaces[name])]
        size = 0.25 * float(np.linalg.norm(np.ptp(points, axis=0)))
        boxes.append((points.min(axis=0) - size, points.max(axis=0) + size))
    (low, high), (below, above) = boxes
    return bool((low <= above).all() and (below <= high).all())


def build_pairs(
    sides: Sequence[Sides],
    names: Mapping[str, str],
    meshes: Mapping[str, BodyMesh],
    interactions: Mapping[str, Interaction],
    given: Mapping[tuple[str, str], tuple[Card, float]],
    alone: Mapping[str, str],
    note: Note,
) -> list[tuple[Sides, ContactPair | AnyTie]]:
    """Return contact pairs and ties between bodies.

    `names`: name of a surface in the deck -> that in the meshes; `alone`: name of a slave whose nodes touch
    one by one -> that of the node set in the meshes.
    """
    found: list[tuple[Sides, ContactPair | AnyTie]] = []
    for both, (card, _) in given.items():
        if both not in {(each.slave, each.master) for each in sides if not each.tied}:
            raise card.error(f"there is no contact pair of {both[0]} on {both[1]}: correct the names")
    for each in sides:
        slave, master = names[each.slave], names[each.master]
        pairs = [
            (Surface(a, slave), Surface(b, master))
            for a, one in meshes.items() if slave in one.surfaces
            for b, other in meshes.items() if master in other.surfaces
        ]  # fmt: skip
        if len(pairs) > 1:
            pairs = [(s, m) for s, m in pairs if near(meshes[s.body], slave, meshes[m.body], master)]
        for one, other in pairs:
            twin = next((p for _, p in found if (p.slave, p.master) == (other, one)), None)
            if twin is not None:
                note(each.card, f"the pair {each.slave} on {each.master} is the one in the other sense, once")
                continue
            try:
                made: ContactPair | AnyTie
                if each.around is not None:
                    made = each.around.tie(one, other, meshes)
                elif each.tied:
                    made = Tie(one, other)
                else:
                    made = _pair(one, other, each, interactions, given, alone, note)
            except InvalidInputError as error:
                if getattr(error, "card", ""):
                    raise
                raise each.card.error(str(error), each.row) from error
            found.append((each, made))
    return found


def _pair(
    slave: Surface,
    master: Surface,
    of: Sides,
    interactions: Mapping[str, Interaction],
    given: Mapping[tuple[str, str], tuple[Card, float]],
    alone: Mapping[str, str],
    note: Note,
) -> ContactPair:
    interaction, card = interaction_of(of.card, interactions), of.card
    kind = card.name_of("TYPE") or "NODE TO SURFACE"
    if kind not in ("NODE TO SURFACE", "SURFACE TO SURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR"):
        raise card.error(f"TYPE={kind} is not read: NODE TO SURFACE, SURFACE TO SURFACE and MORTAR are")
    adjust = card.parameters.get("ADJUST")
    _, clearance = given.get((of.slave, of.master), (None, None))
    if adjust is not None and not _is_number(adjust):
        adjust = None  # a clearance of zero is given
    by_clearance = {} if clearance is None else {"gap" if clearance >= 0 else "interference": abs(clearance)}
    if clearance is None and adjust is None:
        by_clearance = {"interference": "measured"}  # type: ignore[dict-item]
    return ContactPair(
        slave,
        master,
        friction_of(interaction),
        closure=closure_of(interaction, note),
        adjust=None if adjust is None else float(adjust),
        nodes=alone.get(of.slave),
        **by_clearance,  # type: ignore[arg-type]
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
