"""Stresses and plastic strains that a deck gives its elements before the first step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.materials.elastic import IsotropicElasticity, Material, PlaneStrain, lame
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh

#: Place of 11, 22, 33, 12, 13, 23, the order of the deck, among xx, yy, zz, yz, xz, xy.
_IN_VOIGT = [0, 1, 2, 5, 4, 3]


@dataclass(frozen=True, eq=False)
class TensorGiven:
    """Initial stresses, or plastic strains, of elements.

    `card`: the last card that gives some, that of the first elements if none does; `values`: by element, xx,
    yy, zz, yz, xz, xy, (n_elements, 6), zero where none is given.
    """

    card: Card
    values: np.ndarray


def read_initial(
    cards: Sequence[Card], mesh: DeckMesh, note: Callable[[Card, str], None], kind: str
) -> TensorGiven:
    """Return the initial STRESS, or the PLASTICSTRAIN, of the elements of a deck.

    Lines of eight entries have an element, an integration point and six components, as in CalculiX; others an
    element or a set and its components, as in Abaqus. Elements have the mean of their points.
    """
    mine = [each for each in cards if each.name == "INITIALCONDITIONS" and kind_of(each) == kind]
    stress = np.zeros((len(mesh.element_numbers), 6))
    for card in mine:
        widths = {len(entries) for entries in card.rows}
        if widths == {8}:
            _at_points(card, mesh, stress, note)
        elif 8 in widths:
            raise card.error("lines must all have integration points, or none, got both: make two cards")
        else:
            for row, entries in enumerate(card.rows):
                numbers = card.floats(row, 1)
                if not 1 <= len(numbers) <= 6:
                    raise card.error("needs an element or set and up to six stresses: correct the line", row)
                values = np.zeros(6)
                values[_IN_VOIGT[: len(numbers)]] = numbers
                stress[mesh.elements_named(entries[0], card, row)] = values
    return TensorGiven([mesh.blocks[0].card, *mine][-1], stress)


def kind_of(card: Card) -> str:
    """Return the type of an initial condition, without blanks."""
    return card.name_of("TYPE").replace(" ", "")


def relieved(strain: np.ndarray, material: Material, card: Card) -> np.ndarray:
    """Return the stresses −C : ε of bodies that are held, of plastic strains, both (n, 6)."""
    if not isinstance(material, IsotropicElasticity | PlaneStrain):
        raise card.error(
            f"plastic strains need isotropic elasticity without NLGEOM, got {type(material).__name__}"
        )
    first, shear = lame(material.young_modulus, material.poisson_ratio)
    stress = -2 * shear * strain
    stress[:, :3] -= first * strain[:, :3].sum(axis=1, keepdims=True)
    return stress


def _at_points(card: Card, mesh: DeckMesh, stress: np.ndarray, note: Callable[[Card, str], None]) -> None:
    """Give elements the mean stress of their integration points, in place."""
    table = card.numbers_alone
    if not table.size:
        table = np.array([card.floats(row) for row in range(len(card.rows))])
    element = mesh.positions(card.wholes(table[:, 0]), "element", card, by_row=True)
    point, given = card.wholes(table[:, 1]), table[:, 2:]
    here, place, count = np.unique(element, return_inverse=True, return_counts=True)
    place = place.ravel()
    last = np.zeros(len(here), dtype=int)
    np.maximum.at(last, place, point)
    once = len(np.unique(np.column_stack([place, point]), axis=0)) == len(table)
    if not once or (last != count).any() or point.min() < 1:
        bad = here[last != count][:1] if once else here[:1]
        raise card.error(
            "the stress of an element must be given at all of its integration points, 1, 2, ..., each once; "
            f"element {mesh.element_numbers[bad[0] if len(bad) else here[0]]} has others: complete them"
        )
    total = np.zeros((len(here), 6))
    np.add.at(total, place, given)
    mean = total / count[:, None]
    stress[here[:, None], _IN_VOIGT] = mean
    if np.abs(given - mean[place]).max() > 1e-9 * np.abs(given).max(initial=0.0):
        note(card, "elements have the mean of the initial stresses at their integration points")
