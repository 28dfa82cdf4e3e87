"""What holds the bodies of a deck: supports, surfaces that nodes drive, equations, bolts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact._scene.constraints import ConstraintTerm, LinearConstraint
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.preloads import Section as CutAt
from fenics_contact._scene.supports import AnySupport, Kept, RigidSurface, Roller, Support
from fenics_contact.decks.couplings import (
    Bolt,
    Driven,
    Equation,
    by_node,
    rigid_surface,
)
from fenics_contact.decks.model import Model
from fenics_contact.decks.rigid_links import by_small_turns, following, in_their_space, spread_out
from fenics_contact.decks.steps import Held, Instant
from fenics_contact.readers.deck_bodies import (
    Component,
)
from fenics_contact.readers.deck_mesh import Faces, joined


class SupportBuilder:
    """Makes supports, springs and bolts of what a deck holds."""

    def __init__(self, model: Model) -> None:
        self.model = model
        #: What nodes drive or load, with the name of the surface, or of the set of nodes.
        self.driven: list[tuple[Driven, str]] = []

    def supported(self) -> dict[str, tuple[np.ndarray, tuple[int, ...]]]:
        """Return what is held in any step by name: nodes and components. Single nodes are put together."""
        inside = self.model.nodes_of_bodies()
        found: dict[str, tuple[np.ndarray, set[int]]] = {}
        single = np.zeros((len(inside), 3), dtype=bool)
        for target in self.model.steps.targets:
            nodes = target.nodes[inside[target.nodes]]
            inner = [k for k in target.components if k < self.model.dim]
            self._check_turns(target, nodes)
            self._check_plane(target, nodes)
            self._check_kept(target)
            if not len(nodes):
                if not np.isin(target.nodes, self.model.references).any():
                    self.model.note(target.card, f"nodes {target.label} belong to no element")
            elif not target.label or target.label.isdecimal():
                single[np.ix_(nodes, inner)] = True
            elif inner:
                found.setdefault(target.label, (nodes, set()))[1].update(inner)
                self.model.origins.setdefault(("support", target.label), target.card.origin)
        # Nodes that are held alike in all steps are one set.
        course = np.concatenate([single, *(single & marks for marks in self._marks())], axis=1)
        for alike in np.unique(course[single.any(axis=1)], axis=0):
            components = np.flatnonzero(alike[:3])
            name = "BOUNDARY " + " ".join(str(k + 1) for k in components)
            name = next(n for n in (name, *(f"{name} {chr(65 + k)}" for k in range(26))) if n not in found)
            found[name] = np.flatnonzero((course == alike).all(axis=1)), set(components.tolist())
        return {
            self.model.place(name, nodes): (np.unique(nodes), tuple(sorted(held)))
            for name, (nodes, held) in found.items()
        }

    def _marks(self) -> list[np.ndarray]:
        """Return what is held in the steps, (n_nodes, 3), each time that it changes."""
        found: list[np.ndarray] = []
        for step in self.model.steps.steps:
            now = ~np.isnan(step.instants[-1].held[:, :3])
            if not found or (now != found[-1]).any():
                found.append(now)
        return found

    def _check_kept(self, target: Held) -> None:
        """Reject nodes that drive rigid surfaces and are fixed where their motion was free before."""
        driving = {node for driven in self.model.driven for node in (driven.node, driven.turning)}
        here = [node for node in target.nodes.tolist() if node in driving]
        instants = self.model.steps.instants
        if any(instant.kept[node, list(target.components)].any() for instant in instants for node in here):
            raise target.card.error(
                f"node {self.model.mesh.numbers[here[0]]}, which drives a surface, was free before it is "
                "FIXED: give the displacement at which it is to be held", target.row,
            )  # fmt: skip

    def _check_turns(self, target: Held, nodes: np.ndarray) -> None:
        """Reject rotations of nodes of elements, which have none, unless they are held at zero."""
        turned = [k for k in target.components if k > 2]
        free = nodes[~np.isin(nodes, self.model.references)]
        instants = self.model.steps.instants
        if turned and any(np.nan_to_num(instant.held[free][:, turned]).any() for instant in instants):
            name = target.label or self.model.mesh.numbers[free[0]]
            raise target.card.error(
                f"nodes of solid elements have no rotation, but {name} is turned: drive the "
                "surface by a node, with *RIGID BODY or *COUPLING", target.row,
            )  # fmt: skip

    def _check_plane(self, target: Held, nodes: np.ndarray) -> None:
        """Reject axes of nodes of plane elements out of the plane, unless nodes are held wholly at zero."""
        turned = nodes[np.isin(nodes, np.fromiter(self.model.local_axes, dtype=np.int64))]
        inner = [k for k in target.components if k < 3]
        if self.model.dim == 3 or not len(turned) or not inner:
            return
        across = np.array([abs(self.model.local_axes[int(node)][inner, 2]) for node in turned])
        wrong = (abs(across - np.equal(inner, 2)) > 1e-9).any(axis=1)
        for instant in self.model.steps.instants:
            wrong &= (instant.held[turned, :3] != 0.0).any(axis=1)
        if wrong.any():
            node = int(turned[wrong][0])
            k = inner[int(abs(across[wrong][0] - np.equal(inner, 2)).argmax())]
            axis = ", ".join(f"{value:.4g}" for value in self.model.local_axes[node][k] + 0.0)
            raise target.card.error(
                f"node {self.model.mesh.numbers[node]} of plane elements is held along its axis {k + 1}, by "
                f"*TRANSFORM ({axis}), which must be in the plane, and axis 3 along z: give other axes, or "
                "hold components 1 to 3 at zero", target.row,
            )  # fmt: skip

    def supports(
        self, supported: Mapping[str, tuple[np.ndarray, tuple[int, ...]]], instant: Instant | None
    ) -> tuple[AnySupport, ...]:
        """Return the supports at a time; before all those of the first step, at zero."""
        found = []
        marks = None if instant is None else ~np.isnan(instant.held)
        if marks is None and self.model.steps.steps:
            marks = ~np.isnan(self.model.steps.steps[0].instants[0].held)
        for name, (nodes, components) in supported.items():
            held = [k for k in components if marks is None or marks[nodes, k].all()]
            if not held:
                continue
            for body, mesh in self.model.parts.meshes.items():
                mine, inner = self.model.in_body(body, nodes)
                if not len(mine):
                    continue
                found += self._supports_of(body, name, mine, mesh.points[inner], held, instant)
        for driven, name in self.driven:
            if not driven.spread:
                found += self._rigid(driven, name, instant)
        return tuple(found)

    def _supports_of(
        self,
        body: str,
        name: str,
        nodes: np.ndarray,
        points: np.ndarray,
        held: Sequence[int],
        instant: Instant | None,
    ) -> list[AnySupport]:
        """Return the supports of some nodes of a body: along x, y and z, or along their local axes."""
        given = [np.zeros(len(nodes)) if instant is None else instant.held[nodes, k] for k in held]
        amounts: list[Any] = [
            float(each[0]) if np.ptp(each) == 0.0 else NodeValues(points, each) for each in given
        ]
        for place, k in enumerate(held):
            if instant is not None and instant.kept[nodes, k].any():
                amounts[place] = self._kept(name, instant.kept[nodes, k])
        turned = [self.model.local_axes[node] for node in nodes.tolist() if node in self.model.local_axes]
        whole = len(held) == self.model.dim and not any(each.any() for each in given)
        if not turned or (whole and self._always_zero(nodes, held)):
            value: list[Any] = [None] * self.model.dim
            for k, amount in zip(held, amounts, strict=True):
                value[k] = amount
            return [Support(body, name, tuple(value))]
        axes = np.stack([self.model.local_axes.get(node, np.eye(3)) for node in nodes.tolist()])[
            :, :, : self.model.dim
        ]
        found: list[AnySupport] = []
        for k, amount in zip(held, amounts, strict=True):
            alike = np.allclose(axes[:, k], axes[0, k], atol=1e-12)
            direction: Any = tuple(axes[0, k].tolist()) if alike else NodeValues(points, axes[:, k])
            found.append(Roller(body, name, amount, direction))
        return found

    def _kept(self, name: str, kept: np.ndarray) -> Kept:
        """Return a support that keeps what all of its nodes have."""
        if not kept.all():
            target = next(each for each in self.model.steps.targets if "FIXED" in each.card.parameters)
            raise target.card.error(
                f"nodes of {name!r} that are FIXED were partly free before: give those that were in a set of "
                "their own", target.row,
            )  # fmt: skip
        return Kept()

    def _always_zero(self, nodes: np.ndarray, held: Sequence[int]) -> bool:
        """Return whether components of nodes are held at zero in all steps."""
        instants = self.model.steps.instants
        held = list(held)
        return not any(
            np.nan_to_num(instant.held[nodes][:, held]).any() or instant.kept[nodes][:, held].any()
            for instant in instants
        )

    def name_surfaces(self) -> None:
        """Name the surfaces that nodes drive or load."""
        for several in by_node(self.model.driven, self.model.mesh):
            for each in several:
                self._check_axes(each)
            parts = [self._part(each) for each in several]
            name = " AND ".join(dict.fromkeys(name for name, _ in parts))
            faces = [part for _, part in parts if isinstance(part, Faces)]
            if len(faces) == len(parts):
                self.model.surfaces[name] = faces[0] if len(faces) == 1 else joined(faces)
            else:
                single = [part for _, part in parts if isinstance(part, np.ndarray)]
                of_faces = [n.ravel() for each in faces for _, _, _, n in self.model.mesh.parts_of(each)]
                name = self.model.place(name, np.unique(np.concatenate([*single, *of_faces])))
            self.driven.append((several[0], name))
            if len(several) > 1 and several[0].turning < 0:
                self.model.note(
                    several[0].card,
                    f"{' and '.join(each.name for each in several)} have one reference node: they move and "
                    "turn as one piece, where CalculiX lets each turn by itself about the node",
                )

    def _check_axes(self, driven: Driven) -> None:
        if {driven.node, driven.turning} & set(self.model.local_axes):
            raise driven.card.error(
                "the node of a rigid surface must move along x, y and z, it has axes of its own by "
                "*TRANSFORM: leave it out of that set"
            )

    def _part(self, driven: Driven) -> tuple[str, Faces | np.ndarray]:
        """Return the name of what a card drives, and its faces, or nodes that are not all nodes of faces."""
        exterior = self.model.exterior
        name = driven.surface or f"{driven.name} RIGID"
        if not driven.surface and driven.nodes is not None:
            inside = driven.nodes[self.model.nodes_of_bodies()[driven.nodes]]
            if len(inside) and not driven.spread and exterior.covering(inside) is None:
                return name, inside
            faces = exterior.covering(driven.nodes)
        elif driven.surface:
            faces = exterior.faces_of(self.model.mesh.surface_named(name, driven.card))
        else:
            faces = self._whole(driven)
        if faces is None or not exterior.holds(faces).all():
            raise driven.card.error(
                f"{driven.name!r} must be faces on the boundary of a body, or all nodes of some "
                "faces, so that they move as one piece: give such a set"
            )
        return name, faces

    def _whole(self, driven: Driven) -> Faces | None:
        """Return the boundary of the bodies whose elements are those of a set."""
        elements = self.model.mesh.elements_named(driven.name, driven.card)
        for part in self.model.parts_of_mesh:
            if np.array_equal(part.elements, elements):
                mine = np.isin(self.model.exterior.faces.elements, elements)
                return Faces(self.model.exterior.faces.elements[mine], self.model.exterior.faces.sides[mine])
        return None

    def bodies_of(self, name: str) -> list[str]:
        """Return the bodies that have a driven surface, or set of nodes."""
        meshes = self.model.parts.meshes.items()
        return [body for body, mesh in meshes if name in mesh.surfaces or name in mesh.node_sets]

    def _rigid(self, driven: Driven, name: str, instant: Instant | None) -> list[RigidSurface]:
        """Return the rigid surfaces of a node: that of the first body, or of all where all is given."""
        self.model.origins["support", name] = driven.card.origin
        if instant is None and self.model.steps.steps:
            first = self.model.steps.steps[0].instants[0]
            instant = replace(first, held=0.0 * first.held, forces=0.0 * first.forces)
        at = self.model.mesh.points[driven.node, : self.model.dim]
        bodies = self._rigid_bodies(driven, name)
        return [rigid_surface(driven, body, name, at, instant) for body in bodies]

    def _rigid_bodies(self, driven: Driven, name: str) -> list[str]:
        """Return the bodies with a rigid surface of their own; others follow that of the first one."""
        bodies = self.bodies_of(name)
        held = [driven.row(instant.held)[self.model.motions] for instant in self.model.steps.instants]
        if len(bodies) == 1 or (held and not np.isnan(held).any()):
            return bodies
        sizes = [len(spread_out(self.model.parts.meshes[b].points[self._nodes(b, name)])) for b in bodies]
        return [bodies[int(np.argmax(sizes))]]

    def _nodes(self, body: str, name: str) -> np.ndarray:
        """Return nodes of a surface or set that the deck has."""
        own = self.model.parts.meshes[body].nodes_to_hold(name)
        return np.asarray(own[self.model.parts.nodes[body][own] >= 0])

    def _links(self) -> list[LinearConstraint]:
        """Return how surfaces of further bodies follow the rigid surface of the first one."""
        meshes, found = self.model.parts.meshes, []
        for driven, name in self.driven:
            if driven.spread:
                continue
            first, *own = self._rigid_bodies(driven, name)
            for body in self.bodies_of(name):
                if body == first or body in own:
                    continue
                leaders = self._nodes(first, name)
                leaders = leaders[spread_out(meshes[first].points[leaders])]
                nodes = self._nodes(body, name)
                moved = self._moved(driven, name, meshes[body].points[nodes], meshes[first].points[leaders])
                used = leaders[: moved.shape[2]]
                found.append(following(f"{body} {name}", body, nodes, first, used, moved))
        return found

    def _moved(self, driven: Driven, name: str, points: np.ndarray, leaders: np.ndarray) -> np.ndarray:
        """Return how points move with others of one rigid piece, (n, components, m, dim)."""
        dim, instants = self.model.dim, self.model.steps.instants
        turned = [k for k in self.model.motions if k > 2]
        turns = any((driven.row(instant.held)[turned] != 0.0).any() for instant in instants)
        weights = in_their_space(points, leaders) if turns else np.ones((len(points), 1))
        if weights is None and not any(step.large for step in self.model.steps.steps):
            moved = by_small_turns(points, leaders)
            if moved is not None:
                return moved
        if weights is None:
            raise driven.card.error(
                f"{name!r} is on several bodies, and its nodes on one of them do not say how it turns: hold "
                "the rotations of its node at zero, take NLGEOM away, or join the bodies"
            )
        components = np.eye(dim)[1:] if self.model.kind == "axisymmetric" else np.eye(dim)
        return np.einsum("nm,kd->nkmd", weights, components)

    def name_nodes(self) -> None:
        """Name the nodes that an equation holds alone, and reject equations of what has no displacement."""
        inside = self.model.nodes_of_bodies()
        for each in self.model.equations:
            at = np.array(each.nodes)
            turned = np.array(each.components) >= self.model.dim
            if (turned & inside[at]).any():
                raise each.card.error(
                    f"component {int(np.array(each.components)[turned & inside[at]][0]) + 1} of a node of "
                    f"elements is no displacement: components 1 to {self.model.dim} are", each.row,
                )  # fmt: skip
            self._check_plane_terms(each)
            if not inside[at].any():
                raise each.card.error("needs a node of an element, this equation has none: add one", each.row)
            for node, component in zip(at[~inside[at]], np.array(each.components)[~inside[at]], strict=True):
                if any(np.isnan(instant.held[node, component]) for instant in self.model.steps.instants):
                    raise each.card.error(
                        f"node {self.model.mesh.numbers[node]} belongs to no element, its component "
                        f"{component + 1} in an equation must have a value in all steps: give it by "
                        "*BOUNDARY, or write the equation without it", each.row,
                    )  # fmt: skip
            if len(set(each.nodes)) == 1:
                self.model.node_sets[f"NODE {self.model.mesh.numbers[at[0]]}"] = at[:1]

    def _check_plane_terms(self, equation: Equation) -> None:
        """Reject terms of nodes of plane elements along axes out of the plane."""
        turned = self.model.local_axes.keys() & set(equation.nodes) if self.model.dim == 2 else set()
        for node, k in zip(equation.nodes, equation.components, strict=True):
            if node in turned and abs(self.model.local_axes[node][k % 3, 2]) > 1e-9 and k < 2:
                raise equation.card.error(
                    f"component {k + 1} of node {self.model.mesh.numbers[node]} of plane elements is along "
                    "an axis of *TRANSFORM out of the plane: give axes 1 and 2 in it", equation.row,
                )  # fmt: skip

    def equations(self) -> tuple[list[Roller], list[LinearConstraint]]:
        """Return the equations: nodes that slide along planes, and relations of several nodes."""
        alone = [each for each in self.model.equations if len(set(each.nodes)) == 1]
        rollers = []
        for each in alone:
            normal = np.zeros(3)
            np.add.at(normal, list(each.components), each.factors)
            axes = self.model.local_axes.get(each.nodes[0], np.eye(3))
            normal = (normal @ axes)[: self.model.dim]
            node = np.array(each.nodes[:1])
            body = next(b for b in self.model.parts.meshes if len(self.model.in_body(b, node)[0]))
            name = f"NODE {self.model.mesh.numbers[node[0]]}"
            rollers.append(Roller(body, name, 0.0, tuple(normal.tolist())))
        terms = self._terms()
        constraints = [LinearConstraint(terms, name="EQUATIONS")] if terms else []
        return rollers, [*constraints, *self._joints(), *self._links()]

    def _joints(self) -> list[LinearConstraint]:
        """Return what joins bodies that share nodes, but no faces."""
        found = []
        for first, second, nodes in self.model.joints():
            terms = [
                ConstraintTerm(body, np.tile(inner, dim), np.repeat(np.eye(dim), len(inner), axis=0), factor)
                for body, factor in ((first, 1.0), (second, -1.0))
                for dim, (_, inner) in [(self.model.dim, self.model.in_body(body, nodes))]
            ]
            name = f"NODES OF {first} AND {second}"
            found.append(LinearConstraint(terms, name=name))
            card = self.model.mesh.blocks[0].card
            self.model.note(
                card, f"bodies {first} and {second} share {len(nodes)} nodes, but no faces: joined"
            )
        return found

    @cached_property
    def _entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Equation, node, component and factor of all terms of equations of several nodes."""
        several = [each for each in self.model.equations if len(set(each.nodes)) > 1]
        number = np.repeat(np.arange(len(several)), [len(each.nodes) for each in several])
        node, component, factor = (
            np.array([entry for each in several for entry in getattr(each, name)], dtype=kind)
            for name, kind in (("nodes", np.int64), ("components", np.int64), ("factors", np.float64))
        )
        return number, node, component, factor

    def _terms(self) -> list[ConstraintTerm]:
        """Return the terms of the equations, one for each body."""
        number, node, component, factor = self._entries
        along = np.eye(6, 3)[component]
        for place in np.flatnonzero(np.isin(node, np.fromiter(self.model.local_axes, dtype=np.int64))):
            along[place] = self.model.local_axes[int(node[place])][component[place]]
        found = []
        for body in self.model.parts.meshes:
            every = np.unique(node)
            mine, inner = self.model.in_body(body, every)
            owned = self.model.owned(body, mine)
            mine, inner = mine[owned], inner[owned]
            here = np.flatnonzero(np.isin(node, mine))
            if len(here):
                own = inner[np.searchsorted(mine, node[here])]
                vectors = along[here, : self.model.dim]
                found.append(ConstraintTerm(body, own, vectors, factor[here], number[here]))
        return found

    def equation_values(self, instant: Instant) -> dict[str, Any] | None:
        """Return the values of the equations at a time, of nodes without elements; None without any."""
        number, node, component, factor = self._entries
        outside = ~self.model.nodes_of_bodies()[node]
        if not outside.any():
            return None
        count, moved = int(number.max()) + 1, instant.held[node[outside], component[outside]]
        return {"EQUATIONS": -np.bincount(number[outside], factor[outside] * moved, count)}

    def preloads(self) -> list[Preload]:
        """Return the bolts of pre-tension sections, held at their length."""
        found = []
        for bolt in self.model.bolts:
            parts = [p for p in self.model.parts_of_mesh if np.isin(bolt.faces.elements, p.elements).all()]
            if len(parts) != 1:
                raise bolt.card.error(f"surface {bolt.name!r} must go through one body: give one for each")
            found.append(Preload(parts[0].name, self._section(bolt, parts[0]), name=bolt.name))
            self.model.origins["preload", bolt.name] = bolt.card.origin
        return found

    def _section(self, bolt: Bolt, part: Component, flat: float = 1e-6) -> CutAt:
        """Return the plane of a section with the cells that it may separate, those of its elements' body."""
        dim = self.model.dim
        points = self.model.mesh.points[:, :dim]
        corners = np.concatenate([points[n].reshape(-1, dim) for n in self.model.mesh.corners(bolt.faces)])
        centre = corners.mean(axis=0)
        _, size, axes = np.linalg.svd(corners - centre)
        if size[dim - 1] > flat * size[0]:
            raise bolt.card.error(f"surface {bolt.name!r} must be flat: give faces in a plane")
        normal = axes[dim - 1]
        middle = self.model.middles(bolt.faces.elements)[:, :dim]
        normal = normal if (middle - centre).mean(axis=0) @ normal < 0 else -normal
        radius = 1.5 * float(np.linalg.norm(corners - centre, axis=1).max())
        whole = CutAt(tuple(centre.tolist()), tuple(normal.tolist()))
        return whole if self._cuts(whole, bolt, part) else replace(whole, radius=radius)

    def _cuts(self, section: CutAt, bolt: Bolt, part: Component) -> bool:
        """Return whether a plane through a whole body separates it at the faces of a bolt alone."""
        point, normal = np.array(section.point), np.array(section.normal)
        away = (self.model.middles(part.elements)[:, : self.model.dim] - point) @ normal
        before = np.isin(part.elements, bolt.faces.elements)
        return (
            bool((away[before] < 0).all())
            and len(bolt.faces) > 0
            and not self._others_at(section, bolt, part)
        )

    def _others_at(self, section: CutAt, bolt: Bolt, part: Component, near: float = 1e-6) -> bool:
        """Return whether nodes of a body lie in the plane of a section besides those of its faces."""
        nodes = self.model.parts.nodes[part.name]
        nodes = nodes[nodes >= 0]
        points = self.model.mesh.points[nodes][:, : self.model.dim]
        away = (points - np.array(section.point)) @ np.array(section.normal)
        own = np.unique(np.concatenate([n.ravel() for _, _, _, n in self.model.mesh.parts_of(bolt.faces)]))
        return bool((np.abs(away[~np.isin(nodes, own)]) <= near * np.abs(away).max()).any())
