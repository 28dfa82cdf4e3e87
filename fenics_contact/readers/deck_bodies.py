"""Bodies of a deck: elements that share faces, with the sections that give them materials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.checks import naming_arguments, require_file
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quadratic_nodes import with_centres
from fenics_contact.mesh.quality import AT_GAUSS_POINTS, jacobians, thickness
from fenics_contact.readers.bodies import Label, TaggedMesh, bodies_of, one_array
from fenics_contact.readers.deck_assembly import read_cards
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import NO_FACES, Block, DeckMesh, Faces, Named
from fenics_contact.readers.deck_plies import Ply, plies_of
from fenics_contact.readers.deck_shells import read_solid_mesh

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, eq=False)
class Section:
    """A section: elements, their material, its axes, the thickness of plane ones, and its plies, if any."""

    card: Card
    name: str
    material: str
    orientation: str
    thickness: float
    composite: Sequence[Ply] = ()

    @property
    def plies(self) -> Sequence[Ply]:
        """Its materials and their axes, from the bottom of shells."""
        return self.composite or (Ply(1.0, self.material, self.orientation),)


#: Cards that give elements their material.
SECTIONS = ("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION")


def read_sections(cards: Sequence[Card], mesh: DeckMesh) -> tuple[list[Section], np.ndarray]:
    """Return the sections of a deck, and the number of the section of each element, −1 without one."""
    sections: list[Section] = []
    of_element = np.full(len(mesh.element_numbers), -1)
    for card in cards:
        name = card.name_of("ELSET")
        if card.name in SECTIONS and (name in mesh.element_sets or name not in mesh.link_sets):
            name = card.required("ELSET")
            of_element[mesh.elements_named(name, card)] = len(sections)
            plies = plies_of(card)
            thick = card.floats(0)[0] if card.lines and card.rows[0][0] and not plies else 1.0
            if not thick > 0:
                raise card.error(f"the thickness must be above zero, got {thick:g}: correct it", 0)
            material = plies[0].material if plies else card.required("MATERIAL")
            sections.append(Section(card, name, material, card.name_of("ORIENTATION"), thick, plies))
    lost = np.flatnonzero(of_element < 0)
    if len(lost):
        block = mesh.blocks[mesh.block_of[lost[0]]]
        first = block.card.label(mesh.element_numbers[lost[0]])
        raise block.card.error(f"element {first} and {len(lost) - 1} others have no *SOLID SECTION: add it")
    return sections, of_element


@dataclass(frozen=True, eq=False)
class Component:
    """Elements that share faces, ascending, and the sections they have."""

    name: str
    elements: np.ndarray
    sections: Sequence[int]


def components(mesh: DeckMesh, sections: Sequence[Section], of_element: np.ndarray) -> list[Component]:
    """Return the bodies of a deck by their elements, each with a name of its own.

    Elements of full and of reduced integration are bodies of their own.
    """
    count = len(mesh.element_numbers)
    every, corners, _ = _every_face(mesh)
    reduced = np.array([block.element.is_reduced for block in mesh.blocks])[mesh.block_of[every.elements]]
    keys = np.column_stack([np.sort(corners, axis=1), reduced])
    _, face = np.unique(keys, axis=0, return_inverse=True)
    face = face.ravel()
    size = count + int(face.max()) + 1
    graph = sp.coo_matrix((np.ones(len(face)), (every.elements, count + face)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    _, first, number = np.unique(label[:count], return_index=True, return_inverse=True)
    names: list[str] = []
    found = []
    for part in np.argsort(first):
        elements = np.flatnonzero(number.ravel() == part)
        used = sorted(set(of_element[elements].tolist()))
        name = _name(mesh, elements, [sections[k].name for k in used], names)
        names.append(name)
        found.append(Component(name, elements, used))
    return found


def _name(mesh: DeckMesh, elements: np.ndarray, of_sections: Sequence[str], taken: Sequence[str]) -> str:
    """Return that of an instance, or of a set with just these elements, else those of the sections.

    With a number if it is taken.
    """
    within = {mesh.blocks[k].card.body for k in np.unique(mesh.block_of[elements]).tolist()}
    exact = [name for name, inside in mesh.element_sets.items() if np.array_equal(inside, elements)]
    best = [name for name in of_sections if name in exact] or exact or ["+".join(dict.fromkeys(of_sections))]
    if len(within) == 1 and "" not in within:
        best = list(within)
    free = [name for name in best if name not in taken]
    if free:
        return free[0]
    return next(f"{best[0]} {k}" for k in range(2, len(taken) + 3) if f"{best[0]} {k}" not in taken)


@dataclass(frozen=True, eq=False)
class Exterior:
    """The faces that belong to one element alone, and their nodes, −1 behind the last."""

    mesh: DeckMesh
    faces: Faces
    nodes: np.ndarray

    @staticmethod
    def of(mesh: DeckMesh) -> Exterior:
        """Return that of a mesh."""
        every, corners, nodes = _every_face(mesh)
        _, number, count = np.unique(
            np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        single = count[number.ravel()] == 1
        return Exterior(mesh, Faces(every.elements[single], every.sides[single]), nodes[single])

    def holds(self, faces: Faces) -> np.ndarray:
        """Return which faces are exterior ones."""
        known = self.faces.elements * 8 + self.faces.sides
        return np.isin(faces.elements * 8 + faces.sides, known)

    def require(self, faces: Faces, card: Card, row: int, what: str, remedy: str) -> None:
        """Refuse faces that are no exterior ones, with the line of a card."""
        outer = self.holds(faces)
        if not outer.all():
            number = card.label(self.mesh.element_numbers[faces.elements[~outer][0]])
            raise card.error(
                f"{what} on the boundary of a body, a face of element {number} lies between two elements: "
                f"{remedy}", row,
            )  # fmt: skip

    def within(self, nodes: np.ndarray) -> Faces:
        """Return the faces all of whose nodes are among some."""
        mark = np.append(np.zeros(len(self.mesh.points), dtype=bool), True)  # −1 counts as one of them
        mark[nodes] = True
        inside = mark[self.nodes].all(axis=1)
        return Faces(self.faces.elements[inside], self.faces.sides[inside])

    def around(self, nodes: np.ndarray) -> Faces:
        """Return the faces that have one of some nodes or more."""
        mark = np.zeros(len(self.mesh.points) + 1, dtype=bool)  # the last is that of −1
        mark[nodes] = True
        near = mark[self.nodes].any(axis=1)
        return Faces(self.faces.elements[near], self.faces.sides[near])

    def faces_of(self, surface: Named) -> Faces:
        """Return the faces of a surface, of one of nodes those that have all of them, if there are any."""
        return self.covering(surface.nodes) if len(surface.nodes) else surface.faces

    def covering(self, nodes: np.ndarray) -> Faces:
        """Return faces that have these nodes and no others, if there are any."""
        inside = self.within(nodes)
        return inside if np.array_equal(self.mesh.nodes_of(inside), np.unique(nodes)) else NO_FACES


def _every_face(mesh: DeckMesh) -> tuple[Faces, np.ndarray, np.ndarray]:
    """Return the faces of all elements, their corners and their nodes, −1 behind the last."""
    elements, sides = [], []
    for block in mesh.blocks:
        known = np.flatnonzero([len(face) > 0 for face in block.element.faces])
        elements.append(np.repeat(block.first + np.arange(len(block.nodes)), len(known)))
        sides.append(np.tile(known, len(block.nodes)))
    every = Faces(np.concatenate(elements), np.concatenate(sides))
    corners = np.full((len(every), 4), -1)
    nodes = np.full((len(every), 9), -1)
    for mine, element, side, members in mesh.parts_of(every):
        nodes[mine[:, None], np.arange(members.shape[1])] = members
        width = len(element.faces[side])
        corners[mine[:, None], np.arange(width)] = members[:, :width]
    return every, corners, nodes


@dataclass(frozen=True, eq=False)
class Parts:
    """The meshes of a deck's bodies.

    `nodes`: name -> positions in the deck of the nodes of its mesh, −1 for nodes that the deck has not.
    """

    meshes: Mapping[str, BodyMesh]
    nodes: Mapping[str, np.ndarray]

    def within(self, name: str, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which nodes of the deck a body has, and their numbers in it."""
        mine = self.nodes[name]
        mine = mine[mine >= 0]  # ascending; centres of cells are behind
        place = np.minimum(np.searchsorted(mine, nodes), len(mine) - 1)
        there = mine[place] == nodes
        return nodes[there], place[there]

    @cached_property
    def _owner(self) -> np.ndarray:
        """Number of the first body that has a node, −1 of nodes without elements."""
        found = np.full(1 + max(int(nodes.max()) for nodes in self.nodes.values()), -1)
        for number, nodes in reversed(list(enumerate(self.nodes.values()))):
            found[nodes[nodes >= 0]] = number
        return found

    def owned(self, name: str, nodes: np.ndarray) -> np.ndarray:
        """Return which nodes of a body no body before it has."""
        return np.asarray(self._owner[nodes] == list(self.nodes).index(name))

    def joints(self) -> Iterator[tuple[str, str, np.ndarray]]:
        """Yield pairs of bodies and the nodes that they share: the second is not the first with these."""
        names = list(self.nodes)
        for number, (name, nodes) in enumerate(self.nodes.items()):
            mine = nodes[nodes >= 0]
            of = self._owner[mine]
            for first in np.unique(of[of != number]):
                yield names[first], name, mine[of == first]


