"""What a deck asks for of its results, in the files that CalculiX writes: ``.frd`` and ``.dat``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fenics_contact.decks.deck import Deck
from fenics_contact.decks.tables import Print
from fenics_contact.output.frd import (
    BodyNumbers,
    FrdCells,
    FrdField,
    FrdMesh,
    contact_values,
    formatted,
    nodal_fields,
)
from fenics_contact.readers.deck_elements import Element
from fenics_contact.readers.deck_mesh import Block
from fenics_contact.results.at_points import AtPoints
from fenics_contact.results.fields import ContactNodes, in_space


@dataclass(frozen=True, eq=False)
class DeckResults:
    """The results of a deck by its own numbers, by what it asks for.

    What a card asks for holds in later steps, too, until another card of its kind. `others`: variables that
    other results of the deck have.
    """

    deck: Deck
    others: Sequence[str] = ()

    #: Kinds of fields by card and variable.
    kinds: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "NODEFILE": {"U": "DISP", "RF": "FORC"},
        "ELFILE": {"S": "STRESS", "E": "TOSTRAIN", "PEEQ": "PE"},
        "CONTACTFILE": {"CDIS": "CONTACT", "CSTR": "CONTACT"},
    }
    #: Variables that are printed, by card.
    printed: ClassVar[Mapping[str, Sequence[str]]] = {
        "NODEPRINT": ("U", "RF"),
        "ELPRINT": ("S", "E", "PEEQ"),
        "CONTACTPRINT": ("CDIS", "CSTR", "CF", "CFN", "CFS"),
    }

    #: What is written where the deck asks for nothing that is known.
    otherwise: ClassVar[Mapping[str, str]] = {"DISP": "displacements", "STRESS": "stresses"}

    @cached_property
    def numbering(self) -> BodyNumbers:
        """Numbers of nodes and cells, and the mesh: that of the deck."""
        mesh = self.deck.mesh.mesh
        used = np.unique(np.concatenate([block.nodes.ravel() for block in mesh.blocks]))
        cells = [
            FrdCells(each.element.dim, each.numbers, mesh.numbers[each.nodes[:, each.element.written]])
            for each in mesh.blocks
            if has_type(each)
        ]
        known = FrdMesh(mesh.numbers[used], mesh.points[used], cells)
        return BodyNumbers(self.deck.node_numbers, known, self.deck.thickness)

    @cached_property
    def is_flat(self) -> bool:
        """Whether fields of shells are on their own nodes: the parameter of one card holds for all."""
        return any(each.output == "2D" for each in self.deck.prints) and any(map(_is_layer, self._blocks))

    @property
    def _blocks(self) -> Sequence[Block]:
        return self.deck.mesh.mesh.blocks

    @cached_property
    def written(self) -> FrdMesh:
        """The mesh in the file: that of the deck, with nodes across shells unless it asks for these alone."""
        solid = self.numbering.mesh
        if not self.is_flat:
            return solid
        blocks = filter(has_type, self._blocks)
        cells = [
            FrdCells(dim, block.numbers, self.deck.nodes_of_shells(each.nodes[:, at]))
            if _is_layer(block)
            else each
            for block, each in zip(blocks, solid.cells, strict=True)
            for dim, at in (block.element.given,)
        ]
        mesh = self.deck.mesh.mesh
        used = np.unique(np.concatenate([each.nodes.ravel() for each in cells]))
        return FrdMesh(used, mesh.points[np.searchsorted(mesh.numbers, used)], cells)

    def asked(self, step: int, card: str) -> list[Print]:
        """Return what cards of a kind ask for in a step: those of the last step that has some."""
        steps = [each.step for each in self.deck.prints if _plain(each) == card and each.step <= step]
        return [each for each in self.deck.prints if _plain(each) == card and each.step in steps[-1:]]

    def fields(self, step: int) -> list[str]:
        """Return the kinds of fields of a step; usual ones if the deck asks for none here."""
        return self._asked_fields(step) or [*self.otherwise]

    def _asked_fields(self, step: int) -> list[str]:
        """Return the kinds of fields that the deck asks for, CONTACT where there is contact."""
        return [
            kind
            for card, kinds in self.kinds.items()
            for each in self.asked(step, card)
            for variable, kind in kinds.items()
            if variable in _short(each) and (kind != "CONTACT" or self.deck.scene.contacts)
        ]

    @property
    def notes(self) -> list[str]:
        """What is asked for and not written, in words."""
        known = {card: set(kinds) for card, kinds in (*self.kinds.items(), *self.printed.items())}
        blocks = self.deck.mesh.mesh.blocks
        found = [f"elements {block.element.name} are not in .frd" for block in blocks if not has_type(block)]
        for each in self.deck.prints:
            place = f"*{each.card}, {each.origin.file} line {each.origin.line}: "
            if rest := [v for v in each.variables if v[:4] not in known[_plain(each)] | {*self.others}]:
                found.append(f"{place}{', '.join(rest)} not written")
            nodes = self.deck.node_sets.get(each.where, self.numbering.mesh.numbers)
            alone = np.setdiff1d(nodes, [*self.numbering.mesh.numbers, *self.shells_among(nodes)])
            if len(alone) and _plain(each) == "NODEPRINT":
                found.append(f"{place}{len(alone)} nodes of {each.where} belong to no element: not printed")
        if self.is_flat and self.deck.scene.contacts:
            found.append("OUTPUT=2D: fields of contact are not written for nodes of shells")
        if not all(map(self._asked_fields, self.deck.step_of)):
            nothing = "where the deck asks for no known fields (*NODE FILE, *EL FILE)"
            found.append(f"{nothing}, {' and '.join(self.otherwise.values())} are written")
        return found

    def shells_among(self, nodes: np.ndarray) -> np.ndarray:
        """Return which of some numbers are those of shells alone, for which others are in the mesh."""
        return np.setdiff1d(nodes[self.deck.are_of_shells(nodes)], self.numbering.mesh.numbers)

    def made(self, state: Any, kinds: Sequence[str]) -> list[FrdField]:
        """Return fields of a state on all nodes by their kinds. Collective."""
        return nodal_fields(state, self.numbering, kinds)

    def nodal(self, state: Any, step: int) -> list[FrdField]:
        """Return the fields of a state in a step, those of sets for their nodes alone. Collective."""
        found = self.made(state, self.fields(step))
        found = [self._on_shells(each) for each in found] if self.is_flat else found
        chosen = {
            kind: self.deck.across_shells(np.concatenate([self.deck.node_sets[e.where] for e in some]))
            for card, kinds in self.kinds.items()
            for kind in kinds.values()
            if (some := self.asked(step, card)) and all(each.where in self.deck.node_sets for each in some)
        }
        return [_part(each, chosen[each.kind]) if each.kind in chosen else each for each in found]

    def _on_shells(self, of: FrdField) -> FrdField:
        rows = self.deck.on_shells(of.kind, of.numbers, of.values)
        rows = rows[np.isin(rows[:, 0], self.written.numbers)]
        return FrdField(of.kind, rows[:, 0].astype(np.int64), rows[:, 1:])

    def progress(self, state: Any) -> tuple[int, float, int]:
        """Return the steps of the solver, their relative residual, and the number of closed points."""
        closed = int((state.contact.status != 0).sum())
        return int(state.counts["solver_steps"]), float(state.solution.natural_residual), closed

    def tables(self, state: Any, time: float) -> Tables:
        """Return what makes the tables of a state."""
        return Tables(self, state, time)

    def printout(self, state: Any, step: int, time: float) -> str:
        """Return the tables of the printed file of a state. Collective."""
        tables = self.tables(state, time)
        return "".join(
            text
            for card in self.printed
            for each in self.asked(step, card)
            for variable in _short(each)
            if variable in self.printed[card]
            for text in tables.of(each, variable)
        )


class Computed(NamedTuple):
    """A state with what its deck asks for, in a step of this deck, from 0."""

    of: DeckResults
    state: Any
    step: int


def has_type(block: Block) -> bool:
    """Return whether elements are among the types of cells that files have."""
    return (block.element.dim, len(block.element.written)) in FrdCells.kinds


def _is_layer(block: Block) -> bool:
    """Return whether elements are those that shells have become."""
    return block.element.listed < block.element.count


def _plain(asked: Print) -> str:
    return asked.card.replace(" ", "").upper()


def _short(asked: Print) -> list[str]:
    """Return the variables by their first four letters, which count."""
    return [name[:4] for name in asked.variables]


def _part(of: FrdField, nodes: np.ndarray) -> FrdField:
    mine = np.isin(of.numbers, nodes)
    return FrdField(of.kind, of.numbers[mine], of.values[mine])


def exponential(value: float, digits: int) -> str:
    """Return a number as Fortran writes it, from 0.1 to 1 and an exponent: 0.5000000E+00."""
    mantissa, exponent = f"{value:.{digits - 1}E}".split("E")
    sign = "-" if mantissa.startswith("-") else ""
    return f"{sign}0.{mantissa.lstrip('-').replace('.', '')}E{int(exponent) + (value != 0.0):+03d}"


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a state as CalculiX prints them.

    Forces of bodies of revolution are those of its sector of two degrees, as there. Of plane bodies stresses
    are repeated for its points across the thickness.
    """

    results: DeckResults
    state: Any
    time: float

    #: Degrees of CalculiX's sector of bodies of revolution.
    sector: ClassVar[float] = 2.0

    def of(self, asked: Print, variable: str) -> Iterator[str]:
        """Yield the tables of a variable."""
        made: dict[str, Callable[[Print], Iterator[str]]] = {
            "U": self._displacements, "RF": self._forces, "S": self._stresses, "E": self._strains,
            "PEEQ": self._plastic_strains, "CDIS": self._distances, "CSTR": self._tractions,
        }  # fmt: skip
        yield from made.get(variable, self._resultants)(asked)

    def _head(self, what: str) -> str:
        return f"\n {what} and time {exponential(self.time, 7):>14s}\n\n"

    def _displacements(self, asked: Print) -> Iterator[str]:
        yield from self._values("DISP", "displacements (vx,vy,vz)", asked)

    def _values(self, kind: str, what: str, asked: Print) -> Iterator[str]:
        yield self._head(f"{what} for set {asked.where}") + _rows(*self._nodal(kind, asked))

    def _forces(self, asked: Print) -> Iterator[str]:
        yield from self._summed("FORC", "forces (fx,fy,fz)", "total force (fx,fy,fz)", asked)

    def _summed(self, kind: str, each: str, total: str, asked: Print) -> Iterator[str]:
        numbers, values = self._nodal(kind, asked)
        if self.results.deck.scene.axisymmetric:
            values = values * self.sector / 360.0
        if asked.totals != "ONLY":
            yield self._head(f"{each} for set {asked.where}") + _rows(numbers, values)
        if asked.totals:
            yield self._head(f"{total} for set {asked.where}") + _sums(values.sum(axis=0))

    def _nodal(self, kind: str, asked: Print) -> tuple[np.ndarray, np.ndarray]:
        (field,) = self.results.made(self.state, (kind,))
        asked_for = self.results.deck.node_sets.get(asked.where, field.numbers)
        mine, shells = np.isin(field.numbers, asked_for), self.results.shells_among(asked_for)
        numbers, values = field.numbers[mine], field.values[mine]
        if len(shells):
            rows = self.results.deck.of_nodes(asked.where, self.state, {"DISP": "U", "FORC": "RF"}[kind])
            rows = rows[np.isin(rows[:, 0], shells)]
            numbers, values = np.append(numbers, rows[:, 0]), np.vstack([values, in_space(rows[:, 1:])])
        order = np.argsort(numbers, kind="stable")
        return numbers[order], values[order]

    def _stresses(self, asked: Print) -> Iterator[str]:
        head = f"stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set {asked.where}"
        yield self._head(head) + self._at_points(asked, "stress")

    def _strains(self, asked: Print) -> Iterator[str]:
        head = f"strains (elem, integ.pnt.,exx,eyy,ezz,exy,exz,eyz) for set {asked.where}"
        yield self._head(head) + self._at_points(asked, "strain")

    def _plastic_strains(self, asked: Print) -> Iterator[str]:
        head = f"equivalent plastic strain (elem, integ.pnt.,pe)for set {asked.where}"
        yield self._head(head) + self._at_points(asked, "plastic_strain")

    def _points(self, body: str) -> AtPoints:
        return self.state.gather_at_points(body)  # type: ignore[no-any-return]

    def _at_points(self, asked: Print, what: str) -> str:
        deck, found = self.results.deck, list[np.ndarray]()
        mesh = deck.mesh.mesh
        for body, numbers in deck.element_numbers.items():
            at = self._points(body)
            for block in filter(has_type, mesh.blocks):
                mine = np.isin(numbers, block.numbers) & np.isin(numbers, deck.element_sets[asked.where])
                if mine.any():
                    found.append(_point_rows(block, at, numbers[mine], getattr(at, what)[mine]))
        if not found:
            return ""
        rows = np.concatenate(found)
        row = "%10d %3d" + " %13.6E" * (rows.shape[1] - 2) + "\n"
        return formatted(row, rows[np.argsort(rows[:, 0], kind="stable")])

    def _distances(self, asked: Print) -> Iterator[str]:
        head = "relative contact displacement (slave node,normal,tang1,tang2) for all contact elements"
        yield self._head(head).replace("time  ", "time ") + self._contact([0, 1, 2])

    def _tractions(self, asked: Print) -> Iterator[str]:
        head = "contact stress (slave node,press,tang1,tang2) for all contact elements"
        yield self._head(head).replace("time  ", "time ") + self._contact([3, 4, 5])

    def _contact(self, columns: list[int]) -> str:
        numbers, values = [np.zeros(0)], [np.zeros((0, 3))]
        tearing = self.state.torn.decomposition.tearing
        for body, nodes in self.results.deck.node_numbers.items():
            at = np.unique(ContactNodes(self.state.contact, self.state.scene, tearing, body).nodes[1])
            at = at[at < len(nodes)]
            at = at[nodes[at] > 0]
            numbers.append(nodes[at])
            values.append(contact_values(self.state, body)[at][:, columns])
        order = np.argsort(np.concatenate(numbers), kind="stable")
        return _rows(np.concatenate(numbers)[order], np.concatenate(values)[order])

    def _resultants(self, asked: Print) -> Iterator[str]:
        contact, scene = self.state.contact, self.state.scene
        thickness = self.results.deck.thickness
        for number, pair in enumerate(scene.contacts):
            mine = contact.on_pair(number)
            area = contact.area[mine] * thickness
            force = in_space(contact.force[mine] * thickness)
            places, normal = in_space(self.state.contact_places[mine]), -in_space(contact.points.normal[mine])
            centre, total = area @ places / area.sum(), force.sum(axis=0)
            mean = area @ normal / area.sum()
            pressing = -float((contact.normal_force[mine] * thickness).sum())
            shear = float(np.linalg.norm(total - (total @ mean) * mean))
            blocks = {
                "total surface force (fx,fy,fz) and moment about the origin (mx,my,mz)": [
                    *total, *np.cross(places, force).sum(axis=0),
                ],
                "center of gravity and mean normal": [*centre, *mean],
                "moment about the center of gravity(mx,my,mz)": np.cross(places - centre, force).sum(axis=0),
                "area,  normal force (+ = tension) and shear force (size)": [area.sum(), pressing, shear],
            }  # fmt: skip
            head = f"statistics for slave set {pair.slave.name}, master set {pair.master_surface.name}"
            text = "".join(f"   {words}\n\n  {_sums(values)[6:]}\n" for words, values in blocks.items())
            yield "\n" + self._head(head) + text


