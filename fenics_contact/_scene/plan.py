"""What will be built for a scene: its effects, its solver, and which motions its supports resist."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.display import counted, displayed
from fenics_contact._scene.discretisation import in_words
from fenics_contact._scene.effects import Effect, EffectName, listed
from fenics_contact._scene.memory import Subdomains, expected_memory
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.supports import RigidSurface
from fenics_contact._scene.tools import check_partitions, with_tool_parts
from fenics_contact._surfaces.facets import has_midside_pressure
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import pieces
from fenics_contact.mesh.faces import of_one_shape

if TYPE_CHECKING:
    from fenics_contact._scene.pair_geometry import PairGeometry
    from fenics_contact._scene.parts import SceneParts
    from fenics_contact._scene.preloads import Preload


def effects_of(scene: SceneParts) -> tuple[Effect, ...]:
    """List the effects in a scene, in the order of `EffectName`."""
    found = (each.effects for each in scene.bodies.values()), (each.effects(scene) for each in scene.parts)
    return listed(chain.from_iterable(chain(*found)))


#: Parts of rigid motions, their resistance and work below this fraction of the largest are rounding.
MOTION_ROUNDING = 1e-9


def held_components(scene: SceneParts, body: str, modes: np.ndarray) -> np.ndarray:
    """Return what motions of a body move of the components that supports prescribe, shape (n, n_modes).

    Of a rigid surface with free components the others count, as displacement and rotation of its point.

    `modes`: motions at its nodes, shape (n_nodes, dim, n_modes).
    """
    mesh = scene.bodies[body].mesh
    loose = [each for each in scene.rigid_surfaces if each.free.any()]
    firm = [each for each in scene.supports if each not in loose]
    prescribed, axes = scene.prescribed_along(body, firm)
    rows = [axes.to_local(modes)[~np.isnan(prescribed)]]
    for surface in loose:
        if surface.body == body:
            rows.append(_of_point(surface, mesh, modes)[0][~surface.free])
    return np.concatenate(rows)


def point_loads(scene: SceneParts, body: str, modes: np.ndarray) -> np.ndarray:
    """Return the work of the loads at points of rigid surfaces of a body on its rigid motions, (n_modes,)."""
    total = np.zeros(modes.shape[2])
    for surface in scene.rigid_surfaces:
        if surface.body == body and surface.load.any():
            moved, factors = _of_point(surface, scene.bodies[body].mesh, modes)
            total += (factors * surface.load) @ moved
    return total


def _of_point(surface: RigidSurface, mesh: BodyMesh, modes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and rotation of the point for motions of its body, and the units of both.

    Rotations count times the largest arm, see `RigidSurface.unit_modes`: shapes (n_components, n_modes) and
    (n_components,).
    """
    nodes = mesh.nodes_of(surface.surface)
    moved, factors = surface.unit_modes(mesh.points[nodes])
    moved = moved.reshape(-1, len(factors))
    return np.linalg.lstsq(moved, modes[nodes].reshape(len(moved), -1), rcond=MOTION_ROUNDING)[0], factors


