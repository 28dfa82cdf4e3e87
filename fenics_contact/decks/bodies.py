"""Bodies of a deck: their meshes with everything that is named, and their materials."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.plausible import LONG, METALS, odd_modulus
from fenics_contact.decks.cards import DeckCards
from fenics_contact.decks.materials import Conditions, build_material
from fenics_contact.decks.names import Names
from fenics_contact.decks.steps import DeckSteps
from fenics_contact.materials.elastic import isotropic_constants
from fenics_contact.materials.hyperelastic import has_mean_dilatation, is_nonlinear
from fenics_contact.materials.laminate import Laminate
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.one_layer import one_wide
from fenics_contact.mesh.quality import AT_GAUSS_POINTS, jacobians, thickness
from fenics_contact.readers.deck_bodies import (
    Component,
    Parts,
    Section,
    build_bodies,
    integration_of,
    regions_of,
)
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import MeshCards
from fenics_contact.readers.deck_plies import Ply


@dataclass(frozen=True, eq=False)
class DeckBodies:
    """The bodies of a deck, and all that they are built from."""

    deck: DeckCards
    steps: DeckSteps
    names: Names
    parts: Parts
    bodies: Mapping[str, Body]

    @property
    def meshes(self) -> Mapping[str, BodyMesh]:
        """The meshes by body."""
        return self.parts.meshes

    def bodies_with(self, name: str) -> list[str]:
        """Return the bodies that have a surface or set of nodes."""
        meshes = self.parts.meshes.items()
        return [body for body, mesh in meshes if name in mesh.surfaces or name in mesh.node_sets]

    def mesh_cards(self) -> MeshCards:
        """Return the mesh with everything that is named for the scene."""
        deck, mesh = self.deck, self.deck.mesh
        sections = {s.name: mesh.element_sets[s.name] for s in deck.sections}
        # The section of a whole body has its name, as bodies of instances are not named by their sections.
        whole = {
            deck.sections[part.sections[0]].name: part
            for part in deck.components
            if len(part.sections) == 1 and part.name not in sections
        }
        names = {
            name: whole[name].name
            if name in whole and np.array_equal(elements, whole[name].elements)
            else name
            for name, elements in sections.items()
        }
        sets = {names[name]: elements for name, elements in sections.items()}
        sets |= {part.name: part.elements for part in deck.components if part.name not in sets}
        cards = [f"*SOLID SECTION, ELSET={names[s.name]}, MATERIAL={s.material}" for s in deck.sections]
        return MeshCards(mesh, sets, self.names.surfaces, self.names.node_sets, cards)


def bodies_of(deck: DeckCards, steps: DeckSteps, names: Names) -> DeckBodies:
    """Return the bodies of a deck with what is named."""
    parts = build_bodies(
        deck.mesh,
        deck.components,
        deck.of_element,
        deck.sections,
        names.surfaces,
        names.node_sets,
        f"deck '{deck.name}'",
    )
    for step in steps.steps:
        if steps.large and not step.large:
            raise step.card.error("all steps must have NLGEOM, or none, got both: give it to this one, too")
    bodies = {part.name: _body(deck, steps, parts, part) for part in deck.components}
    return DeckBodies(deck, steps, names, parts, bodies)


def _body(deck: DeckCards, steps: DeckSteps, parts: Parts, part: Component) -> Body:
    """Return a body with its materials."""
    mesh, nodes = parts.meshes[part.name], parts.nodes[part.name]
    sections = regions_of(deck.sections, part)
    every = _temperatures(steps)
    heated = any((instant.temperatures != steps.initial).any() for instant in steps.instants)
    of = Conditions(
        deck.kind,
        steps.large,
        _only(every),
        heated,
        mesh.cell_type in ("hexahedron", "quadrilateral"),
        initial=_only(np.unique(steps.initial[nodes[nodes >= 0]])),
        expands=heated and any(_expands(deck, section) for section in sections.values()),
    )
    given = {}
    for region, section in sections.items():
        thick = section.thickness if len(deck.thicknesses) > 1 else None
        given[region] = _material(deck, section, replace(of, thickness=thick))
        _note_units(deck, section.card, given[region], mesh)
    integration = _integration(deck, part, mesh, given.values())
    _note_corners(deck, part, mesh)
    deck.record.origins["body", part.name] = deck.sections[part.sections[0]].card.origin
    return Body(
        mesh,
        given if len(given) > 1 else next(iter(given.values())),
        axisymmetric=deck.kind == "axisymmetric",
        integration=integration,
    )


def _integration(
    deck: DeckCards, part: Component, mesh: BodyMesh, materials: Iterable[Any]
) -> Literal["full", "reduced", "stabilised", "rows"]:
    """Return how the elements of a body are integrated; rows of single cells need some of full."""
    found = integration_of(deck.mesh, part, deck.note)
    blocks = [deck.mesh.blocks[k] for k in np.unique(deck.mesh.block_of[part.elements])]
    if found == "reduced" and blocks[0].element.shape == "wedge":
        if any(has_history(each) or has_mean_dilatation(each) for each in materials):
            deck.note(blocks[0].card, "prisms of such a material are integrated in full, by more points")
        return found
    if found == "full" or not mesh.centres:
        return "full"
    if blocks[0].element.is_row:
        if any(map(is_nonlinear, materials)):
            deck.note(blocks[0].card, "B32R are integrated in full where materials or strains are nonlinear")
            return "full"
        return "rows"
    layers = any(block.element.listed < block.element.count for block in blocks)
    return "stabilised" if layers and one_wide(mesh).any() else found


def _temperatures(steps: DeckSteps) -> np.ndarray:
    """Return all temperatures that there are."""
    return np.unique(
        [*np.unique(steps.initial), *(t for at in steps.instants for t in np.unique(at.temperatures))]
    )


def _only(values: np.ndarray) -> float | None:
    """Return a single value, None of several."""
    return float(values[0]) if len(values) == 1 else None


def _expands(deck: DeckCards, section: Section) -> bool:
    known = [deck.materials[ply.material] for ply in section.plies if ply.material in deck.materials]
    return any("EXPANSION" in material.parts for material in known)


def _material(deck: DeckCards, section: Section, of: Conditions) -> Any:
    built = [_of_ply(deck, section.card, ply, of) for ply in section.plies]
    if not section.composite:
        return built[0]
    if any(is_nonlinear(each) for each in built):
        raise section.card.error(
            "COMPOSITE is for linear materials and small displacements: leave NLGEOM out"
        )
    deck.note(
        section.card, "cells are of one piece across the plies; their stresses are those of the mean ply"
    )
    return Laminate.of(zip(built, (ply.thickness for ply in section.plies), strict=True))


def _of_ply(deck: DeckCards, card: Card, ply: Ply, of: Conditions) -> Any:
    cards = card.known("material", ply.material, deck.materials)
    if ply.orientation:
        card.known("orientation", ply.orientation, deck.orientations)
    deck.record.origins["material", ply.material] = cards.card.origin
    return build_material(cards, deck.orientations.get(ply.orientation), of)


def _note_units(deck: DeckCards, card: Card, material: Any, mesh: BodyMesh) -> None:
    """Report a Young's modulus that looks like one in other units than the lengths."""
    young, _ = isotropic_constants(material) or (0.0, 0.0)
    size = float(np.ptp(mesh.points, axis=0).max())
    if METALS[0] <= young <= METALS[1] and size >= LONG:
        deck.note(
            card,
            f"odd units? a Young's modulus of {young:g} is that of a metal in GPa, the body is {size:.4g}"
            f" long: with lengths in mm and forces in N it would be {1e3 * young:g}",
        )
    elif words := odd_modulus(young, size):
        deck.note(card, f"odd units? {words}")


def _note_corners(deck: DeckCards, part: Component, mesh: BodyMesh) -> None:
    """Report elements that are turned inside out at a corner, but not at their Gauss points."""
    bad = np.flatnonzero(thickness(mesh.points, mesh.cells) <= 0.0)
    if not len(bad):
        return
    least = jacobians(mesh.points, mesh.cells[bad]).min(axis=1)
    inside = jacobians(mesh.points, mesh.cells[bad], AT_GAUSS_POINTS).min()
    elements = deck.mesh.in_cell_order(part.elements)[bad]
    number = deck.mesh.element_numbers[elements[np.argmin(least)]]
    card = deck.mesh.blocks[deck.mesh.block_of[elements[0]]].card
    deck.note(
        card,
        f"the Jacobian of {len(bad)} elements of body {part.name} is not positive at a corner or "
        f"an edge, down to {least.min():.3g} in element {card.label(number)}; it is {inside:.3g} and "
        "more at their Gauss points, which count: bend them less where results matter",
    )
