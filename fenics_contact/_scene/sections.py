"""Bodies of a scene, cut at the sections of its preloads, and what load steps do with these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._scene.body import Body
from fenics_contact._scene.parts import SceneParts
from fenics_contact._scene.preloads import AnySection, Preload, Section, cells_of_region
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import cut_between, nodes_between

_CUT: WeakKeyDictionary[BodyMesh, dict[AnySection, BodyMesh]] = WeakKeyDictionary()
"""Meshes that were cut: scenes made of the same bodies have the same meshes."""


def with_cuts(scene: SceneParts) -> Mapping[str, Body]:
    """Return the bodies of a scene, cut at the sections of its preloads."""
    bodies = dict(scene.bodies)
    for preload in scene.preloads:
        body = bodies[preload.body]
        if preload.section not in body.mesh.cuts:
            known = _CUT.setdefault(body.mesh, {})
            if preload.section not in known:
                known[preload.section] = _cut(body.mesh, preload)
            bodies[preload.body] = replace(body, mesh=known[preload.section])
    return bodies


def _cut(mesh: BodyMesh, preload: Preload) -> BodyMesh:
    section, body = preload.section, preload.body
    if isinstance(section, Section):
        before, behind = section.sides(mesh, body)
        where = section.reach(mesh)
        if np.isfinite(section.extent):
            where += f", its {counted(len(before) + len(behind), 'cell')} within {section.extent:g} matter"
    else:
        before, behind = (cells_of_region(mesh, body, name) for name in section)
        where = "the two regions have no common face"
    if mesh.cuts:
        where += ", and where another section lies there is none left"
    shared = nodes_between(mesh, before, behind)
    if not len(shared):
        raise InvalidInputError(
            f"the section of a preload must cut its body in two, that of {body!r} cuts through nothing: "
            f"{where}; give a point inside the bolt's shank, and a normal along its axis"
        )
    others = np.setdiff1d(np.arange(mesh.n_cells), np.concatenate([before, behind]))
    inside = np.intersect1d(shared, mesh.cells[others])
    if len(inside):
        raise InvalidInputError(
            f"the section of a preload must leave two parts, that of {body!r} ends inside the body, at "
            f"{counted(len(inside), 'node')} near {_at(mesh, inside)}: let region or radius reach its surface"
        )
    taken = [node for cut in mesh.cuts.values() for node in np.intersect1d(shared, cut.pairs)]
    if taken:
        raise InvalidInputError(
            f"sections of preloads must not meet, but two of body {body!r} share "
            f"{counted(len(taken), 'node')} near {_at(mesh, taken)}: keep a cell between them, or one of them"
        )
    return cut_between(mesh, section, before, behind)


def _at(mesh: BodyMesh, nodes: Sequence[int] | np.ndarray) -> str:
    return f"({', '.join(f'{x:.4g}' for x in mesh.points[nodes[0]])})"


def require_preloads(scene: SceneParts) -> None:
    """Reject two preloads of one section, and cuts that no preload holds together."""
    keys = [preload.key for preload in scene.preloads]
    for number, key in enumerate(keys):
        if key in keys[:number]:
            raise InvalidInputError(
                f"each section needs one Preload, that of body {key[0]!r} has two: keep one of them"
            )
    for name, body in scene.bodies.items():
        for section in body.mesh.cuts:
            if (name, section) not in keys:
                raise InvalidInputError(
                    f"body {name!r} was cut at a section that no Preload holds together, {section!r}: give "
                    "the scene its Preload, without force or shortening to hold the length"
                )


def changed_by(scene: SceneParts, given: Sequence[Preload]) -> tuple[Preload, ...]:
    """Return the preloads of a load step: those given, all others held at their lengths."""
    aims = {preload.key: preload.aims for preload in given}
    unknown = aims.keys() - {preload.key for preload in scene.preloads}
    if unknown:
        raise InvalidInputError(
            f"LoadStep.preloads has a section of body {min(body for body, _ in unknown)!r} that the scene "
            "does not have: give the scene all, those that are tightened later without force or shortening"
        )
    return tuple(preload.with_aims(aims.get(preload.key, {})) for preload in scene.preloads)


def held_at(scene: SceneParts, lengths: np.ndarray) -> tuple[Preload, ...]:
    """Return the preloads with the shortenings before the load step, shape (n,), where they are held."""
    return tuple(
        each if each.aims else replace(each, shortening=float(length))
        for each, length in zip(scene.preloads, lengths, strict=True)
    )
