"""Load steps of a deck: what is held and loaded at the end of each, node by node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fenics_contact.decks.initial_stress import kind_of
from fenics_contact.decks.vocabulary import KNOWN, PRINT_CARDS, PROCEDURES
from fenics_contact.readers.deck_cards import Card, DeckError, plain
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class Amplitude:
    """A factor over time: linear between values, constant beyond them.

    Attributes:
        total: Whether time counts from the first step on, else from the start of each.
    """

    times: np.ndarray
    values: np.ndarray
    total: bool

    def at(self, step_time: float, total_time: float) -> float:
        """Return the factor at a time."""
        return float(np.interp(total_time if self.total else step_time, self.times, self.values))


def read_amplitudes(cards: Sequence[Card]) -> dict[str, Amplitude]:
    """Return the amplitudes of a deck by name."""
    found = {}
    for card in cards:
        if card.name != "AMPLITUDE":
            continue
        if card.name_of("DEFINITION") not in ("", "TABULAR") or "USER" in card.parameters:
            raise card.error(f"only tables are read, got {card.given}: give pairs of time and value")
        numbers = card.all_floats()
        if len(numbers) < 2 or len(numbers) % 2:
            raise card.error(f"needs pairs of a time and a value, got {len(numbers)} numbers: complete them")
        times, values = np.array(numbers).reshape(-1, 2).T
        if (np.diff(times) < 0).any():
            raise card.error("times must ascend: sort the pairs")
        total = card.name_of("TIME").startswith("TOTAL") or card.name_of("VALUE") == "TOTALTIME"
        shift = card.number_of("SHIFTX"), card.number_of("SHIFTY")
        found[card.required("NAME")] = Amplitude(times + shift[0], values + shift[1], total)
    return found


@dataclass(frozen=True)
class Pressed:
    """A pressure on faces.

    Attributes:
        where: Element set or element, and face: ("TOP", "P2"); of a surface its name alone.
        value: Pressure at the time, [force / length²].
    """

    where: tuple[str, ...]
    card: Card
    row: int
    value: float


@dataclass(frozen=True)
class Weight:
    """A load on the volume: acceleration, or the square of an angular velocity about an axis."""

    where: str
    card: Card
    row: int
    kind: str
    value: float
    numbers: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Moment:
    """What acts at a time of a step.

    Attributes:
        time: Time from the first step on.
        held: What nodes are held at, NaN where they are free, displacements and rotations, (n_nodes, 6),
            along their local axes.
        forces: Forces and moments on nodes, (n_nodes, 6), along their local axes.
        temperatures: (n_nodes,), or None where none are given.
        fixed: What is held as it was before the step, (n_nodes, 6).
        kept: What of it was free before, so that `held` does not know its value, (n_nodes, 6).
    """

    time: float
    held: np.ndarray
    forces: np.ndarray
    pressures: Sequence[Pressed]
    weights: Sequence[Weight]
    temperatures: np.ndarray | None
    fixed: np.ndarray
    kept: np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """One load step of a deck.

    Attributes:
        large: Whether it has NLGEOM, or one before it.
        moments: What acts at times of it, the last one at its end.
    """

    card: Card
    name: str
    large: bool
    moments: Sequence[Moment]


@dataclass(frozen=True)
class Held:
    """Nodes that a card holds.

    Attributes:
        label: Name of the set, or number of the node; "" for single nodes.
        components: Components from zero.
    """

    label: str
    nodes: np.ndarray
    components: tuple[int, ...]
    card: Card
    row: int


class _Course:
    """What acts now, changed by one card after the other."""

    def __init__(self, mesh: DeckMesh, amplitudes: Mapping[str, Amplitude]) -> None:
        shape = (len(mesh.points), 6)
        self.mesh, self.amplitudes = mesh, amplitudes
        self.held, self.held_before = np.full(shape, np.nan), np.zeros(shape)
        self.fixed, self.kept = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        #: What has no value that the deck gives: it was free at the end of the step before, or kept then.
        self.unknown = np.zeros(shape, dtype=bool)
        self.force, self.force_before = np.zeros(shape), np.zeros(shape)
        self.held_by, self.force_by = np.zeros(shape, dtype=int), np.zeros(shape, dtype=int)
        self.factors: list[Amplitude | None] = [None]
        self.names: list[tuple[str, float]] = [("", 0.0)]
        self.pressures: dict[tuple[str, ...], tuple[Pressed, int, float]] = {}
        self.pressed = set[tuple[str, ...]]()  # in the step
        self.weights: dict[tuple[str, str], tuple[Weight, int, float]] = {}
        self.temperature: np.ndarray | None = None
        self.temperature_before: np.ndarray | None = None
        self.temperature_by = 0
        self.targets: list[Held] = []

    def _by(self, card: Card) -> int:
        """Return the number of the amplitude of a card, 0 without one."""
        name, delay = card.name_of("AMPLITUDE"), card.number_of("TIMEDELAY")
        if not name:
            if delay:
                raise card.error("TIME DELAY needs an AMPLITUDE, there is none: add it, or leave it out")
            return 0
        if name not in self.amplitudes:
            raise card.error(
                f"amplitude {name!r} is not there; the deck has {', '.join(self.amplitudes) or 'none'}"
            )
        if (name, delay) not in self.names:
            factor = self.amplitudes[name]
            self.names.append((name, delay))
            self.factors.append(replace(factor, times=factor.times + delay))
        return self.names.index((name, delay))

    def boundary(self, card: Card, fresh: bool) -> None:
        """Hold nodes."""
        if card.name_of("OP") == "NEW" and fresh:
            self.held[:] = np.nan
        if card.name_of("TYPE") not in ("", "DISPLACEMENT"):
            raise card.error(f"TYPE={card.name_of('TYPE')} is not read: prescribe displacements")
        fixed, by = "FIXED" in card.parameters, self._by(card)
        if card.numbers_alone is not None and card.numbers_alone.shape[1] > 1:
            self._hold_single(card, card.numbers_alone, fixed, by)
            return
        for row, entries in enumerate(card.rows):
            nodes = self.mesh.nodes_named(entries[0], card, row)
            components, value = _components(card, row, entries)
            inside = tuple(components)
            self.targets.append(Held(plain(entries[0]), nodes, inside, card, row))
            for k in inside:
                self.held[nodes, k] = self.held_before[nodes, k] if fixed else value
                self._held_so(nodes, k, by, fixed)

    def _hold_single(self, card: Card, table: np.ndarray, fixed: bool, by: int) -> None:
        """Hold single nodes by their numbers, lines alike in their components at once."""
        nodes = self.mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True)
        first = card.wholes(table[:, 1])
        last = card.wholes(np.where(table[:, 2] > 0, table[:, 2], first)) if table.shape[1] > 2 else first
        value = table[:, 3] if table.shape[1] > 3 else np.zeros(len(table))
        for span in np.unique(np.column_stack([first, last]), axis=0).tolist():
            rows = np.flatnonzero((first == span[0]) & (last == span[1]))
            _check_span(card, int(rows[0]), *span)
            inside = tuple(range(span[0] - 1, span[1]))
            self.targets.append(Held("", nodes[rows], inside, card, int(rows[0])))
            for k in inside:
                self.held[nodes[rows], k] = self.held_before[nodes[rows], k] if fixed else value[rows]
                self._held_so(nodes[rows], k, by, fixed)

    def _held_so(self, nodes: np.ndarray, component: int, by: int, fixed: bool) -> None:
        at = nodes, component
        self.held_by[at], self.fixed[at], self.kept[at] = by, fixed, self.unknown[at] & fixed

    def forces(self, card: Card, fresh: bool, touched: np.ndarray) -> None:
        """Load nodes. Forces of one step add up, those of earlier steps are replaced.

        `touched`: what the step has loaded, (n_nodes, 6), changed in place.
        """
        if card.name_of("OP") == "NEW" and fresh:
            self.force[:] = 0.0
        by, table = self._by(card), card.numbers_alone
        if table is not None and table.shape[1] > 2 and ((table[:, 1] >= 1) & (table[:, 1] <= 6)).all():
            nodes = self.mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True)
            at = nodes, card.wholes(table[:, 1]) - 1
            self.force[at] = np.where(touched[at], self.force[at], 0.0)
            np.add.at(self.force, at, table[:, 2])
            self.force_by[at], touched[at] = by, True
            return
        for row, entries in enumerate(card.rows):
            nodes = self.mesh.nodes_named(entries[0], card, row)
            numbers = card.floats(row, 1)
            if len(numbers) < 2 or not 1 <= numbers[0] <= 6:
                raise card.error("needs node or set, component and force: complete the line", row)
            component = int(card.wholes(np.array(numbers[:1]), row)[0]) - 1
            kept = np.where(touched[nodes, component], self.force[nodes, component], 0.0)
            self.force[nodes, component] = kept + numbers[1]
            self.force_by[nodes, component] = by
            touched[nodes, component] = True

    def distributed(self, card: Card, fresh: bool) -> None:
        """Load faces and volumes."""
        if card.name_of("OP") == "NEW" and fresh:
            self.pressures.clear()
            self.weights.clear()
        by = self._by(card)
        self._check_single_faces(card)
        for row, entries in enumerate(card.rows):
            label = plain(entries[1]) if len(entries) > 1 else ""
            numbers = tuple(card.floats(row, 2))
            where = plain(entries[0])
            if card.name == "DSLOAD":
                self.mesh.surface_named(where, card, row)
                if label != "P" or not numbers:
                    raise card.error(
                        f"a surface is loaded by P and a pressure, got {label!r}: give these", row
                    )
                self._press((where,), card, row, numbers[0], by)
            elif label in ("GRAV", "CENTRIF"):
                needed = 4 if label == "GRAV" else 7
                if len(numbers) != needed:
                    raise card.error(f"{label} needs {needed} numbers behind it, got {len(numbers)}", row)
                if not any(numbers[-3:]):
                    what = "a direction" if label == "GRAV" else "the direction of an axis"
                    raise card.error(f"{label} needs {what}, its last three numbers, got zeros", row)
                self.mesh.elements_named(where, card, row)
                before = self.weights.get((where, label), (None, 0, 0.0))[0]
                load = Weight(where, card, row, label, numbers[0], numbers[1:])
                self.weights[where, label] = load, by, before.value if before else 0.0
            elif label[:1] == "P" and label[1:].isdecimal() and numbers:
                if not where.isdecimal():
                    self.mesh.faces_of(self.mesh.elements_named(where, card, row), label, card, row)
                self._press((where, label), card, row, numbers[0], by)
            else:
                raise card.error(
                    f"load {label!r} is not read: P1, P2, ... on faces of elements, GRAV and CENTRIF are", row
                )

    def _check_single_faces(self, card: Card) -> None:
        """Reject single elements and faces that are not there, those of one label at once."""
        rows: dict[str, list[int]] = {}
        for row, entries in enumerate(card.rows):
            label = plain(entries[1]) if len(entries) > 1 else ""
            if plain(entries[0]).isdecimal() and label[:1] == "P" and label[1:].isdecimal():
                rows.setdefault(label, []).append(row)
        for label, some in rows.items():
            numbers = np.array([plain(card.rows[row][0]) for row in some], dtype=np.float64)
            there = np.isin(numbers, self.mesh.element_numbers)
            lost = [row for row, known in zip(some, there.tolist(), strict=True) if not known]
            for row in lost[:1]:
                self.mesh.elements_named(plain(card.rows[row][0]), card, row)
            elements = self.mesh.positions(numbers.astype(np.int64), "element", card)
            try:
                self.mesh.faces_of(elements, label, card, some[0])
            except DeckError:
                for row, element in zip(some, elements.tolist(), strict=True):
                    self.mesh.faces_of(np.array([element]), label, card, row)

    def _press(self, where: tuple[str, ...], card: Card, row: int, value: float, by: int) -> None:
        known = self.pressures.get(where)
        start = 0.0 if known is None else known[0].value
        if known is not None and where in self.pressed:  # pressures of one step add up
            value, start = value + known[0].value, known[2]
        self.pressed.add(where)
        self.pressures[where] = Pressed(where, card, row, value), by, start

    def heat(self, card: Card, initial: np.ndarray, fresh: bool) -> None:
        """Give nodes temperatures."""
        if self.temperature is None or (card.name_of("OP") == "NEW" and fresh):
            self.temperature = initial.copy()
        if self.temperature_before is None:
            self.temperature_before = initial.copy()
        self.temperature_by = self._by(card)
        _assign(self.temperature, card, self.mesh)

    def at(self, step_time: float, period: float, start: float, at_once: bool = False) -> Moment:
        """Return what acts at a time of the step.

        What has no amplitude grows in proportion to the time, or is there at once.
        """
        ramp = 1.0 if at_once else step_time / period
        factor = np.array(
            [np.nan, *(each.at(step_time, start + step_time) for each in self.factors[1:] if each)]
        )

        def now(target: np.ndarray, before: np.ndarray, by: np.ndarray) -> np.ndarray:
            grown = before + ramp * (target - before)
            return np.where(by == 0, grown, target * factor[by])

        held = now(self.held, np.nan_to_num(self.held_before), self.held_by)
        pressures = [
            replace(each, value=float(now(np.array(each.value), np.array(old), np.array(by))))
            for each, by, old in self.pressures.values()
        ]
        weights = [
            replace(each, value=float(now(np.array(each.value), np.array(old), np.array(by))))
            for each, by, old in self.weights.values()
        ]
        heat = None
        if self.temperature is not None:
            before = self.temperature if self.temperature_before is None else self.temperature_before
            heat = now(self.temperature, before, np.full(len(self.temperature), self.temperature_by))
        forces = now(self.force, self.force_before, self.force_by)
        fixed, kept = self.fixed.copy(), self.kept & ~np.isnan(self.held)
        return Moment(start + step_time, held, forces, pressures, weights, heat, fixed, kept)

    def times(self, period: float, start: float) -> list[float]:
        """Return the times of a step at which something changes its slope, and its end."""
        used = np.unique(np.concatenate([
            self.held_by[~np.isnan(self.held)], self.force_by[self.force != 0.0],
            [by for _, by, _ in self.pressures.values()], [by for _, by, _ in self.weights.values()],
            [self.temperature_by],
        ])).astype(int)  # fmt: skip
        inner = set()
        for by in used[used > 0]:
            factor = self.factors[by]
            assert factor is not None
            inner |= {float(t) - (start if factor.total else 0.0) for t in factor.times}
        return [*sorted(t for t in inner if 1e-9 * period < t < period * (1 - 1e-9)), period]

    def finish(self, last: Moment) -> None:
        """Take the end of a step as the start of the next."""
        self.held_before, self.force_before = np.nan_to_num(last.held), last.forces.copy()
        self.unknown = np.isnan(last.held) | last.kept
        # What had an amplitude keeps it; what was ramped has its value at the start of the next step.
        for where, (each, by, _) in list(self.pressures.items()):
            self.pressures[where] = each, by, next(p.value for p in last.pressures if p.where == where)
        for key, (load, by, _) in list(self.weights.items()):
            self.weights[key] = load, by, next(w.value for w in last.weights if (w.where, w.kind) == key)
        if last.temperatures is not None:
            self.temperature_before = last.temperatures.copy()


def _assign(values: np.ndarray, card: Card, mesh: DeckMesh) -> None:
    """Give nodes the values of a card, in place."""
    table = card.numbers_alone
    if table is not None and table.shape[1] > 1:
        values[mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True)] = table[:, 1]
        return
    for row, entries in enumerate(card.rows):
        given = card.floats(row, 1)
        if not given:
            raise card.error("needs a node or set and its temperature: complete the line", row)
        values[mesh.nodes_named(entries[0], card, row)] = given[0]


def _check_span(card: Card, row: int, first: int, last: int) -> None:
    """Reject components that are no displacements or rotations."""
    if first < 1:
        raise card.error(
            "needs a node or set and the first component to hold, from 1: complete the line", row
        )
    if last < first:
        raise card.error(
            f"the first component must not be above the last, got {first} and {last}: exchange them", row
        )
    if last > 6:
        raise card.error(
            f"component {last} is no displacement: 1 to 3, of nodes that drive rigid surfaces 4 to 6", row
        )


def _components(card: Card, row: int, entries: Sequence[str]) -> tuple[range | tuple[int, ...], float]:
    """Return the components, from zero, that a line of *BOUNDARY holds, and their value."""
    named = {"XSYMM": (0,), "YSYMM": (1,), "ZSYMM": (2,), "PINNED": (0, 1, 2), "ENCASTRE": (0, 1, 2)}
    if len(entries) > 1 and plain(entries[1]) in named:
        return named[plain(entries[1])], 0.0
    numbers = card.floats(row, 1)
    if not numbers or numbers[0] < 1:
        raise card.error(
            "needs a node or set and the first component to hold, from 1: complete the line", row
        )
    first, *rest = card.wholes(np.array(numbers[:2]), row).tolist()
    last = rest[0] if rest and rest[0] else first
    _check_span(card, row, first, last)
    return range(first - 1, last), numbers[2] if len(numbers) > 2 else 0.0


@dataclass(frozen=True, eq=False)
class History:
    """The load steps of a deck.

    Attributes:
        targets: What is held, in the order of the deck, before and in all steps.
        prints: Cards that ask for results, with the number of their step.
    """

    steps: Sequence[Step]
    targets: Sequence[Held]
    prints: Sequence[tuple[int, Card]]
    initial: np.ndarray

    @cached_property
    def moments(self) -> Sequence[Moment]:
        """What acts at all times of all steps, in their order."""
        return [moment for step in self.steps for moment in step.moments]


def read_history(cards: Sequence[Card], mesh: DeckMesh) -> History:
    """Return the load steps of a deck."""
    course = _Course(mesh, read_amplitudes(cards))
    initial = _initial(cards, mesh)
    steps: list[Step] = []
    prints: list[tuple[int, Card]] = []
    start = 0.0
    inside: list[Card] | None = None
    for card in cards:
        if card.name == "STEP":
            if inside is not None:
                raise card.error("the step before has no *END STEP: add it")
            inside = [card]
        elif card.name == "ENDSTEP":
            if inside is None:
                raise card.error("there is no *STEP before it: add one, or leave it out")
            step, start = _step(inside, course, initial, start, steps)
            steps.append(step)
            prints += [(len(steps) - 1, each) for each in inside if each.name in PRINT_CARDS]
            inside = None
        elif inside is not None:
            inside.append(card)
        elif card.name == "BOUNDARY":
            course.boundary(card, fresh=True)
        elif card.name in ("CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "STATIC", *PROCEDURES):
            raise card.error("must be between *STEP and *END STEP: move it there")
    if inside is not None:
        raise inside[0].error("has no *END STEP: add it")
    return History(steps, course.targets, prints, initial)


def _initial(cards: Sequence[Card], mesh: DeckMesh) -> np.ndarray:
    """Return the initial temperatures of all nodes."""
    found = np.zeros(len(mesh.points))
    for card in cards:
        if card.name == "INITIALCONDITIONS":
            kind = kind_of(card)
            if kind in ("STRESS", "PLASTICSTRAIN"):
                continue
            if kind != "TEMPERATURE":
                raise card.error(f"TYPE={kind} is not read: TEMPERATURE, STRESS and PLASTIC STRAIN are")
            _assign(found, card, mesh)
    return found


def _step(
    cards: Sequence[Card],
    course: _Course,
    initial: np.ndarray,
    start: float,
    before: Sequence[Step],
) -> tuple[Step, float]:
    """Return a step and the time at its end."""
    head, seen, period = cards[0], set[str](), 1.0
    course.pressed.clear()
    loaded = np.zeros(course.force.shape, dtype=bool)
    if "PERTURBATION" in head.parameters:
        raise head.error(
            "PERTURBATION is not read: a step here has all loads, give them in full, or take the steps of "
            "statics before it alone (statics_only=True, or --statics-only)"
        )
    amplitude = head.name_of("AMPLITUDE") or "RAMP"
    if amplitude not in ("RAMP", "STEP"):
        raise head.error(f"AMPLITUDE={amplitude} is not read: RAMP and STEP are")
    static = False
    for card in cards[1:]:
        fresh = card.name not in seen
        seen.add(card.name)
        if card.name in PROCEDURES:
            raise card.error(
                "only *STATIC is solved here: take the steps of statics alone (statics_only=True, or "
                "--statics-only), or leave this one out"
            )
        if card.name == "STATIC":
            static = True
            numbers = card.floats(0) if card.lines else []
            period = numbers[1] if len(numbers) > 1 and numbers[1] > 0 else 1.0
        elif card.name == "BOUNDARY":
            course.boundary(card, fresh)
        elif card.name == "CLOAD":
            course.forces(card, fresh, loaded)
        elif card.name in ("DLOAD", "DSLOAD"):
            course.distributed(card, fresh)
        elif card.name == "TEMPERATURE":
            course.heat(card, initial, fresh)
        elif card.name not in KNOWN:
            raise card.error("this card is not known: see the list of cards in the guide")
    if not static:
        raise head.error("needs *STATIC: nothing else is solved here, add it")
    times = course.times(period, start)
    moments = [course.at(time, period, start, amplitude == "STEP") for time in times]
    course.finish(moments[-1])
    # Once it is there it stays.
    large = bool(before) and before[-1].large
    if "NLGEOM" in head.parameters:
        large = plain(head.parameters["NLGEOM"]) in ("", "YES")
    return Step(head, _name(head, before), large, moments), start + period


def _name(head: Card, before: Sequence[Step]) -> str:
    name = head.name_of("NAME") or f"step {len(before) + 1}"
    if any(each.name == name for each in before):
        raise head.error(f"a step before it has the name {name!r}, too: give it another one")
    return name