def build_bodies(
    mesh: DeckMesh,
    parts: Sequence[Component],
    of_element: np.ndarray,
    sections: Sequence[Section],
    surfaces: Mapping[str, Faces],
    node_sets: Mapping[str, np.ndarray],
    source: str,
) -> Parts:
    """Return the meshes of the bodies with named surfaces and sets of nodes."""
    dims = {block.element.kind for block in mesh.blocks}
    if len(dims) > 1:
        block = next(b for b in mesh.blocks if b.element.kind != mesh.blocks[0].element.kind)
        raise block.card.error(
            f"elements must be of one kind, got {mesh.blocks[0].element.name} and {block.element.name}"
        )
    dim = mesh.blocks[0].element.dim
    points = np.ascontiguousarray(mesh.points[:, :dim])
    cells, place = _cells(mesh, points)
    kinds = np.array([block.element.cell for block in mesh.blocks])[mesh.block_of]
    groups: dict[Label, dict[str, np.ndarray]] = {}
    chosen: dict[str, dict[str, str]] = {}
    for part in parts:
        for section in part.sections:
            mine = part.elements[of_element[part.elements] == section]
            label = f"{part.name}/{section}"
            groups[label] = {str(kind): place[mine[kinds[mine] == kind]] for kind in np.unique(kinds[mine])}
            region = _region(sections, part, section)
            chosen.setdefault(part.name, {})[region] = label
    tagged = TaggedMesh(
        source,
        points,
        cells,
        groups,
        {name: mesh.corners(faces) for name, faces in surfaces.items()},
        ("element set", "surface"),
        point_sets=node_sets,
        coincident_nodes=True,
    )
    wanted = {
        name: regions if len(regions) > 1 else next(iter(regions.values()))
        for name, regions in chosen.items()
    }
    meshes = bodies_of(tagged, wanted, list(surfaces))
    nodes = {}
    for part in parts:
        rows = [cells[kind][at] for label in chosen[part.name].values() for kind, at in groups[label].items()]
        mine = np.unique(np.concatenate([row.ravel() for row in rows]))
        centres = meshes[part.name].n_nodes - len(mine)  # after all others
        nodes[part.name] = np.append(mine, np.full(centres, -1))
    return Parts(meshes, nodes)


