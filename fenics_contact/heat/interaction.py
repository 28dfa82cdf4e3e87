"""What mechanics and heat of the same bodies do to each other: strains, friction, pressures, gaps, work."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._scene.checks import check_known
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import ThermalStrain
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.decomposition import Tearing
from fenics_contact.heat.friction import FrictionHeat
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.plastic import plastic_work
from fenics_contact.heat.problem import GivenContact, as_given
from fenics_contact.heat.scene import HeatScene
from fenics_contact.materials.elastic import can_expand
from fenics_contact.materials.plastic import has_history
from fenics_contact.results.contact import Status
from fenics_contact.results.deformed_state import AnyState


@dataclass(frozen=True, eq=False)
class Interaction:
    """Both scenes, and how each enters the other.

    `joints`, `tearing`: of the heat; `cold`: temperatures at which bodies are free of stress, by body;
    `duration`: time in which the work of friction becomes heat.
    """

    scene: Scene
    heat: HeatScene
    joints: Joints
    tearing: Tearing
    cold: Mapping[str, float]
    duration: float

    @cached_property
    def pairs(self) -> dict[int, int]:
        """Number of a thermal contact -> that of the contact pair with its surfaces, where there is one."""
        return pairs_with_heat(self.scene, self.heat)

    @property
    def mechanics_heats(self) -> bool:
        """Whether temperatures depend on mechanics."""
        heats = any(law.part > 0.0 for law in self.laws.values())
        heats = heats or any(load.by_mechanics for load in self.heat.loads)
        return heats or any(each.law.by_contact for each in self.heat.contacts)

    @property
    def laws(self) -> dict[int, FrictionHeat]:
        """The heat of friction of each thermal contact that has a contact pair, by its number."""
        return {number: self.heat.contacts[number].friction for number in self.pairs}

    @property
    def expanding(self) -> list[str]:
        """The bodies that temperatures strain."""
        materials = {name: self.scene.bodies[name].materials for name in self.heat.bodies}
        return [name for name, given in materials.items() if any(map(can_expand, given))]

    @property
    def rubbing(self) -> list[int]:
        """The thermal contacts whose temperatures change the friction of their pair."""
        acting = {
            number: self.scene.contacts[place].effects(self.scene) for number, place in self.pairs.items()
        }
        return [k for k, law in self.laws.items() if law.by_temperature and EffectName.COULOMB in acting[k]]

    def strains(self, temperature: np.ndarray, least: float = 1e-10) -> list[ThermalStrain]:
        """Return the loads of temperatures of all nodes, (n_nodes,).

        `least`: changes of a body relative to temperatures that are what linear systems leave. Alone in a
        scene they would be all that mechanics resolves.
        """
        loads, size = [], max(np.abs(temperature).max(), *map(abs, self.cold.values()))
        for name in self.expanding:
            points = self.scene.bodies[name].mesh.points
            change = temperature[self.tearing.first_of(name) :][: len(points)] - self.cold[name]
            change *= np.abs(change).max() > least * size
            loads.append(ThermalStrain(name, NodeValues(points, change)))
        return loads

    def heated(self, temperature: np.ndarray) -> Scene:
        """Return the scene of mechanics at temperatures of all nodes, (n_nodes,)."""
        heated = replace(self.scene, loads=[*self.scene.loads, *self.strains(temperature)])
        return replace(heated, contacts=self._with_friction(temperature)) if self.rubbing else heated

    def between(self, number: int, temperature: np.ndarray) -> tuple[NodeValues, np.ndarray]:
        """Return the points of a thermal contact, as a function of position, and the means of both sides."""
        mine = np.flatnonzero(self.joints.points.pair == number)
        mean = 0.5 * np.sum(self.joints.sides(temperature), axis=0)
        return NodeValues(self.joints.places[mine], mine), mean

    def _with_friction(self, temperature: np.ndarray) -> list[ContactPair]:
        """Return the contact pairs with the friction of the temperatures between their surfaces."""
        pairs = list(self.scene.contacts)
        for number in self.rubbing:
            (at, mean), place = self.between(number, temperature), self.pairs[number]
            table: Any = self.laws[number].coefficient
            law: Any = pairs[place].friction
            values = NodeValues(at.points, table.at(mean[at.values]))
            pairs[place] = replace(pairs[place], friction=replace(law, friction_coefficient=values))
        return pairs

    def given(self, state: AnyState) -> GivenContact:
        """Return the pressures, gaps and work of a state at the points where heat passes. Collective."""
        points, given, contact = self.joints.points, as_given(self.joints), state.contact
        moved = nodal_mean_at(state.torn.decomposition, state.torn_displacement, self.nodes_in(state))
        way = points.relative(moved[:, : points.normal.shape[1]])
        pressure, gap = given.pressure.copy(), points.gap + np.einsum("nd,nd->n", points.normal, way)
        work, lost = given.work.copy(), self.lost(state)
        open_gap = np.where(contact.normal_force > 0.0, 0.0, contact.gap)
        for number, place, mine, onto in self.means(state):
            pressure[mine] = onto @ contact.nominal_pressure
            gap[mine] = np.where(onto.getnnz(axis=1) > 0, onto @ open_gap, gap[mine])
            # Means over other nodes keep the work of the whole pair.
            w, total = onto @ (lost / contact.nominal_area), lost[contact.on_pair(place)].sum()
            work[mine] = w * (total / (w @ self.joints.area[mine])) if w.any() else w
        return GivenContact(np.maximum(pressure, 0.0), gap, np.maximum(work, 0.0))

    def worked(self, before: AnyState | None, state: AnyState) -> HeatScene:
        """Return the heat with that of plastic work from a state before. Collective."""

        def power(body: str) -> np.ndarray:
            return plastic_work(before, state, body) * (self.heat.bodies[body].thickness / self.duration)

        loads = [load.worked(power) for load in self.heat.loads]
        same = all(one is other for one, other in zip(loads, self.heat.loads, strict=True))
        return self.heat if same else replace(self.heat, loads=loads)

    def nodes_in(self, state: AnyState) -> np.ndarray:
        """Return the numbers that the nodes of the heat have in a state of mechanics."""
        tearing, bodies = state.torn.decomposition.tearing, self.heat.bodies
        own = [
            tearing.global_nodes(name, np.arange(bodies[name].mesh.n_nodes))
            for name in self.tearing.body_names
        ]
        return np.concatenate(own)

    def lost(self, state: AnyState) -> np.ndarray:
        """Return the power of friction at the points of mechanics, (n_contact,)."""
        contact = state.contact
        work = np.einsum("na,na->n", contact.friction_force, contact.slip)
        return np.where(contact.status == Status.SLIP, np.maximum(work, 0.0), 0.0) / self.duration

    def means(self, state: AnyState) -> Iterator[tuple[int, int, np.ndarray, sp.csr_matrix]]:
        """Yield thermal contacts with their pairs: number, pair, points (n,), and means of values of points.

        Means are (n, n_contact) over the points of mechanics, without entries where there are none.
        """
        contact, points = state.contact, self.joints.points
        tearings = self.tearing, state.torn.decomposition.tearing
        for number, place in self.pairs.items():
            side, mine = self.scene.contacts[place].slave, np.flatnonzero(points.pair == number)
            weights = points.own if side == self.heat.contacts[number].slave else points.master
            here, there = (each.first_of(side.body) for each in tearings)
            nodes, which = contact.points.of_surface(place, np.arange(contact.points.count))
            on = weights[mine][:, nodes - there + here]
            covered = np.asarray(on.sum(axis=1)).ravel()
            scale = np.where(covered > 0.5, 1.0 / np.where(covered > 0.5, covered, 1.0), 0.0)
            chosen = (np.ones(len(which)), (np.arange(len(which)), which))
            onto = sp.diags(scale) @ on @ Csr(chosen, shape=(len(which), contact.points.count))
            onto.eliminate_zeros()
            yield number, place, mine, onto.tocsr()


def pairs_with_heat(scene: Scene, heat: HeatScene) -> dict[int, int]:
    """Return number of a thermal contact -> that of the contact pair with its surfaces, if there is one."""
    pairs = [[pair.slave, pair.master] for pair in scene.contacts]
    sides = [[contact.slave, contact.master] for contact in heat.contacts]
    found = {k: [both in (each, each[::-1]) for each in pairs] for k, both in enumerate(sides)}
    return {number: same.index(True) for number, same in found.items() if True in same}


def check_fit(scene: Scene, heat: HeatScene, given: Mapping[str, float]) -> None:
    """Reject fields on different bodies or meshes, and materials that are free of stress elsewhere."""
    flowing = [load.body for load in heat.loads if load.by_mechanics]
    if twice := [name for name in flowing if flowing.count(name) > 1]:
        raise InvalidInputError(
            f"plastic work of a body becomes heat once, got several PlasticHeat of {twice[0]!r}: "
            "add up shares"
        )
    for load in heat.loads:
        plastic = load.body not in scene.bodies or any(map(has_history, scene.bodies[load.body].materials))
        if load.by_mechanics and not plastic:
            raise InvalidInputError(
                f"PlasticHeat needs a material of body {load.body!r} that flows, got none: give one, such as "
                "J2Plasticity"
            )
    for contact in (heat.contacts[number] for number in pairs_with_heat(scene, heat)):
        if callable(contact.pressure) or contact.pressure:
            raise InvalidInputError(
                f"{contact.place} has the pressures of the contact pair with its surfaces, got "
                "ThermalContact.pressure as well: leave it out"
            )
    for name, body in heat.bodies.items():
        check_known(name, scene.bodies, f"heat is of body {name!r}, the mechanics has")
        check_known(name, given, f"stress_free needs a temperature of body {name!r}, it has")
        if not np.isfinite(given[name]):
            raise InvalidInputError(
                f"stress_free of body {name!r} must be finite, got {given[name]!r}: give the temperature at "
                "which it has no thermal strain"
            )
        points, known = body.mesh.points, scene.bodies[name].mesh.points
        if not np.array_equal(known, points):
            raise InvalidInputError(
                f"heat and mechanics need the same mesh of body {name!r}, got {len(points)} nodes for heat, "
                f"{len(known)} for mechanics: take HeatScene.on(scene, ...)"
            )
        thick = np.unique(scene.bodies[name].thickness_of_cells).tolist()
        alike = scene.bodies[name].axisymmetric == body.axisymmetric
        if not alike or (thick != [body.thickness] and scene.bodies[name].has_thickness):
            raise InvalidInputError(
                f"heat and mechanics need body {name!r} of one thickness, and both of revolution or none, "
                f"got {body.thickness:g} and {thick}, axisymmetric={body.axisymmetric} and "
                f"{scene.bodies[name].axisymmetric}: take HeatScene.on(scene, ...)"
            )
        materials = scene.bodies[name].materials
        initial = {getattr(each, "initial_temperature", given[name]) for each in materials}
        if initial != {given[name]}:
            raise InvalidInputError(
                f"body {name!r} must be free of stress at the initial temperature of its materials, "
                f"{sorted(initial)}, got stress_free {given[name]:g}: give it by stress_free={{...}}"
            )
