"""What a deck says, before a scene is made of it: mesh, materials, steps, and names of surfaces and nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.plausible import LONG, METALS, odd_modulus
from fenics_contact.decks.couplings import (
    in_global_axes,
    read_axes,
    read_bolts,
    read_driven,
    read_equations,
    require_own_nodes,
)
from fenics_contact.decks.initial_stress import read_initial
from fenics_contact.decks.materials import Conditions, build_material, read_materials
from fenics_contact.decks.multi_point import mean_equations, read_means, read_points, shared_out
from fenics_contact.decks.regions import split_sections
from fenics_contact.decks.steps import DeckSteps, read_steps
from fenics_contact.materials.elastic import isotropic_constants
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quality import AT_GAUSS_POINTS, jacobians, thickness
from fenics_contact.readers.deck_bodies import (
    Component,
    Exterior,
    Parts,
    Section,
    build_bodies,
    components,
    integration_of,
    read_sections,
    regions_of,
)
from fenics_contact.readers.deck_cards import Card, Origin
from fenics_contact.readers.deck_mesh import DeckMesh, Faces, MeshCards, read_mesh_cards


class Model:
    """The cards of a deck, sorted, and what is named for the scene."""

    def __init__(self, name: str, cards: Sequence[Card]) -> None:
        """Sort the cards."""
        self.name, self.cards = name, cards
        self.notes: list[str] = []
        self.origins: dict[tuple[str, str], Origin] = {}
        self.mesh: DeckMesh = read_mesh_cards(cards)
        self.kind = self.mesh.blocks[0].element.kind
        self.dim = self.mesh.blocks[0].element.dim
        self.sections, self.of_element = read_sections(cards, self.mesh)
        self.materials, self.axes = read_materials(cards)
        self.parts_of_mesh = components(self.mesh, self.sections, self.of_element)
        self.exterior = Exterior.of(self.mesh)
        self.thickness = self._thickness()
        self.steps: DeckSteps = read_steps(cards, self.mesh)
        self.parts: Parts
        self.surfaces: dict[str, Faces] = {}
        self.node_sets: dict[str, np.ndarray] = {}
        self._split()
        self.stressed = read_initial(cards, self.mesh, self.note)
        self.flowed = read_initial(cards, self.mesh, self.note, "PLASTICSTRAIN")
        self.driven = read_driven(cards, self.mesh)
        self.bolts = read_bolts(cards, self.mesh)
        self.means = read_means(cards, self.mesh)
        require_own_nodes([(each.card, each.node) for each in self.bolts], self.mesh)
        require_own_nodes([(each.card, each.node) for each in self.means], self.mesh)
        large = any(step.large for step in self.steps.steps)
        held = [~np.isnan(instant.held) for instant in self.steps.instants]
        self.equations = [
            *read_equations(cards, self.mesh),
            *read_points(cards, self.mesh, large),
            *(mean_equations(self.means, np.any(held, axis=0)) if held else ()),
        ]
        self.local_axes = read_axes(cards, self.mesh, self.steps)
        nodes = [[each.node, each.turning] for each in self.driven] + [[bolt.node] for bolt in self.bolts]
        nodes += [[each.node] for each in self.means]
        self.references = np.array(
            [node for several in nodes for node in several if node >= 0], dtype=np.int64
        )
        self._share_forces()

    def _split(self) -> None:
        """Cut sections where a part of them is loaded."""
        weights = [w for instant in self.steps.instants for w in instant.weights]
        loaded = {w.where[0]: self.mesh.elements_named(w.where[0], w.card, w.row) for w in weights}
        self.mesh, self.sections, self.of_element, self.parts_of_mesh = split_sections(
            self.mesh, self.sections, self.of_element, self.parts_of_mesh, loaded.items()
        )

    def note(self, card: Card, words: str) -> None:
        """Keep what is worth knowing of a card."""
        text = f"{card.origin}: {words}"
        if text not in self.notes:
            self.notes.append(text)

    def _share_forces(self) -> None:
        """Take forces per unit of thickness and along x, y and z, those of means on their nodes."""
        steps = [
            replace(step, instants=[replace(m, forces=self._shared(m.forces)) for m in step.instants])
            for step in self.steps.steps
        ]
        self.steps = replace(self.steps, steps=steps)

    def _shared(self, forces: np.ndarray) -> np.ndarray:
        return shared_out(in_global_axes(forces, self.local_axes), self.means) / self.thickness

    def _thickness(self) -> float:
        if self.kind not in ("plane stress", "plane strain"):
            return 1.0
        found = {section.thickness for section in self.sections}
        return 1.0 if len(found) > 1 else found.pop()

    @property
    def motions(self) -> list[int]:
        """Components of displacement and rotation that a rigid piece has, from zero."""
        if self.kind == "axisymmetric":
            return [1]
        return list(range(6)) if self.dim == 3 else [0, 1, 5]

    @property
    def _has_thicknesses(self) -> bool:
        """Whether plane sections differ in their thickness, which their materials have then."""
        plane = self.kind in ("plane stress", "plane strain")
        return plane and len({section.thickness for section in self.sections}) > 1

    def build_meshes(self) -> None:
        """Make the meshes of the bodies, with everything that is named by now."""
        self.parts = build_bodies(
            self.mesh,
            self.parts_of_mesh,
            self.of_element,
            self.sections,
            self.surfaces,
            self.node_sets,
            f"deck '{self.name}'",
        )

    def in_cell_order(self, part: Component) -> np.ndarray:
        """Return the elements of a body in the order of its cells: type by type, by their names."""
        kinds = np.array([block.element.cell for block in self.mesh.blocks])[self.mesh.block_of]
        return part.elements[np.argsort(kinds[part.elements], kind="stable")]

    def mesh_cards(self) -> MeshCards:
        """Return the mesh with everything that is named for the scene."""
        sections = {s.name: self.mesh.element_sets[s.name] for s in self.sections}
        # The section of a whole body has its name, as bodies of instances are not named by their sections.
        bodies = {
            self.sections[part.sections[0]].name: part
            for part in self.parts_of_mesh
            if len(part.sections) == 1 and part.name not in sections
        }
        names = {
            name: bodies[name].name
            if name in bodies and np.array_equal(elements, bodies[name].elements)
            else name
            for name, elements in sections.items()
        }
        sets = {names[name]: elements for name, elements in sections.items()}
        sets |= {part.name: part.elements for part in self.parts_of_mesh if part.name not in sets}
        cards = [f"*SOLID SECTION, ELSET={names[s.name]}, MATERIAL={s.material}" for s in self.sections]
        return MeshCards(self.mesh, sets, self.surfaces, self.node_sets, cards)

    def bodies(self) -> dict[str, Body]:
        """Return the bodies with their materials."""
        large = any(step.large for step in self.steps.steps)
        if large and not all(step.large for step in self.steps.steps):
            step = next(step for step in self.steps.steps if not step.large)
            raise step.card.error("all steps must have NLGEOM, or none, got both: give it to this one, too")
        bodies, temperature, heated = {}, self._temperature(), self._heated()
        for part in self.parts_of_mesh:
            mesh = self.parts.meshes[part.name]
            of = Conditions(
                self.kind,
                large,
                temperature,
                heated,
                mesh.cell_type in ("hexahedron", "quadrilateral"),
                initial=self._initial_of(part),
            )
            given, sections = {}, regions_of(self.sections, part)
            expands = any(self._expands(section) for section in sections.values())
            of = replace(of, expands=of.heated and expands)
            for region, section in sections.items():
                thickness = section.thickness if self._has_thicknesses else None
                given[region] = self._material(section, replace(of, thickness=thickness))
                self._note_units(section.card, given[region], mesh)
            material = given if len(given) > 1 else next(iter(given.values()))
            integration = integration_of(self.mesh, part, self.note)
            self._note_corners(part, mesh)
            if not mesh.centres:
                integration = "full"
            revolved = self.kind == "axisymmetric"
            bodies[part.name] = Body(mesh, material, axisymmetric=revolved, integration=integration)
            self.origins["body", part.name] = self.sections[part.sections[0]].card.origin
        return bodies

    def _expands(self, section: Section) -> bool:
        return section.material in self.materials and "EXPANSION" in self.materials[section.material].parts

    def _material(self, section: Section, of: Conditions) -> Any:
        if section.material not in self.materials:
            there = ", ".join(self.materials) or "none"
            raise section.card.error(f"material {section.material!r} is not there; the deck has {there}")
        if section.orientation and section.orientation not in self.axes:
            there = ", ".join(self.axes) or "none"
            raise section.card.error(
                f"orientation {section.orientation!r} is not there; the deck has {there}"
            )
        cards = self.materials[section.material]
        self.origins["material", section.material] = cards.card.origin
        return build_material(cards, self.axes.get(section.orientation), of)

    def _note_units(self, card: Card, material: Any, mesh: BodyMesh) -> None:
        """Report a Young's modulus that looks like one in other units than the lengths."""
        young, _ = isotropic_constants(material) or (0.0, 0.0)
        size = float(np.ptp(mesh.points, axis=0).max())
        if METALS[0] <= young <= METALS[1] and size >= LONG:
            self.note(
                card,
                f"odd units? a Young's modulus of {young:g} is that of a metal in GPa, the body is {size:.4g}"
                f" long: with lengths in mm and forces in N it would be {1e3 * young:g}",
            )
        elif words := odd_modulus(young, size):
            self.note(card, f"odd units? {words}")

    def _note_corners(self, part: Component, mesh: BodyMesh) -> None:
        """Report elements that are turned inside out at a corner, but not at their Gauss points."""
        bad = np.flatnonzero(thickness(mesh.points, mesh.cells) <= 0.0)
        if len(bad):
            least = jacobians(mesh.points, mesh.cells[bad]).min(axis=1)
            inside = jacobians(mesh.points, mesh.cells[bad], AT_GAUSS_POINTS).min()
            number = self.mesh.element_numbers[self.in_cell_order(part)[bad[np.argmin(least)]]]
            card = self.mesh.blocks[self.mesh.block_of[self.in_cell_order(part)[bad[0]]]].card
            self.note(
                card,
                f"the Jacobian of {len(bad)} elements of body {part.name} is not positive at a corner or "
                f"an edge, down to {least.min():.3g} in element {card.label(number)}; it is {inside:.3g} and "
                "more at their Gauss points, which count: bend them less where results matter",
            )

    def _heated(self) -> bool:
        """Return whether the temperature of any node changes."""
        return any(
            bool((instant.temperatures != self.steps.initial).any()) for instant in self.steps.instants
        )

    def _initial_of(self, part: Component) -> float | None:
        """Return the initial temperature of a body if it is the same everywhere."""
        nodes = self.parts.nodes[part.name]
        found = np.unique(self.steps.initial[nodes[nodes >= 0]])
        return float(found[0]) if len(found) == 1 else None

    def _temperature(self) -> float | None:
        """Return the temperature if it is the same everywhere and always."""
        found = {float(t) for t in np.unique(self.steps.initial)}
        for instant in self.steps.instants:
            found |= {float(t) for t in np.unique(instant.temperatures)}
        return found.pop() if len(found) == 1 else None

    def nodes_of_bodies(self) -> np.ndarray:
        """Return which nodes belong to elements, (n_nodes,)."""
        mark = np.zeros(len(self.mesh.points), dtype=bool)
        for block in self.mesh.blocks:
            mark[block.nodes] = True
        return mark

    def place(self, name: str, nodes: np.ndarray) -> str:
        """Name nodes as a surface if they are all nodes of some faces, else as a set of nodes."""
        faces = self.exterior.covering(nodes)
        if faces is not None:
            name = f"{name} FACES" if name in self.mesh.surfaces else name
            self.surfaces[name] = faces
        else:
            name = f"{name} NODES" if name in self.mesh.surfaces else name
            self.node_sets[name] = np.unique(nodes)
        return name

    def set_of(self, nodes: np.ndarray) -> str:
        """Return the name of exactly these nodes, a new one if there is none."""
        for known in (self.node_sets, self.mesh.node_sets):
            for name, inside in known.items():
                if np.array_equal(inside, nodes) and (known is self.node_sets or name not in self.surfaces):
                    self.node_sets.setdefault(name, nodes)
                    return name
        name = next(
            f"CLOAD {k}" for k in range(1, len(self.node_sets) + 2) if f"CLOAD {k}" not in self.node_sets
        )
        self.node_sets[name] = nodes
        return name

    def in_body(self, name: str, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which nodes of the deck a body has, and their numbers in it."""
        mine = self.parts.nodes[name]
        mine = mine[mine >= 0]  # ascending; centres of cells are behind
        place = np.minimum(np.searchsorted(mine, nodes), len(mine) - 1)
        there = mine[place] == nodes
        return nodes[there], place[there]

    @property
    def owner(self) -> np.ndarray:
        """Number of the first body that has a node, −1 of nodes without elements, shape (n_nodes,)."""
        found = np.full(len(self.mesh.points), -1)
        for number, nodes in reversed(list(enumerate(self.parts.nodes.values()))):
            found[nodes[nodes >= 0]] = number
        return found

    def owned(self, name: str, nodes: np.ndarray) -> np.ndarray:
        """Return which nodes of a body no body before it has."""
        return np.asarray(self.owner[nodes] == list(self.parts.nodes).index(name))

    def joints(self) -> list[tuple[str, str, np.ndarray]]:
        """Return pairs of bodies and the nodes that they share: the second is not the first with these."""
        names, found = list(self.parts.nodes), []
        for name, nodes in self.parts.nodes.items():
            mine = nodes[nodes >= 0]
            of = self.owner[mine]
            for first in np.unique(of[of != names.index(name)]):
                found.append((names[first], name, mine[of == first]))
        return found

    def middles(self, elements: np.ndarray) -> np.ndarray:
        """Return the mean of the nodes of elements, (n, 3)."""
        block_of, found = self.mesh.block_of, np.zeros((len(elements), 3))
        for number in np.unique(block_of[elements]):
            block, mine = self.mesh.blocks[number], block_of[elements] == number
            found[mine] = self.mesh.points[block.nodes[elements[mine] - block.first]].mean(axis=1)
        return found