def _cells(mesh: DeckMesh, points: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return cells by type, as the deck has them, and the place of each element among those of its type."""
    joined: dict[str, list[np.ndarray]] = {}
    place = np.zeros(len(mesh.element_numbers), dtype=np.int64)
    for block in mesh.blocks:
        _check_block(block, points)
        known = joined.setdefault(block.element.cell, [])
        start = sum(map(len, known))
        place[block.first : block.first + len(block.nodes)] = start + np.arange(len(block.nodes))
        known.append(block.nodes)
    return {kind: np.concatenate(rows) for kind, rows in joined.items()}, place


def _region(sections: Sequence[Section], part: Component, section: int) -> str:
    names = [sections[k].name for k in part.sections]
    name = sections[section].name
    return name if names.count(name) == 1 else f"{name} {part.sections.index(section) + 1}"


def regions_of(sections: Sequence[Section], part: Component) -> dict[str, Section]:
    """Return the sections of a body by the names of its regions."""
    return {_region(sections, part, number): sections[number] for number in part.sections}


def split_sections(
    mesh: DeckMesh,
    sections: Sequence[Section],
    of_element: np.ndarray,
    parts: Sequence[Component],
    sets: Iterable[tuple[str, np.ndarray]],
) -> tuple[DeckMesh, list[Section], np.ndarray, list[Component]]:
    """Cut sections of bodies that sets of elements have a part of, so that each is in a set or is not.

    `sets`: names, which parts of sections get behind their own, and elements.
    """
    found, of_element, parts = list(sections), of_element.copy(), list(parts)
    new: dict[str, np.ndarray] = {}
    for label, elements in sets:
        inside = np.zeros(len(of_element), dtype=bool)
        inside[elements] = True
        for place, part in enumerate(parts):
            for number in part.sections:
                mine = part.elements[of_element[part.elements] == number]
                if inside[mine].all() or not inside[mine].any():
                    continue
                name = _free(f"{found[number].name}_{label}", {*mesh.element_sets, *new})
                new[name] = mine[inside[mine]]
                of_element[new[name]] = len(found)
                parts[place] = replace(parts[place], sections=[*parts[place].sections, len(found)])
                found.append(replace(found[number], name=name))
    if new:
        mesh = replace(mesh, element_sets={**mesh.element_sets, **new})
    return mesh, found, of_element, parts


def _free(name: str, taken: set[str]) -> str:
    return next(n for n in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if n not in taken)


def region_names(sections: Sequence[Section], part: Component) -> dict[int, str | None]:
    """Return the names of a body's regions by the numbers of its sections, None where there is only one."""
    names = regions_of(sections, part)
    if len(names) == 1:
        return {part.sections[0]: None}
    return dict(zip(part.sections, names, strict=True))


def inverted(block: Block, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which elements have no positive Jacobian at all Gauss points, and the least of each of them."""
    places, whole = with_centres(points, {block.element.name: block.nodes}, block.element.dim)
    cells = one_array(whole, block.element.dim)
    bad = np.flatnonzero(thickness(places, cells) <= 0.0)
    bad = bad[thickness(places, cells[bad], AT_GAUSS_POINTS) <= 0.0] if len(bad) else bad
    least = jacobians(places, cells[bad], AT_GAUSS_POINTS).min(axis=1) if len(bad) else np.zeros(0)
    return bad, least


def _check_block(block: Block, points: np.ndarray) -> None:
    """Reject elements without a positive Jacobian at their Gauss points, by their numbers."""
    bad, least = inverted(block, points)
    if len(bad):
        worst = int(np.argmin(least))
        at = ", ".join(f"{x:.6g}" for x in points[block.nodes[bad[worst]]].mean(axis=0))
        first = map(block.card.label, block.numbers[bad[:5]].tolist())
        numbers = ", ".join(first) + (", ..." if len(bad) > 5 else "")
        ends = np.cumsum([line.strip().rstrip(",").count(",") + 1 for line in block.card.lines])
        width = 1 + block.element.listed
        row = int(np.searchsorted(ends, block.records[bad[0]] * width, side="right"))
        raise block.card.error(
            f"every element must have a positive Jacobian at its Gauss points, {len(bad)} of "
            f"{len(block.nodes)} of type {block.element.name} are inverted or flat: {numbers}; the smallest "
            f"is {least[worst]:.3g} in element {block.card.label(block.numbers[bad[worst]])} around ({at}): "
            "see the order of their nodes, and their coordinates", row,
        )  # fmt: skip


def integration_of(
    mesh: DeckMesh, part: Component, note: Callable[[Card, str], None]
) -> Literal["full", "reduced"]:
    """Return how the elements of a body are integrated, all alike."""
    blocks = [mesh.blocks[k] for k in np.unique(mesh.block_of[part.elements])]
    if all(block.element.shape == "wedge" for block in blocks):
        return "reduced"
    for block in blocks:
        element = block.element
        if count := {"C3D6": 2, "C3D15": 9, "CAX3": 2, "CAX6": 9}.get(element.name):
            note(block.card, f"elements {element.name} are integrated in full, CalculiX takes {count} points")
        if element.variant and not element.is_reduced:
            plain = element.name.removesuffix(element.variant)
            stiff = ", which bends too little: take quadratic ones" if element.variant == "I" else ""
            note(block.card, f"elements {element.name} are solved as {plain}, by full integration{stiff}")
    return "reduced" if blocks[0].element.is_reduced else "full"


@naming_arguments
def read_deck_mesh(path: str | Path, comm: MPI.Comm | None = None) -> dict[str, BodyMesh]:
    """Read the mesh of a deck of CalculiX or Abaqus: its bodies, with regions, surfaces and node sets.

    Bodies are elements that share faces, named by their element sets; sections are regions where a body has
    several. Surfaces are those of ``*SURFACE`` on the boundary, node sets those of ``*NSET``. All other cards
    are of no concern to a mesh; `fenics_contact.decks.read_deck` reads whole decks.

    Args:
        path: The file, mostly ``.inp``.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Raises:
        InvalidInputError: If the file is missing, or elements, sets or surfaces do not fit each other, with
            card and line.

    Note:
        Collective on ``comm`` if given.
    """
    return on_root_then_bcast(comm, lambda: _read(Path(path)))


def _read(path: Path) -> dict[str, BodyMesh]:
    require_file(path, "a deck")
    cards = read_cards(path)
    mesh = read_solid_mesh(cards)
    sections, of_element = read_sections(cards, mesh)
    exterior = Exterior.of(mesh)
    surfaces = {}
    for name, given in mesh.surfaces.items():
        faces = exterior.faces_of(given)
        if len(faces) and exterior.holds(faces).all():
            surfaces[name] = faces
    parts = components(mesh, sections, of_element)
    sets = {name: nodes for name, nodes in mesh.node_sets.items() if name not in surfaces}
    return dict(build_bodies(mesh, parts, of_element, sections, surfaces, sets, f"deck '{path.name}'").meshes)
