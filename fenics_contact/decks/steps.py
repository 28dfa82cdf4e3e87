"""Load steps of a deck: what is held, loaded and heated at instants of each, node by node."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact.decks.initial_stress import kind_of
from fenics_contact.decks.multi_point import NO_ROWS, Equation, Rows
from fenics_contact.decks.vocabulary import HEAT, PRINT_CARDS, PROCEDURES
from fenics_contact.readers.deck_cards import AtLine, Card, DeckError, plain
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class Amplitude:
    """A factor over time: linear between values, constant beyond them.

    `total`: whether time counts from the first step on, else from the start of each.
    """

    times: np.ndarray
    values: np.ndarray
    total: bool

    def at(self, step_time: float, total_time: float) -> float:
        """Return the factor at a time."""
        return float(np.interp(total_time if self.total else step_time, self.times, self.values))


@dataclass(frozen=True, eq=False)
class Amplitudes:
    """The amplitudes of a deck, numbered from 1 by name and delay; 0 is what has none and is ramped."""

    known: Mapping[str, Amplitude]
    numbered: Mapping[tuple[str, float], Amplitude]

    @classmethod
    def of(cls, cards: Sequence[Card]) -> Amplitudes:
        """Read those of a deck, with the delays that its loads and supports give."""
        known, numbered = read_amplitudes(cards), {}
        for card in cards:
            name = card.name_of("AMPLITUDE")
            if name in known:
                delay = card.number_of("TIMEDELAY")
                numbered[name, delay] = replace(known[name], times=known[name].times + delay)
        return cls(known, numbered)

    def number(self, card: Card) -> int:
        """Return the number of the amplitude of a card, 0 without one."""
        name, delay = card.name_of("AMPLITUDE"), card.number_of("TIMEDELAY")
        if not name:
            if delay:
                raise card.error("TIME DELAY needs an AMPLITUDE, there is none: add it, or leave it out")
            return 0
        card.known("amplitude", name, self.known)
        return 1 + list(self.numbered).index((name, delay))

    def factors(self, step_time: float, total_time: float) -> np.ndarray:
        """Return the factors at a time by their numbers."""
        return np.array([np.nan, *(each.at(step_time, total_time) for each in self.numbered.values())])

    def times(self, numbers: np.ndarray, start: float) -> set[float]:
        """Return the times of a step at which amplitudes change their slope."""
        every = list(self.numbered.values())
        used = [every[number - 1] for number in np.unique(numbers) if number > 0]
        return {float(t) - (start if each.total else 0.0) for each in used for t in each.times}


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


@dataclass(frozen=True, eq=False)
class Clock:
    """A time of a step, from the first step on, and the factors of amplitudes by their numbers.

    `share`: share of its change that what is ramped has made.
    """

    time: float
    share: float
    factors: np.ndarray

    def between(self, start: Any, end: Any, by: Any) -> np.ndarray:
        """Return values on their ways from the start of the step to their aims, or by amplitudes."""
        grown = start + self.share * (end - start)
        return np.where(np.equal(by, 0), grown, end * self.factors[by])


@dataclass(frozen=True, eq=False)
class Ramp:
    """Values of nodes in a step: at its start, their aims, and the numbers of their amplitudes."""

    start: np.ndarray
    end: np.ndarray
    by: np.ndarray

    def at(self, clock: Clock) -> np.ndarray:
        """Return them at a time."""
        return clock.between(self.start, self.end, self.by)


@dataclass(frozen=True)
class DistributedLoad(AtLine):
    """A load on faces, or on volumes: acceleration, or the square of an angular velocity.

    `where`: element set or element, and face or "GRAV" or "CENTRIF": ("TOP", "P2"); of a surface its name
    alone with a pressure, or with "TRVEC" or "TRSHR", whose direction `numbers` are;
    `value`: at the time, or the aim of the step, and `start`, at its start; `by`: number of its amplitude.
    """

    card: Card
    row: int
    where: tuple[str, ...]
    value: float
    numbers: tuple[float, ...]
    by: int
    start: float = 0.0

    @property
    def on_volume(self) -> bool:
        """Whether it is a load on volumes."""
        return self.where[-1] in ("GRAV", "CENTRIF") and len(self.where) > 1

    @property
    def is_traction(self) -> bool:
        """Whether it is a force per area along a direction."""
        return self.where[-1] in ("TRVEC", "TRSHR") and len(self.where) > 1

    def at(self, clock: Clock) -> DistributedLoad:
        """Return it at a time."""
        return replace(self, value=float(clock.between(self.start, self.value, self.by)))


@dataclass(frozen=True)
class Held(AtLine):
    """Nodes that a card holds.

    `label`: name of the set, or number of the node; "" for single nodes; `value`: displacement or rotation,
    or that of each; `by`: number of its amplitude.
    """

    label: str
    nodes: np.ndarray
    components: tuple[int, ...]
    card: Card
    row: int
    value: float | np.ndarray
    by: int

    @property
    def fixed(self) -> bool:
        """Whether nodes stay where they were at the end of the step before."""
        return "FIXED" in self.card.parameters


@dataclass(frozen=True, eq=False)
class Instant:
    """What acts at a time of a step.

    `held`: what nodes are held at, NaN where they are free, displacements and rotations, (n_nodes, 6), along
    their local axes; `kept`: what of it was free before, so that `held` does not know its value.
    """

    time: float
    held: np.ndarray
    forces: np.ndarray
    acting: Sequence[DistributedLoad]
    temperatures: np.ndarray
    fixed: np.ndarray
    kept: np.ndarray

    @classmethod
    def rest(cls, initial: np.ndarray) -> Instant:
        """Return what is before all steps, at initial temperatures: nothing moves."""
        zero, none = np.zeros((len(initial), 6)), np.zeros((len(initial), 6), dtype=bool)
        return cls(0.0, zero, zero, (), initial, none, none)

    @property
    def pressures(self) -> list[DistributedLoad]:
        """The pressures and tractions on faces."""
        return [each for each in self.acting if not each.on_volume]

    @property
    def weights(self) -> list[DistributedLoad]:
        """The loads on volumes."""
        return [each for each in self.acting if each.on_volume]


@dataclass(frozen=True, eq=False)
class StepState:
    """What holds, loads and heats in a step.

    `held`: displacements and rotations of nodes, NaN where they are free, (n_nodes, 6); `acting`: loads on
    faces and volumes, each once for where it is; `fixed`: what is held as it was before the step; `kept`:
    what of it was free before.
    """

    held: Ramp
    forces: Ramp
    temperatures: Ramp
    acting: Sequence[DistributedLoad]
    fixed: np.ndarray
    kept: np.ndarray

    @classmethod
    def free(cls, initial: np.ndarray) -> StepState:
        """Return that of bodies that nothing holds and loads, at initial temperatures."""
        zero, none = np.zeros((len(initial), 6)), np.zeros((len(initial), 6), dtype=bool)
        by = np.zeros(zero.shape, dtype=int)
        heat = Ramp(initial, initial, np.zeros(len(initial), dtype=int))
        return cls(Ramp(zero, zero + np.nan, by), Ramp(zero, zero, by), heat, (), none, none)

    def with_held(self, targets: Sequence[Held], replaced: bool, reached: Instant) -> StepState:
        """Return the state with nodes that are held; `reached`: the end of the step before."""
        start = np.nan_to_num(reached.held)
        # What was free at the end of the step before, or kept then, has no value that the deck gives.
        unknown = np.isnan(reached.held) | reached.kept
        end, by, fixed, kept = (each.copy() for each in (self.held.end, self.held.by, self.fixed, self.kept))
        if replaced:
            end[:] = np.nan
        for each in targets:
            for k in each.components:
                at = each.nodes, k
                end[at] = start[at] if each.fixed else each.value
                by[at], fixed[at], kept[at] = each.by, each.fixed, unknown[at] & each.fixed
        return replace(self, held=Ramp(start, end, by), fixed=fixed, kept=kept)

    def with_loads(self, loads: Loads, reached: Instant, initial: np.ndarray) -> StepState:
        """Return the state with loads; forces of one step add up, those of earlier ones are replaced."""
        end, by = self.forces.end.copy(), self.forces.by.copy()
        touched = np.zeros(end.shape, dtype=bool)
        if "CLOAD" in loads.replaced:
            end[:] = 0.0
        for nodes, components, values, number in loads.forces:
            at = nodes, components
            end[at] = np.where(touched[at], end[at], 0.0)
            np.add.at(end, at, values)
            by[at], touched[at] = number, True
        heat = (initial if "TEMPERATURE" in loads.replaced else self.temperatures.end).copy()
        heated_by = self.temperatures.by
        for nodes, values, number in loads.temperatures:
            heat[nodes], heated_by = values, np.full(len(heat), number)
        acting = () if {"DLOAD", "DSLOAD"} & loads.replaced else self.acting
        return replace(
            self,
            forces=Ramp(reached.forces, end, by),
            temperatures=Ramp(reached.temperatures, heat, heated_by),
            acting=_added(acting, loads.acting, reached.acting),
        )

    def at(self, clock: Clock) -> Instant:
        """Return what acts at a time."""
        return Instant(
            clock.time,
            self.held.at(clock),
            self.forces.at(clock),
            [each.at(clock) for each in self.acting],
            self.temperatures.at(clock),
            self.fixed,
            self.kept & ~np.isnan(self.held.end),
        )

    @property
    def amplitudes(self) -> np.ndarray:
        """The numbers of the amplitudes in use."""
        held, forced = ~np.isnan(self.held.end), self.forces.end != 0.0
        acting = np.array([each.by for each in self.acting], dtype=int)
        return np.concatenate([self.held.by[held], self.forces.by[forced], self.temperatures.by[:1], acting])


def _added(
    known: Sequence[DistributedLoad], given: Sequence[DistributedLoad], reached: Sequence[DistributedLoad]
) -> list[DistributedLoad]:
    """Return loads with those of a step: pressures that it gives add up.

    What had an amplitude keeps it; what was ramped starts with its value at the end of the step before.
    """
    values = {each.where: each.value for each in reached}
    found = {each.where: replace(each, start=values.get(each.where, each.start)) for each in known}
    seen = set[tuple[str, ...]]()
    for each in given:
        if each.where in seen and not each.on_volume:
            before = found[each.where]
            found[each.where] = replace(each, value=each.value + before.value, start=before.start)
        else:
            start = found[each.where].value if each.where in found else 0.0
            found[each.where] = replace(each, start=start)
        seen.add(each.where)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Step:
    """One load step of a deck.

    `large`: whether it has NLGEOM, or one before it; `instants`: what acts at times of it, the last one at
    its end.
    """

    card: Card
    name: str
    large: bool
    instants: Sequence[Instant]


@dataclass(frozen=True, eq=False)
class DeckSteps:
    """The load steps of a deck.

    `targets`: what is held, in the order of the deck, before and in all steps; `at_rest`: what is held in the
    first step, or without any, all at zero; `rows`: further equations.
    """

    steps: Sequence[Step]
    targets: Sequence[Held]
    prints: Sequence[tuple[int, Card]]
    initial: np.ndarray
    at_rest: Instant
    equations: Sequence[Equation] = ()
    rows: Rows = NO_ROWS

    @cached_property
    def instants(self) -> Sequence[Instant]:
        """What acts at all times of all steps, in their order."""
        return [instant for step in self.steps for instant in step.instants]

    @property
    def large(self) -> bool:
        """Whether any step has NLGEOM."""
        return any(step.large for step in self.steps)

    def with_forces(self, change: Callable[[np.ndarray], np.ndarray]) -> DeckSteps:
        """Return the steps with other forces on nodes, (n_nodes, 6)."""
        steps = [
            replace(step, instants=[replace(each, forces=change(each.forces)) for each in step.instants])
            for step in self.steps
        ]
        return replace(self, steps=steps)


def read_steps(cards: Sequence[Card], mesh: DeckMesh) -> DeckSteps:
    """Return the load steps of a deck."""
    amplitudes, initial = Amplitudes.of(cards), _initial(cards, mesh)
    state, reached = StepState.free(initial), Instant.rest(initial)
    steps, targets, prints = list[Step](), list[Held](), list[tuple[int, Card]]()
    for group in groups_of(cards):
        held = [each for each in group if each.name == "BOUNDARY"]
        if group[0].name == "STEP":
            _check_step(group[0], group)
        own = [target for card in held for target in _held(card, mesh, amplitudes.number(card))]
        state = state.with_held(own, bool(held) and held[0].name_of("OP") == "NEW", reached)
        targets += own
        if group[0].name == "STEP":
            state = state.with_loads(Loads.of(group, mesh, amplitudes), reached, initial)
            prints += [(len(steps), each) for each in group if each.name in PRINT_CARDS]
            steps.append(_step(group, state, amplitudes, reached.time, steps))
            reached = steps[-1].instants[-1]
    first = steps[0].instants[0] if steps else state.at(Clock(0.0, 0.0, amplitudes.factors(0.0, 0.0)))
    rest = replace(Instant.rest(initial), held=np.where(np.isnan(first.held), np.nan, 0.0))
    return DeckSteps(steps, targets, prints, initial, rest)


def groups_of(cards: Sequence[Card]) -> Iterator[list[Card]]:
    """Yield the cards of each step, and each card outside of steps that holds nodes."""
    inside = list[Card]()
    for card in cards:
        if card.name == "STEP":
            if inside:
                raise card.error("the step before has no *END STEP: add it")
            inside = [card]
        elif card.name == "ENDSTEP":
            if not inside:
                raise card.error("there is no *STEP before it: add one, or leave it out")
            yield inside
            inside = []
        elif inside:
            inside.append(card)
        elif card.name == "BOUNDARY":
            yield [card]
        elif card.name in ("CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "STATIC", *PROCEDURES):
            raise card.error("must be between *STEP and *END STEP: move it there")
    if inside:
        raise inside[0].error("has no *END STEP: add it")


def _step(
    group: Sequence[Card],
    state: StepState,
    amplitudes: Amplitudes,
    start: float,
    before: Sequence[Step],
) -> Step:
    """Return a step that begins at a time."""
    head = group[0]
    static = next(card for card in group if card.name == "STATIC")
    numbers = static.floats(0) if static.lines else []
    period = numbers[1] if len(numbers) > 1 and numbers[1] > 0 else 1.0
    times = amplitudes.times(state.amplitudes, start)
    times |= {time for row in range(1, len(static.lines)) for time in static.floats(row)}
    inner = sorted(t for t in times if 1e-9 * period < t < period * (1 - 1e-9))
    at_once = head.name_of("AMPLITUDE") == "STEP"
    instants = [
        state.at(Clock(start + t, 1.0 if at_once else t / period, amplitudes.factors(t, start + t)))
        for t in (*inner, period)
    ]
    large = bool(before) and before[-1].large  # once it is there it stays
    if "NLGEOM" in head.parameters:
        large = is_large(head)
    return Step(head, _name(head, before), large, instants)


def is_large(head: Card) -> bool:
    """Return whether a *STEP asks for large deformations itself."""
    return plain(head.parameters.get("NLGEOM", "NO")) in ("", "YES")


def _name(head: Card, before: Sequence[Step]) -> str:
    name = head.name_of("NAME") or f"step {len(before) + 1}"
    if any(each.name == name for each in before):
        raise head.error(f"a step before it has the name {name!r}, too: give it another one")
    return name


def _check_step(head: Card, group: Sequence[Card]) -> None:
    """Reject steps that are not static, perturbations, and other amplitudes of all loads than two."""
    if "PERTURBATION" in head.parameters:
        raise head.error("PERTURBATION is not supported: give all loads, or read with statics_only")
    amplitude = head.name_of("AMPLITUDE") or "RAMP"
    if amplitude not in ("RAMP", "STEP"):
        raise head.error(f"AMPLITUDE={amplitude} is not read: RAMP and STEP are")
    for card in group:
        if card.name in PROCEDURES:
            other = "; decks of heat alone are read by read_heat_deck" * (card.name in HEAT)
            raise card.error(f"only *STATIC is solved: leave this step out, or read with statics_only{other}")
    if not any(card.name == "STATIC" for card in group):
        raise head.error("needs *STATIC: nothing else is solved here, add it")


@dataclass(frozen=True, eq=False)
class Loads:
    """What the cards of a step load and heat, in their order, with the numbers of amplitudes.

    `replaced`: keywords whose first card replaces all that is there from earlier steps.
    """

    replaced: set[str]
    forces: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, int]]
    temperatures: Sequence[tuple[np.ndarray, Any, int]]
    acting: Sequence[DistributedLoad]

    @classmethod
    def of(cls, group: Sequence[Card], mesh: DeckMesh, amplitudes: Amplitudes) -> Loads:
        """Return those of the cards of a step."""
        replaced, seen = set[str](), set[str]()
        forces, temperatures, acting = list[Any](), list[Any](), list[DistributedLoad]()
        for card in group:
            if card.name not in ("CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE"):
                continue
            distributed = card.name in ("DLOAD", "DSLOAD")
            if card.name_of("OP") == "NEW" and card.name not in seen:
                replaced.add(card.name)
                acting = [] if distributed else acting
            seen.add(card.name)
            by = amplitudes.number(card)
            if distributed:
                acting += _distributed(card, mesh, by)
            elif card.name == "CLOAD":
                forces += [(*each, by) for each in _forces(card, mesh)]
            else:
                temperatures += [(*each, by) for each in _temperatures(card, mesh)]
        return cls(replaced, forces, temperatures, acting)


def _held(card: Card, mesh: DeckMesh, by: int) -> Iterator[Held]:
    """Yield what a card holds; single nodes by their numbers, lines alike in their components at once."""
    if card.name_of("TYPE") not in ("", "DISPLACEMENT"):
        raise card.error(f"TYPE={card.name_of('TYPE')} is not read: prescribe displacements")
    table = card.numbers_alone
    if table.shape[1] < 2:
        for row, entries in enumerate(card.rows):
            nodes = mesh.nodes_named(entries[0], card, row)
            components, number = _components(card, row, entries)
            yield Held(plain(entries[0]), nodes, tuple(components), card, row, number, by)
        return
    nodes = mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True)
    table = np.pad(table, ((0, 0), (0, 2)))
    first = card.wholes(table[:, 1])
    last = card.wholes(np.where(table[:, 2] > 0, table[:, 2], first))
    for span in np.unique(np.column_stack([first, last]), axis=0).tolist():
        rows = np.flatnonzero((first == span[0]) & (last == span[1]))
        _check_span(card, int(rows[0]), *span)
        inside = tuple(range(span[0] - 1, span[1]))
        yield Held("", nodes[rows], inside, card, int(rows[0]), table[rows, 3], by)


def _forces(card: Card, mesh: DeckMesh) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield nodes, components and forces of a card; of single nodes by their numbers at once."""
    table = card.numbers_alone
    if table.shape[1] > 2 and ((table[:, 1] >= 1) & (table[:, 1] <= 6)).all():
        nodes = mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True)
        yield nodes, card.wholes(table[:, 1]) - 1, table[:, 2]
        return
    for row, entries in enumerate(card.rows):
        nodes = mesh.nodes_named(entries[0], card, row)
        numbers = card.floats(row, 1)
        if len(numbers) < 2 or not 1 <= numbers[0] <= 6:
            raise card.error("needs node or set, component and force: complete the line", row)
        component = card.wholes(np.array(numbers[:1]), row) - 1
        yield nodes, np.repeat(component, len(nodes)), np.full(len(nodes), numbers[1])


