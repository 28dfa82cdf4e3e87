"""What loads the bodies of a deck."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count
from typing import Any

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import (
    BodyForce,
    InitialStress,
    Load,
    PointForce,
    Pressure,
    ThermalStrain,
    TotalForce,
    centrifugal,
    gravity,
)
from fenics_contact.decks.couplings import (
    Driven,
)
from fenics_contact.decks.initial_stress import relieved
from fenics_contact.decks.model import Model
from fenics_contact.decks.regions import region_names
from fenics_contact.decks.steps import Acting, Instant
from fenics_contact.decks.supports import SupportBuilder
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.readers.deck_bodies import (
    Component,
)
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import Faces


class LoadBuilder:
    """Makes loads of what acts at a time of a deck."""

    def __init__(self, model: Model, supports: SupportBuilder) -> None:
        self.model, self.supports = model, supports
        #: Where pressures act -> the name of the surface.
        self.pressed: dict[tuple[str, ...], str] = {}

    def name_surfaces(self) -> None:
        """Name the faces that pressures act on."""
        taken: dict[tuple[int, int], str] = {}
        for several in self._alike():
            first = several[0]
            name = " ".join(first.where)
            if len(several) > 1:
                name = next(n for n in map("DLOAD {}".format, count(1)) if n not in self.model.surfaces)
            faces = self._faces(first) if len(several) == 1 else self._single_faces(several)
            what, remedy = "a pressure must act", "correct the set or the label"
            self.model.exterior.require(faces, first.card, first.row, what, remedy)
            for key in zip(faces.elements.tolist(), faces.sides.tolist(), strict=True):
                other = taken.setdefault(key, name)
                if other != name:
                    number = self.model.mesh.element_numbers[key[0]]
                    raise first.card.error(
                        f"the same face of element {number} is loaded by {other!r} and {name!r}: load it "
                        "once",
                        first.row,
                    )
            self.model.surfaces[name] = faces
            self.model.origins["load", name] = first.card.origin
            self.pressed.update((each.where, name) for each in several)

    def _alike(self) -> list[list[Acting]]:
        """Return the pressures of all instants; those on single elements together that are always equal."""
        instants = self.model.steps.instants
        first: dict[tuple[str, ...], Acting] = {}
        values: dict[tuple[str, ...], list[float]] = {}
        for number, instant in enumerate(instants):
            for pressed in instant.pressures:
                first.setdefault(pressed.where, pressed)
                values.setdefault(pressed.where, [0.0] * len(instants))[number] = pressed.value
        found: dict[tuple[object, ...], list[Acting]] = {}
        for where, pressed in first.items():
            single = len(where) == 2 and where[0].isdecimal()
            found.setdefault(tuple(values[where]) if single else where, []).append(pressed)
        return list(found.values())

    def _single_faces(self, several: Sequence[Acting]) -> Faces:
        """Return the faces of single elements."""
        mesh, card = self.model.mesh, several[0].card
        numbers = np.array([int(each.where[0]) for each in several])
        sides = np.array([int(each.where[1][1:]) - 1 for each in several])
        return Faces(mesh.positions(numbers, "element", card), sides)

    def _faces(self, pressed: Acting) -> Faces:
        card, row = pressed.card, pressed.row
        if len(pressed.where) == 1:
            given = self.model.mesh.surface_named(pressed.where[0], card, row)
            if given.faces is None:
                raise card.error(
                    "a pressure needs a surface of faces, this one has nodes: give TYPE=ELEMENT", row
                )
            return given.faces
        elements = self.model.mesh.elements_named(pressed.where[0], card, row)
        return self.model.mesh.faces_of(elements, pressed.where[1], card, row)

    def loaded(self) -> dict[int, list[tuple[str, np.ndarray | None]]]:
        """Name the nodes that forces act on; return for each instant its names, with None for many forces."""
        result: dict[int, list[tuple[str, np.ndarray | None]]] = {}
        inside = self.model.nodes_of_bodies()
        for step in self.model.steps.steps:
            for instant in step.instants:
                turned = np.flatnonzero(
                    instant.forces[:, 3:].any(axis=1)
                    & ~np.isin(np.arange(len(inside)), self.model.references)
                )
                if len(turned):
                    raise step.card.error(
                        f"nodes of solid elements take no moments, node "
                        f"{self.model.mesh.numbers[turned[0]]} has one: load a surface by a node, with "
                        "*COUPLING"
                    )
                self._check_plane(step.card, instant.forces)
                loose = inside & ~np.isin(np.arange(len(inside)), self.model.references)
                force = np.where(loose[:, None], instant.forces, 0.0)[:, : self.model.dim]
                nodes = np.flatnonzero(force.any(axis=1))
                result[id(instant)] = self._groups(nodes, force) if len(nodes) else []
        return result

    def _check_plane(self, card: Card, forces: np.ndarray) -> None:
        """Reject forces and moments out of the plane on plane bodies and on nodes that drive them."""
        if self.model.dim == 3:
            return
        drives = np.isin(np.arange(len(forces)), self.model.references)
        wrong = abs(forces[:, 2]) > 1e-9 * np.linalg.norm(forces[:, :3], axis=1)
        wrong &= drives | self.model.nodes_of_bodies()
        wrong |= drives & forces[:, 3:5].any(axis=1)
        if wrong.any():
            raise card.error(
                "plane elements take forces along x and y and moments about z, node "
                f"{self.model.mesh.numbers[np.flatnonzero(wrong)[0]]} has others by *CLOAD: correct their "
                "components, or the axes of *TRANSFORM"
            )

    def _groups(
        self, nodes: np.ndarray, force: np.ndarray, most: int = 6
    ) -> list[tuple[str, np.ndarray | None]]:
        """Return sets of nodes with the same force each, one set for all where there are many forces."""
        values, number = np.unique(force[nodes], axis=0, return_inverse=True)
        if len(values) > most:
            return [(self.model.set_of(nodes), None)]
        return [(self.model.set_of(nodes[number.ravel() == k]), value) for k, value in enumerate(values)]

    def loads(
        self, instant: Instant, loaded: Sequence[tuple[str, np.ndarray | None]], bodies: Mapping[str, Body]
    ) -> tuple[Load, ...]:
        """Return the loads at a time."""
        found: list[Load] = []
        for name, force in loaded:
            for body, mesh in self.model.parts.meshes.items():
                mine, inner = self.model.in_body(body, self.model.node_sets[name])
                if len(mine):
                    owned = self.model.owned(body, mine)
                    each = instant.forces[mine, : self.model.dim] * owned[:, None]
                    value: Any = (
                        tuple(force.tolist())
                        if force is not None and owned.all()
                        else NodeValues(mesh.points[inner], each)
                    )
                    found.append(PointForce(body, name, value))
        pressures = {self.pressed[pressed.where]: pressed.value for pressed in instant.pressures}
        for name, value in pressures.items():
            if value:
                meshes = self.model.parts.meshes.items()
                found += [Pressure(body, name, value) for body, mesh in meshes if name in mesh.surfaces]
        for weight in instant.weights:
            found += self._weights(weight)
        for driven, name in self.supports.driven:
            if driven.spread:
                found += self._spread(driven, name, instant)
        found += self._heat(instant.temperatures, bodies)
        return (*found, *self._stressed(bodies))

    def _stressed(self, bodies: Mapping[str, Body]) -> list[Load]:
        """Return the initial stresses of bodies."""
        given, flowed, found = self.model.stressed, self.model.flowed, list[Load]()
        for part in self.model.parts_of_mesh:
            order, body = self.model.in_cell_order(part), bodies[part.name]
            stress = np.zeros((len(order), 6)) if given is None else given.values[order].copy()
            if flowed is not None:
                for number, material in enumerate(body.materials):
                    cells = np.flatnonzero(body.material_of_cells == number)
                    strain = flowed.values[order][cells]
                    if strain.any():
                        stress[cells] += relieved(strain, material, flowed.card)
            if not stress.any():
                continue
            if given is not None and any(map(is_nonlinear, body.materials)):
                raise given.card.error(
                    f"initial stresses are read for linear materials without NLGEOM, body {part.name} has "
                    f"{bodies[part.name].in_words}: leave them out"
                )
            mesh = bodies[part.name].mesh
            value: Any = tuple(stress[0].tolist())
            if np.ptp(stress, axis=0).any():
                value = NodeValues(mesh.points[mesh.cells].mean(axis=1), stress)
            found.append(InitialStress(part.name, value))
        return found

    def _spread(self, driven: Driven, name: str, instant: Instant) -> list[Load]:
        """Return the force and instant of a node, spread over its surface."""
        body, *others = self.supports.bodies_of(name)
        if others:
            raise driven.card.error(
                f"a distributing coupling loads a surface of one body, {driven.name!r} is on {body} and "
                f"{', '.join(others)}: give one for each, with a node of its own"
            )
        held, load = driven.row(instant.held), driven.row(instant.forces)
        if not np.isnan(held).all():
            raise driven.card.error(
                "a distributing coupling takes forces, but its node is held: use *KINEMATIC for displacements"
            )
        if not load.any():
            return []
        dim, at = self.model.dim, self.model.mesh.points[driven.node]
        moments: Any = tuple(load[3:].tolist()) if dim == 3 else float(load[5])
        return [
            TotalForce(
                body,
                name,
                tuple(load[:dim].tolist()),
                moments if np.any(moments) else None,
                tuple(at[:dim].tolist()),
            )
        ]

    def _weights(self, weight: Acting) -> list[Load]:
        """Return gravity or centrifugal force on bodies, by region where some are not loaded or differ."""
        elements = self.model.mesh.elements_named(weight.where[0], weight.card, weight.row)
        found: list[Load] = []
        for part in self.model.parts_of_mesh:
            if not weight.value:
                continue
            densities: dict[str | None, float] = {}
            names = region_names(self.model.sections, part)
            for number, region in names.items():
                mine = part.elements[self.model.of_element[part.elements] == number]
                if np.isin(mine, elements).any():
                    densities[region] = self._density(weight, number)
            if len(densities) == len(names) and len(set(densities.values())) == 1:
                densities = {None: next(iter(densities.values()))}
            found += [self._weight(weight, part, density, region) for region, density in densities.items()]
        return found

    def _density(self, weight: Acting, section: int) -> float:
        name = self.model.sections[section].material
        density = self.model.materials[name].density
        if not density:
            raise weight.card.error(
                f"{weight.where[1]} needs a *DENSITY of material {name}: add it", weight.row
            )
        return density

    def _check_direction(self, weight: Acting, numbers: np.ndarray) -> None:
        """Reject directions that plane bodies and bodies of revolution do not have."""
        if self.model.dim == 3:
            return
        revolved, spins = self.model.kind == "axisymmetric", weight.where[1] == "CENTRIF"
        point, along = (numbers[:3], numbers[3:]) if spins else (np.zeros(3), numbers)
        across = along[[0, 2]] if revolved else along[:2] if spins else along[2:]
        if across.any() or (revolved and spins and point[0]):
            needed = "the axis of revolution, y" if revolved else "z" if spins else "the plane"
            raise weight.card.error(
                f"{weight.where[1]} here must be along {needed}, got {numbers.tolist()}: correct it",
                weight.row,
            )

    def _weight(self, weight: Acting, part: Component, density: float, region: str | None) -> BodyForce:
        numbers = np.array(weight.numbers)
        self._check_direction(weight, numbers)
        if weight.where[1] == "GRAV":
            along = weight.value * numbers / np.linalg.norm(numbers)
            return gravity(part.name, density, along[: self.model.dim].tolist(), region)
        speed = float(np.sqrt(weight.value))
        if self.model.dim == 3:
            return centrifugal(part.name, density, speed, tuple(numbers[:3]), tuple(numbers[3:]), region)
        if self.model.kind == "axisymmetric":
            return centrifugal(part.name, density, speed, (0.0, 0.0), (0.0, 1.0), region)
        return centrifugal(part.name, density, speed, tuple(numbers[:2]), region=region)

    def _heat(self, temperatures: np.ndarray, bodies: Mapping[str, Body]) -> list[Load]:
        """Return the changes of temperature of bodies that expand."""
        found: list[Load] = []
        for name, mesh in self.model.parts.meshes.items():
            nodes = self.model.parts.nodes[name]
            change = mesh.centres.placed((temperatures - self.model.steps.initial)[nodes])
            materials = bodies[name].materials
            if not change.any() or not all(getattr(m, "expands", False) for m in materials):
                continue
            value: Any = float(change[0]) if np.ptp(change) == 0.0 else NodeValues(mesh.points, change)
            found.append(ThermalStrain(name, value))
        return found
