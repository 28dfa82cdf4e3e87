"""The cards of a deck, sorted by what they are of, before steps, names and a scene are made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fenics_contact.decks.contact import Interaction, Sides, read_interactions, read_sides
from fenics_contact.decks.couplings import (
    Bolt,
    Driven,
    read_bolts,
    read_driven,
    require_own_nodes,
)
from fenics_contact.decks.distributions import by_distribution
from fenics_contact.decks.initial_stress import TensorGiven, read_initial
from fenics_contact.decks.linear_couplings import LinearCoupling, Nodes, led, read_linear
from fenics_contact.decks.local_axes import LocalAxes, in_global_axes, read_axes
from fenics_contact.decks.materials import MaterialCards, read_materials
from fenics_contact.decks.multi_point import (
    Equation,
    Mean,
    mean_equations,
    read_equations,
    read_means,
    read_points,
    shared_out,
)
from fenics_contact.decks.outside import reduced
from fenics_contact.decks.pair_changes import PairChange, read_changes
from fenics_contact.decks.springs import NodeMass, NodeSpring, read_masses, read_springs
from fenics_contact.decks.steps import DeckSteps, read_steps
from fenics_contact.decks.vocabulary import IDLE_PARAMETERS, WITHOUT_EFFECT
from fenics_contact.readers.deck_bodies import (
    Component,
    Exterior,
    Section,
    components,
    read_sections,
    split_sections,
)
from fenics_contact.readers.deck_cards import Card, Origin
from fenics_contact.readers.deck_mesh import DeckMesh
from fenics_contact.readers.deck_shells import read_solid_mesh
from fenics_contact.readers.deck_straightened import straightened


@dataclass(frozen=True, eq=False)
class Record:
    """What is worth knowing of a deck, collected while it is read: notes, and where its parts are said."""

    notes: list[str] = field(default_factory=list)
    origins: dict[tuple[str, str], Origin] = field(default_factory=dict)

    def note(self, card: Card, words: str) -> None:
        """Keep what is worth knowing of a card."""
        text = f"{card.origin}: {words}"
        if text not in self.notes:
            self.notes.append(text)


@dataclass(frozen=True, eq=False)
class DeckCards:
    """The cards of a deck, sorted.

    `of_element`: number of the section of each element; `driven`: surfaces that nodes drive or load;
    `linear`: those that equations couple to nodes; `means`: nodes that move as means of others; `changes`:
    what each step changes of contact pairs, None where it changes nothing.
    """

    name: str
    cards: Sequence[Card]
    record: Record
    mesh: DeckMesh
    sections: Sequence[Section]
    of_element: np.ndarray
    components: Sequence[Component]
    exterior: Exterior
    materials: Mapping[str, MaterialCards]
    orientations: Mapping[str, Card]
    stress: TensorGiven
    strain: TensorGiven
    driven: Sequence[Driven]
    linear: Sequence[LinearCoupling]
    bolts: Sequence[Bolt]
    means: Sequence[Mean]
    springs: Sequence[NodeSpring]
    masses: Sequence[NodeMass]
    equations: Sequence[Equation]
    axes: LocalAxes
    interactions: Mapping[str, Interaction]
    sides: Sequence[Sides]
    changes: Sequence[PairChange | None]

    @classmethod
    def of(cls, name: str, cards: Sequence[Card], record: Record) -> DeckCards:
        """Sort the cards of a deck."""
        mesh = straightened(read_solid_mesh(cards), record.note)
        sections, of_element = read_sections(cards, mesh)
        materials, orientations = read_materials(cards)
        mesh, sections, of_element, orientations = by_distribution(
            cards, mesh, sections, of_element, orientations
        )
        bolts, means = read_bolts(cards, mesh), read_means(cards, mesh)
        require_own_nodes([(each.card, each.node) for each in bolts], mesh)
        require_own_nodes([(each.card, each.node) for each in means], mesh)
        interactions = read_interactions(cards)
        sides = read_sides(cards, interactions)
        return cls(
            name=name,
            cards=cards,
            record=record,
            mesh=mesh,
            sections=sections,
            of_element=of_element,
            components=components(mesh, sections, of_element),
            exterior=Exterior.of(mesh),
            materials=materials,
            orientations=orientations,
            stress=read_initial(cards, mesh, record.note, "STRESS"),
            strain=read_initial(cards, mesh, record.note, "PLASTICSTRAIN"),
            driven=read_driven(cards, mesh, orientations),
            linear=read_linear(cards, mesh, orientations),
            bolts=bolts,
            means=means,
            springs=read_springs(cards, mesh, materials),
            masses=read_masses(cards, mesh, materials),
            equations=read_equations(cards, mesh),
            axes=read_axes(cards, mesh),
            interactions=interactions,
            sides=sides,
            changes=read_changes(cards, interactions, sides),
        )

    def note(self, card: Card, words: str) -> None:
        """Keep what is worth knowing of a card."""
        self.record.note(card, words)

    def note_without_effect(self) -> None:
        """Report known cards and parameters without effect."""
        for card in self.cards:
            if card.name in WITHOUT_EFFECT and card.name != "HEADING":
                self.note(card, f"has no effect here ({WITHOUT_EFFECT[card.name]})")
            self.note_idle(card)

    def note_idle(self, card: Card) -> None:
        """Report parameters of a card without effect."""
        for name in card.parameters:
            if (card.name, name) in IDLE_PARAMETERS:
                self.note(card, f"{name} {IDLE_PARAMETERS[card.name, name]}")

    def cut_where_loaded(self, steps: DeckSteps) -> DeckCards:
        """Return the cards with sections cut where loads on volumes act on a part of them."""
        weights = [weight for instant in steps.instants for weight in instant.weights]
        loaded = {w.where[0]: self.mesh.weighed(w.where[0], w.card, w.row) for w in weights}
        mesh, sections, of_element, parts = split_sections(
            self.mesh, self.sections, self.of_element, self.components, loaded.items()
        )
        return replace(self, mesh=mesh, sections=sections, of_element=of_element, components=parts)

    @property
    def kind(self) -> str:
        """Kind of the elements, see `Element.kind`."""
        return self.mesh.blocks[0].element.kind

    @property
    def dim(self) -> int:
        """Dimension of their space."""
        return self.mesh.blocks[0].element.dim

    @property
    def thicknesses(self) -> set[float]:
        """Those of plane bodies, of others 1."""
        plane = self.kind in ("plane stress", "plane strain")
        return {section.thickness for section in self.sections} if plane else {1.0}

    @property
    def thickness(self) -> float:
        """The thickness by which forces are divided: 1 where materials have several."""
        return 1.0 if len(self.thicknesses) > 1 else next(iter(self.thicknesses))

    @property
    def motions(self) -> list[int]:
        """Components of displacement and rotation that a rigid piece has, from zero."""
        if self.kind == "axisymmetric":
            return [1]
        return list(range(6)) if self.dim == 3 else [0, 1, 5]

    @cached_property
    def inside(self) -> np.ndarray:
        """Which nodes belong to elements, (n_nodes,)."""
        mark = np.zeros(len(self.mesh.points), dtype=bool)
        for block in self.mesh.blocks:
            mark[block.nodes] = True
        return mark

    def ends_at(self, node: int) -> np.ndarray:
        """Return the nodes of elements whose mean an end of a spring is, none of one that has to be held."""
        if self.inside[node]:
            return np.array([node])
        means = [each.nodes for each in self.means if each.node == node and not np.ptp(each.weights)]
        return np.concatenate([self.mesh.shells.sides_at(node), *means])

    @cached_property
    def references(self) -> np.ndarray:
        """Which nodes drive surfaces, draw bolts or are means of others, (n_nodes,)."""
        mark = np.zeros(len(self.mesh.points) + 1, dtype=bool)  # the last is that of −1
        driving = [node for each in self.driven for node in each.reserved]
        mark[[*driving, *(each.node for each in self.bolts), *(each.node for each in self.means)]] = True
        return mark[:-1]


def steps_of(deck: DeckCards) -> tuple[DeckCards, DeckSteps]:
    """Return the steps of a deck: its equations, and forces along x, y and z per unit of thickness.

    The deck comes back with the rigid surfaces that equations join.
    """
    steps = read_steps(deck.cards, deck.mesh)
    held = [~np.isnan(instant.held) for instant in steps.instants]
    ever = np.any([np.zeros((len(deck.inside), 6), dtype=bool), *held], axis=0)
    nodes = Nodes(deck.mesh, deck.inside, deck.axes)
    given = [*deck.equations, *read_points(deck.cards, deck.mesh, steps.large)]
    given += [e for each in deck.linear for e in each.equations(nodes)]
    driven, given = led(deck.driven, given, nodes, steps.large)
    deck = replace(deck, driven=driven)
    given += mean_equations(deck.means, ever) if held else ()
    moving = np.tile(deck.inside[:, None], 6)
    moving[:, 3:] = False
    moving[deck.mesh.shells.node] = True
    found = reduced(given, ~(moving | ever | deck.references[:, None]), moving)
    deck.axes.check(steps)

    def shared(forces: np.ndarray) -> np.ndarray:
        along = in_global_axes(forces, deck.axes.rows)
        along = found.forces(forces, along, deck.axes, deck.mesh)
        return shared_out(along, deck.means) / deck.thickness

    return deck, replace(steps.with_forces(shared), equations=found.equations)