def _distributed(card: Card, mesh: DeckMesh, by: int) -> Iterator[DistributedLoad]:
    """Yield the loads of a card on faces and volumes."""
    _check_single_faces(card, mesh)
    for row, entries in enumerate(card.rows):
        label = plain(entries[1]) if len(entries) > 1 else ""
        numbers = tuple(card.floats(row, 2))
        where: tuple[str, ...] = plain(entries[0]), label
        if card.name == "DSLOAD":
            mesh.surface_named(where[0], card, row)
            _check_on_surface(card, row, label, numbers)
            where = where[:1] if label == "P" else where
        elif label in ("GRAV", "CENTRIF"):
            _check_weight(card, row, label, numbers)
            mesh.weighed(where[0], card, row)
        elif _is_pressure(label) and numbers:
            if not where[0].isdecimal():
                mesh.faces_of(mesh.elements_named(where[0], card, row), label, card, row)
        else:
            raise card.error(f"load {label!r} is not supported: give P1, P2, ..., GRAV or CENTRIF", row)
        yield DistributedLoad(card, row, where, numbers[0], numbers[1:], by)


def _check_on_surface(card: Card, row: int, label: str, numbers: Sequence[float]) -> None:
    """Reject loads on surfaces but pressures, and tractions without a direction."""
    if label == "P" and numbers:
        return
    if label not in ("TRVEC", "TRSHR") or len(numbers) != 4 or not any(numbers[1:]):
        needed = "P and a pressure, or by TRVEC or TRSHR, its size and a direction x, y, z"
        raise card.error(f"a surface is loaded by {needed}, got {', '.join(card.rows[row][1:])!r}", row)