def _rows(numbers: np.ndarray, values: np.ndarray) -> str:
    """Return lines of numbers of nodes and three values."""
    return formatted("%10d" + " %13.6E" * values.shape[1] + "\n", np.column_stack([numbers, values + 0.0]))


def _sums(values: Sequence[float] | np.ndarray) -> str:
    return " " * 6 + "".join(f" {value:13.6E}" for value in values) + "\n"


def _point_rows(block: Block, at: AtPoints, numbers: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return number, point and components of elements at CalculiX's points."""
    places, layers = points_of(block.element, at.collapses)
    own = np.einsum("mq,cq...->cm...", at.to(places), values)
    own = np.tile(own, (1, layers, *[1] * (own.ndim - 2)))
    points = np.tile(np.arange(1, own.shape[1] + 1), len(own))
    parts = [own[..., k].ravel() for k in range(own.shape[2])] if own.ndim == 3 else [own.ravel()]
    if own.ndim == 4:
        parts = [own[..., i, j].ravel() for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return np.column_stack([np.repeat(numbers, own.shape[1]), points, *parts])


def points_of(element: Element, collapses: bool) -> tuple[np.ndarray, int]:
    """Return positions of the points of an element in its cell, in CalculiX's order, and layers of them.

    `collapses`: whether triangles, prisms and tetrahedra are cells whose vertices coincide.
    """
    count, dim = len(element.written), element.dim
    linear = count <= 8 if dim == 3 else count <= 4
    gauss = 0.5 + 0.5 * np.polynomial.legendre.leggauss(2 if linear or element.variant == "R" else 3)[0]
    if count in {3: (8, 20), 2: (4, 8)}[dim]:
        grid = np.meshgrid(*[gauss] * dim, indexing="ij")
        return np.stack([each.ravel() for each in grid[::-1]], axis=1), len(gauss) if dim == 2 else 1
    if (dim, count) in ((3, 4), (3, 10)):
        near, far = (0.25, 0.25) if count == 4 else (0.58541019662496852, 0.13819660112501051)
        simplex = np.full((4, 3), far) + np.vstack([np.zeros(3), np.eye(3)]) * (near - far)
        return _collapsed(simplex[: 1 if count == 4 else 4], collapses), 1
    flat = np.array([[1 / 3, 1 / 3]]) if linear else np.eye(3, 2, -1) / 2 + 1 / 6
    if dim == 2:
        return _collapsed(flat, collapses), 3 - linear
    heights = np.repeat(gauss, len(flat))[:, None]
    return np.hstack([np.tile(_collapsed(flat, True), (len(gauss), 1)), heights]), 1


def _collapsed(places: np.ndarray, collapses: bool) -> np.ndarray:
    """Return positions in a triangle or tetrahedron as those in the collapsed cell."""
    if not collapses:
        return places
    rest = 1.0 - places[:, -1:]
    inner = places[:, :-1] / rest
    return np.hstack([inner if inner.shape[1] == 1 else _collapsed(inner, True), places[:, -1:]])
