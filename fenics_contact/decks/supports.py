"""Supports of a deck: what it holds at an instant, rigid surfaces, equations between nodes, bolts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact._scene.constraints import ConstraintTerm, LinearConstraint
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.preloads import Section as CutAt
from fenics_contact._scene.supports import AnySupport, HoldCurrent, RigidSurface, Roller, Support
from fenics_contact.decks.bodies import DeckBodies
from fenics_contact.decks.couplings import Bolt, Driven, rigid_surface
from fenics_contact.decks.multi_point import Rows
from fenics_contact.decks.rigid_links import by_small_turns, following, in_their_space, spread_out
from fenics_contact.decks.springs import name_of
from fenics_contact.decks.steps import Instant
from fenics_contact.readers.deck_bodies import Component


@dataclass(frozen=True, eq=False)
class SupportBuilder:
    """Makes supports, equations and bolts of what a deck holds."""

    built: DeckBodies

    def at(self, instant: Instant) -> tuple[AnySupport, ...]:
        """Return the supports at a time."""
        built, found = self.built, list[AnySupport]()
        marks = ~np.isnan(instant.held)
        for name, (nodes, components) in built.names.supported.items():
            held = [k for k in components if marks[nodes, k].all()]
            for body, mesh in built.meshes.items() if held else ():
                mine, inner = built.parts.within(body, nodes)
                if len(mine):
                    found += self._supports_of(body, name, mine, mesh.points[inner], held, instant)
        for driven, name in built.names.driven:
            if not driven.spread:
                found += self._rigid(driven, name, instant)
        return (*found, *self.rollers)

    def _supports_of(
        self,
        body: str,
        name: str,
        nodes: np.ndarray,
        points: np.ndarray,
        held: Sequence[int],
        instant: Instant,
    ) -> list[AnySupport]:
        """Return the supports of some nodes of a body: along x, y and z, or along their local axes."""
        dim, axes = self.built.deck.dim, self.built.deck.axes
        given = [instant.held[nodes, k] for k in held]
        amounts: list[Any] = [
            float(each[0]) if np.ptp(each) == 0.0 else NodeValues(points, each) for each in given
        ]
        for place, k in enumerate(held):
            if instant.kept[nodes, k].any():
                amounts[place] = self._kept(name, instant.kept[nodes, k])
        whole = len(held) == dim and not any(each.any() for each in given)
        if not axes.turned(nodes).any() or (whole and self._always_zero(nodes, held)):
            value: list[Any] = [None] * dim
            for k, amount in zip(held, amounts, strict=True):
                value[k] = amount
            return [Support(body, name, tuple(value))]
        rows = np.stack([axes.of(node) for node in nodes.tolist()])[:, :, :dim]
        found: list[AnySupport] = []
        for k, amount in zip(held, amounts, strict=True):
            alike = np.allclose(rows[:, k], rows[0, k], atol=1e-12)
            direction: Any = tuple(rows[0, k].tolist()) if alike else NodeValues(points, rows[:, k])
            found.append(Roller(body, name, amount, direction))
        return found

    def _kept(self, name: str, kept: np.ndarray) -> HoldCurrent:
        """Return a support that keeps what all of its nodes have."""
        if not kept.all():
            target = next(each for each in self.built.steps.targets if each.fixed)
            raise target.error(f"nodes of {name!r} that are FIXED were partly free before: make two sets")
        return HoldCurrent()

    def _always_zero(self, nodes: np.ndarray, held: Sequence[int]) -> bool:
        """Return whether components of nodes are held at zero in all steps."""
        held = list(held)
        return not any(
            np.nan_to_num(at.held[nodes][:, held]).any() or at.kept[nodes][:, held].any()
            for at in self.built.steps.instants
        )

    def _rigid(self, driven: Driven, name: str, instant: Instant) -> list[RigidSurface]:
        """Return the rigid surfaces of a node: that of the first body, or of all where all is given."""
        deck = self.built.deck
        deck.record.origins["support", name] = driven.card.origin
        at = deck.mesh.points[driven.node, : deck.dim]
        return [rigid_surface(driven, body, name, at, instant) for body in self._rigid_bodies(driven, name)]

    def _rigid_bodies(self, driven: Driven, name: str) -> list[str]:
        """Return the bodies with a rigid surface of their own; others follow that of the first one."""
        bodies, motions = self.built.bodies_with(name), self.built.deck.motions
        held = [driven.motion(instant)[motions] for instant in self.built.steps.instants]
        if len(bodies) == 1 or (held and not np.isnan(held).any()):
            return bodies
        sizes = [len(spread_out(self.built.meshes[b].points[self._nodes(b, name)])) for b in bodies]
        return [bodies[int(np.argmax(sizes))]]

    def _nodes(self, body: str, name: str) -> np.ndarray:
        """Return nodes of a surface or set that the deck has."""
        own = self.built.meshes[body].nodes_to_hold(name)
        return np.asarray(own[self.built.parts.nodes[body][own] >= 0])

    @cached_property
    def rollers(self) -> list[Roller]:
        """Nodes that equations let slide along planes."""
        built, found = self.built, []
        for each in built.steps.equations:
            if len(set(each.nodes)) == 1:
                node, normal = each.nodes[0], np.zeros(3)
                np.add.at(normal, list(each.components), each.factors)
                normal = (normal @ built.deck.axes.of(node))[: built.deck.dim]
                body = next(b for b in built.meshes if len(built.parts.within(b, np.array([node]))[0]))
                name = name_of(built.deck.mesh.numbers[node])
                found.append(Roller(body, name, 0.0, tuple(normal.tolist())))
        return found

    def constraints(self) -> list[LinearConstraint]:
        """Return the equations of several nodes, joints of bodies and surfaces that follow others."""
        terms = self._terms()
        found = [LinearConstraint(terms, name="EQUATIONS")] if terms else []
        return [*found, *self._joints(), *self._links()]

    def _joints(self) -> Iterator[LinearConstraint]:
        """Yield what joins bodies that share nodes."""
        deck, dim = self.built.deck, self.built.deck.dim
        for first, second, nodes in self.built.parts.joints():
            terms = []
            for body, factor in ((first, 1.0), (second, -1.0)):
                inner = np.tile(self.built.parts.within(body, nodes)[1], dim)
                terms.append(ConstraintTerm(body, inner, np.repeat(np.eye(dim), len(nodes), axis=0), factor))
            deck.note(
                deck.mesh.blocks[0].card,
                f"bodies {first} and {second} share {len(nodes)} nodes: joined",
            )
            yield LinearConstraint(terms, name=f"NODES OF {first} AND {second}")

    def _links(self) -> Iterator[LinearConstraint]:
        """Yield how surfaces of further bodies follow the rigid surface of the first one."""
        meshes = self.built.meshes
        for driven, name in self.built.names.driven:
            if driven.spread:
                continue
            first, *own = self._rigid_bodies(driven, name)
            for body in self.built.bodies_with(name):
                if body == first or body in own:
                    continue
                leaders = self._nodes(first, name)
                leaders = leaders[spread_out(meshes[first].points[leaders])]
                nodes = self._nodes(body, name)
                moved = self._moved(driven, name, meshes[body].points[nodes], meshes[first].points[leaders])
                yield following(f"{body} {name}", body, nodes, first, leaders[: moved.shape[2]], moved)

    def _moved(self, driven: Driven, name: str, points: np.ndarray, leaders: np.ndarray) -> np.ndarray:
        """Return how points move with others of one rigid piece, (n, components, m, dim)."""
        deck, steps = self.built.deck, self.built.steps
        turned = [k for k in deck.motions if k > 2]
        turns = any((driven.motion(instant)[turned] != 0.0).any() for instant in steps.instants)
        weights = in_their_space(points, leaders) if turns else np.ones((len(points), 1))
        if weights is not None:
            components = np.eye(deck.dim)[1:] if deck.kind == "axisymmetric" else np.eye(deck.dim)
            return np.einsum("nm,kd->nkmd", weights, components)
        moved = None if steps.large else by_small_turns(points, leaders)
        if moved is None:
            raise driven.card.error(
                f"nodes of {name!r} on one body do not show how it turns: hold its rotations at zero"
            )
        return moved

    @cached_property
    def _rows(self) -> Rows:
        """The terms of equations of several nodes."""
        steps = self.built.steps
        several = [each for each in steps.equations if len(set(each.nodes)) > 1]
        return Rows.joined([Rows.of_equations(several), steps.rows])

    def _terms(self) -> list[ConstraintTerm]:
        """Return the terms of the equations, one for each body."""
        number, node, component, factor = self._rows.columns
        axes, parts = self.built.deck.axes, self.built.parts
        along = np.eye(6, 3)[component]
        for place in np.flatnonzero(axes.turned(node) & (component < 3)):
            along[place] = axes.of(int(node[place]))[component[place]]
        used, place = np.unique(node, return_inverse=True)
        owner, own = np.full((2, len(used)), -1)
        for k, body in enumerate(self.built.meshes):
            mine, inner = parts.within(body, used)
            owned = parts.owned(body, mine)
            at = np.searchsorted(used, mine[owned])
            owner[at], own[at] = k, inner[owned]
        of = np.where(component < 3, owner[place], -1)
        order = np.argsort(of, kind="stable")
        ends = np.searchsorted(of[order], np.arange(len(self.built.meshes) + 1))
        vectors = along[:, : self.built.deck.dim]
        return [
            ConstraintTerm(body, own[place[here]], vectors[here], factor[here], number[here])
            for body, here in zip(self.built.meshes, np.split(order, ends)[1:], strict=False)
            if len(here)
        ]

    def values(self, instant: Instant) -> Mapping[str, Any] | None:
        """Return the values of equations at a time, of nodes without elements; None without any."""
        number, node, component, factor = self._rows.columns
        outside = ~self.built.deck.inside[node] | (component > 2)
        if not outside.any():
            return None
        count, moved = int(number.max()) + 1, instant.held[node[outside], component[outside]]
        return {"EQUATIONS": -np.bincount(number[outside], factor[outside] * moved, count)}

    @cached_property
    def preloads(self) -> list[Preload]:
        """The bolts of pre-tension sections, held at their length."""
        found = []
        for bolt in self.built.deck.bolts:
            elements = bolt.faces.elements
            parts = [p for p in self.built.deck.components if np.isin(elements, p.elements).all()]
            if len(parts) != 1:
                raise bolt.card.error(f"surface {bolt.name!r} must go through one body: give one for each")
            found.append(Preload(parts[0].name, self._section(bolt, parts[0]), name=bolt.name))
            self.built.deck.record.origins["preload", bolt.name] = bolt.card.origin
        return found

    def _section(self, bolt: Bolt, part: Component, flat: float = 1e-6) -> CutAt:
        """Return the plane of a section with the cells that it may separate, those of its elements' body."""
        mesh, dim = self.built.deck.mesh, self.built.deck.dim
        points = mesh.points[:, :dim]
        corners = np.concatenate([points[n].reshape(-1, dim) for n in mesh.corners(bolt.faces)])
        centre = corners.mean(axis=0)
        _, size, axes = np.linalg.svd(corners - centre)
        if size[dim - 1] > flat * size[0]:
            raise bolt.card.error(f"surface {bolt.name!r} must be flat: give faces in a plane")
        normal = axes[dim - 1]
        middle = mesh.middles(bolt.faces.elements)[:, :dim]
        normal = normal if (middle - centre).mean(axis=0) @ normal < 0 else -normal
        radius = 1.5 * float(np.linalg.norm(corners - centre, axis=1).max())
        whole = CutAt(tuple(centre.tolist()), tuple(normal.tolist()))
        return whole if self._cuts(whole, bolt, part) else replace(whole, radius=radius)

    def _cuts(self, section: CutAt, bolt: Bolt, part: Component, near: float = 1e-6) -> bool:
        """Return whether a plane through a whole body separates it at the faces of a bolt alone."""
        mesh, dim = self.built.deck.mesh, self.built.deck.dim
        point, normal = np.array(section.point), np.array(section.normal)
        before = part.elements[np.isin(part.elements, bolt.faces.elements)]
        if not len(before) or ((mesh.middles(before)[:, :dim] - point) @ normal >= 0).any():
            return False
        nodes = self.built.parts.nodes[part.name]
        nodes = nodes[nodes >= 0]
        away = np.abs((mesh.points[nodes][:, :dim] - point) @ normal)
        others = ~np.isin(nodes, mesh.nodes_of(bolt.faces))
        return not (away[others] <= near * away.max()).any()