def _check_weight(card: Card, row: int, label: str, numbers: Sequence[float]) -> None:
    needed = 4 if label == "GRAV" else 7
    if len(numbers) != needed:
        raise card.error(f"{label} needs {needed} numbers behind it, got {len(numbers)}", row)
    if not any(numbers[-3:]):
        what = "a direction" if label == "GRAV" else "the direction of an axis"
        raise card.error(f"{label} needs {what}, its last three numbers, got zeros", row)


def _is_pressure(label: str) -> bool:
    """Return whether a label is that of a face, or of the side of a shell that a pressure acts on."""
    return label == "P" or (label[:1] == "P" and label[1:].isdecimal())


def _check_single_faces(card: Card, mesh: DeckMesh) -> None:
    """Reject single elements and faces that are not there, those of one label at once."""
    rows: dict[str, list[int]] = {}
    for row, entries in enumerate(card.rows):
        label = plain(entries[1]) if len(entries) > 1 else ""
        if plain(entries[0]).isdecimal() and _is_pressure(label):
            rows.setdefault(label, []).append(row)
    for label, some in rows.items():
        numbers = np.array([plain(card.rows[row][0]) for row in some], dtype=np.float64)
        there = np.isin(numbers, mesh.element_numbers)
        lost = [row for row, known in zip(some, there.tolist(), strict=True) if not known]
        for row in lost[:1]:
            mesh.elements_named(plain(card.rows[row][0]), card, row)
        elements = mesh.positions(numbers.astype(np.int64), "element", card)
        try:
            mesh.faces_of(elements, label, card, some[0])
        except DeckError:
            for row, element in zip(some, elements.tolist(), strict=True):
                mesh.faces_of(np.array([element]), label, card, row)


