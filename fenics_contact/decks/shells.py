"""What a deck holds, loads and heats of nodes of shells and beams, on the nodes across their thickness."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.decks.cards import DeckCards
from fenics_contact.decks.multi_point import Equation, Rows
from fenics_contact.decks.shell_motions import ShellMotions
from fenics_contact.decks.steps import DeckSteps, Held, Instant
from fenics_contact.readers.deck_cards import Card
from fenics_contact.results.constraints import ConstraintForce
from fenics_contact.results.state import Tolerance


def on_solids(deck: DeckCards, steps: DeckSteps) -> DeckSteps:
    """Return the steps with what acts on nodes of shells on the nodes across their thickness."""
    if not len(deck.mesh.shells.node):
        return steps
    between = deck.mesh.shells.between

    def held(instant: Instant) -> Instant:
        return replace(instant, held=between(instant.held))

    named = any("NODALTHICKNESS" in card.parameters for card in deck.cards)
    for card in deck.cards:
        if card.name == "NODALTHICKNESS" and not named:
            deck.note(card, "has no effect, as in CalculiX: no *SHELL SECTION has NODAL THICKNESS")
    for block in deck.mesh.blocks:
        if block.element.instead:
            deck.note(
                block.card,
                f"{block.card.name_of('TYPE')} get nodes in the middle of their edges and are solved as "
                f"{block.element.instead}",
            )
    inner = [replace(step, instants=[*map(held, step.instants)]) for step in steps.steps]
    steps = replace(steps, steps=inner, at_rest=held(steps.at_rest))
    return _Carrier(deck, steps, ShellMotions.of(deck.mesh.shells, deck.mesh.points)).carried()


@dataclass(frozen=True, eq=False)
class _Carrier:
    """Carries steps over.

    A node that solids have, too, is theirs: shells follow it, by hinges.
    """

    deck: DeckCards
    steps: DeckSteps
    motions: ShellMotions

    def carried(self) -> DeckSteps:
        """Return the steps."""
        self._check()
        if self._of_solids.any():
            count = np.count_nonzero(self._of_solids)
            self.deck.note(
                self._card, f"{count} nodes of shells or beams are of solids, too, and follow these by hinges"
            )
        at_rest, *_ = changed = [self._instant(each) for each in (self.steps.at_rest, *self.steps.instants)]
        instants = iter(changed[1:])
        steps = [replace(step, instants=[next(instants) for _ in step.instants]) for step in self.steps.steps]
        none = self.motions.nodes[:0]
        rows = [Rows.of(self.motions.joints, self._given(none, none)), *self._held_rows()]
        return replace(
            self.steps,
            steps=steps,
            at_rest=at_rest,
            initial=self.deck.mesh.shells.heated(self.steps.initial),
            targets=[each for target in self.steps.targets for each in self._target(target)],
            equations=[self._equation(each) for each in self.steps.equations],
            rows=Rows.joined(rows),
        )

    @property
    def _card(self) -> Card:
        """The card of the first shells."""
        blocks = self.deck.mesh.blocks
        return next(block.card for block in blocks if block.element.listed < block.element.count)

    @cached_property
    def _of_solids(self) -> np.ndarray:
        """Which nodes solids have, too."""
        return np.asarray(self.deck.inside[self.motions.nodes])

    @cached_property
    def marks(self) -> np.ndarray:
        """Which components of nodes of shells alone are held, (n, 6)."""
        held = ~np.isnan(self.steps.at_rest.held[self.motions.nodes])
        return np.asarray(held & ~self._of_solids[:, None])

    @cached_property
    def _turned(self) -> np.ndarray:
        return self.deck.axes.turned(self.motions.nodes)

    @cached_property
    def _local(self) -> sp.csr_matrix:
        """Displacements and rotations along the local axes of the nodes."""
        blocks = np.tile(np.eye(3), (len(self.motions.nodes), 1, 1))
        for place in np.flatnonzero(self._turned):
            blocks[place] = self.deck.axes.of(int(self.motions.nodes[place]))
        count = 2 * len(blocks)
        turn = sp.bsr_matrix(
            (np.repeat(blocks, 2, axis=0), np.arange(count), np.arange(count + 1)), shape=(3 * count,) * 2
        )
        return (turn @ self.motions.motion).tocsr()

    @cached_property
    def _direct(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes in the middle that are held themselves, and the numbers of their owners.

        Where a node has axes of its own CalculiX holds the mean alone, and so is it here.
        """
        motions = self.motions
        held = (motions.ends[:, 1] >= 0) & self.marks[:, :3].any(axis=1) & ~motions.of_beam
        owner = np.flatnonzero(held & ~motions.is_knot & ~self._turned)
        return motions.ends[owner, 1], owner

    def _instant(self, instant: Instant) -> Instant:
        """Return what acts at a time."""
        nodes, (direct, owner) = self.motions.nodes, self._direct
        held = instant.held.copy()
        held[direct, :3] = held[nodes[owner], :3]
        forces = instant.forces.copy()
        alone = nodes[~self._of_solids]
        given = np.where(self._of_solids[:, None], 0.0, forces[nodes])
        self._check_moments(given)
        forces[alone] = 0.0
        forces[:, :3] += self._loads(given)
        heat = self.deck.mesh.shells.heated(instant.temperatures)
        return replace(instant, held=held, forces=forces, temperatures=heat)

    def _loads(self, given: np.ndarray) -> np.ndarray:
        """Return forces of all nodes, (n_nodes, 3), that forces and moments of nodes of shells make.

        At corners of shells CalculiX shares a force by (−1, 4, −1) / 2, as comparison shows: so is it here.
        """
        found = (self.motions.motion.T @ given.ravel()).reshape(-1, 3)
        bottom, middle, top = self.motions.ends[:, :3].T
        corner = (middle >= 0) & ~self.motions.is_knot & ~self.motions.of_beam
        for ends, share in ((bottom, -1.0), (middle, 2.0), (top, -1.0)):
            np.add.at(found, ends[corner], share * given[corner, :3])
        return np.asarray(found)

    def _target(self, target: Held) -> Iterator[Held]:
        """Yield what a card holds, of shells the nodes that are held themselves, if there are any."""
        alone = self.motions.nodes[~self._of_solids]
        mine = np.isin(target.nodes, alone)
        if not mine.any():
            yield target
            return
        direct, owner = self._direct
        own = np.unique(direct[np.isin(self.motions.sources[owner], target.nodes[mine]).any(axis=1)])
        if len(own) or not mine.all():
            yield replace(target, nodes=np.concatenate([target.nodes[~mine], own]))

    def _equation(self, equation: Equation) -> Equation:
        """Return an equation with the nodes across in place of those of shells alone."""
        place = np.searchsorted(self.motions.nodes, equation.nodes)
        entries = []
        for k, node, component, factor in zip(
            place.tolist(), equation.nodes, equation.components, equation.factors, strict=True
        ):
            if k == len(self.motions.nodes) or self.motions.nodes[k] != node or self._of_solids[k]:
                entries.append((node, component, factor))
                continue
            row = self._local[6 * k + component]
            entries += zip(row.indices // 3, row.indices % 3, factor * row.data, strict=True)
        nodes, components, factors = zip(*((int(n), int(c), float(f)) for n, c, f in entries), strict=True)
        return replace(equation, nodes=nodes, components=components, factors=factors)

    def _held_rows(self) -> Iterator[Rows]:
        """Yield the equations of what is held otherwise than node by node, and of hinges at solids."""
        held = self.marks
        number, k = np.nonzero(held[:, :3])
        yield Rows.of(self._local[6 * number + k], self._given(self.motions.nodes[number], k))
        for pattern in np.unique(held[held[:, 3:].any(axis=1), 3:], axis=0):
            mine = np.flatnonzero((held[:, 3:] == pattern).all(axis=1))
            yield self._turns(mine, 3 + np.flatnonzero(pattern))
        number = np.repeat(np.flatnonzero(self._of_solids), 3)
        k = np.tile(np.arange(3), len(number) // 3)
        yield Rows.of(self._local[6 * number + k], self._given(self.motions.nodes[number], k))
        turned = np.flatnonzero(held[:, 3:].any(axis=1) & self.motions.of_beam)
        between = self.motions.inner(turned, 3 * len(self.deck.mesh.points))
        yield Rows.of(between, sp.csr_matrix((between.shape[0], 6 * len(self.deck.mesh.points))))

    def _given(self, nodes: np.ndarray, components: np.ndarray) -> sp.csr_matrix:
        """Return the matrix that takes one component of a node of the deck in each row, (n, 6 n_nodes)."""
        shape = len(nodes), 6 * len(self.deck.mesh.points)
        return sp.csr_matrix((np.ones(len(nodes)), (np.arange(len(nodes)), 6 * nodes + components)), shape)

    def _turns(self, number: np.ndarray, components: np.ndarray, least: float = 0.1) -> Rows:
        """Return the equations of rotations of nodes.

        `least`: sine of the angle between their axis and the normal, about which shells do not resist.
        """
        every = self._gram(number, np.arange(3, 6))
        largest = np.linalg.eigvalsh(every)[:, -1]
        values, ways = np.linalg.eigh(self._gram(number, components))
        free = (values <= least**2 * largest[:, None]) & ~self.motions.of_beam[number, None]
        place, way = np.nonzero(~free)
        mine, share = number[place], ways[place, :, way] / np.sqrt(largest[place])[:, None]
        nodes = self.motions.nodes[mine]
        row = np.repeat(np.arange(len(mine)), len(components))
        chosen = (6 * mine[:, None] + components).ravel(), (6 * nodes[:, None] + components).ravel()
        mixed, given = (
            sp.csr_matrix((share.ravel(), (row, each)), (len(mine), size))
            for each, size in zip(
                chosen, (6 * len(self.motions.nodes), 6 * len(self.deck.mesh.points)), strict=True
            )
        )
        self._note_free(number, components, free, ways)
        self._note_oblique(number, components)
        return Rows.of(mixed @ self._local, given)

    def _gram(self, number: np.ndarray, components: np.ndarray) -> np.ndarray:
        """Return the products of the rows of some components of nodes, (n, m, m)."""
        rows = [self._local[6 * number + k] for k in components]
        return np.array([[np.asarray(a.multiply(b).sum(axis=1)).ravel() for a in rows] for b in rows]).T

    def _note_free(
        self, number: np.ndarray, components: np.ndarray, free: np.ndarray, ways: np.ndarray
    ) -> None:
        """Report held rotations about normals, and refuse those that are not zero."""
        place, way = np.nonzero(free)
        if not len(place) or len(components) == 3:  # held as a whole, as at a clamped edge
            return
        nodes = self.motions.nodes[number[place]]
        target = next(
            t for t in self.steps.targets if np.isin(nodes, t.nodes).any() and max(t.components) > 2
        )
        for instant in self.steps.instants:
            turned = np.einsum("nk,nk->n", instant.held[nodes[:, None], components], ways[place, :, way])
            if np.abs(turned).max() > 1e-12:
                raise target.error(
                    "a rotation about the normal of a shell cannot be prescribed: leave it out"
                )
        self.deck.note(
            target.card,
            f"rotations about the normals of shells at {len(set(nodes.tolist()))} nodes, first "
            f"{self.deck.mesh.numbers[nodes[0]]}, are not held: no shell resists them",
        )

    def _note_oblique(self, number: np.ndarray, components: np.ndarray, least: float = 1e-3) -> None:
        """Report given rotations about one or two axes oblique to shells; `least`: of cosines to normals."""
        cosine = np.abs(self.motions.normal[number][:, components - 3])
        oblique = ((cosine > least) & (cosine < 1.0 - least)).any(axis=1) & (len(components) < 3)
        nodes = self.motions.nodes[number[oblique]]
        given = [np.nan_to_num(each.held[nodes[:, None], components]) for each in self.steps.instants]
        if np.abs(given).max(initial=0.0) > 1e-12:
            target = next(t for t in self.steps.targets if np.isin(nodes, t.nodes).any())
            self.deck.note(
                target.card,
                f"turns about axes oblique to shells, at node {self.deck.mesh.numbers[nodes[0]]}, are those "
                "in their plane; CalculiX takes each as a whole turn about its axis: give all three",
            )

    def _check(self) -> None:
        """Refuse what equations of small displacements, the same in all steps, cannot have."""
        nodes, steps = self.motions.nodes, self.steps
        for instant in steps.instants:
            changed = (np.isnan(instant.held[nodes]) == self.marks) & ~self._of_solids[:, None]
            wrong = nodes[changed.any(axis=1)]
            for target in (each for each in steps.targets if np.isin(wrong, each.nodes).any()):
                raise target.error(
                    "nodes of shells and beams must be held alike in all steps: hold them in each, or none"
                )
            if instant.kept[nodes].any():
                raise next(t for t in steps.targets if t.fixed).error(
                    "nodes of shells and beams that were free before cannot be FIXED: give values"
                )
        if self.deck.references[nodes].any():
            number = self.deck.mesh.numbers[nodes[self.deck.references[nodes]][0]]
            raise self._card.error(
                f"node {number} of a shell or beam also drives a surface or a bolt: give that one its own"
            )
        if not steps.large:
            return
        if len(self.motions.of_joint):
            number = self.deck.mesh.numbers[nodes[self.motions.of_joint[0]]]
            raise self._card.error(
                f"shells or beams meet in a knot at node {number}, for small displacements: leave NLGEOM out"
            )
        for step in steps.steps:
            for instant in step.instants:
                if np.nan_to_num(instant.held[nodes, 3:]).any() or instant.forces[nodes, 3:].any():
                    raise step.card.error(
                        "with NLGEOM rotations and moments of nodes of shells and beams are not supported"
                    )

    def _check_moments(self, given: np.ndarray, most: float = 0.02) -> None:
        """Refuse moments about the normals of shells; `most`: share of them that is rounding of the mesh."""
        about = np.abs(np.einsum("nd,nd->n", given[:, 3:], self.motions.normal))
        wrong = (about > most * np.linalg.norm(given[:, 3:], axis=1)) & ~self.motions.is_knot
        if wrong.any():
            number = self.deck.mesh.numbers[self.motions.nodes[wrong][0]]
            raise self.steps.steps[0].card.error(
                f"node {number} has a moment about the normal of its shell, which resists none: leave it out"
            )


@dataclass(frozen=True, eq=False)
class ShellPrints:
    """How values of nodes of shells are those of the nodes across their thickness.

    `sources`, `ends` and `weights`: as in `ShellNodes`, by numbers in the deck; `rows`: equations that hold
    nodes, and `of_rows`: the sources of these.
    """

    sources: np.ndarray
    ends: np.ndarray
    weights: np.ndarray
    rows: Rows
    of_rows: np.ndarray

    @classmethod
    def of(cls, deck: DeckCards, steps: DeckSteps) -> ShellPrints:
        """Return those of a deck."""
        shells, numbers = deck.mesh.shells, np.append(deck.mesh.numbers, -1)
        here = np.isin(steps.rows.node, shells.node) & ~deck.inside[steps.rows.node]
        rows = Rows(*(each[here] for each in steps.rows.columns))
        before = sum(len(set(each.nodes)) > 1 for each in steps.equations)  # equations of the deck itself
        rows = replace(rows, number=rows.number + before)
        sources = np.repeat(np.arange(len(numbers))[:, None], 2, axis=1)
        sources[shells.node] = shells.sources
        across = numbers[shells.ends], shells.weights
        return cls(numbers[shells.sources], *across, rows, numbers[sources[rows.node]])

    @property
    def tolerance(self) -> Tolerance:
        """That of solutions by default: frames bend so easily that the usual one is 0.8 % off."""
        return 1e-6 if self.weights.shape[1] > 3 else None

    @property
    def is_held(self) -> bool:
        """Whether equations hold nodes of shells."""
        return len(self.rows.number) > 0

    def across(self, nodes: np.ndarray) -> np.ndarray:
        """Return numbers of nodes with those of the nodes across the thickness, ascending."""
        ends = self.ends[np.isin(self.sources, nodes).all(axis=1)]
        return np.union1d(nodes, ends[ends > 0])

    def moved(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return displacements of nodes of a body behind their numbers in the deck, (n, 1 + dim).

        `nodes`: numbers of the nodes of its mesh. Of shells they are (bottom + 4 middle + top) / 6, in the
        middle of edges the mean of bottom and top, as CalculiX prints them.
        """
        place, there = self._across(nodes)
        mine = there.any(axis=1) & (self.sources[:, 0] == self.sources[:, 1])
        found = np.einsum("nk,nkd->nd", self.weights[mine], values[place[mine]])
        return np.vstack([self._own(nodes, values), np.column_stack([self.sources[mine, 0], found])])

    def flat(self, kind: str, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return values of a field of files behind numbers of nodes, (n, 1 + k), as CalculiX's `OUTPUT=2D`.

        Of nodes across shells forces are added up, and means are weighted as displacements, also at nodes
        of solids; contact is left out.
        """
        own = self._own(nodes, values)
        if kind == "CONTACT":
            return own
        rows = self.summed(nodes, values) if kind == "FORC" else self.moved(nodes, values)
        if kind != "FORC":
            rows = rows[(np.arange(len(rows)) >= len(own)) | ~np.isin(rows[:, 0], self.sources)]
        numbers, number = np.unique(rows[:, 0], return_inverse=True)
        sums = np.stack([np.bincount(number.ravel(), column) for column in rows[:, 1:].T], axis=1)
        counts = np.ones(len(numbers)) if kind == "FORC" else np.bincount(number.ravel())
        return np.column_stack([numbers, sums / counts[:, None]])

    def owners(self, nodes: np.ndarray) -> np.ndarray:
        """Return the numbers of the nodes of shells that nodes across belong to, same shape."""
        order = np.argsort(self.ends, axis=None)
        found = order[np.searchsorted(self.ends.ravel()[order], nodes)]
        return np.asarray(self.sources[found // self.ends.shape[1], 0])

    def summed(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return forces on nodes of a body behind their numbers in the deck, (n, 1 + dim), of shells sums."""
        place, there = self._across(nodes)
        mine = there.any(axis=1)
        half = np.einsum("nk,nkd->nd", there[mine] * 0.5, values[place[mine]])
        return np.vstack(
            [self._own(nodes, values), *(np.column_stack([each, half]) for each in self.sources[mine].T)]
        )

    def _own(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return values of nodes that belong to no shells behind their numbers."""
        own = np.flatnonzero((nodes > 0) & ~np.isin(nodes, self.ends))
        return np.column_stack([nodes[own], values[own]])

    def _across(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the places of the nodes across among some, and which are among them, (n, 3)."""
        order = np.argsort(nodes, kind="stable")
        place = order[np.minimum(np.searchsorted(nodes[order], self.ends), len(nodes) - 1)]
        return place, (nodes[place] == self.ends) & (self.ends > 0)

    def held(self, forces: Mapping[str, ConstraintForce]) -> np.ndarray:
        """Return the forces of the equations that hold nodes of shells, behind their numbers, (n, 4)."""
        moved = np.flatnonzero(self.rows.component < 3)
        found = np.zeros((2, len(moved), 4))
        found[:, :, 0] = self.of_rows[moved].T
        size = -self.rows.factor[moved] * forces["EQUATIONS"].force[self.rows.number[moved]]
        found[:, np.arange(len(moved)), 1 + self.rows.component[moved]] = 0.5 * size
        return found.reshape(-1, 4)
