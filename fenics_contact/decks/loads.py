"""Loads of a deck at an instant: forces, pressures, weight, temperatures, initial stresses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import (
    BodyForce,
    InitialStress,
    Load,
    PointForce,
    Pressure,
    ThermalStrain,
    TotalForce,
    Traction,
    centrifugal,
    gravity,
)
from fenics_contact.decks.bodies import DeckBodies
from fenics_contact.decks.couplings import Driven
from fenics_contact.decks.initial_stress import relieved
from fenics_contact.decks.names import Forced
from fenics_contact.decks.springs import name_of
from fenics_contact.decks.steps import DistributedLoad, Instant
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.readers.deck_bodies import Component, region_names


@dataclass(frozen=True, eq=False)
class LoadBuilder:
    """Makes loads of what acts at an instant of a deck."""

    built: DeckBodies

    def at(self, instant: Instant, forced: Forced) -> tuple[Load, ...]:
        """Return the loads at a time; `forced`: names of the nodes that forces act on."""
        built, found = self.built, list[Load]()
        for name, force in forced:
            for body, mesh in built.meshes.items():
                mine, inner = built.parts.within(body, built.names.node_sets[name])
                if len(mine):
                    owned = built.parts.owned(body, mine)
                    each = instant.forces[mine, : built.deck.dim] * owned[:, None]
                    value: Any = force if force and owned.all() else NodeValues(mesh.points[inner], each)
                    found.append(PointForce(body, name, value))
        pressed = [each for each in instant.pressures if not each.is_traction]
        pressures = {built.names.pressed[each.where]: each.value for each in pressed}
        for each in instant.pressures:
            found += self._tractions(each) if each.is_traction and each.value else ()
        for name, value in pressures.items():
            if value:
                bodies = [body for body, mesh in built.meshes.items() if name in mesh.surfaces]
                found += [Pressure(body, name, value) for body in bodies]
        for weight in instant.weights:
            found += [*self._weights(weight), *self._of_masses(weight, instant)]
        for driven, name in built.names.driven:
            if driven.spread:
                found += self._spread(driven, name, instant)
        return (*found, *self._heat(instant), *self._stressed())

    def _tractions(self, load: DistributedLoad) -> Iterator[Load]:
        """Yield a force per area along a direction, of TRSHR along the plane of the surface."""
        name, dim, along = self.built.names.pressed[load.where], self.built.deck.dim, np.array(load.numbers)
        if self.built.steps.large and load.card.name_of("FOLLOWER") != "NO":
            raise load.error("a traction that turns with its surface is not read: give FOLLOWER=NO")
        if along[dim:].any():
            raise load.error(f"the direction of a plane body's traction must be in its plane, got {along}")
        for body, mesh in self.built.meshes.items():
            if name not in mesh.surfaces:
                continue
            direction = along[:dim]
            if load.where[1] == "TRSHR":
                corners = mesh.points[mesh.surfaces[name][:, :dim]]
                spans = np.linalg.qr(np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2))[0]
                each = np.einsum("fik,fjk,j->fi", spans, spans, direction)
                direction = each.mean(axis=0)
                if np.abs(each - direction).max() > 1e-6 * np.abs(along).max() or not direction.any():
                    raise load.error("TRSHR needs a plane surface, and a direction not across it: give TRVEC")
            value = load.value * direction / np.linalg.norm(direction)
            yield Traction(body, name, tuple(value.tolist()))

    def _stressed(self) -> Iterator[Load]:
        """Yield the initial stresses of bodies."""
        deck = self.built.deck
        for part in deck.components:
            order, body = deck.mesh.in_cell_order(part.elements), self.built.bodies[part.name]
            stress = deck.stress.values[order].copy()
            for number, material in enumerate(body.materials):
                cells = np.flatnonzero(body.material_of_cells == number)
                strain = deck.strain.values[order][cells]
                if strain.any():
                    stress[cells] += relieved(strain, material, deck.strain.card)
            if not stress.any():
                continue
            if any(map(is_nonlinear, body.materials)):
                raise deck.stress.card.error(
                    f"initial stresses need linear materials without NLGEOM, got {body.in_words}"
                )
            value: Any = tuple(stress[0].tolist())
            if np.ptp(stress, axis=0).any():
                value = NodeValues(body.mesh.points[body.mesh.cells].mean(axis=1), stress)
            yield InitialStress(part.name, value)

    def _spread(self, driven: Driven, name: str, instant: Instant) -> list[Load]:
        """Return the force and moment of a node, spread over its surface."""
        body, *others = self.built.bodies_with(name)
        if others:
            raise driven.card.error(
                f"a distributing coupling must load one body, {driven.name!r} is also on {', '.join(others)}"
            )
        if not np.isnan(driven.motion(instant)).all():
            raise driven.card.error("the node of a distributing coupling is held: take *KINEMATIC")
        dim, load = self.built.deck.dim, driven.load(instant).tolist()
        at = driven.place(self.built.deck.mesh)
        moment: Any = tuple(load[3:]) if dim == 3 else load[5]
        given = moment if np.any(moment) else None
        return [TotalForce(body, name, tuple(load[:dim]), given, at)] if any(load) else []

    def _of_masses(self, weight: DistributedLoad, instant: Instant) -> Iterator[Load]:
        """Yield the weight, or the centrifugal force, of masses at nodes."""
        deck, dim = self.built.deck, self.built.deck.dim
        numbers = np.array(weight.numbers)
        for each in deck.masses if weight.value else ():
            if weight.where[0] not in each.sets:
                continue
            if not each.mass:
                raise weight.error("the masses of its elements are zero: give *MASS, or trusses a *DENSITY")
            if weight.where[1] == "GRAV":
                force = each.mass * weight.value * numbers / np.linalg.norm(numbers)
            else:
                arm, along = deck.mesh.points[each.node] - numbers[:3], numbers[3:]
                arm = arm - (arm @ along) * along / (along @ along)
                force = each.mass * weight.value * arm
            name, nodes = name_of(deck.mesh.numbers[each.node]), deck.ends_at(each.node)
            if not len(nodes):
                if np.isnan(instant.held[each.node, :dim]).any():
                    raise each.card.error(f"mass at {name.lower()}, of no element and not held: hold it")
                continue  # its support alone carries it
            body = next(b for b, mesh in self.built.meshes.items() if name in mesh.node_sets)
            yield PointForce(body, name, tuple((force[:dim] / deck.thickness / len(nodes)).tolist()))

    def _weights(self, weight: DistributedLoad) -> Iterator[Load]:
        """Yield gravity or centrifugal force on bodies, by region where some are not loaded or differ."""
        deck = self.built.deck
        elements = deck.mesh.weighed(weight.where[0], weight.card, weight.row)
        for part in deck.components if weight.value else ():
            densities: dict[str | None, float] = {}
            names = region_names(deck.sections, part)
            for number, region in names.items():
                mine = part.elements[deck.of_element[part.elements] == number]
                if np.isin(mine, elements).any():
                    densities[region] = self._density(weight, number)
            if len(densities) == len(names) and len(set(densities.values())) == 1:
                densities = {None: next(iter(densities.values()))}
            for region, density in densities.items():
                yield self._weight(weight, part, density, region)

    def _density(self, weight: DistributedLoad, section: int) -> float:
        plies, found = self.built.deck.sections[section].plies, 0.0
        for ply in plies:
            density = self.built.deck.materials[ply.material].density
            if not density:
                needed = f"{weight.where[1]} needs a *DENSITY of material {ply.material}: add it"
                raise weight.error(needed)
            found += density * ply.thickness / sum(each.thickness for each in plies)
        return found

    def _check_direction(self, weight: DistributedLoad, numbers: np.ndarray) -> None:
        """Reject directions that plane bodies and bodies of revolution do not have."""
        if self.built.deck.dim == 3:
            return
        revolved, spins = self.built.deck.kind == "axisymmetric", weight.where[1] == "CENTRIF"
        point, along = (numbers[:3], numbers[3:]) if spins else (np.zeros(3), numbers)
        across = along[[0, 2]] if revolved else along[:2] if spins else along[2:]
        if across.any() or (revolved and spins and point[0]):
            needed = "the axis of revolution, y" if revolved else "z" if spins else "the plane"
            raise weight.error(f"{weight.where[1]} here must be along {needed}, got {numbers.tolist()}")

    def _weight(
        self, weight: DistributedLoad, part: Component, density: float, region: str | None
    ) -> BodyForce:
        numbers = np.array(weight.numbers)
        self._check_direction(weight, numbers)
        if weight.where[1] == "GRAV":
            along = weight.value * numbers / np.linalg.norm(numbers)
            return gravity(part.name, density, along[: self.built.deck.dim].tolist(), region)
        speed = float(np.sqrt(weight.value))
        if self.built.deck.dim == 3:
            return centrifugal(part.name, density, speed, tuple(numbers[:3]), tuple(numbers[3:]), region)
        if self.built.deck.kind == "axisymmetric":
            return centrifugal(part.name, density, speed, (0.0, 0.0), (0.0, 1.0), region)
        return centrifugal(part.name, density, speed, tuple(numbers[:2]), region=region)

    def _heat(self, instant: Instant) -> Iterator[Load]:
        """Yield the changes of temperature of bodies that expand."""
        for name, mesh in self.built.meshes.items():
            nodes = self.built.parts.nodes[name]
            change = mesh.centres.placed((instant.temperatures - self.built.steps.initial)[nodes])
            materials = self.built.bodies[name].materials
            if not change.any() or not all(getattr(m, "expands", False) for m in materials):
                continue
            value: Any = float(change[0]) if np.ptp(change) == 0.0 else NodeValues(mesh.points, change)
            yield ThermalStrain(name, value)