def resisted_motions(held: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the rigid motions that supports resist.

    `held`: what the motions move of prescribed components, shape (n, n_modes), see `held_components`.

    Returns coefficients of the modes as columns, shape (n_modes, rank).
    """
    # The edge of a thin plate moves little when the plate turns about it: singular values resolve how much,
    # their squares would be lost in rounding.
    _, size, motions = np.linalg.svd(held, full_matrices=False)
    return np.asarray(motions[size > MOTION_ROUNDING * size.max(initial=0.0)].T)


def held_by_supports(scene: SceneParts, body: str) -> bool:
    """Return whether the supports of a body resist all its rigid motions."""
    modes = scene.bodies[body].rigid_modes()
    return resisted_motions(held_components(scene, body, modes)).shape[1] == modes.shape[2]


class SolverKind(StrEnum):
    """How the equilibrium is computed."""

    DIRECT = "sparse factorisation of one body"
    PROJECTED_CG = "projected conjugate gradients"
    FACE_NEWTON = "semismooth Newton on faces"
    TANGENT_NEWTON = "Newton's method with tangents of the deformed bodies"


class ConeKind(StrEnum):
    """Which inequalities the multipliers obey."""

    NONE = "none"
    BOUNDS = "half lines"
    DISCS = "half lines and discs of given radius"
    COULOMB = "friction cones"


@displayed
@dataclass(frozen=True)
class Plan:
    """What the solution of a scene needs; nothing else is built.

    Attributes:
        multipliers: Number of multipliers by kind; those of ties and contact are upper bounds, as only nodes
            that face their master have one.
        fixed_point: Whether slip bounds follow the normal forces (Coulomb's law).
        coarse_motions: Rigid motions of the subdomains and free ones of rigid surfaces, the size of the
            coarse problem; 0 without one.
        kinds: Subdomains of different shape, material or interface on their ranks: those alike share factors.
            About, as matrices decide; of nonlinear materials none are shared.
        adjoint: Whether sensitivities are requested, which need one adjoint solve per design.
        memory: Expected memory of all ranks together without their libraries, [bytes].
        contacts: Between which surfaces the gaps of each contact pair are measured, and where it is enforced.
        ties: Where each tie is enforced, and why.
        unpaired: Which bodies touch or overlap without a pair or tie, or will where supports move them as if
            they were rigid, and what to do.
        preloads: What each preload does, and along which faces of cells its body is cut.
    """

    effects: tuple[Effect, ...]
    subdomains: int
    unknowns: int
    multipliers: Mapping[str, int]
    solver: SolverKind
    cone: ConeKind
    fixed_point: bool
    coarse_motions: int
    kinds: int
    adjoint: bool
    memory: float
    contacts: tuple[PairGeometry, ...]
    ties: tuple[str, ...]
    unpaired: tuple[str, ...]
    preloads: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return one line for each decision."""
        return "\n".join(f"{name:15s} {value}" for name, value in self._facts().items())

    def _facts(self) -> dict[str, str]:
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.multipliers.items() if count)
        coarse = f"{self.coarse_motions} rigid motions" if self.coarse_motions else "none"
        bounds = "follow the normal forces" if self.fixed_point else "given"
        alike = f" of {counted(self.kinds, 'kind')}" if self.kinds < self.subdomains else ""
        return {
            "effects": "; ".join(f"{effect.name} ({effect.reason})" for effect in self.effects),
            "unknowns": f"{self.unknowns} in {counted(self.subdomains, 'subdomain')}{alike}",
            "multipliers": kinds or "none",
            "solver": self.solver.value,
            "cone": self.cone.value,
            "slip bounds": bounds if self.cone in (ConeKind.DISCS, ConeKind.COULOMB) else "none",
            "coarse problem": coarse,
            "adjoint": "one solve per design" if self.adjoint else "none",
            "memory": f"{self.memory / 1e6:.0f} MB",
            **{f"pair {number}": str(pair) for number, pair in enumerate(self.contacts)},
            **{f"tie {number}": tie for number, tie in enumerate(self.ties)},
            **{f"preload {number}": preload for number, preload in enumerate(self.preloads)},
            **({"no pair": "; ".join(self.unpaired)} if self.unpaired else {}),
        }


def make_plan(
    scene: SceneParts, partitions: Mapping[str, np.ndarray], *, ranks: int = 1, sensitivity: bool = False
) -> Plan:
    """Decide what a scene needs.

    `ranks`: among which the subdomains are dealt out; `sensitivity`: whether derivatives by the shape are
    wanted.
    """
    from fenics_contact._scene.pair_geometry import pair_geometry, unpaired_bodies

    partitions = with_tool_parts(scene.bodies, partitions)
    check_partitions(scene.bodies, partitions)
    effects = effects_of(scene)
    partitions = {name: pieces(body.mesh, partitions[name]) for name, body in scene.bodies.items()}
    names = {effect.name for effect in effects}
    parts = Subdomains.of(scene, partitions)
    subdomains, unknowns = len(parts.size), int(parts.size.sum())
    solver = choose_solver(scene, subdomains, sensitivity=sensitivity)
    direct = solver is SolverKind.DIRECT
    loose = sum(int(surface.free.sum()) for surface in scene.rigid_surfaces)
    loose += sum(preload.is_free for preload in scene.preloads)
    each = next(iter(scene.bodies.values())).motions
    motions = 0 if direct else subdomains * each + loose
    return Plan(
        effects=effects,
        subdomains=subdomains,
        unknowns=unknowns,
        multipliers={} if direct else _multipliers(scene, unknowns),
        solver=solver,
        cone=_cone(names),
        fixed_point=EffectName.COULOMB in names,
        coarse_motions=motions,
        kinds=subdomains if solver is SolverKind.TANGENT_NEWTON else parts.kinds(ranks),
        adjoint=sensitivity,
        memory=expected_memory(scene, parts, ranks),
        contacts=tuple(pair_geometry(scene, pair) for pair in scene.contacts),
        ties=tuple(f"{tie.place}; {in_words(tie)}" for tie in scene.ties),
        unpaired=unpaired_bodies(scene),
        preloads=tuple(map(partial(_section_in_words, scene), scene.preloads)),
    )


def _section_in_words(scene: SceneParts, preload: Preload) -> str:
    """Return what a preload does, and how closely faces of cells follow its section."""
    mesh = scene.bodies[preload.body].mesh
    facets, normal = preload.cut(mesh).facets, preload.normal(mesh)
    along = mesh.points[np.unique(facets)] @ normal
    area = preload.area(mesh, scene.bodies[preload.body].kinematics.measure)
    cut = f"cut along {counted(len(facets), 'face')} of cells, area {area:.6g}"
    words = f"{preload.place}; {cut}"
    away = float(np.ptp(along))
    size = float(np.ptp(mesh.points[np.unique(facets)], axis=0).max())
    return words if away <= MOTION_ROUNDING * size else f"{words}, within a layer of {away:.3g} [length]"


def choose_solver(scene: SceneParts, subdomains: int, *, sensitivity: bool = False) -> SolverKind:
    """Return how the equilibrium of a scene is computed."""
    effects = {effect.name for effect in effects_of(scene)}
    if EffectName.NONLINEAR_MATERIAL in effects:
        return SolverKind.TANGENT_NEWTON
    if EffectName.CONTACT in effects:
        return SolverKind.FACE_NEWTON
    # A body that its supports alone do not hold has a singular stiffness; ties need multipliers.
    loose = any(surface.free.any() for surface in scene.rigid_surfaces)
    loose = loose or bool(scene.preloads or scene.ties or scene.springs or scene.constraints)
    if subdomains == 1 and not (sensitivity or loose) and held_by_supports(scene, scene.body_names[0]):
        return SolverKind.DIRECT
    return SolverKind.PROJECTED_CG


def _cone(names: set[EffectName]) -> ConeKind:
    if EffectName.COULOMB in names:
        return ConeKind.COULOMB
    if EffectName.TRESCA in names:
        return ConeKind.DISCS
    return ConeKind.BOUNDS if EffectName.CONTACT in names else ConeKind.NONE


def _multipliers(scene: SceneParts, unknowns: int) -> dict[str, int]:
    nodes = sum(body.mesh.n_nodes for body in scene.bodies.values())
    fixed = sum(int(np.count_nonzero(scene.fixed(name))) for name in scene.body_names)
    slaves = [_bearing_nodes(scene, pair) for pair in scene.contacts]
    rubbing = [count for pair, count in zip(scene.contacts, slaves, strict=True) if pair.has_friction]
    tied = [(1 if tie.sliding else scene.components) * _slave_nodes(scene, tie.slave) for tie in scene.ties]
    return {
        "gluing": unknowns - scene.components * nodes,
        "prescribed": fixed,
        "tied": sum(tied),
        "drawn": sum(scene.components * each.count(scene.bodies[each.body].mesh) for each in scene.preloads),
        "sprung": sum(len(each.rows(scene)[1]) for each in scene.springs),
        "constrained": sum(each.count(scene.bodies) for each in scene.constraints),
        "normal": sum(slaves),
        "tangential": (scene.components - 1) * sum(rubbing),
    }


def _bearing_nodes(scene: SceneParts, pair: ContactPair) -> int:
    facets = scene.bodies[pair.slave.body].mesh.surfaces[pair.slave.name]
    if pair.by_mortar:
        return _slave_nodes(scene, pair.slave)
    parts = (some[:, 3:] if has_midside_pressure(some) else some for _, some in of_one_shape(facets))
    return len(np.unique(np.concatenate([part.ravel() for part in parts])))


def _slave_nodes(scene: SceneParts, surface: Surface) -> int:
    return len(np.unique(scene.facets(surface)))