def _temperatures(card: Card, mesh: DeckMesh) -> Iterator[tuple[np.ndarray, Any]]:
    """Yield nodes of a card and their temperatures."""
    if "LINTEMP" in card.parameters:
        yield from (_between_planes(card, row, mesh) for row in range(len(card.lines)))
        return
    table = card.numbers_alone
    if table.shape[1] > 1 and not table[:, 2:].any():
        yield mesh.positions(card.wholes(table[:, 0]), "node", card, by_row=True), table[:, 1]
        return
    for row, entries in enumerate(card.rows):
        given = card.floats(row, 1)
        if any(given[1:]):
            raise card.error("gradients of temperature across shells are not read: leave them out", row)
        if not given:
            raise card.error("needs a node or set and its temperature: complete the line", row)
        yield mesh.nodes_named(entries[0], card, row), given[0]


def _between_planes(card: Card, row: int, mesh: DeckMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes between two parallel planes, and their temperatures, linear between those of these."""
    numbers = card.floats(row)
    if len(numbers) != 7 or not any(numbers[:3]) or numbers[3] == numbers[5]:
        raise card.error("needs a normal and two planes, each with its distance and temperature", row)
    first, second = numbers[3:5], numbers[5:7]
    place = mesh.points @ np.array(numbers[:3])
    share = (place - first[0]) / (second[0] - first[0])
    nodes = np.flatnonzero((share >= 0.0) & (share <= 1.0))
    return nodes, first[1] + share[nodes] * (second[1] - first[1])


def _check_span(card: Card, row: int, first: int, last: int) -> None:
    """Reject components that are no displacements or rotations."""
    if first < 1:
        raise card.error("needs a node or set and the first component, from 1: complete the line", row)
    if last < first:
        raise card.error(f"the first component must not be above the last, got {first} and {last}", row)
    if last > 6:
        raise card.error(f"components are displacements, 1 to 3, and rotations, 4 to 6, got {last}", row)


def _components(card: Card, row: int, entries: Sequence[str]) -> tuple[range | tuple[int, ...], float]:
    """Return the components, from zero, that a line of *BOUNDARY holds, and their value."""
    named = {
        "XSYMM": (0, 4, 5), "YSYMM": (1, 3, 5), "ZSYMM": (2, 3, 4),
        "PINNED": (0, 1, 2), "ENCASTRE": tuple(range(6)),
    }  # fmt: skip
    if len(entries) > 1 and plain(entries[1]) in named:
        return named[plain(entries[1])], 0.0
    numbers = card.floats(row, 1) or [0.0]
    first, *rest = card.wholes(np.array(numbers[:2]), row).tolist()
    last = rest[0] if rest and rest[0] else first
    _check_span(card, row, first, last)
    return range(first - 1, last), numbers[2] if len(numbers) > 2 else 0.0


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
            for nodes, values in _temperatures(card, mesh):
                found[nodes] = values
    return found
